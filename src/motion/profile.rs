//! Trapezoidal moves in whole cycles.
//!
//! The three phases of a move take whole numbers of cycles ([`Timing`]), so that
//! moves of several axes can be given the same phases and start and end in the
//! same SYNC. Velocity and accelerations are scaled down to fit, never up.

use core::fmt;

/// Longest phase, in cycles: times stay exact in single precision.
const LONGEST_PHASE: f32 = 4_194_304.0;
/// A quotient this little (relative) above a whole number of cycles is taken as
/// that number: it is the rounding of single precision.
const ROUNDING: f32 = 1.0 / 1_048_576.0;

/// Where an axis should be at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setpoint {
    /// Position in increments, rounded toward the nearer end of the move; wraps
    /// as 6064h does.
    pub position: i32,
    /// What the rounding left over, in increments: -1.0 .. 1.0.
    pub fraction: f32,
    /// Increments per cycle.
    pub velocity: f32,
    /// Increments per cycle squared.
    pub acceleration: f32,
}

impl Setpoint {
    /// At rest at `position`.
    pub const fn at_rest(position: i32) -> Setpoint {
        Setpoint {
            position,
            fraction: 0.0,
            velocity: 0.0,
            acceleration: 0.0,
        }
    }

    /// `offset` increments away from `base`.
    pub(super) const fn beside(base: i32, offset: f32) -> Setpoint {
        let whole = offset as i32;
        Setpoint {
            position: base.wrapping_add(whole),
            fraction: offset - whole as f32,
            velocity: 0.0,
            acceleration: 0.0,
        }
    }

    /// Reference minus `position`, in increments: the error that the position
    /// loop sees. Right across the wrap of the 32-bit position.
    pub fn minus(&self, position: i32) -> f32 {
        self.position.wrapping_sub(position) as f32 + self.fraction
    }
}

/// Bounds of a move, all positive, in increments and cycles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Increments per cycle.
    pub velocity: f32,
    /// Increments per cycle squared while the speed grows.
    pub acceleration: f32,
    /// Increments per cycle squared while it shrinks.
    pub deceleration: f32,
}

/// The phases of a move in cycles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Timing {
    /// Cycles of growing speed.
    pub accelerate: u32,
    /// Cycles of constant speed.
    pub cruise: u32,
    /// Cycles of shrinking speed.
    pub decelerate: u32,
}

/// A move that takes longer than the resolution of time allows (4 194 304
/// cycles a phase), or whose limits are not positive numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NotFeasible;

impl fmt::Display for NotFeasible {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the move would take too long: raise its velocity or accelerations")
    }
}

impl core::error::Error for NotFeasible {}

impl Timing {
    /// The shortest phases, in whole cycles, in which a move over `distance`
    /// increments keeps `limits`.
    ///
    /// # Errors
    /// [`NotFeasible`] if a limit is not positive or a phase too long.
    pub fn shortest(distance: i32, limits: &Limits) -> Result<Timing, NotFeasible> {
        let Limits {
            velocity,
            acceleration,
            deceleration,
        } = *limits;
        // Written so that a NaN is refused as well.
        if !(velocity > 0.0 && acceleration > 0.0 && deceleration > 0.0) {
            return Err(NotFeasible);
        }
        if distance == 0 {
            return Ok(Timing::default());
        }
        let distance = distance.unsigned_abs() as f32;
        let ramps = whole_cycles(velocity / acceleration)? as f32
            + whole_cycles(velocity / deceleration)? as f32;
        if distance >= velocity * ramps / 2.0 {
            return Ok(Timing {
                accelerate: whole_cycles(velocity / acceleration)?,
                cruise: whole_cycles(distance / velocity - ramps / 2.0)?,
                decelerate: whole_cycles(velocity / deceleration)?,
            });
        }
        let peak = square_root(
            2.0 * distance * acceleration * deceleration / (acceleration + deceleration),
        );
        Ok(Timing {
            accelerate: whole_cycles(peak / acceleration)?.max(1),
            cruise: 0,
            decelerate: whole_cycles(peak / deceleration)?.max(1),
        })
    }

    /// Phases in which a move that needs `self` and one that needs `other` both
    /// keep their limits.
    pub fn together(self, other: Timing) -> Timing {
        Timing {
            accelerate: self.accelerate.max(other.accelerate),
            cruise: self.cruise.max(other.cruise),
            decelerate: self.decelerate.max(other.decelerate),
        }
    }

    /// Cycles from start to end.
    pub const fn total(&self) -> u32 {
        self.accelerate + self.cruise + self.decelerate
    }
}

/// The smallest whole number of cycles that is at least `x`.
pub(super) fn whole_cycles(x: f32) -> Result<u32, NotFeasible> {
    if !(0.0..LONGEST_PHASE).contains(&x) {
        return Err(NotFeasible);
    }
    let x = x * (1.0 - ROUNDING);
    let whole = x as u32;
    Ok(if x > whole as f32 { whole + 1 } else { whole })
}

/// Square root of a positive number by Newton's iteration; `core` has none.
/// Relative error below 1e-6, which the rounding to whole cycles absorbs.
fn square_root(x: f32) -> f32 {
    /// Halving the exponent of the binary representation is the first guess:
    /// its bias has to be halved with it.
    const HALF_BIAS: u32 = 127 << 22;
    let mut root = f32::from_bits((x.to_bits() >> 1) + HALF_BIAS);
    for _ in 0..4 {
        root = 0.5 * (root + x / root);
    }
    root
}

/// A move of one axis from rest to rest.
///
/// # Resolution
/// Positions are computed from the nearer end of the move, with a relative
/// error of 2^-22: better than 1/16 increment within 262 144 increments (131
/// turns of 2000) of either end, and exact at both ends, whatever the distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    start: i32,
    target: i32,
    timing: Timing,
    /// Increments per cycle in the cruise phase, signed.
    peak: f32,
    /// Increments per cycle squared, signed as the acceleration acts.
    acceleration: f32,
    deceleration: f32,
}

impl Profile {
    /// A move from `start` to `target` in the phases of `timing`. The shorter
    /// way around is taken if the positions lie on both sides of the wrap.
    pub fn new(start: i32, target: i32, timing: Timing) -> Profile {
        let distance = target.wrapping_sub(start) as f32;
        let weight = timing.accelerate + 2 * timing.cruise + timing.decelerate;
        let peak = if weight == 0 {
            0.0
        } else {
            2.0 * distance / weight as f32
        };
        let over = |cycles: u32| {
            if cycles == 0 {
                0.0
            } else {
                peak / cycles as f32
            }
        };
        Profile {
            start,
            target,
            timing,
            peak,
            acceleration: over(timing.accelerate),
            deceleration: -over(timing.decelerate),
        }
    }

    /// Where the move ends.
    pub const fn target(&self) -> i32 {
        self.target
    }

    /// Cycles from start to end.
    pub const fn duration(&self) -> u32 {
        self.timing.total()
    }

    /// Magnitudes of acceleration and deceleration, in increments per cycle
    /// squared.
    pub fn accelerations(&self) -> (f32, f32) {
        (self.acceleration.abs(), self.deceleration.abs())
    }

    /// The reference `t` cycles after the start; before it and after the end
    /// the axis rests.
    pub fn at(&self, t: i32) -> Setpoint {
        let Timing {
            accelerate,
            cruise,
            decelerate,
        } = self.timing;
        let total = accelerate + cruise + decelerate;
        let Ok(elapsed) = u32::try_from(t) else {
            return Setpoint::at_rest(self.start);
        };
        if elapsed >= total {
            return Setpoint::at_rest(self.target);
        }
        let remaining = total - elapsed;
        if elapsed < accelerate {
            let s = elapsed as f32;
            Setpoint {
                velocity: self.acceleration * s,
                acceleration: self.acceleration,
                ..Setpoint::beside(self.start, 0.5 * self.acceleration * s * s)
            }
        } else if remaining <= decelerate {
            let s = remaining as f32;
            Setpoint {
                velocity: -self.deceleration * s,
                acceleration: self.deceleration,
                ..Setpoint::beside(self.target, 0.5 * self.deceleration * s * s)
            }
        } else {
            let place = if elapsed < remaining {
                let offset = self.peak * (elapsed as f32 - 0.5 * accelerate as f32);
                Setpoint::beside(self.start, offset)
            } else {
                let offset = -self.peak * (remaining as f32 - 0.5 * decelerate as f32);
                Setpoint::beside(self.target, offset)
            };
            Setpoint {
                velocity: self.peak,
                ..place
            }
        }
    }
}

//! Position control closed in the master over the drive's velocity loop.
//!
//! The drive runs in profile velocity mode (CiA 402-2, clause 15) and gets a new
//! target velocity (60FFh) every cycle. Two delays lie between a reference and
//! the motor: what is written in cycle k is taken over at SYNC k+1, and the
//! drive's velocity loop follows with a lag. Both are known well enough to
//! command ahead of time; the position loop only removes what is left.
//!
//! - *Feed-forward*: at SYNC k the reference for SYNC k+2 is commanded, where the
//!   drive's ramp from the target of SYNC k+1 ends, advanced by the lag.
//! - *Lag*: starts at a nominal value and is learned while the reference
//!   accelerates: there, a lag estimated wrongly by d shows as a constant
//!   position error of d times the acceleration over the gain.
//! - *Position loop*: proportional, bounded. Below the resolution of 60FFh (1
//!   rpm) the rounding error is carried to the next cycle, so that the mean
//!   velocity is exact and the last increment is reached. Inside the dead band
//!   an axis whose reference rests is commanded 0: it does not hunt.

use super::profile::Setpoint;
use super::scale::Scale;
use crate::time::Duration;

/// Properties of the position loop of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// Proportional gain in 1/s. Its product with the loop's delay (1.5 cycles
    /// and the lag) should stay below 0.35: then the loop does not overshoot.
    pub gain: f32,
    /// Lag of the drive's velocity loop to start from, in seconds.
    pub lag: f32,
    /// Largest lag that can be learned, in seconds.
    pub lag_max: f32,
    /// Share of a newly seen lag that is taken over per cycle, 0 .. 1.
    pub learning: f32,
    /// Bound of the position loop's output in rpm while the reference moves.
    pub correction_rpm: f32,
    /// The same in rpm while the reference rests: creeping to the last
    /// increments must not count as motion.
    pub creep_rpm: f32,
    /// Position error in increments within which a resting axis gets velocity 0.
    pub dead_band: u32,
}

impl Tuning {
    /// For drives with a velocity loop of 3 .. 10 ms at a cycle of 10 ms.
    pub const MILLISECONDS_10: Tuning = Tuning {
        gain: 12.0,
        lag: 0.005,
        lag_max: 0.015,
        learning: 0.03,
        correction_rpm: 60.0,
        creep_rpm: 3.0,
        dead_band: 1,
    };

    /// For the same drives at another cycle: the gain falls with the delay of the
    /// loop, 1.5 cycles and the lag; the lag is learned in the same time.
    pub const fn for_cycle(cycle: Duration) -> Tuning {
        /// The product of gain and delay, per mille.
        const GAIN_BY_DELAY: f32 = 300.0;
        /// The lag that a drive is taken to have, in milliseconds.
        const LAG_MS: f32 = 10.0;
        const CYCLES: f32 = 1.5;
        /// Longer cycles learn no faster.
        const NOMINAL_MS: f32 = 10.0;
        const fn least(a: f32, b: f32) -> f32 {
            if a < b { a } else { b }
        }
        const US_PER_MS: f32 = 1000.0;
        let cycle_ms = cycle.as_micros() as f32 / US_PER_MS;
        Tuning {
            gain: GAIN_BY_DELAY / (CYCLES * cycle_ms + LAG_MS),
            learning: Tuning::MILLISECONDS_10.learning * least(cycle_ms / NOMINAL_MS, 1.0),
            ..Tuning::MILLISECONDS_10
        }
    }
}

/// What an axis rolls on after an advanced ramp, over deceleration times lag
/// squared. It is a half for a continuous ramp; with ramps in steps of a cycle,
/// interpolated by the drive (which shortens the lag as learned), simulated
/// drives of 3 .. 10 ms end nearest to their targets with this value.
const STOPPING_SHORT: f32 = 1.0;

/// The reference around one SYNC, as the position loop needs it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// At the SYNC just passed, when the position was sampled.
    pub now: Setpoint,
    /// At the end of the cycle that the next command governs.
    pub ahead: Setpoint,
    /// Velocity one cycle later, increments per cycle.
    pub beyond: f32,
}

impl Window {
    /// Whether the reference rests all through the window.
    fn rests(&self) -> bool {
        self.now.velocity == 0.0 && self.ahead.velocity == 0.0 && self.beyond == 0.0
    }
}

/// The position loop of one axis: what it remembers from cycle to cycle.
#[derive(Clone, Debug)]
pub struct PositionControl {
    scale: Scale,
    tuning: Tuning,
    /// The lag as learned so far, in cycles.
    lag: f32,
    lag_max: f32,
    /// Gain per cycle.
    gain: f32,
    /// What rounding the last command to whole rpm left over, in rpm.
    carry: f32,
}

impl PositionControl {
    /// A loop that has learned nothing yet.
    pub fn new(scale: Scale, tuning: Tuning) -> PositionControl {
        PositionControl {
            scale,
            tuning,
            lag: scale.cycles(tuning.lag),
            lag_max: scale.cycles(tuning.lag_max),
            gain: scale.per_cycle(tuning.gain),
            carry: 0.0,
        }
    }

    /// The lag of the drive's velocity loop as learned so far, in cycles.
    pub const fn lag(&self) -> f32 {
        self.lag
    }

    /// The target velocity (60FFh) in rpm that follows the reference, at most
    /// `limit` in magnitude.
    ///
    /// `position` is 6064h as sampled at `window.now`; without it (its TPDO is
    /// missing) the axis is driven by feed-forward alone.
    pub fn step(&mut self, window: &Window, position: Option<i32>, limit: u32) -> i32 {
        let error = position.map(|p| window.now.minus(p) + self.stopping_short(&window.now));
        let mut correction = 0.0;
        if let Some(error) = error {
            if window.rests() && error.abs() <= self.tuning.dead_band as f32 {
                self.carry = 0.0;
                return 0;
            }
            self.learn(window, error);
            let bound = if window.rests() {
                self.tuning.creep_rpm
            } else {
                self.tuning.correction_rpm
            };
            correction = within(self.scale.rpm(self.gain * error), -bound, bound);
        }
        let advanced = window.ahead.velocity + self.lag * (window.beyond - window.ahead.velocity);
        let wanted = self.scale.rpm(advanced) + correction + self.carry;
        let limit = limit as f32;
        let command = round(within(wanted, -limit, limit));
        self.carry = within(wanted - command as f32, -1.0, 1.0);
        command
    }

    /// The way in increments by which an axis has to stay behind while it brakes.
    ///
    /// The advanced command reaches 0 a lag before the reference does and cannot
    /// undershoot, so that the axis would roll on when the ramp is over.
    fn stopping_short(&self, now: &Setpoint) -> f32 {
        if now.acceleration * now.velocity < 0.0 {
            STOPPING_SHORT * now.acceleration * self.lag * self.lag
        } else {
            0.0
        }
    }

    /// A constant error while the reference accelerates is a wrong lag.
    fn learn(&mut self, window: &Window, error: f32) {
        let acceleration = window.now.acceleration;
        if acceleration == 0.0 || window.ahead.acceleration != acceleration {
            return;
        }
        let missing = error * self.gain / acceleration;
        self.lag = within(self.lag + self.tuning.learning * missing, 0.0, self.lag_max);
    }
}

/// The number of `low ..= high` that is nearest to `x`. Unlike `f32::clamp` it
/// has no panic, whose message would bring the formatting of floating-point
/// numbers into the image.
fn within(x: f32, low: f32, high: f32) -> f32 {
    if x < low {
        low
    } else if x > high {
        high
    } else {
        x
    }
}

/// To the nearest whole number, halves away from zero.
fn round(x: f32) -> i32 {
    (x + 0.5f32.copysign(x)) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Increments per cycle that are 1 rpm with 2000 increments and 10 ms.
    const RPM: f32 = 1.0 / 3.0;

    fn control() -> PositionControl {
        let scale = Scale::new(2000, Duration::from_millis(10));
        PositionControl::new(scale, Tuning::MILLISECONDS_10)
    }

    fn resting(position: i32) -> Window {
        Window {
            now: Setpoint::at_rest(position),
            ahead: Setpoint::at_rest(position),
            beyond: 0.0,
        }
    }

    fn cruising(rpm: f32) -> Window {
        let at = Setpoint {
            velocity: rpm * RPM,
            ..Setpoint::at_rest(0)
        };
        Window {
            now: at,
            ahead: at,
            beyond: at.velocity,
        }
    }

    #[test]
    fn the_tuning_follows_the_cycle() {
        let of = |ms| Tuning::for_cycle(Duration::from_millis(ms));
        assert_eq!(of(10), Tuning::MILLISECONDS_10);
        assert!(of(2).gain > 20.0 && of(50).gain < 4.0);
    }

    #[test]
    fn a_resting_axis_inside_the_dead_band_gets_nothing() {
        let mut control = control();
        for error in [-1, 0, 1] {
            assert_eq!(control.step(&resting(100), Some(100 - error), 3000), 0);
        }
    }

    #[test]
    fn creeping_is_slower_than_what_counts_as_motion() {
        for error in [-1000, -20, 20, 1000] {
            let mut control = control();
            for _ in 0..10 {
                let rpm = control.step(&resting(0), Some(-error), 3000);
                assert!(rpm.abs() <= 3 && rpm * error > 0, "{rpm}");
            }
        }
    }

    /// Two increments of error are 0.72 rpm: 72 of 100 cycles at 1 rpm.
    #[test]
    fn rounding_is_carried_on() {
        let mut control = control();
        let sum: i32 = (0..100)
            .map(|_| control.step(&resting(2), Some(0), 3000))
            .sum();
        assert_eq!(sum, 72);
    }

    #[test]
    fn the_wrap_of_the_position_is_no_error() {
        let mut control = control();
        let window = resting(i32::MIN);
        assert_eq!(control.step(&window, Some(i32::MAX), 3000), 0);
    }

    #[test]
    fn commands_keep_their_limits() {
        let mut control = control();
        assert_eq!(control.step(&cruising(5000.0), Some(0), 3000), 3000);
        assert_eq!(control.step(&cruising(-5000.0), Some(0), 3000), -3000);
        // The correction is bounded as well.
        let mut control = super::tests::control();
        let rpm = control.step(&cruising(1000.0), Some(-100_000), 3000);
        assert_eq!(rpm, 1060);
    }

    #[test]
    fn without_feedback_the_feed_forward_goes_on() {
        let mut control = control();
        for _ in 0..10 {
            assert_eq!(control.step(&cruising(750.0), None, 3000), 750);
        }
    }

    /// A drive whose lag is 4 ms longer than assumed is late by 4 ms times the
    /// acceleration, less the share already learned.
    #[test]
    fn the_lag_is_learned_and_bounded() {
        let mut control = control();
        let acceleration = 3.0;
        let at = Setpoint {
            acceleration,
            velocity: 100.0,
            ..Setpoint::at_rest(0)
        };
        let window = Window {
            now: at,
            ahead: at,
            beyond: 103.0,
        };
        for _ in 0..300 {
            let late = (0.9 - control.lag()) * acceleration / control.gain;
            control.step(&window, Some(-round(late)), 3000);
        }
        assert!((control.lag() - 0.9).abs() < 0.03, "{}", control.lag());
        for _ in 0..1000 {
            control.step(&window, Some(-100_000), 3000);
        }
        assert_eq!(control.lag(), control.lag_max);
        for _ in 0..1000 {
            control.step(&window, Some(100_000), 3000);
        }
        assert_eq!(control.lag(), 0.0);
    }
}

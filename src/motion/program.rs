//! Motion programs: a constant table that one release runs through once.

use super::group::GroupConfig;
use super::profile::{Limits, Timing};
use super::scale::Scale;
use crate::time::Duration;
use crate::words::in_words;

/// One axis' part of a move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AxisMove {
    /// Where to go, in increments from the axis' home: its position when it was
    /// enabled.
    pub target: i32,
    /// Highest speed in rpm.
    pub velocity: u32,
    /// rpm/s while the speed grows.
    pub acceleration: u32,
    /// rpm/s while it shrinks.
    pub deceleration: u32,
    /// Axes with the same number share the phases of the slowest of them: they
    /// start and arrive in the same SYNC.
    pub set: u8,
}

/// One step of a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Step<const N: usize> {
    /// The named axes start in the same SYNC; the step ends when all have
    /// arrived. The others hold their positions.
    Move([Option<AxisMove>; N]),
    /// All axes hold their positions.
    Dwell(Duration),
}

/// A motion program for `N` axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Program<const N: usize> {
    /// For logs and reports.
    pub name: &'static str,
    /// Run in order, once per release.
    pub steps: &'static [Step<N>],
}

/// The quantity of a move that a bound of the axis forbids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Limit {
    /// Highest speed, rpm.
    Velocity,
    /// Acceleration, rpm/s.
    Acceleration,
    /// Deceleration, rpm/s.
    Deceleration,
    /// Distance from home in increments.
    Target,
}

in_words!(Limit {
    Limit::Velocity => ("velocity in rpm"),
    Limit::Acceleration => ("acceleration in rpm/s"),
    Limit::Deceleration => ("deceleration in rpm/s"),
    Limit::Target => ("target in increments from home"),
});

/// Why a program cannot be run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PlanError {
    /// A value of a move lies outside the limits of the axis.
    OutOfLimits {
        /// Axis, counted from 0.
        axis: u8,
        /// Which value.
        limit: Limit,
        /// What the program asks for.
        value: i32,
        /// Largest magnitude allowed (0 itself is allowed for the target only).
        allowed: u32,
    },
    /// The move would take longer than the resolution of time allows.
    TooLong {
        /// Axis, counted from 0.
        axis: u8,
    },
}

in_words!(PlanError {
    PlanError::OutOfLimits { axis, limit, value, allowed } => (
        "axis {}: {} is {}, at most {} allowed: change the program",
        axis + 1, limit, value, allowed
    ),
    PlanError::TooLong { axis } => (
        "axis {}: the move takes too long: raise its velocity or accelerations", axis + 1
    ),
});

impl core::error::Error for PlanError {}

impl AxisMove {
    /// Checks the move against the limits of its axis.
    fn check<const N: usize>(&self, axis: u8, config: &GroupConfig<N>) -> Result<(), PlanError> {
        let Some(limits) = config.axes.get(usize::from(axis)) else {
            return Ok(());
        };
        let checks = [
            (Limit::Velocity, self.velocity, limits.velocity_max),
            (
                Limit::Acceleration,
                self.acceleration,
                limits.acceleration_max,
            ),
            (
                Limit::Deceleration,
                self.deceleration,
                limits.acceleration_max,
            ),
        ];
        for (limit, value, allowed) in checks {
            if value == 0 || value > allowed {
                return Err(PlanError::OutOfLimits {
                    axis,
                    limit,
                    value: i32::try_from(value).unwrap_or(i32::MAX),
                    allowed,
                });
            }
        }
        if self.target.unsigned_abs() > limits.travel_max {
            return Err(PlanError::OutOfLimits {
                axis,
                limit: Limit::Target,
                value: self.target,
                allowed: limits.travel_max,
            });
        }
        Ok(())
    }

    /// The shortest phases of the move over `distance` increments.
    fn timing(&self, axis: u8, distance: i32, scale: Scale) -> Result<Timing, PlanError> {
        let limits = Limits {
            velocity: scale.velocity(self.velocity as f32),
            acceleration: scale.acceleration(self.acceleration as f32),
            deceleration: scale.acceleration(self.deceleration as f32),
        };
        Timing::shortest(distance, &limits).map_err(|_| PlanError::TooLong { axis })
    }
}

/// Phases for each axis of a move from `from` (increments from home), those of
/// the same set sharing theirs. Axes without a part in the move get no phases.
///
/// # Errors
/// [`PlanError`] for the first axis whose part breaks a limit.
pub(super) fn plan<const N: usize>(
    moves: &[Option<AxisMove>; N],
    from: &[i32; N],
    config: &GroupConfig<N>,
) -> Result<[Timing; N], PlanError> {
    let mut timings = [Timing::default(); N];
    for (axis, ((part, from), timing)) in (0u8..).zip(moves.iter().zip(from).zip(&mut timings)) {
        let Some(part) = part else { continue };
        part.check(axis, config)?;
        *timing = part.timing(axis, part.target.wrapping_sub(*from), config.scale(axis))?;
    }
    let alone = timings;
    for (part, timing) in moves.iter().zip(&mut timings) {
        let Some(part) = part else { continue };
        for (other, other_timing) in moves.iter().zip(&alone) {
            if other.is_some_and(|o| o.set == part.set) {
                *timing = timing.together(*other_timing);
            }
        }
    }
    Ok(timings)
}

impl<const N: usize> Program<N> {
    /// Checks every move against the limits in `config` and sums up how long one
    /// run takes when it starts from home.
    ///
    /// The settling of an axis at each target is taken as the time allowed for
    /// it at best; a disturbed axis may need longer, up to
    /// [`GroupConfig::settle_timeout`] per move.
    ///
    /// # Errors
    /// [`PlanError`] for the first move that cannot be carried out.
    pub fn duration(&self, config: &GroupConfig<N>) -> Result<Duration, PlanError> {
        let mut from = [0; N];
        let mut cycles = 0u64;
        for step in self.steps {
            match step {
                Step::Dwell(time) => cycles += u64::from(config.cycles(*time)),
                Step::Move(moves) => {
                    let timings = plan(moves, &from, config)?;
                    let longest = timings.iter().map(Timing::total).max().unwrap_or(0);
                    cycles += u64::from(longest) + SETTLING_CYCLES;
                    for (from, part) in from.iter_mut().zip(moves) {
                        *from = part.map_or(*from, |p| p.target);
                    }
                }
            }
        }
        let us = cycles * u64::from(config.cycle.as_micros());
        Ok(Duration::from_micros(u32::try_from(us).unwrap_or(u32::MAX)))
    }
}

/// Cycles between the end of a move's reference and the next step when nothing
/// disturbs the axes: delay of the loop, last increments, confirmation.
const SETTLING_CYCLES: u64 = 12;

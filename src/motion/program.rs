//! Motion programs: a constant table that one release runs through once.

use super::format::VERSION;
use super::path::Point;
use super::plan::{self, Knots, Leg};
use super::scale::Scale;
use super::{AxisConfig, GroupConfig};
use crate::sdo::Crc16;
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
    /// Torque, per mille of the rated one.
    Torque,
}

in_words!(Limit {
    Limit::Velocity => ("velocity in rpm"),
    Limit::Acceleration => ("acceleration in rpm/s"),
    Limit::Deceleration => ("deceleration in rpm/s"),
    Limit::Target => ("target in increments from home"),
    Limit::Torque => ("torque in per mille"),
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
        /// Largest magnitude allowed on this side (0 itself is allowed for the
        /// target only).
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
    /// The leg of a path, from rest at 0; its target as it stands here.
    pub(super) fn leg(&self, scale: Scale) -> Leg {
        Leg {
            target: self.target,
            velocity: scale.velocity(self.velocity as f32),
            acceleration: scale.acceleration(self.acceleration as f32),
            deceleration: scale.acceleration(self.deceleration as f32),
            set: self.set,
            ..Leg::default()
        }
    }

    /// Checks the move against the limits of its axis, its target only if it is
    /// `absolute`.
    ///
    /// # Errors
    /// [`PlanError`] for the first value that breaks a limit.
    pub fn keeps(&self, axis: u8, limits: &AxisConfig, absolute: bool) -> Result<(), PlanError> {
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
        if absolute {
            limits.reaches(axis, self.target)?;
        }
        Ok(())
    }
}

/// The axes that have a part: bit n for axis n.
const fn axes<const N: usize>(moves: &[Option<AxisMove>; N]) -> u32 {
    let (mut axes, mut bit) = (0, 1);
    let mut left: &[Option<AxisMove>] = moves;
    while let Some((part, others)) = left.split_first() {
        if part.is_some() {
            axes |= bit;
        }
        bit <<= 1;
        left = others;
    }
    axes
}

/// Writes the lowest bytes of `value`; what is left behind them.
const fn put(bytes: &mut [u8], value: u32, size: u8) -> &mut [u8] {
    let (mut left, mut value, mut size) = (bytes, value, size);
    while size > 0 {
        let Some((byte, more)) = left.split_first_mut() else {
            return &mut [];
        };
        *byte = value as u8;
        (left, value, size) = (more, value >> u8::BITS, size - 1);
    }
    left
}

impl<const N: usize> Program<N> {
    /// Bytes of a program with so many moves of all axes and so many dwells.
    pub const fn len_of(moves: usize, dwells: usize) -> usize {
        const FRAME: usize = 6;
        const MOVE: usize = 8;
        const PART: usize = 17;
        const WAIT: usize = 5;
        FRAME + moves * (MOVE + N * PART) + dwells * WAIT
    }

    /// The program as [`format`](crate::motion::format) has it; `BYTES` is to be
    /// [`len_of`](Self::len_of) its steps.
    pub const fn bytes<const BYTES: usize>(&self) -> [u8; BYTES] {
        const MOVE: u32 = 1;
        const WAIT: u32 = 2;
        const FRAME: u32 = 6;
        let mut bytes = [0; BYTES];
        let mut left = put(&mut bytes, VERSION as u32, 1);
        left = put(left, N as u32, 1);
        left = put(left, BYTES as u32 - FRAME, 2);
        let mut steps = self.steps;
        while let Some((step, others)) = steps.split_first() {
            left = match step {
                Step::Dwell(time) => put(put(left, WAIT, 1), time.as_millis(), 4),
                Step::Move(moves) => {
                    left = put(put(left, MOVE, 2), axes(moves), 2);
                    left = put(left, 0, 4);
                    let mut parts: &[Option<AxisMove>] = moves;
                    while let Some((part, more)) = parts.split_first() {
                        if let Some(part) = part {
                            left = put(left, part.target as u32, 4);
                            left = put(left, part.velocity, 4);
                            left = put(left, part.acceleration, 4);
                            left = put(left, part.deceleration, 4);
                            left = put(left, part.set as u32, 1);
                        }
                        parts = more;
                    }
                    left
                }
            };
            steps = others;
        }
        if let Some((all, crc)) = bytes.split_last_chunk_mut() {
            *crc = Crc16::new().update(all).get().to_le_bytes();
        }
        bytes
    }

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
        let mut at = [0; N];
        let mut cycles = 0u64;
        for step in self.steps {
            match step {
                Step::Dwell(time) => cycles += u64::from(config.cycles(*time)),
                Step::Move(moves) => {
                    let mut legs = [None; N];
                    let parts = moves.iter().zip(&mut legs).zip(&mut at).zip(&config.axes);
                    for (axis, (((part, leg), at), limits)) in (0..).zip(parts) {
                        let Some(part) = part else { continue };
                        part.keeps(axis, limits, true)?;
                        let from = core::mem::replace(at, part.target);
                        *leg = Some(Leg {
                            from: Point::at_rest(from),
                            ..part.leg(config.scale(axis))
                        });
                    }
                    let mut knots = [const { Knots::new() }; N];
                    let longest = plan::plan(&legs, &mut knots);
                    let longest = longest.map_err(|late| PlanError::TooLong { axis: late.leg })?;
                    cycles += u64::from(longest) + SETTLING_CYCLES;
                }
            }
        }
        let us = cycles * u64::from(config.cycle.as_micros());
        Ok(Duration::from_micros(u32::try_from(us).unwrap_or(u32::MAX)))
    }
}

/// Cycles between the end of a move's reference and the next step when nothing
/// disturbs the axes: delay of the loop, last increments, confirmation, planning.
const SETTLING_CYCLES: u64 = 14;

//! One axis' part of a move, and why a move or a program cannot be carried out.

use super::AxisConfig;
use super::scale::Scale;
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

/// What of a move or a program is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[non_exhaustive]
pub enum Fault {
    /// Bytes of the program.
    Length,
    /// Version of the format.
    Version,
    /// Number of axes that it is made for.
    Axes,
    /// SYNC period that it is made for, microseconds.
    Cycle,
    /// CRC-16.
    Checksum,
    /// Kind of a step.
    Step,
    /// The axes of a step, bit n for axis n.
    Members,
    /// Mode of operation, as 6060h; allowed are those of 6502h.
    Mode,
    /// How deep a loop lies in others; below 1 one ends that did not begin.
    Loop,
    /// Points of a path, or cycles from one to the next.
    Points,
    /// Where a path begins, increments from home.
    Begin,
    /// What a path has left at its end: velocity, or way where it is repeated.
    End,
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
    /// Cycles of a move.
    Time,
}

#[cfg(feature = "defmt")]
impl Fault {
    const fn place(&self) -> u8 {
        *self as u8
    }
}

in_words!(Fault by Fault::place {
    Fault::Length => ("length in bytes"),
    Fault::Version => ("version of the format"),
    Fault::Axes => ("number of axes"),
    Fault::Cycle => ("SYNC period in us"),
    Fault::Checksum => ("checksum"),
    Fault::Step => ("kind of the step"),
    Fault::Members => ("set of axes"),
    Fault::Mode => ("mode of operation"),
    Fault::Loop => ("depth of loops"),
    Fault::Points => ("number of points or cycles"),
    Fault::Begin => ("begin of the path in increments from home"),
    Fault::End => ("end of the path"),
    Fault::Velocity => ("velocity in rpm"),
    Fault::Acceleration => ("acceleration in rpm/s"),
    Fault::Deceleration => ("deceleration in rpm/s"),
    Fault::Target => ("target in increments from home"),
    Fault::Torque => ("torque in per mille"),
    Fault::Time => ("time in cycles"),
});

/// Why a move or a program cannot be carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlanError {
    /// What is wrong.
    pub fault: Fault,
    /// Axis, counted from 0; [`NO_AXIS`](Self::NO_AXIS) where it is no matter of
    /// one.
    pub axis: u8,
    /// Step of the program, counted from 1; 0: a single move, or the program as a
    /// whole.
    pub step: u16,
    /// What is asked for.
    pub value: i32,
    /// Largest magnitude allowed, or the only value.
    pub allowed: i32,
}

impl PlanError {
    /// No single axis.
    pub const NO_AXIS: u8 = u8::MAX;

    /// Of no axis and no step.
    pub(super) const fn whole(fault: Fault, value: u32, allowed: u32) -> PlanError {
        PlanError {
            fault,
            axis: PlanError::NO_AXIS,
            step: 0,
            value: value as i32,
            allowed: allowed as i32,
        }
    }
}

in_words!(PlanError {
    PlanError { axis: PlanError::NO_AXIS, step, fault, value, allowed } => (
        "step {}: {} is {}, allowed is {}", step, fault, value, allowed
    ),
    PlanError { axis, step, fault, value, allowed } => (
        "step {}, axis {}: {} is {}, allowed is {}", step, axis + 1, fault, value, allowed
    ),
});

impl core::error::Error for PlanError {}

/// `value`, a magnitude above 0, against the largest that is allowed.
#[inline(never)]
pub(super) fn within(axis: u8, fault: Fault, value: u32, allowed: u32) -> Result<(), PlanError> {
    if value.wrapping_sub(1) < allowed {
        return Ok(());
    }
    Err(PlanError {
        axis,
        ..PlanError::whole(fault, value, allowed)
    })
}

impl AxisMove {
    /// The limits of a leg, in increments and cycles.
    pub(super) fn limits(&self, scale: Scale) -> [f32; 3] {
        [
            scale.velocity(self.velocity as f32),
            scale.acceleration(self.acceleration as f32),
            scale.acceleration(self.deceleration as f32),
        ]
    }

    /// Checks all but the target against the limits of its axis.
    ///
    /// # Errors
    /// [`PlanError`] for the first value that breaks a limit.
    pub fn keeps(&self, axis: u8, limits: &AxisConfig) -> Result<(), PlanError> {
        let most = limits.acceleration_max;
        within(axis, Fault::Velocity, self.velocity, limits.velocity_max)?;
        within(axis, Fault::Acceleration, self.acceleration, most)?;
        within(axis, Fault::Deceleration, self.deceleration, most)
    }
}

//! One axis' part of a move, and why a move or a program cannot be carried out.

use super::scale::Scale;
use super::{AxisConfig, GroupState};
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

/// In the set of a program's move: its target is a torque, and per mille stand where
/// else there are rpm.
pub(super) const TORQUE: u8 = 1 << 7;

/// Why something is refused: the number that stands in 2002h.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[non_exhaustive]
pub enum Reason {
    /// None: nothing is refused.
    None = 0,
    /// The order does not count in this state of the group, 2001h.
    State = 1,
    /// The axis' TPDO of this cycle is missing.
    NotFresh = 2,
    /// Speed in rpm: the axis turns.
    NotAtRest = 3,
    /// The network is not ready.
    Network = 4,
    /// The axis is in another mode of operation than the allowed one.
    WrongMode = 5,
    /// The drive does not have the mode; allowed are those of 6502h.
    NoSuchMode = 6,
    /// The last command is not carried out yet.
    Busy = 7,
    /// There is no such command, or no such axis.
    Unknown = 8,
    /// Bytes of the program. From here on a move or a program cannot be made.
    Length = 16,
    /// Version of the format.
    Version,
    /// Number of axes that it is made for.
    Axes,
    /// SYNC period that it is made for, microseconds.
    Cycle,
    /// CRC-16.
    Checksum,
    /// Kind of a step, or the flags of one that has less.
    Step,
    /// The axes of a step, bit n for axis n.
    Members,
    /// Mode of operation, as 6060h; allowed are those of 6502h.
    Mode,
    /// How deep a loop lies in others; below 1 one ends that did not begin,
    /// or has nothing in it.
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
    /// Cycles of a move, a wait or a search for home.
    Time,
    /// Velocity in rpm that the drive does not show in 6081h; what it showed before is not
    /// known any more.
    NotShown,
}

impl Reason {
    #[cfg(feature = "defmt")]
    const fn place(&self) -> u8 {
        const GAP: u8 = Reason::Length as u8 - Reason::Unknown as u8 - 1;
        let number = *self as u8;
        number
            - if number < Reason::Length as u8 {
                0
            } else {
                GAP
            }
    }

    /// Whether another value would have been taken.
    pub(super) const fn is_of_the_value(self) -> bool {
        self as u8 >= Reason::Length as u8 || matches!(self, Reason::NoSuchMode | Reason::Unknown)
    }
}

in_words!(Reason by Reason::place {
    Reason::None => ("nothing"),
    Reason::State => ("state of the group"),
    Reason::NotFresh => ("TPDO in this cycle"),
    Reason::NotAtRest => ("speed in rpm"),
    Reason::Network => ("readiness of the network"),
    Reason::WrongMode => ("mode of operation (6061h)"),
    Reason::NoSuchMode => ("mode of operation (6502h)"),
    Reason::Busy => ("command that is not carried out yet"),
    Reason::Unknown => ("command or axes"),
    Reason::Length => ("length in bytes"),
    Reason::Version => ("version of the format"),
    Reason::Axes => ("number of axes"),
    Reason::Cycle => ("SYNC period in us"),
    Reason::Checksum => ("checksum"),
    Reason::Step => ("kind or flags of the step"),
    Reason::Members => ("set of axes"),
    Reason::Mode => ("mode of operation"),
    Reason::Loop => ("depth of loops"),
    Reason::Points => ("number of points or cycles"),
    Reason::Begin => ("begin of the path in increments from home"),
    Reason::End => ("end of the path"),
    Reason::Velocity => ("velocity in rpm"),
    Reason::Acceleration => ("acceleration in rpm/s"),
    Reason::Deceleration => ("deceleration in rpm/s"),
    Reason::Target => ("target in increments from home"),
    Reason::Torque => ("torque in per mille"),
    Reason::Time => ("time in cycles"),
    Reason::NotShown => ("velocity in rpm, which 6081h does not come to,"),
});

/// A [`Refusal`] says why: it stays in its place, which is shorter than to hand it on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Refused;

/// What an order, a move or a program is judged.
pub(super) type Judged = Result<(), Refused>;

/// Why an order, a move or a program cannot be carried out. Nothing has been sent
/// because of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// What is wrong.
    pub reason: Reason,
    /// Axis, counted from 0; [`NO_AXIS`](Self::NO_AXIS) where it is no matter of
    /// one.
    pub axis: u8,
    /// Step of the program, counted from 1; 0: none, or the program as a whole.
    pub step: u16,
    /// What is asked for, or what there is.
    pub value: i32,
    /// Largest magnitude allowed, or the only value.
    pub allowed: i32,
}

impl Refusal {
    /// No single axis.
    pub const NO_AXIS: u8 = u8::MAX;

    /// Nothing is refused.
    pub(super) const NONE: Refusal = Refusal::whole(Reason::None, 0, 0);

    /// That, as zeros.
    pub(super) const ZERO: Refusal = Refusal::of(0, Reason::None, 0, 0);

    /// This is it, of the axis and the step that are named already.
    #[inline(never)]
    pub(super) fn because(&mut self, reason: Reason, value: u32, allowed: u32) -> Judged {
        self.reason = reason;
        self.value = value as i32;
        self.allowed = allowed as i32;
        Err(Refused)
    }

    /// `value`, a magnitude above 0, against the largest that is allowed.
    #[inline(never)]
    pub(super) fn within(&mut self, reason: Reason, value: u32, allowed: u32) -> Judged {
        if value.wrapping_sub(1) < allowed {
            return Ok(());
        }
        self.because(reason, value, allowed)
    }

    /// The last command is not carried out yet.
    pub(super) fn busy(&mut self) -> Judged {
        self.because(Reason::Busy, 1, 0)
    }

    /// That is not done in this state.
    pub(super) fn state(&mut self, state: GroupState) -> Judged {
        self.because(Reason::State, state as u32, 0)
    }

    /// The group is in a state in which that does not count.
    pub const fn not_in(state: GroupState) -> Refusal {
        Refusal::whole(Reason::State, state as u32, 0)
    }

    /// Of no axis and no step.
    pub const fn whole(reason: Reason, value: u32, allowed: u32) -> Refusal {
        Refusal::of(Refusal::NO_AXIS, reason, value, allowed)
    }

    /// Of an axis.
    pub const fn of(axis: u8, reason: Reason, value: u32, allowed: u32) -> Refusal {
        Refusal {
            reason,
            axis,
            step: 0,
            value: value as i32,
            allowed: allowed as i32,
        }
    }
}

in_words!(Refusal {
    Refusal { reason: Reason::State, value, .. } => (
        "not while the group is {}", GroupState::of(value as u8)
    ),
    Refusal { axis: Refusal::NO_AXIS, reason, value, allowed, .. } => (
        "{} is {}, allowed is {}", reason, value, allowed
    ),
    Refusal { axis, reason, value, allowed, .. } => (
        "axis {}: {} is {}, allowed is {}", axis + 1, reason, value, allowed
    ),
});

impl core::error::Error for Refusal {}

impl AxisMove {
    /// The limits of a leg, in increments and cycles.
    pub(super) fn limits(&self, scale: Scale) -> [f32; 3] {
        [
            scale.velocity(self.velocity as f32),
            scale.acceleration(self.acceleration as f32),
            scale.acceleration(self.deceleration as f32),
        ]
    }

    /// Checks all but the target against the limits of its axis; how fast a torque
    /// changes has none.
    pub(super) fn keeps(&self, torque: bool, limits: &AxisConfig, why: &mut Refusal) -> Judged {
        let (mut fastest, mut most) = (limits.velocity_max, limits.acceleration_max);
        if torque {
            (fastest, most) = (u32::MAX, u32::MAX);
        }
        why.within(Reason::Velocity, self.velocity, fastest)?;
        why.within(Reason::Acceleration, self.acceleration, most)?;
        why.within(Reason::Deceleration, self.deceleration, most)
    }
}

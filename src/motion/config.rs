//! What a group is told about its axes, all in constants.

use crate::motion::mode::Mode;
use crate::motion::position_control::Tuning;
use crate::motion::program::{Judged, Reason, Refusal};
use crate::motion::scale::Scale;
use crate::time::Duration;

/// One axis of a group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisConfig {
    /// Increments of 6064h per turn of the motor.
    pub increments_per_turn: u32,
    /// Highest speed that is ever commanded, rpm. The position loop's correction
    /// counts: leave room above the program's speeds.
    pub velocity_max: u32,
    /// Highest acceleration and deceleration of a move, rpm/s.
    pub acceleration_max: u32,
    /// Farthest targets from home, increments: the lower, the upper.
    pub travel: (i32, i32),
    /// Position error that stops the group, increments.
    pub following_error_max: u32,
    /// Position error within which an axis has arrived, increments.
    pub in_position: u32,
    /// Its units, from `increments_per_turn` and the cycle.
    pub scale: Scale,
    /// Modes of operation that the drive has, as 6502h.
    pub modes: u32,
    /// The mode that it is configured for.
    pub mode: Mode,
    /// Highest torque that is ever commanded, per mille of the rated one.
    pub torque_max: u16,
}

impl AxisConfig {
    /// Whether it can be told to go to a target from home, or to a torque.
    #[inline(never)]
    pub(in crate::motion) fn takes(&self, target: i32, torque: bool, why: &mut Refusal) -> Judged {
        if torque {
            let value = target.unsigned_abs().max(1);
            return why.within(Reason::Torque, value, self.torque_max.into());
        }
        self.reaches(target, why)
    }

    /// Whether a target, counted from home, lies within the travel; if not, the end
    /// that is passed.
    #[inline(never)]
    pub(in crate::motion) fn reaches(&self, target: i32, why: &mut Refusal) -> Judged {
        let (lower, upper) = self.travel;
        let end = if target < 0 { lower } else { upper };
        if target.unsigned_abs() > end.unsigned_abs() {
            return why.because(Reason::Target, target as u32, end as u32);
        }
        Ok(())
    }
}

/// A group of `N` axes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct GroupConfig<const N: usize> {
    /// Time between two SYNCs, which is the time between two steps.
    pub cycle: Duration,
    /// The position loops.
    pub tuning: Tuning,
    /// Time for all axes to reach the next state on the way to operation
    /// enabled.
    pub enable_timeout: Duration,
    /// Consecutive cycles without an axis' TPDO that stop the group.
    pub missing_tpdo_max: u8,
    /// Deceleration of the fastest axis in a stop and after a fault, rpm/s; the
    /// others come to rest together with it.
    pub stop_deceleration: u32,
    /// Speed below which an axis counts as standing, rpm. Above the noise of
    /// 606Ch.
    pub standstill_rpm: u32,
    /// Cycles in a row in which an axis must be in position, or at standstill,
    /// to count as such.
    pub settle_cycles: u8,
    /// Time for an axis to arrive after the end of its reference, and to come
    /// to rest after a fault.
    pub settle_timeout: Duration,
    /// 6083h and 6084h over the steepest slope of the reference, in percent: the
    /// drive interpolates between two targets and still has room for the
    /// position loop's corrections. Above 100.
    pub ramp_percent: u32,
    /// Smallest 6083h and 6084h, rpm/s: room for the position loop when the
    /// reference rests.
    pub ramp_min: u32,
    /// The axes, in the order of feedback and commands.
    pub axes: [AxisConfig; N],
}

impl<const N: usize> GroupConfig<N> {
    /// Whole cycles that last at least `time`.
    #[inline(never)]
    pub const fn cycles(&self, time: Duration) -> u32 {
        let cycle = self.cycle.as_micros();
        time.as_micros()
            .div_ceil(if cycle == 0 { 1 } else { cycle })
    }
}

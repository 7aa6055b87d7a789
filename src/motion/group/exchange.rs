//! What is told to the group and read from it.

use crate::cia402::State;
use crate::motion::FaultCause;
use crate::motion::mode::Mode;

/// What a drive reported in this cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AxisFeedback {
    /// 6041h.
    pub statusword: u16,
    /// 6064h, increments, sampled at this SYNC.
    pub position: i32,
    /// 606Ch, rpm.
    pub velocity: i32,
    /// 6077h, per mille of the rated torque.
    pub torque: i16,
    /// The TPDO with statusword and position of this SYNC has arrived. Without
    /// it, the other values are not looked at.
    pub fresh: bool,
}

impl AxisFeedback {
    /// Before it reported anything.
    pub const NONE: AxisFeedback = AxisFeedback {
        statusword: 0,
        position: 0,
        velocity: 0,
        torque: 0,
        fresh: false,
    };
}

/// What a drive is told for the next cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AxisCommand {
    /// Which of the RPDOs is sent, and what the target is.
    pub mode: Mode,
    /// 6040h.
    pub controlword: u16,
    /// 60FFh in the unit of 60A9h, 607Ah in increments, or 6071h in per mille.
    pub target: i32,
    /// 6083h, rpm/s.
    pub acceleration: u32,
    /// 6084h, rpm/s.
    pub deceleration: u32,
}

/// What the group is told in every step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inputs {
    /// Level: all mandatory nodes are checked, configured and operational.
    pub network_ready: bool,
    /// Level: bit n leaves out axis n, whose optional node is not there. One that
    /// goes in motion is a fault; one that comes waits for standby. While the network
    /// is not ready: the axes that it misses.
    pub absent: u32,
    /// Edge: a fault seen elsewhere, with the axis counted from 0; a number that no
    /// axis has: of all.
    pub fault: Option<(usize, FaultCause)>,
    /// Cycles since the last step: more than one if some were missed, for the axes went
    /// on meanwhile. 0 counts as 1.
    pub passed: u32,
}

impl Inputs {
    /// At least one.
    pub(super) fn cycles(&self) -> u32 {
        self.passed.max(1)
    }
}

/// One axis, for whoever looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisView {
    /// As confirmed in 6061h.
    pub mode: Mode,
    /// As last heard since the group began to enable.
    pub state: Option<State>,
    /// What its drive reported in the last cycle.
    pub feedback: AxisFeedback,
    /// Where it should be, increments; in torque mode per mille.
    pub reference: i32,
    /// Reference minus actual position at the SYNC of that, increments.
    pub following_error: i32,
    /// Where its path ends, as far as it is known.
    pub end: i32,
    /// Position from which targets count.
    pub home: i32,
    /// It is left out.
    pub absent: bool,
    /// A fault of it stopped the group.
    pub faulted: bool,
}

/// What a drive is to have, and is asked for until it shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveSetting {
    /// Mode of operation: to be written to 6060h and shown in 6061h.
    Mode,
    /// Velocity of the next set-point: to be written to 6081h and shown there.
    ProfileVelocity,
}

/// An axis whose drive is to be written to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// Counted from 0.
    pub axis: usize,
    /// What of it.
    pub setting: DriveSetting,
    /// A mode as 6060h has it, or rpm.
    pub value: u32,
}

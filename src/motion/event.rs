//! What a group reports, with the facts for a log.

use crate::cia402::{State, StatusWord};
use crate::motion::program::Refusal;
use crate::words::in_words;

/// State of a group of axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum GroupState {
    /// The network is not ready; every axis is told to stay off.
    Idle,
    /// The axes are led together to operation enabled, target velocity 0.
    Enabling,
    /// Enabled at target velocity 0; a release starts the program.
    Standby,
    /// The program runs.
    Moving,
    /// All axes ramp together to standstill, enabled; standby follows.
    Stopping,
    /// As stopping, but the motion waits there for another release.
    Halt,
    /// The drives search for their homes.
    Homing,
    /// Axes change their modes of operation, at standstill.
    ModeChange,
    /// Each drive brakes on its quick stop ramp; the axes are disabled then.
    QuickStop,
    /// The axes are led to switch on disabled.
    Disabling,
    /// After a fault: the axes that still obey ramp together to standstill.
    FaultStop,
    /// At standstill and disabled after a fault. A fault reset leads out, and the node
    /// or the network that was lost and is back.
    Faulted,
}

impl GroupState {
    /// All of them, in the order of the table of the contract.
    pub const ALL: [GroupState; 12] = [
        GroupState::Idle,
        GroupState::Enabling,
        GroupState::Standby,
        GroupState::Moving,
        GroupState::Stopping,
        GroupState::Halt,
        GroupState::Homing,
        GroupState::ModeChange,
        GroupState::QuickStop,
        GroupState::Disabling,
        GroupState::FaultStop,
        GroupState::Faulted,
    ];

    /// The state of this number in 2001h; idle if there is none.
    pub(super) fn of(number: u8) -> GroupState {
        let state = GroupState::ALL.get(usize::from(number));
        state.copied().unwrap_or(GroupState::Idle)
    }
}

in_words!(GroupState {
    GroupState::Idle => ("idle"),
    GroupState::Enabling => ("enabling"),
    GroupState::Standby => ("standby"),
    GroupState::Moving => ("moving"),
    GroupState::Stopping => ("stopping"),
    GroupState::Halt => ("halted"),
    GroupState::Homing => ("homing"),
    GroupState::ModeChange => ("changing modes"),
    GroupState::QuickStop => ("quick stop"),
    GroupState::Disabling => ("disabling"),
    GroupState::FaultStop => ("stopping after a fault"),
    GroupState::Faulted => ("faulted"),
});

/// Why the group stops and disables its axes: the number in bits 31..16 of 200Eh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[non_exhaustive]
pub enum Cause {
    /// The drive reports a fault in its statusword.
    DriveFault = 1,
    /// The drive left operation enabled without being told to; its statusword.
    LeftEnabled = 2,
    /// The drive did not follow the state machine's commands in time; its
    /// statusword.
    NotEnabled = 3,
    /// The axis' TPDO was missing in this many cycles in a row.
    TpdoMissing = 4,
    /// Reference minus actual position: more increments than allowed.
    FollowingError = 5,
    /// The reference ended, but the axis did not come to rest on its target in
    /// time: target minus actual position, increments.
    NotArrived = 6,
    /// The drive's heartbeat stopped.
    HeartbeatLost = 7,
    /// The drive sent an emergency message with a fault reaction; its code.
    Emergency = 8,
    /// The drive booted again or left NMT operational.
    LeftOperational = 9,
    /// The network as a whole is no longer ready.
    NetworkLost = 10,
    /// The drive reports a following error or, searching for home, that it
    /// failed: bit 13 of this statusword.
    DriveError = 11,
    /// The drive did not acknowledge a set-point, or did not find its home, in
    /// time, in this mode (6060h).
    NotDone = 12,
    /// 6061h did not show the mode of operation that was written in time.
    ModeNotConfirmed = 13,
    /// The planning did not keep up with the motion.
    PathDry = 14,
    /// So many cycles in a row did not finish in time: the drives follow old
    /// commands.
    CyclesLate = 15,
}

impl Cause {
    /// With its detail.
    pub const fn with(self, detail: i32) -> FaultCause {
        FaultCause {
            cause: self,
            detail,
        }
    }

    /// Without one.
    pub const fn alone(self) -> FaultCause {
        self.with(0)
    }
}

/// A [`Cause`] with its detail. Two numbers, so that it stays in registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultCause {
    /// What happened.
    pub cause: Cause,
    /// A number that belongs to it; 0 if there is none.
    pub detail: i32,
}

impl FaultCause {
    #[cfg(feature = "defmt")]
    const fn place(&self) -> u8 {
        self.cause as u8 - 1
    }

    const fn status(self) -> StatusWord {
        StatusWord(self.detail as u16)
    }
}

in_words!(FaultCause by FaultCause::place {
    it @ FaultCause { cause: Cause::DriveFault, detail } => (
        "the drive reports \"{}\" (statusword {:#06x}): see its emergency message",
        it.status().state(), detail
    ),
    it @ FaultCause { cause: Cause::LeftEnabled, detail } => (
        "the drive went to \"{}\" by itself (statusword {:#06x}): check supply, enable input and wiring",
        it.status().state(), detail
    ),
    it @ FaultCause { cause: Cause::NotEnabled, detail } => (
        "stayed in \"{}\" (statusword {:#06x}) instead of being enabled or disabled",
        it.status().state(), detail
    ),
    FaultCause { cause: Cause::TpdoMissing, detail } => (
        "no TPDO in {} cycles in a row: check the cable and the drive's supply", detail
    ),
    FaultCause { cause: Cause::FollowingError, detail } => (
        "following error of {} increments: check for a blocked axis, load and limits", detail
    ),
    FaultCause { cause: Cause::NotArrived, detail } => (
        "did not arrive: {} increments short of the target", detail
    ),
    FaultCause { cause: Cause::HeartbeatLost, .. } => (
        "heartbeat lost: check the cable and the drive's supply"
    ),
    FaultCause { cause: Cause::Emergency, detail } => ("emergency {:#06x}", detail),
    FaultCause { cause: Cause::LeftOperational, .. } => ("the node left NMT operational"),
    FaultCause { cause: Cause::NetworkLost, .. } => ("the network is no longer complete"),
    it @ FaultCause { cause: Cause::DriveError, detail } => (
        "the drive reports a following or homing error in \"{}\" (statusword {:#06x})",
        it.status().state(), detail
    ),
    FaultCause { cause: Cause::NotDone, detail } => ("not done in time in mode {} (6060h)", detail),
    FaultCause { cause: Cause::ModeNotConfirmed, detail } => (
        "mode {} (6060h) was not confirmed in 6061h", detail
    ),
    FaultCause { cause: Cause::PathDry, .. } => (
        "no set-points in time: the processor is overloaded"
    ),
    FaultCause { cause: Cause::CyclesLate, detail } => (
        "{} cycles in a row did not finish in time: see 2F20h, take a longer cycle_us", detail
    ),
});

/// Something that happened in a step, for the log. Axes are counted from 0 and
/// shown from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum GroupEvent {
    /// The group changed its state.
    State {
        /// Before.
        from: GroupState,
        /// After.
        to: GroupState,
    },
    /// An axis reported another state of its state machine.
    AxisState {
        /// Counted from 0.
        axis: u8,
        /// As reported.
        state: State,
    },
    /// A release was not accepted.
    ReleaseRefused(Refusal),
    /// A step of the program began.
    StepStarted {
        /// Counted from 0.
        step: u16,
    },
    /// An axis came to rest on its target.
    Arrived {
        /// Counted from 0.
        axis: u8,
        /// Target in increments of 6064h.
        target: i32,
        /// Target minus actual position, increments.
        error: i32,
    },
    /// The program ran through; the group is in standby again.
    ProgramDone,
    /// The program cannot go on; the group stops.
    ProgramFailed(Refusal),
    /// A move cannot be made; what was commanded before goes on.
    MoveRefused(Refusal),
    /// A fault stops the group, or came on top of one.
    Fault {
        /// Counted from 0; `None` where no single axis is the cause.
        axis: Option<u8>,
        /// What happened.
        cause: FaultCause,
    },
    /// The axis is out of the master's hands: its own drive brakes it or lets
    /// it coast, and the others stop without it.
    Coasting {
        /// Counted from 0.
        axis: u8,
        /// As last reported.
        state: State,
    },
    /// After a fault the axis was not seen to come to rest in time; it is
    /// disabled anyway.
    NotAtRest {
        /// Counted from 0.
        axis: u8,
        /// rpm, as last reported in 606Ch.
        velocity: i32,
    },
    /// Events were not taken in time and are lost.
    Lost {
        /// How many.
        count: u16,
    },
}

in_words!(GroupEvent {
    GroupEvent::State { from, to } => ("group: {} -> {}", from, to),
    GroupEvent::AxisState { axis, state } => ("axis {}: {}", axis + 1, state),
    GroupEvent::ReleaseRefused(why) => ("release refused: {}", why),
    GroupEvent::StepStarted { step } => ("program step {}", step + 1),
    GroupEvent::Arrived { axis, target, error } => (
        "axis {}: arrived at {}, error {}", axis + 1, target, error
    ),
    GroupEvent::ProgramDone => ("program done"),
    GroupEvent::ProgramFailed(error) => ("program stopped in step {}: {}", error.step, error),
    GroupEvent::MoveRefused(error) => ("move refused: {}", error),
    GroupEvent::Fault { axis: Some(axis), cause } => ("axis {}: {}", axis + 1, cause),
    GroupEvent::Fault { axis: None, cause } => ("{}", cause),
    GroupEvent::Coasting { axis, state } => (
        "axis {}: left to its drive in \"{}\"", axis + 1, state
    ),
    GroupEvent::NotAtRest { axis, velocity } => (
        "axis {}: not seen at rest, last speed {} rpm; disabled", axis + 1, velocity
    ),
    GroupEvent::Lost { count } => ("{} events lost", count),
});

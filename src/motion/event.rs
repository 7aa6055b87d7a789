//! What a group reports, with the facts for a log.

use crate::cia402::{State, StatusWord, Timeout};
use crate::motion::mode::Mode;
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
    /// At standstill and disabled after a fault. Only a restart of the network
    /// leads out.
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

/// Why the group stops and disables its axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FaultCause {
    /// The drive reports a fault in its statusword.
    DriveFault {
        /// As received.
        status: StatusWord,
    },
    /// The drive left operation enabled without being told to.
    LeftEnabled {
        /// As received.
        status: StatusWord,
    },
    /// The drive did not follow the state machine's commands in time.
    NotEnabled(Timeout),
    /// The axis' TPDO was missing in this many cycles in a row.
    TpdoMissing {
        /// Consecutive cycles.
        cycles: u8,
    },
    /// The axis is too far from its reference.
    FollowingError {
        /// Reference minus actual position, increments.
        error: i32,
        /// Largest magnitude allowed.
        allowed: u32,
    },
    /// The reference ended, but the axis did not come to rest on its target in
    /// time.
    NotArrived {
        /// Target minus actual position, increments.
        error: i32,
    },
    /// The drive's heartbeat stopped.
    HeartbeatLost,
    /// The drive sent an emergency message with a fault reaction.
    Emergency {
        /// Emergency error code.
        code: u16,
    },
    /// The drive booted again or left NMT operational.
    LeftOperational,
    /// The network as a whole is no longer ready.
    NetworkLost,
    /// The drive reports a following error or, searching for home, that it
    /// failed: bit 13 of the statusword.
    DriveError {
        /// As received.
        status: StatusWord,
    },
    /// The drive did not acknowledge a set-point, or did not find its home, in
    /// time.
    NotDone {
        /// In which mode.
        mode: Mode,
    },
    /// 6061h did not show the mode of operation that was written in time.
    ModeNotConfirmed {
        /// The mode.
        mode: Mode,
    },
    /// The planning did not keep up with the motion.
    PathDry,
    /// Cycles in a row did not finish in time: the drives follow old commands.
    CyclesLate {
        /// So many.
        cycles: u8,
    },
}

in_words!(FaultCause {
    FaultCause::DriveFault { status } => (
        "the drive reports \"{}\" (statusword {:#06x}): see its emergency message",
        status.state(), status.0
    ),
    FaultCause::LeftEnabled { status } => (
        "the drive went to \"{}\" by itself (statusword {:#06x}): check supply, enable input and wiring",
        status.state(), status.0
    ),
    FaultCause::NotEnabled(timeout) => ("{}", timeout),
    FaultCause::TpdoMissing { cycles } => (
        "no TPDO in {} cycles in a row: check the cable and the drive's supply", cycles
    ),
    FaultCause::FollowingError { error, allowed } => (
        "following error of {} increments, {} allowed: check for a blocked axis, load and limits",
        error, allowed
    ),
    FaultCause::NotArrived { error } => (
        "did not arrive: {} increments short of the target", error
    ),
    FaultCause::HeartbeatLost => ("heartbeat lost: check the cable and the drive's supply"),
    FaultCause::Emergency { code } => ("emergency {:#06x}", code),
    FaultCause::LeftOperational => ("the node left NMT operational"),
    FaultCause::DriveError { status } => (
        "the drive reports a following or homing error (statusword {:#06x})", status.0
    ),
    FaultCause::NotDone { mode } => ("not done in time in mode \"{}\"", mode),
    FaultCause::ModeNotConfirmed { mode } => (
        "mode \"{}\" was not confirmed in 6061h", mode
    ),
    FaultCause::PathDry => ("no set-points in time: the processor is overloaded"),
    FaultCause::NetworkLost => ("the network is no longer complete"),
    FaultCause::CyclesLate { cycles } => (
        "{} cycles in a row did not finish in time: see 2F20h, take a longer cycle_us", cycles
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
        step: u8,
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

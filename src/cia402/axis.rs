//! The commanding side of the state machine of one drive (CiA 402-2, 8.3).

use super::{Command, ControlWord, State, StatusWord};
use crate::time::{Duration, Instant};
use crate::words::in_words;

/// Time after which a fault reset that changed nothing is tried with a new
/// edge: a drive may still be leaving its fault reaction when the first comes.
const RESET_RETRY: Duration = Duration::from_millis(200);

/// Where the drive's state machine shall go.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Goal {
    /// Switch on disabled: the power stage off, faults reset.
    Disabled,
    /// Ready to switch on.
    Ready,
    /// Switched on.
    SwitchedOn,
    /// Operation enabled.
    Enabled,
    /// Braked by the drive's own quick stop ramp.
    QuickStop,
}

impl Goal {
    /// Whether a drive in `state` has reached the goal. A quick stop is reached
    /// also when the drive has already gone on to switch on disabled.
    pub const fn reached_by(self, state: State) -> bool {
        match self {
            Goal::Disabled => matches!(state, State::SwitchOnDisabled),
            Goal::Ready => matches!(state, State::ReadyToSwitchOn),
            Goal::SwitchedOn => matches!(state, State::SwitchedOn),
            Goal::Enabled => matches!(state, State::OperationEnabled),
            Goal::QuickStop => {
                matches!(state, State::QuickStopActive | State::SwitchOnDisabled)
            }
        }
    }

    /// The next command on the way from `state` to the goal. `None`: the drive
    /// moves on by itself (initialising, reacting to a fault) or reports bits
    /// that mean nothing; nothing new is commanded.
    const fn command_from(self, state: State) -> Option<Command> {
        Some(match (state, self) {
            (State::NotReadyToSwitchOn | State::FaultReactionActive | State::Other(_), _) => {
                return None;
            }
            (State::Fault, Goal::QuickStop) => Command::QuickStop,
            (State::Fault, _) => Command::FaultReset,
            (_, Goal::Disabled) => Command::DisableVoltage,
            (_, Goal::QuickStop) => Command::QuickStop,
            // The way back up leads through switch on disabled, so that the
            // drive does not resume an old target (transition 16).
            (State::QuickStopActive, _) => Command::DisableVoltage,
            (State::SwitchOnDisabled, _) => Command::Shutdown,
            (_, Goal::Ready) => Command::Shutdown,
            (State::ReadyToSwitchOn, _) => Command::SwitchOn,
            (State::OperationEnabled, Goal::SwitchedOn) => Command::DisableOperation,
            (_, Goal::SwitchedOn) => Command::SwitchOn,
            (_, Goal::Enabled) => Command::EnableOperation,
        })
    }
}

in_words!(Goal {
    Goal::Disabled => ("switch on disabled"),
    Goal::Ready => ("ready to switch on"),
    Goal::SwitchedOn => ("switched on"),
    Goal::Enabled => ("operation enabled"),
    Goal::QuickStop => ("quick stop"),
});

/// A drive did not reach its goal in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timeout {
    /// The last state heard since the goal was set; `None` if none was heard.
    pub state: Option<State>,
    /// What was waited for.
    pub goal: Goal,
}

in_words!(Timeout {
    Timeout { state: Some(state), goal } => ("stayed in \"{}\" instead of \"{}\"", state, goal),
    Timeout { state: None, goal } => ("no statusword while waiting for \"{}\"", goal),
});

impl core::error::Error for Timeout {}

/// Phase of the fault reset's edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reset {
    /// No reset in progress.
    Idle,
    /// The last controlword returned had bit 7 low, for the edge.
    Low,
    /// Bit 7 is high since then.
    High(Instant),
}

/// The commanding side for one drive: follows the statusword and says which
/// controlword to send.
///
/// A statusword is judged only when it is fresh, that is received after the
/// goal was set: what an old one says about the state is never acted upon.
#[derive(Clone, Debug)]
pub struct Axis {
    goal: Goal,
    since: Instant,
    timeout: Duration,
    /// The statusword that was judged last for this goal.
    judged: Option<StatusWord>,
    state: Option<State>,
    word: ControlWord,
    reset: Reset,
}

impl Axis {
    /// An axis of which nothing is known; sends disable voltage until told
    /// otherwise. `timeout` bounds the way to every goal.
    pub const fn new(timeout: Duration) -> Axis {
        Axis {
            goal: Goal::Disabled,
            since: Instant::ZERO,
            timeout,
            judged: None,
            state: None,
            word: ControlWord::new(Command::DisableVoltage),
            reset: Reset::Idle,
        }
    }

    /// Sets a new goal; what was heard before does not count for it.
    pub const fn set_goal(&mut self, goal: Goal, now: Instant) {
        self.goal = goal;
        self.since = now;
        self.judged = None;
        self.state = None;
    }

    /// The goal as set.
    pub const fn goal(&self) -> Goal {
        self.goal
    }

    /// The last state heard since the goal was set.
    pub const fn state(&self) -> Option<State> {
        self.state
    }

    /// Whether a fresh statusword has shown that the goal is reached.
    pub fn reached(&self) -> bool {
        self.state.is_some_and(|s| self.goal.reached_by(s))
    }

    /// One cycle: takes in the statusword, if a fresh one came, and returns the
    /// controlword to send. Each returned word must reach the drive before the
    /// next call, or the reset's edge is lost.
    pub fn step(&mut self, now: Instant, fresh: Option<StatusWord>) -> ControlWord {
        let Some(status) = fresh else {
            return self.word;
        };
        let judged = self.judged.is_some_and(|last| last.is_alike(status));
        if judged && matches!(self.reset, Reset::Idle) {
            // The way of almost every cycle.
            return self.word;
        }
        let state = status.state();
        self.judged = Some(status);
        self.state = Some(state);
        match self.goal.command_from(state) {
            None => {}
            Some(Command::FaultReset) => self.reset_fault(now),
            Some(command) => {
                self.word = self.word.with(command);
                self.reset = Reset::Idle;
            }
        }
        self.word
    }

    /// The goal was not reached within the time allowed.
    ///
    /// # Errors
    /// [`Timeout`] with the state that the drive stayed in.
    pub fn check(&self, now: Instant) -> Result<(), Timeout> {
        if self.reached() || now.since(self.since) <= self.timeout {
            return Ok(());
        }
        Err(Timeout {
            state: self.state,
            goal: self.goal,
        })
    }

    /// A clean edge: bit 7 low in at least one controlword, then high.
    fn reset_fault(&mut self, now: Instant) {
        match self.reset {
            Reset::High(since) if now.since(since) < RESET_RETRY => {}
            Reset::Low => {
                self.word = ControlWord::new(Command::FaultReset);
                self.reset = Reset::High(now);
            }
            Reset::Idle | Reset::High(_) => {
                self.word = ControlWord::new(Command::DisableVoltage);
                self.reset = Reset::Low;
            }
        }
    }
}

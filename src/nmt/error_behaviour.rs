//! Error behaviour, object 1029h (CiA 301, 7.5.2.32).

use super::command::Command;
use super::state::State;

/// What a communication error does to the NMT state of the device: sub-index 1
/// of 1029h.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ErrorBehaviour {
    /// 0: pre-operational, if it was operational.
    #[default]
    PreOperational,
    /// 1: no change.
    NoChange,
    /// 2: stopped.
    Stopped,
}

impl ErrorBehaviour {
    /// The highest code.
    pub const MAX: u8 = 2;

    /// `None` for codes that the standard does not have.
    pub const fn from_code(code: u8) -> Option<ErrorBehaviour> {
        Some(match code {
            0 => ErrorBehaviour::PreOperational,
            1 => ErrorBehaviour::NoChange,
            2 => ErrorBehaviour::Stopped,
            _ => return None,
        })
    }

    /// The code.
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// What a node in `state` does by itself on a communication error: bus-off,
    /// the heartbeat of a watched node or the life guarding lost.
    pub const fn reaction(self, state: State) -> Option<Command> {
        match (self, state) {
            (ErrorBehaviour::PreOperational, State::Operational) => {
                Some(Command::EnterPreOperational)
            }
            (ErrorBehaviour::Stopped, State::Operational | State::PreOperational) => {
                Some(Command::Stop)
            }
            _ => None,
        }
    }
}

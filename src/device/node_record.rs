//! What the master knows of a node: boot-up, NMT state, emergencies.

use super::window::Window;
use crate::boot::{Cause, Event, Status};
use crate::emcy::{Emcy, History};
use crate::nmt::State;

/// Emergencies kept per node.
pub(super) const HISTORY: usize = 4;

/// How far the boot-up of a node is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NodeStatus {
    words: Words,
    /// The error status of CiA 302-2 as an ASCII letter; 0 for none.
    pub(super) letter: u8,
    /// Writes done while it is configured.
    done: u16,
    /// Writes in all; 0 before the first.
    total: u16,
}

/// What is told of a node, by the number of its text. Of a failure without its facts:
/// those are in the log, whose words take no room in the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
enum Words {
    /// The network has not been started yet.
    Idle,
    /// Its boot-up frame is awaited.
    Awaited,
    /// It is asked what it is.
    Identifying,
    /// Its configuration is being written.
    Configuring,
    /// It was booted and is not what it should be: it is booted again.
    Lost,
    /// Its heartbeat is awaited.
    Configured,
    /// It may be started.
    Ready,
    /// It was started.
    Operational,
    /// It was operational already and is left so: L.
    LeftRunning,
    // Given up, and why.
    NotListed,
    NoBootUp,
    Restarts,
    NoAnswer,
    Refused,
    Garbled,
    Mismatch,
    NoState,
    NoHeartbeat,
    NotOperational,
}

/// Texts that follow those.
pub(super) const NOT_IN_THE_NETWORK: u8 = Words::NotOperational as u8 + 1;
pub(super) const NO_EMERGENCY: u8 = NOT_IN_THE_NETWORK + 1;
const BOOT_STATUS: u8 = NO_EMERGENCY + 1;
const WRITES: u8 = BOOT_STATUS + 1;

impl NodeStatus {
    /// The network was not started.
    const NONE: NodeStatus = NodeStatus {
        words: Words::Idle,
        letter: 0,
        done: 0,
        total: 0,
    };

    /// The status after a step of the boot-up that concerns this node.
    pub(super) fn after(event: &Event) -> Option<NodeStatus> {
        let mut status = NodeStatus::NONE;
        status.words = match *event {
            Event::ResetSent => Words::Awaited,
            Event::BootUp(_) => Words::Identifying,
            Event::Identified(_) => Words::Configuring,
            Event::Configuring { done, total, .. } => {
                (status.done, status.total) = (done, total);
                Words::Configuring
            }
            Event::Configured(_) => Words::Configured,
            Event::Ready(_) => Words::Ready,
            Event::Operational(_) | Event::NodeBack(_) => Words::Operational,
            Event::LeftRunning(_) => {
                status.letter = Status::L as u8;
                Words::LeftRunning
            }
            Event::NodeLost(_) => Words::Lost,
            Event::NotListed(_) => {
                status.letter = Status::A as u8;
                Words::NotListed
            }
            Event::Failed(_, ref failure) => {
                status.letter = failure.status as u8;
                words(&failure.cause)
            }
            _ => return None,
        };
        Some(status)
    }

    /// The master speaks to its SDO server, or is about to.
    pub(super) fn is_in_boot_up(&self) -> bool {
        (Words::Awaited..=Words::Lost).contains(&self.words)
    }

    /// In words.
    pub(super) fn write(&self, window: &mut Window<'_>) {
        window.packed(self.words as u8);
        if self.words == Words::Configuring {
            window.decimal(self.done);
            if self.total != 0 {
                window.text(" of ");
                window.decimal(self.total);
            }
            window.packed(WRITES);
        }
        if self.words >= Words::NotListed {
            window.packed(BOOT_STATUS);
            window.put(&[self.letter]);
            window.text(")");
        }
    }
}

const fn words(cause: &Cause) -> Words {
    match cause {
        Cause::NotListed => Words::NotListed,
        Cause::NoBootUp => Words::NoBootUp,
        Cause::Restarts => Words::Restarts,
        Cause::NoAnswer { .. } => Words::NoAnswer,
        Cause::Refused { .. } => Words::Refused,
        Cause::Garbled { .. } => Words::Garbled,
        Cause::Mismatch { .. } => Words::Mismatch,
        Cause::NoState => Words::NoState,
        Cause::NoHeartbeat => Words::NoHeartbeat,
        Cause::NotOperational => Words::NotOperational,
    }
}

/// What is known of one node.
#[derive(Clone, Debug)]
pub(super) struct NodeRecord {
    pub(super) status: NodeStatus,
    pub(super) presence: Presence,
    pub(super) emcy: History<Emcy, HISTORY>,
}

impl NodeRecord {
    /// Nothing.
    pub(super) const NONE: NodeRecord = NodeRecord {
        status: NodeStatus::NONE,
        presence: Presence::UNKNOWN,
        emcy: History::new(),
    };
}

/// What error control hears of the node, as 1F82h has it (CiA 302-2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Presence(pub(super) u8);

impl Presence {
    /// It was never heard.
    pub(super) const UNKNOWN: Presence = Presence(0);
    /// It was heard and is not any more, or not in its boot time.
    pub(super) const MISSING: Presence = Presence(1);

    /// What it last said.
    pub(super) const fn state(state: State) -> Presence {
        Presence(state.code())
    }
}

//! What the master knows of a node: boot-up, NMT state, emergencies.

use super::window::Window;
use crate::boot::{Cause, Event, Status};
use crate::emcy::{Emcy, History};
use crate::nmt::State;

/// Emergencies kept per node.
pub(super) const HISTORY: usize = 4;

/// How far the boot-up of a node is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum NodeStatus {
    /// The network has not been started yet.
    #[default]
    Idle,
    /// Its boot-up frame is awaited.
    Awaited,
    /// It is asked what it is.
    Identifying,
    /// Its configuration is being written.
    Configuring {
        /// Writes done.
        done: u16,
        /// Writes in all; 0 before the first.
        total: u16,
    },
    /// Its heartbeat is awaited.
    Configured,
    /// It may be started.
    Ready,
    /// It was started.
    Operational,
    /// It was operational already and is left so: L.
    LeftRunning,
    /// It was booted and is not what it should be: it is booted again.
    Lost,
    /// It was given up.
    Failed {
        /// The letter of CiA 302-2.
        status: Status,
        /// The cause without its facts: those are in the log, whose words take no
        /// room in the device.
        words: &'static str,
    },
}

impl NodeStatus {
    /// The status after a step of the boot-up that concerns this node.
    pub(super) const fn after(event: &Event) -> Option<NodeStatus> {
        Some(match *event {
            Event::ResetSent => NodeStatus::Awaited,
            Event::BootUp(_) => NodeStatus::Identifying,
            Event::Identified(_) => NodeStatus::Configuring { done: 0, total: 0 },
            Event::Configuring { done, total, .. } => NodeStatus::Configuring { done, total },
            Event::Configured(_) => NodeStatus::Configured,
            Event::Ready(_) => NodeStatus::Ready,
            Event::Operational(_) | Event::NodeBack(_) => NodeStatus::Operational,
            Event::LeftRunning(_) => NodeStatus::LeftRunning,
            Event::NodeLost(_) => NodeStatus::Lost,
            Event::NotListed(_) => NodeStatus::Failed {
                status: Status::A,
                words: words(&Cause::NotListed),
            },
            Event::Failed(_, ref failure) => NodeStatus::Failed {
                status: failure.status,
                words: words(&failure.cause),
            },
            _ => return None,
        })
    }

    /// The master speaks to its SDO server, or is about to.
    pub(super) const fn is_in_boot_up(&self) -> bool {
        matches!(
            self,
            NodeStatus::Awaited
                | NodeStatus::Identifying
                | NodeStatus::Configuring { .. }
                | NodeStatus::Lost
        )
    }

    /// The error status of CiA 302-2 as an ASCII letter; 0 for none.
    pub const fn letter(&self) -> u8 {
        match self {
            NodeStatus::Failed { status, .. } => *status as u8,
            NodeStatus::LeftRunning => Status::L as u8,
            _ => 0,
        }
    }
}

impl NodeStatus {
    /// In words.
    pub(super) fn write(&self, window: &mut Window<'_>) {
        window.text(match self {
            NodeStatus::Idle => "not started yet",
            NodeStatus::Awaited => "boot-up frame awaited",
            NodeStatus::Identifying => "identity is checked",
            NodeStatus::Configuring { .. } => "configuring, ",
            NodeStatus::Configured => "configured, heartbeat awaited",
            NodeStatus::Ready => "ready to be started",
            NodeStatus::Operational => "operational",
            NodeStatus::LeftRunning => "was operational already and is left running",
            NodeStatus::Lost => "lost, to be booted again",
            NodeStatus::Failed { words, .. } => words,
        });
        match *self {
            NodeStatus::Configuring { done, total } => {
                window.decimal(done);
                if total != 0 {
                    window.text(" of ");
                    window.decimal(total);
                }
                window.text(" writes");
            }
            NodeStatus::Failed { status, .. } => {
                window.text(" (boot status ");
                window.put(&[status as u8]);
                window.text(")");
            }
            _ => {}
        }
    }
}

const fn words(cause: &Cause) -> &'static str {
    match cause {
        Cause::NotListed => "not in the list of this master",
        Cause::NoBootUp => "no boot-up frame",
        Cause::Restarts => "restarts again and again",
        Cause::NoAnswer { .. } => "no answer to an access",
        Cause::Refused { .. } => "an access was refused",
        Cause::Garbled { .. } => "wrong answer to an access",
        Cause::Mismatch { .. } => "not the expected device",
        Cause::NoState => "does not tell its NMT state",
        Cause::NoHeartbeat => "no heartbeat after the configuration",
        Cause::NotOperational => "not operational after NMT start",
    }
}

/// What is known of one node.
#[derive(Clone, Debug, Default)]
pub(super) struct NodeRecord {
    pub(super) status: NodeStatus,
    pub(super) presence: Presence,
    pub(super) emcy: History<Emcy, HISTORY>,
}

/// What error control hears of the node, as 1F82h has it (CiA 302-2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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

//! What the boot-up asks for and what it tells.

use super::failure::Failure;
use crate::frame::Frame;
use crate::id::NodeId;
use crate::lss::LssAddress;
use crate::words::in_words;

/// What the caller has to do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Send this frame.
    Send(Frame),
    /// Begin to produce SYNC: 1005h, bit 30.
    ProduceSync,
    /// The pause after bus-off is over: let the controller take part again.
    RestartController,
    /// Something worth telling.
    Report(Event),
}

/// A step of the boot-up, for the log and for the object dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event {
    /// NMT reset communication went to all nodes that are not to be kept alive;
    /// the boot-up frames are awaited.
    ResetSent,
    /// The node sent its boot-up frame.
    BootUp(NodeId),
    /// It is the device that the network names.
    Identified(NodeId),
    /// Part of its configuration is written.
    Configuring {
        /// The node.
        node: NodeId,
        /// Writes done.
        done: u16,
        /// Writes in all.
        total: u16,
    },
    /// Its configuration is complete, or was found to be (1020h).
    Configured(NodeId),
    /// Its heartbeat is seen: it is ready to be started.
    Ready(NodeId),
    /// It was operational already and is left running: boot status L.
    LeftRunning(NodeId),
    /// It is not in the list of this master (1F81h, bit 0): boot status A.
    NotListed(NodeId),
    /// It was given up.
    Failed(NodeId, Failure),
    /// All mandatory nodes are booted; the start is the application's to order
    /// (1F80h, bit 2).
    StartAwaited,
    /// NMT start went to the nodes.
    StartSent,
    /// The master is operational and leaves the start of the nodes to the
    /// application (1F80h, bit 3).
    StartLeft,
    /// The node reports operational.
    Operational(NodeId),
    /// A node that was booted booted again, fell silent or left operational. It
    /// is taken through boot-up again.
    NodeLost(NodeId),
    /// A node that was lost is operational again.
    NodeBack(NodeId),
    /// Every mandatory node is checked, configured and operational.
    NetworkReady,
    /// That is no longer so.
    NetworkDown,
    /// A mandatory node failed: nothing is started.
    NetworkFailed,
    /// An error of a mandatory node stopped all nodes (1F80h, bit 6).
    NetworkStopped,
    /// The controller is bus-off.
    BusOff {
        /// Until it is restarted.
        pause_ms: u32,
    },
    /// The controller is restarted; the silent phase begins.
    BusRestarted,
    /// A node did not boot; it is looked for among those without node-ID
    /// (CiA 305, fastscan).
    Scanning,
    /// The node with the serial number that the network names was given its
    /// node-ID.
    IdGiven {
        /// The node-ID.
        node: NodeId,
        /// Whether the node keeps it when its supply is off.
        stored: bool,
    },
    /// The node was found, but refused its node-ID (CiA 305, 3.9.2).
    IdRefused {
        /// The node-ID.
        node: NodeId,
        /// 1: out of range; 255: see `specific`.
        error: u8,
        /// Error of the manufacturer.
        specific: u8,
    },
    /// The node was found, but did not answer when it was given its node-ID.
    IdUnanswered(NodeId),
    /// A node that stays without node-ID: the network does not name it, or it
    /// refused the one that it was given.
    Stranger(LssAddress),
}

impl Event {
    /// The node that it is about, if it is about one.
    pub const fn node(&self) -> Option<NodeId> {
        match *self {
            Event::BootUp(node)
            | Event::Identified(node)
            | Event::Configuring { node, .. }
            | Event::Configured(node)
            | Event::Ready(node)
            | Event::LeftRunning(node)
            | Event::NotListed(node)
            | Event::Failed(node, _)
            | Event::Operational(node)
            | Event::NodeLost(node)
            | Event::NodeBack(node)
            | Event::IdGiven { node, .. }
            | Event::IdRefused { node, .. }
            | Event::IdUnanswered(node) => Some(node),
            _ => None,
        }
    }
}

in_words!(Event {
    Event::ResetSent => ("reset communication sent, awaiting the nodes"),
    Event::BootUp(node) => ("node {}: boot-up", node),
    Event::Identified(node) => ("node {}: is the expected device", node),
    Event::Configuring { node, done, total } => (
        "node {}: configuring, {} of {} writes", node, done, total
    ),
    Event::Configured(node) => ("node {}: configured", node),
    Event::Ready(node) => ("node {}: ready to start", node),
    Event::LeftRunning(node) => (
        "node {}: was operational already and is left running (boot status L)", node
    ),
    Event::NotListed(node) => (
        "node {}: not in the list of this master (1F81h), left alone (boot status A)", node
    ),
    Event::Failed(node, failure) => ("node {}: {}", node, failure),
    Event::StartAwaited => (
        "every mandatory node is booted; the start has to be requested (1F82h)"
    ),
    Event::StartSent => ("NMT start sent"),
    Event::StartLeft => ("the nodes are to be started by request (1F82h)"),
    Event::Operational(node) => ("node {}: operational", node),
    Event::NodeLost(node) => ("node {}: lost, to be booted again", node),
    Event::NodeBack(node) => ("node {}: is back", node),
    Event::NetworkReady => ("network ready: every node is operational"),
    Event::NetworkDown => ("network not ready: a mandatory node is not operational"),
    Event::NetworkFailed => ("network not started: a mandatory node failed"),
    Event::NetworkStopped => ("all nodes stopped after the error of a mandatory node"),
    Event::BusOff { pause_ms } => ("bus-off: restarting the controller in {} ms", pause_ms),
    Event::BusRestarted => ("controller restarted, silent until the drives are at rest"),
    Event::Scanning => ("not every node booted: looking for nodes without node-ID (LSS)"),
    Event::IdGiven { node, stored } => (
        "node {}: found by its serial number, node-ID given{}", node, Kept(stored)
    ),
    Event::IdRefused { node, error, specific } => (
        "node {}: found by its serial number, refused its node-ID with error {}, specific error {}", node, error, specific
    ),
    Event::IdUnanswered(node) => (
        "node {}: found by its serial number, did not answer to its node-ID; reset the board to try again", node
    ),
    Event::Stranger(address) => (
        "a node stays without node-ID, since the network does not name it or it refused: {}", address
    ),
});

/// Whether a node stores its node-ID.
#[derive(Clone, Copy)]
struct Kept(bool);

in_words!(Kept {
    Kept(true) => (""),
    Kept(false) => (", but the node does not store it"),
});

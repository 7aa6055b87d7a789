//! What the boot-up asks for and what it tells.

use super::failure::Failure;
use crate::frame::Frame;
use crate::id::NodeId;

/// What the caller has to do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Send this frame.
    Send(Frame),
    /// Begin to produce SYNC: 1005h, bit 30.
    ProduceSync,
    /// Something worth telling.
    Report(Event),
}

/// A step of the boot-up, for the log and for the object dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event {
    /// NMT reset communication went to all nodes; the boot-up frames are
    /// awaited.
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
    /// Its configuration is complete.
    Configured(NodeId),
    /// Its heartbeat is seen: it is ready to be started.
    Ready(NodeId),
    /// It was given up.
    Failed(NodeId, Failure),
    /// NMT start went to the nodes.
    StartSent,
    /// The node reports operational.
    Operational(NodeId),
    /// Every mandatory node is checked, configured and operational.
    NetworkReady,
    /// A mandatory node failed: nothing is started.
    NetworkFailed,
}

#[cfg(feature = "defmt")]
impl defmt::Format for Event {
    fn format(&self, f: defmt::Formatter<'_>) {
        match self {
            Event::ResetSent => defmt::write!(f, "reset communication sent, awaiting the nodes"),
            Event::BootUp(node) => defmt::write!(f, "node {}: boot-up", node),
            Event::Identified(node) => defmt::write!(f, "node {}: is the expected device", node),
            Event::Configuring { node, done, total } => {
                defmt::write!(
                    f,
                    "node {}: configuring, {} of {} writes",
                    node,
                    done,
                    total
                )
            }
            Event::Configured(node) => defmt::write!(f, "node {}: configured", node),
            Event::Ready(node) => defmt::write!(f, "node {}: heartbeat seen, ready to start", node),
            Event::Failed(node, failure) => defmt::write!(f, "node {}: {}", node, failure),
            Event::StartSent => defmt::write!(f, "NMT start sent"),
            Event::Operational(node) => defmt::write!(f, "node {}: operational", node),
            Event::NetworkReady => defmt::write!(f, "network ready: every node is operational"),
            Event::NetworkFailed => {
                defmt::write!(f, "network not started: a mandatory node failed")
            }
        }
    }
}

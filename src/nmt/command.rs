//! NMT node control (CiA 301, 7.2.8.2.1, 7.2.8.3.1).

use crate::frame::Frame;
use crate::id::{CobId, NodeId};

/// What the master commands (CiA 301, 7.2.8.3.1). Unknown commands survive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// Enter operational.
    Start,
    /// Enter stopped.
    Stop,
    /// Enter pre-operational.
    EnterPreOperational,
    /// Start as after power-on.
    ResetNode,
    /// Restore the communication parameters.
    ResetCommunication,
    /// Not a command that the standard knows.
    Other(u8),
}

impl Command {
    /// The command specifier.
    pub const fn code(self) -> u8 {
        match self {
            Command::Start => 0x01,
            Command::Stop => 0x02,
            Command::EnterPreOperational => 0x80,
            Command::ResetNode => 0x81,
            Command::ResetCommunication => 0x82,
            Command::Other(code) => code,
        }
    }

    /// The command with this specifier.
    pub const fn from_code(code: u8) -> Command {
        match code {
            0x01 => Command::Start,
            0x02 => Command::Stop,
            0x80 => Command::EnterPreOperational,
            0x81 => Command::ResetNode,
            0x82 => Command::ResetCommunication,
            code => Command::Other(code),
        }
    }
}

/// Whom the master commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Target {
    /// Every node, node-ID 0 on the wire.
    All,
    /// One node.
    Node(NodeId),
}

impl Target {
    /// Whether `node` is meant.
    pub fn includes(self, node: NodeId) -> bool {
        match self {
            Target::All => true,
            Target::Node(target) => target == node,
        }
    }
}

/// The NMT node control protocol: two bytes on COB-ID 0
/// (CiA 301, 7.2.8.3.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NodeControl {
    /// What to do.
    pub command: Command,
    /// Who.
    pub target: Target,
}

impl NodeControl {
    /// To all nodes.
    pub const fn all(command: Command) -> NodeControl {
        NodeControl {
            command,
            target: Target::All,
        }
    }

    /// To one node.
    pub const fn node(command: Command, node: NodeId) -> NodeControl {
        NodeControl {
            command,
            target: Target::Node(node),
        }
    }

    /// The frame to send.
    pub fn frame(&self) -> Frame {
        let target = match self.target {
            Target::All => 0,
            Target::Node(node) => node.get(),
        };
        // Two bytes always fit.
        Frame::data_frame(CobId::NMT, &[self.command.code(), target])
            .unwrap_or(Frame::empty(CobId::NMT))
    }

    /// `None` unless `frame` has COB-ID 0, two bytes and a node-ID of 0..=127.
    pub fn decode(frame: &Frame) -> Option<NodeControl> {
        if frame.id() != CobId::NMT {
            return None;
        }
        let &[command, target] = frame.data() else {
            return None;
        };
        let target = match target {
            0 => Target::All,
            node => Target::Node(NodeId::new(node)?),
        };
        Some(NodeControl {
            command: Command::from_code(command),
            target,
        })
    }
}

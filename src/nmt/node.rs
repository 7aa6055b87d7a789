//! The NMT state machine of a node (CiA 301, 7.3.2).

use super::command::{Command, NodeControl};
use super::error_control::ErrorControl;
use super::state::{Service, State};
use crate::frame::Frame;
use crate::id::NodeId;

/// What the node has to do after a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NodeEvent {
    /// The state has changed.
    Changed {
        /// The state left.
        from: State,
        /// The state entered.
        to: State,
    },
    /// Start as after power-on, then call [`Node::boot`]
    /// (CiA 301, 7.3.2.2.1.2).
    ResetNode,
    /// Restore the communication parameters (1000h..=1FFFh) to their power-on
    /// values, then call [`Node::boot`] (CiA 301, 7.3.2.2.1.3).
    ResetCommunication,
}

/// The NMT state machine of one node (CiA 301, 7.3.2.2).
///
/// It starts in initialising. Once the device is ready, [`Node::boot`] yields
/// the boot-up message and enters pre-operational.
#[derive(Clone, Debug)]
pub struct Node {
    id: NodeId,
    state: State,
}

impl Node {
    /// A node that has not booted yet.
    pub const fn new(id: NodeId) -> Node {
        Node {
            id,
            state: State::Initialising,
        }
    }

    /// The node-ID.
    pub const fn id(&self) -> NodeId {
        self.id
    }

    /// The present state.
    pub const fn state(&self) -> State {
        self.state
    }

    /// Whether the present state allows `service`.
    pub const fn allows(&self, service: Service) -> bool {
        self.state.allows(service)
    }

    /// Leaves initialising for pre-operational, with the boot-up message to
    /// send (CiA 301, 7.2.8.3.3). `None` in any other state.
    pub fn boot(&mut self) -> Option<Frame> {
        if self.state != State::Initialising {
            return None;
        }
        self.state = State::PreOperational;
        Some(ErrorControl::heartbeat(self.id, State::Initialising).frame())
    }

    /// Takes in a frame; `None` if it commands this node nothing new.
    pub fn on_frame(&mut self, frame: &Frame) -> Option<NodeEvent> {
        let control = NodeControl::decode(frame)?;
        if control.target.includes(self.id) {
            self.command(control.command)
        } else {
            None
        }
    }

    /// Carries out a command; while initialising none is heard.
    pub fn command(&mut self, command: Command) -> Option<NodeEvent> {
        if !self.allows(Service::NodeControl) {
            return None;
        }
        match command {
            Command::Start => self.enter(State::Operational),
            Command::Stop => self.enter(State::Stopped),
            Command::EnterPreOperational => self.enter(State::PreOperational),
            Command::ResetNode => {
                self.state = State::Initialising;
                Some(NodeEvent::ResetNode)
            }
            Command::ResetCommunication => {
                self.state = State::Initialising;
                Some(NodeEvent::ResetCommunication)
            }
            Command::Other(_) => None,
        }
    }

    /// Starts anew, as after power-on.
    pub fn reset(&mut self) {
        self.state = State::Initialising;
    }

    fn enter(&mut self, to: State) -> Option<NodeEvent> {
        let from = self.state;
        self.state = to;
        (from != to).then_some(NodeEvent::Changed { from, to })
    }
}

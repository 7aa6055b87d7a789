//! The node's end of the layer setting services (CiA 305, 3.3 .. 3.11).

use super::address::{LssAddress, Part};
use super::command::{Answer, ConfigurationResult, Mode, Request};
use super::fastscan::RESTART;
use crate::frame::Frame;
use crate::id::NodeId;

/// What the device decides.
pub trait Device {
    /// Whether the device can run at this bit rate; it takes effect when it is
    /// activated.
    fn configure_bit_timing(&mut self, table: u8, index: u8) -> ConfigurationResult;

    /// Keeps node-ID and bit rate for the next power-on.
    fn store(&mut self, node: Option<NodeId>) -> ConfigurationResult;
}

/// What the node has to do after a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SlaveEvent {
    /// Answer.
    Send(Frame),
    /// The node had no node-ID and now has this one: it boots.
    Boot(NodeId),
    /// Wait `delay` milliseconds, switch to the configured bit rate, wait
    /// again, then communicate.
    Activate {
        /// In milliseconds.
        delay: u16,
    },
}

/// The LSS slave of a node.
///
/// The caller hands it frames only while LSS is available: without node-ID, or
/// in NMT stopped.
#[derive(Clone, Debug)]
pub struct LssSlave {
    address: LssAddress,
    mode: Mode,
    /// The node-ID in use.
    active: Option<NodeId>,
    /// The node-ID that takes effect with the next reset communication, or at
    /// once if there is none in use.
    pending: Option<NodeId>,
    /// How many parts of switch mode selective have matched.
    selected: u8,
    /// The part that fastscan is at.
    scanned: u8,
}

impl LssSlave {
    /// A node with this LSS address and node-ID, waiting.
    pub const fn new(address: LssAddress, node: Option<NodeId>) -> LssSlave {
        LssSlave {
            address,
            mode: Mode::Waiting,
            active: node,
            pending: node,
            selected: 0,
            scanned: 0,
        }
    }

    /// Waiting or configuration.
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// The node-ID in use.
    pub const fn node(&self) -> Option<NodeId> {
        self.active
    }

    /// NMT reset communication: the configured node-ID takes effect
    /// (CiA 305, 3.9.2).
    pub fn reset_communication(&mut self) -> Option<NodeId> {
        self.mode = Mode::Waiting;
        self.selected = 0;
        self.scanned = 0;
        self.active = self.pending;
        self.active
    }

    /// Takes in a frame; `None` if there is nothing to do.
    pub fn on_frame(&mut self, frame: &Frame, device: &mut impl Device) -> Option<SlaveEvent> {
        let configuring = self.mode == Mode::Configuration;
        if configuring && Request::is_bad_node_id(frame) {
            return send(Answer::NodeId(ConfigurationResult::REFUSED));
        }
        match Request::decode(frame)? {
            Request::SwitchGlobal(mode) => self.switch(mode),
            Request::Select(part, number) => self.select(part, number),
            Request::Fastscan { id, bit, sub, next } => self.fastscan(id, bit, sub, next),
            _ if !configuring => None,
            Request::NodeId(node) => {
                self.pending = node;
                send(Answer::NodeId(ConfigurationResult::OK))
            }
            Request::BitTiming { table, index } => {
                send(Answer::BitTiming(device.configure_bit_timing(table, index)))
            }
            Request::Activate { delay } => Some(SlaveEvent::Activate { delay }),
            Request::Store => send(Answer::Store(device.store(self.pending))),
            Request::Inquire(part) => send(Answer::Inquire(part, self.address.part(part))),
            Request::InquireNodeId => send(Answer::InquireNodeId(self.active)),
        }
    }

    /// CiA 305, 3.8.1. Leaving configuration, a node without node-ID takes the
    /// one it was given.
    fn switch(&mut self, mode: Mode) -> Option<SlaveEvent> {
        let before = core::mem::replace(&mut self.mode, mode);
        self.selected = 0;
        if before == mode || mode == Mode::Configuration || self.active.is_some() {
            return None;
        }
        self.active = self.pending;
        self.active.map(SlaveEvent::Boot)
    }

    /// CiA 305, 3.8.2: the four numbers come in their order.
    fn select(&mut self, part: Part, number: u32) -> Option<SlaveEvent> {
        let in_order = part == Part::Vendor || part.position() == self.selected;
        if self.mode != Mode::Waiting || !in_order || self.address.part(part) != number {
            self.selected = 0;
            return None;
        }
        if part.next().is_some() {
            self.selected = part.position() + 1;
            return None;
        }
        self.selected = 0;
        self.mode = Mode::Configuration;
        send(Answer::Selected)
    }

    /// CiA 305, 3.11.3: only nodes without node-ID that wait take part.
    fn fastscan(&mut self, id: u32, bit: u8, sub: u8, next: u8) -> Option<SlaveEvent> {
        if self.active.is_some() || self.pending.is_some() || self.mode != Mode::Waiting {
            return None;
        }
        if bit == RESTART {
            self.scanned = 0;
            return send(Answer::Identified);
        }
        let own = self.address.part(Part::at(sub)?);
        let compared = u32::MAX.checked_shl(u32::from(bit))?;
        if sub != self.scanned || (own ^ id) & compared != 0 {
            return None;
        }
        self.scanned = next;
        if bit == 0 && next < sub {
            self.scanned = 0;
            self.mode = Mode::Configuration;
        }
        send(Answer::Identified)
    }
}

fn send(answer: Answer) -> Option<SlaveEvent> {
    Some(SlaveEvent::Send(answer.frame()))
}

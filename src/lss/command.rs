//! The bytes of LSS frames (CiA 305, 3.9).

use super::address::Part;
use crate::frame::{Frame, MAX_DATA};
use crate::id::{CobId, NodeId};

/// The node-ID of a node that has none (CiA 305, 3.9.2).
pub(super) const UNCONFIGURED: u8 = 0xFF;

/// Command specifiers.
mod cs {
    pub(super) const SWITCH_GLOBAL: u8 = 0x04;
    pub(super) const NODE_ID: u8 = 0x11;
    pub(super) const BIT_TIMING: u8 = 0x13;
    pub(super) const ACTIVATE: u8 = 0x15;
    pub(super) const STORE: u8 = 0x17;
    /// To 0x43, by part of the address.
    pub(super) const SELECT: u8 = 0x40;
    pub(super) const SELECT_LAST: u8 = 0x43;
    pub(super) const SELECTED: u8 = 0x44;
    pub(super) const IDENTIFIED: u8 = 0x4F;
    pub(super) const FASTSCAN: u8 = 0x51;
    /// To 0x5D, by part of the address.
    pub(super) const INQUIRE: u8 = 0x5A;
    pub(super) const INQUIRE_LAST: u8 = 0x5D;
    pub(super) const INQUIRE_NODE_ID: u8 = 0x5E;
}

/// The LSS state of a node (CiA 305, 3.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Mode {
    /// Waiting to be selected.
    Waiting,
    /// Selected, can be configured.
    Configuration,
}

/// What a node answers to a configuration service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ConfigurationResult {
    /// 0: done. Node-ID: 1 = out of range. Bit timing: 1 = not supported.
    /// Store: 1 = not supported, 2 = storage medium access error. 255: see
    /// `specific`.
    pub error: u8,
    /// Error of the manufacturer.
    pub specific: u8,
}

impl ConfigurationResult {
    /// Done.
    pub const OK: ConfigurationResult = ConfigurationResult::error(0);
    /// Node-ID out of range, bit timing or storing not supported.
    pub const REFUSED: ConfigurationResult = ConfigurationResult::error(1);
    /// Storage medium access error.
    pub const MEDIUM: ConfigurationResult = ConfigurationResult::error(2);

    const fn error(error: u8) -> ConfigurationResult {
        ConfigurationResult { error, specific: 0 }
    }

    /// The result in `frame` if it answers the service that is `awaited`: less
    /// code than [`Answer::decode`] for whoever needs no other answer.
    pub(crate) fn decode(frame: &Frame, awaited: Awaited) -> Option<ConfigurationResult> {
        let [cs, error, specific, ..] = eight(frame, CobId::LSS_SLAVE)?;
        (cs == awaited as u8).then_some(ConfigurationResult { error, specific })
    }

    /// Whether it was done.
    pub const fn is_ok(self) -> bool {
        self.error == 0
    }
}

/// Services whose answer is a result, or nothing but an answer, by the command
/// specifier of the answer.
#[derive(Clone, Copy, Debug)]
#[repr(u8)]
pub(crate) enum Awaited {
    /// Configure node-ID.
    NodeId = cs::NODE_ID,
    /// Store configuration.
    Store = cs::STORE,
    /// Fastscan.
    Identified = cs::IDENTIFIED,
}

/// What the master sends on 7E5h.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request {
    /// Switch mode global (CiA 305, 3.8.1).
    SwitchGlobal(Mode),
    /// One of the four frames of switch mode selective (CiA 305, 3.8.2).
    Select(Part, u32),
    /// Configure node-ID; `None` takes it away (CiA 305, 3.9.2).
    NodeId(Option<NodeId>),
    /// Configure bit timing (CiA 305, 3.9.3).
    BitTiming {
        /// 0: the standard table.
        table: u8,
        /// See [`BitRate`](super::BitRate).
        index: u8,
    },
    /// Activate bit timing (CiA 305, 3.9.4).
    Activate {
        /// Silence before and after the switch, in milliseconds.
        delay: u16,
    },
    /// Store configuration (CiA 305, 3.9.5).
    Store,
    /// Inquire a part of the LSS address (CiA 305, 3.10.1).
    Inquire(Part),
    /// Inquire the node-ID (CiA 305, 3.10.2).
    InquireNodeId,
    /// Fastscan (CiA 305, 3.11.3).
    Fastscan {
        /// The number tried.
        id: u32,
        /// The lowest bit that is compared; 80h: start anew.
        bit: u8,
        /// The part that is compared, 0..=3.
        sub: u8,
        /// The part that comes next, 0..=3.
        next: u8,
    },
}

/// What a node answers on 7E4h.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Answer {
    /// The LSS address of switch mode selective is its own.
    Selected,
    /// To configure node-ID.
    NodeId(ConfigurationResult),
    /// To configure bit timing.
    BitTiming(ConfigurationResult),
    /// To store configuration.
    Store(ConfigurationResult),
    /// A part of the LSS address.
    Inquire(Part, u32),
    /// The node-ID, `None` if it has none.
    InquireNodeId(Option<NodeId>),
    /// To fastscan.
    Identified,
}

type Bytes = [u8; MAX_DATA];

impl Request {
    /// The frame to send.
    pub fn frame(&self) -> Frame {
        Frame::full(CobId::LSS_MASTER, self.bytes())
    }

    /// Its data. Where the request is known, so is the data: little code is left.
    #[inline(always)]
    pub(crate) fn bytes(&self) -> Bytes {
        match *self {
            Request::SwitchGlobal(Mode::Waiting) => short(cs::SWITCH_GLOBAL, 0, 0),
            Request::SwitchGlobal(Mode::Configuration) => short(cs::SWITCH_GLOBAL, 1, 0),
            Request::Select(part, number) => long(cs::SELECT + part.position(), number),
            Request::NodeId(node) => short(cs::NODE_ID, node_byte(node), 0),
            Request::BitTiming { table, index } => short(cs::BIT_TIMING, table, index),
            Request::Activate { delay } => {
                let [low, high] = delay.to_le_bytes();
                short(cs::ACTIVATE, low, high)
            }
            Request::Store => short(cs::STORE, 0, 0),
            Request::Inquire(part) => short(cs::INQUIRE + part.position(), 0, 0),
            Request::InquireNodeId => short(cs::INQUIRE_NODE_ID, 0, 0),
            Request::Fastscan { id, bit, sub, next } => {
                let [a, b, c, d] = id.to_le_bytes();
                [cs::FASTSCAN, a, b, c, d, bit, sub, next]
            }
        }
    }

    /// The same as a number, of which less code is made where it is one of several.
    #[inline(always)]
    pub(crate) fn number(&self) -> u64 {
        u64::from_le_bytes(self.bytes())
    }

    /// `None` unless `frame` has eight bytes, comes on 7E5h and is a command
    /// that exists.
    pub fn decode(frame: &Frame) -> Option<Request> {
        let [cs, a, b, c, d, bit, sub, next] = eight(frame, CobId::LSS_MASTER)?;
        let number = u32::from_le_bytes([a, b, c, d]);
        Some(match cs {
            cs::SWITCH_GLOBAL => Request::SwitchGlobal(match a {
                0 => Mode::Waiting,
                1 => Mode::Configuration,
                _ => return None,
            }),
            cs::SELECT..=cs::SELECT_LAST => Request::Select(Part::at(cs - cs::SELECT)?, number),
            cs::NODE_ID => Request::NodeId(node(a)?),
            cs::BIT_TIMING => Request::BitTiming { table: a, index: b },
            cs::ACTIVATE => Request::Activate {
                delay: u16::from_le_bytes([a, b]),
            },
            cs::STORE => Request::Store,
            cs::INQUIRE..=cs::INQUIRE_LAST => Request::Inquire(Part::at(cs - cs::INQUIRE)?),
            cs::INQUIRE_NODE_ID => Request::InquireNodeId,
            cs::FASTSCAN => Request::Fastscan {
                id: number,
                bit,
                sub,
                next,
            },
            _ => return None,
        })
    }

    /// Whether `frame` asks for a node-ID that no node can have: it is answered
    /// with an error.
    pub(super) fn is_bad_node_id(frame: &Frame) -> bool {
        matches!(eight(frame, CobId::LSS_MASTER), Some([cs::NODE_ID, id, ..]) if node(id).is_none())
    }
}

impl Answer {
    /// The frame to send.
    pub fn frame(&self) -> Frame {
        let bytes = match *self {
            Answer::Selected => short(cs::SELECTED, 0, 0),
            Answer::NodeId(result) => short(cs::NODE_ID, result.error, result.specific),
            Answer::BitTiming(result) => short(cs::BIT_TIMING, result.error, result.specific),
            Answer::Store(result) => short(cs::STORE, result.error, result.specific),
            Answer::Inquire(part, number) => long(cs::INQUIRE + part.position(), number),
            Answer::InquireNodeId(node) => short(cs::INQUIRE_NODE_ID, node_byte(node), 0),
            Answer::Identified => short(cs::IDENTIFIED, 0, 0),
        };
        Frame::full(CobId::LSS_SLAVE, bytes)
    }

    /// `None` unless `frame` has eight bytes, comes on 7E4h and is an answer
    /// that exists.
    pub fn decode(frame: &Frame) -> Option<Answer> {
        let [cs, a, b, c, d, ..] = eight(frame, CobId::LSS_SLAVE)?;
        let result = ConfigurationResult {
            error: a,
            specific: b,
        };
        Some(match cs {
            cs::SELECTED => Answer::Selected,
            cs::NODE_ID => Answer::NodeId(result),
            cs::BIT_TIMING => Answer::BitTiming(result),
            cs::STORE => Answer::Store(result),
            cs::INQUIRE..=cs::INQUIRE_LAST => {
                let number = u32::from_le_bytes([a, b, c, d]);
                Answer::Inquire(Part::at(cs - cs::INQUIRE)?, number)
            }
            cs::INQUIRE_NODE_ID => Answer::InquireNodeId(node(a)?),
            cs::IDENTIFIED => Answer::Identified,
            _ => return None,
        })
    }
}

fn eight(frame: &Frame, id: CobId) -> Option<Bytes> {
    if frame.id() != id {
        return None;
    }
    Bytes::try_from(frame.data()).ok()
}

const fn short(cs: u8, a: u8, b: u8) -> Bytes {
    [cs, a, b, 0, 0, 0, 0, 0]
}

const fn long(cs: u8, number: u32) -> Bytes {
    let [a, b, c, d] = number.to_le_bytes();
    [cs, a, b, c, d, 0, 0, 0]
}

fn node_byte(node: Option<NodeId>) -> u8 {
    node.map_or(UNCONFIGURED, NodeId::get)
}

/// `None` for a byte that is neither a node-ID nor the absence of one.
fn node(byte: u8) -> Option<Option<NodeId>> {
    match byte {
        UNCONFIGURED => Some(None),
        byte => NodeId::new(byte).map(Some),
    }
}

//! Emergency messages (CiA 301, 7.2.7).

mod cob_id;
mod code;
mod history;
mod producer;
mod register;
mod texts;

pub use cob_id::EmcyCobId;
pub use code::{Class, EmcyCode};
pub use history::History;
pub use producer::{ERROR_FIELD, Producer};
pub use register::ErrorRegister;
pub(crate) use texts::other as other_text;

use crate::frame::{Frame, MAX_DATA};
use crate::id::{CobId, FunctionCode, NodeId};

/// An emergency message (CiA 301, 7.2.7.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Emcy {
    /// The error.
    pub code: EmcyCode,
    /// 1001h at that moment.
    pub register: ErrorRegister,
    /// What the manufacturer adds.
    pub manufacturer: [u8; 5],
}

impl Emcy {
    /// An emergency without bytes of the manufacturer.
    pub const fn new(code: EmcyCode, register: ErrorRegister) -> Emcy {
        Emcy {
            code,
            register,
            manufacturer: [0; 5],
        }
    }

    /// The eight data bytes.
    pub const fn encode(&self) -> [u8; MAX_DATA] {
        let [low, high] = self.code.0.to_le_bytes();
        let [a, b, c, d, e] = self.manufacturer;
        [low, high, self.register.0, a, b, c, d, e]
    }

    /// The frame on the node's predefined identifier, 080h + node-ID.
    pub const fn frame(&self, node: NodeId) -> Frame {
        Frame::full(CobId::of(FunctionCode::Emcy, node), self.encode())
    }

    /// Node and emergency of a frame on 081h..=0FFh.
    ///
    /// A frame with fewer than eight bytes breaks the standard; its missing
    /// bytes count as zero, because a fault reported badly is still a fault.
    /// Without a whole code there is nothing to report: `None`.
    pub fn decode(frame: &Frame) -> Option<(NodeId, Emcy)> {
        let (FunctionCode::Emcy, node) = frame.id().split()? else {
            return None;
        };
        if frame.data().len() < size_of::<EmcyCode>() {
            return None;
        }
        let [low, high, register, a, b, c, d, e] = frame.padded();
        let emcy = Emcy {
            code: EmcyCode(u16::from_le_bytes([low, high])),
            register: ErrorRegister(register),
            manufacturer: [a, b, c, d, e],
        };
        Some((node, emcy))
    }
}

//! The error control frame: boot-up, heartbeat, answer to node guarding
//! (CiA 301, 7.2.8.3.2, 7.2.8.3.3).

use super::state::State;
use crate::frame::Frame;
use crate::id::{CobId, FunctionCode, NodeId};

/// Bit 7 of the answer to node guarding.
const TOGGLE: u8 = 0x80;

/// One byte on 700h + node-ID.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ErrorControl {
    /// Who reports.
    pub node: NodeId,
    /// Its state; [`State::Initialising`] is the boot-up message.
    pub state: State,
    /// Alternates in answers to node guarding, `false` in heartbeats.
    pub toggle: bool,
}

impl ErrorControl {
    /// A heartbeat, or with [`State::Initialising`] the boot-up message.
    pub const fn heartbeat(node: NodeId, state: State) -> ErrorControl {
        ErrorControl {
            node,
            state,
            toggle: false,
        }
    }

    /// The frame to send.
    pub fn frame(&self) -> Frame {
        let id = CobId::of(FunctionCode::ErrorControl, self.node);
        let toggle = if self.toggle { TOGGLE } else { 0 };
        // One byte always fits.
        Frame::data_frame(id, &[self.state.code() | toggle]).unwrap_or(Frame::empty(id))
    }

    /// `None` unless `frame` is a data frame of one byte on 701h..=77Fh.
    pub fn decode(frame: &Frame) -> Option<ErrorControl> {
        let (FunctionCode::ErrorControl, node) = frame.id().split()? else {
            return None;
        };
        let &[byte] = frame.data() else {
            return None;
        };
        Some(ErrorControl {
            node,
            state: State::from_code(byte),
            toggle: byte & TOGGLE != 0,
        })
    }
}

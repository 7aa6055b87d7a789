//! Modes of operation: where the group wants another one of an axis, 6060h of its
//! drive is written, and 6061h is read until it shows the mode. An answer that stays
//! away, or a mode that is not shown, is waited for as long as the group does, which
//! then names the axis.

use crate::{app::app::NETWORK, asking};
use canmaster::{
    Frame, NodeId,
    id::{CobId, FunctionCode},
    motion::ModeWanted,
    objects,
    time::{Duration, Instant},
};

/// Download initiate, expedited, one byte (CiA 301, 7.2.4.3.3).
const DOWNLOAD_U8: u8 = 0x2F;
/// Upload initiate (CiA 301, 7.2.4.3.6).
const UPLOAD: u8 = 0x40;
/// The answer to a download initiate.
const DOWNLOADED: u8 = 0x60;
/// The answer to an upload initiate, expedited, whether or not it tells the size.
const UPLOADED: u8 = 0x42;
const UPLOADED_MASK: u8 = 0xE2;
/// After that a request is repeated.
const REPEAT: Duration = Duration::from_millis(100);
/// A drive that shows another mode is asked again after that.
const POLL: Duration = Duration::from_millis(5);

/// The change of one axis at a time.
pub(crate) struct Modes {
    wanted: Option<ModeWanted>,
    /// 6060h was written.
    written: bool,
    /// 6061h shows the mode.
    confirmed: bool,
    /// When to ask next.
    next: Instant,
}

impl Modes {
    pub(crate) const NONE: Modes = Modes {
        wanted: None,
        written: false,
        confirmed: false,
        next: Instant::ZERO,
    };

    /// The mode that an axis has come to, once.
    pub(crate) fn take_confirmed(&mut self) -> Option<ModeWanted> {
        let confirmed = core::mem::take(&mut self.confirmed);
        self.wanted.filter(|_| confirmed)
    }

    /// What is to be sent for what the group wants.
    pub(crate) fn poll(&mut self, wanted: Option<ModeWanted>, now: Instant) -> Option<Frame> {
        if self.wanted != wanted {
            self.wanted = wanted;
            self.written = false;
            self.next = now;
        }
        let wanted = wanted.filter(|_| now >= self.next)?;
        self.next = now + REPEAT;
        let (command, at, value) = match self.written {
            true => (UPLOAD, objects::MODES_OF_OPERATION_DISPLAY, 0),
            false => {
                let code = wanted.mode.code() as u8;
                (DOWNLOAD_U8, objects::MODES_OF_OPERATION, code)
            }
        };
        Some(asking::request(command, at, node(wanted)?, value))
    }

    /// Takes in an answer; `false` if it is somebody else's.
    pub(crate) fn on_frame(&mut self, frame: &Frame, now: Instant) -> bool {
        let Some(wanted) = self.wanted else {
            return false;
        };
        let answers = |node| CobId::of(FunctionCode::SdoResponse, node) == frame.id();
        let [command, low, high, sub, value, ..] = frame.padded();
        let at = match self.written {
            true => objects::MODES_OF_OPERATION_DISPLAY,
            false => objects::MODES_OF_OPERATION,
        };
        if !node(wanted).is_some_and(answers)
            || [low, high] != at.index.0.to_le_bytes()
            || sub != at.sub.0
        {
            return false;
        }
        match command {
            DOWNLOADED => {
                self.written = true;
                self.next = now;
            }
            _ if command & UPLOADED_MASK == UPLOADED => {
                self.confirmed = value == wanted.mode.code() as u8;
                self.next = now + POLL;
            }
            // It is tried again.
            _ => {}
        }
        true
    }
}

fn node(wanted: ModeWanted) -> Option<NodeId> {
    NETWORK.nodes.get(wanted.axis).map(|node| node.id)
}

//! What the group wants a drive to show before it goes on: a mode of operation, which is
//! written to 6060h and read in 6061h, or the velocity of its next set-point, 6081h. An
//! answer that stays away, or another value, is waited for as long as the group or its
//! director does, which then names the axis.

use crate::{app::app::NETWORK, asking};
use canmaster::{
    Frame, NodeId,
    id::{Address, CobId, FunctionCode},
    motion::{DriveSetting, Wanted},
    objects,
    time::{Duration, Instant},
};

/// Download initiate, expedited, one byte and four (CiA 301, 7.2.4.3.3).
const DOWNLOAD_U8: u8 = 0x2F;
const DOWNLOAD_U32: u8 = 0x23;
/// Upload initiate (CiA 301, 7.2.4.3.6).
const UPLOAD: u8 = 0x40;
/// The answer to a download initiate.
const DOWNLOADED: u8 = 0x60;
/// The answer to an upload initiate, expedited, whether or not it tells the size.
const UPLOADED: u8 = 0x42;
const UPLOADED_MASK: u8 = 0xE2;
/// After that a request is repeated.
const REPEAT: Duration = Duration::from_millis(100);
/// A drive that shows something else is asked again after that.
const POLL: Duration = Duration::from_millis(5);

/// A setting of one axis at a time.
pub(crate) struct Settings {
    wanted: Option<Wanted>,
    /// It was written.
    written: bool,
    /// The drive shows it.
    shown: bool,
    /// When to ask next.
    next: Instant,
}

impl Settings {
    pub(crate) const NONE: Settings = Settings {
        wanted: None,
        written: false,
        shown: false,
        next: Instant::ZERO,
    };

    /// What a drive has come to show, once.
    pub(crate) fn take_shown(&mut self) -> Option<&Wanted> {
        let shown = core::mem::take(&mut self.shown);
        self.wanted.as_ref().filter(|_| shown)
    }

    /// Where it is written or read, and the request to write it.
    #[inline(never)]
    fn access(&self, setting: DriveSetting) -> (Address, u8) {
        match (setting, self.written) {
            (DriveSetting::Mode, false) => (objects::MODES_OF_OPERATION, DOWNLOAD_U8),
            (DriveSetting::Mode, true) => (objects::MODES_OF_OPERATION_DISPLAY, DOWNLOAD_U8),
            (DriveSetting::ProfileVelocity, _) => (objects::PROFILE_VELOCITY, DOWNLOAD_U32),
        }
    }

    /// What is to be sent for what the group wants.
    pub(crate) fn poll(&mut self, wanted: Option<Wanted>, now: Instant) -> Option<Frame> {
        if self.wanted != wanted {
            self.wanted = wanted;
            self.written = false;
            self.next = now;
        }
        let wanted = wanted.filter(|_| now >= self.next)?;
        self.next = now + REPEAT;
        let (at, command) = self.access(wanted.setting);
        let (command, value) = match self.written {
            true => (UPLOAD, 0),
            false => (command, wanted.value),
        };
        Some(asking::request(command, at, node(&wanted)?, value))
    }

    /// Takes in an answer; `false` if it is somebody else's.
    pub(crate) fn on_frame(&mut self, frame: &Frame, now: Instant) -> bool {
        let Some(wanted) = &self.wanted else {
            return false;
        };
        let answers = |node| CobId::of(FunctionCode::SdoResponse, node) == frame.id();
        let [command, low, high, sub, value @ ..] = frame.padded();
        let (at, written) = self.access(wanted.setting);
        // All of them have sub-index 0.
        let of = u32::from_le_bytes([low, high, sub, 0]);
        if of != at.index.0.into() || !node(wanted).is_some_and(answers) {
            return false;
        }
        match command {
            DOWNLOADED => {
                self.written = true;
                self.next = now;
            }
            _ if command & UPLOADED_MASK == UPLOADED => {
                // Bytes beyond those of the object mean nothing.
                let beyond = u32::from(written >> 2 & 3) * u8::BITS;
                self.shown = (u32::from_le_bytes(value) ^ wanted.value) << beyond == 0;
                self.next = now + POLL;
            }
            // It is tried again.
            _ => {}
        }
        true
    }
}

fn node(wanted: &Wanted) -> Option<NodeId> {
    NETWORK.nodes.get(wanted.axis).map(|node| node.id)
}

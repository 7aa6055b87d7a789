//! Frames as the message RAM holds them (RM0440, 44.3.4 and 44.3.5).

use crate::message_ram::USED_WORDS;
use embedded_can::{Frame, Id, StandardId};

const REMOTE: u32 = 1 << 29;
const EXTENDED: u32 = 1 << 30;
const STANDARD_SHIFT: u32 = 18;
const STANDARD_MASK: u32 = 0x7FF;
const DLC_SHIFT: u32 = 16;
const DLC_MASK: u32 = 0xF;
const DATA_MAX: usize = 8;
const FILTER_SHIFT: u32 = 24;
const FILTER_MASK: u32 = 0x7F;

/// A frame with a standard identifier, made ready to be sent.
#[derive(Clone, Copy, Debug)]
pub struct Element([u32; USED_WORDS]);

impl Element {
    /// `None` for an extended identifier or more than eight bytes of data.
    pub fn new(frame: &impl Frame) -> Option<Element> {
        let Id::Standard(id) = frame.id() else {
            return None;
        };
        let dlc = frame.dlc();
        if dlc > DATA_MAX {
            return None;
        }
        let mut bytes = [0; DATA_MAX];
        let remote = if frame.is_remote_frame() {
            REMOTE
        } else {
            // Byte by byte: a call of memcpy is longer than this loop.
            for (to, from) in bytes.iter_mut().zip(frame.data()) {
                *to = *from;
            }
            0
        };
        let [a, b, c, d, e, f, g, h] = bytes;
        Some(Element([
            remote | u32::from(id.as_raw()) << STANDARD_SHIFT,
            (dlc as u32) << DLC_SHIFT,
            u32::from_le_bytes([a, b, c, d]),
            u32::from_le_bytes([e, f, g, h]),
        ]))
    }

    /// From now on `data` is the only byte, or there is none.
    #[inline(always)]
    pub fn set_byte(&mut self, data: Option<u8>) {
        self.0[1] = u32::from(data.is_some()) << DLC_SHIFT;
        self.0[2] = u32::from(data.unwrap_or_default());
    }

    pub(crate) const fn words(&self) -> &[u32; USED_WORDS] {
        &self.0
    }

    pub(crate) const fn identifier(&self) -> u16 {
        ((self.0[0] >> STANDARD_SHIFT) & STANDARD_MASK) as u16
    }

    pub(crate) const fn has_data(&self) -> bool {
        self.0[1] != 0
    }
}

/// A received frame.
#[derive(Clone, Copy, Debug)]
pub struct RxElement([u32; USED_WORDS]);

impl RxElement {
    pub(crate) const fn new(words: [u32; USED_WORDS]) -> RxElement {
        RxElement(words)
    }

    /// The index of the filter that let the frame in.
    pub const fn filter(&self) -> u8 {
        ((self.0[1] >> FILTER_SHIFT) & FILTER_MASK) as u8
    }

    /// The identifier, if it is a standard one.
    pub fn identifier(&self) -> Option<StandardId> {
        if self.0[0] & EXTENDED != 0 {
            return None;
        }
        StandardId::new(((self.0[0] >> STANDARD_SHIFT) & STANDARD_MASK) as u16)
    }

    /// Whether this is a remote frame.
    pub const fn is_remote(&self) -> bool {
        self.0[0] & REMOTE != 0
    }

    /// The number of data bytes.
    pub const fn len(&self) -> usize {
        let dlc = ((self.0[1] >> DLC_SHIFT) & DLC_MASK) as usize;
        // In classical CAN the codes 9..=15 stand for eight bytes, too.
        if dlc > DATA_MAX { DATA_MAX } else { dlc }
    }

    /// Whether there are no data bytes.
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Eight bytes; what lies past [`len`](RxElement::len) is left from earlier
    /// frames.
    pub const fn bytes(&self) -> [u8; DATA_MAX] {
        let [a, b, c, d] = self.0[2].to_le_bytes();
        let [e, f, g, h] = self.0[3].to_le_bytes();
        [a, b, c, d, e, f, g, h]
    }

    /// The frame in the caller's type. `None` for an extended identifier, or if
    /// that type refuses it.
    pub fn frame<F: Frame>(&self) -> Option<F> {
        let id = self.identifier()?;
        if self.is_remote() {
            F::new_remote(id, self.len())
        } else {
            F::new(id, self.bytes().get(..self.len())?)
        }
    }
}

//! Frames as the message RAM holds them (RM0440, 44.3.4 and 44.3.5).

use crate::message_ram::USED_WORDS;
use core::arch::asm;
use embedded_can::{Frame, StandardId};

const REMOTE: u32 = 1 << 29;
const EXTENDED: u32 = 1 << 30;
const STANDARD_SHIFT: u32 = 18;
const STANDARD_MASK: u32 = 0x7FF;
/// EFC: store an event.
const EVENT: u32 = 1 << 23;
const DLC_SHIFT: u32 = 16;
const DLC_MASK: u32 = 0xF;
const DATA_MAX: usize = 8;
const FILTER_SHIFT: u32 = 24;
const FILTER_MASK: u32 = 0x7F;

/// A frame with a standard identifier, made ready to be sent.
#[derive(Clone, Copy, Debug)]
pub struct Element([u32; USED_WORDS]);

impl Element {
    /// A frame with `dlc` bytes, at most eight, of `data`.
    #[inline(always)]
    pub fn new(id: StandardId, remote: bool, dlc: u8, data: [u8; DATA_MAX]) -> Element {
        let [a, b, c, d, e, f, g, h] = data;
        let remote = if remote { REMOTE } else { 0 };
        Element([
            remote | (id.as_raw() as u32) << STANDARD_SHIFT,
            (dlc as u32 & DLC_MASK) << DLC_SHIFT,
            u32::from_le_bytes([a, b, c, d]),
            u32::from_le_bytes([e, f, g, h]),
        ])
    }

    /// The same, and when it is sent the controller is to tell when it began.
    pub const fn with_event(self) -> Element {
        let [id, control, low, high] = self.0;
        Element([id, control | EVENT, low, high])
    }

    /// The same, worked out here: the compiler would do it as late as it can, which
    /// is while the SYNC is held off.
    #[inline(always)]
    pub fn made(self) -> Element {
        let [mut id, mut control, mut low, mut high] = self.0;
        // SAFETY: no instruction; the compiler takes it for one that needs the four
        // words.
        unsafe {
            asm!(
                "/* {0} {1} {2} {3} */",
                inout(reg) id,
                inout(reg) control,
                inout(reg) low,
                inout(reg) high,
                options(nomem, nostack, preserves_flags)
            );
        }
        Element([id, control, low, high])
    }

    /// From now on `data` is the only byte, or there is none.
    #[inline(always)]
    pub fn set_byte(&mut self, data: Option<u8>) {
        self.0[1] = self.0[1] & EVENT | u32::from(data.is_some()) << DLC_SHIFT;
        self.0[2] = u32::from(data.unwrap_or_default());
    }

    pub(crate) const fn words(&self) -> &[u32; USED_WORDS] {
        &self.0
    }

    pub(crate) const fn identifier(&self) -> u16 {
        ((self.0[0] >> STANDARD_SHIFT) & STANDARD_MASK) as u16
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

//! Reading a piece of something that is made anew each time.

use crate::emcy;
use crate::network::ConfigWrite;
use crate::od::Chunk;
use crate::words::PackedText;

/// Takes in the whole and keeps the piece from an offset on.
pub(super) struct Window<'a> {
    offset: usize,
    buf: &'a mut [u8],
    /// How much of the whole has been taken in.
    total: usize,
}

impl Window<'_> {
    pub(super) fn new(offset: u32, buf: &mut [u8]) -> Window<'_> {
        Window {
            offset: usize::try_from(offset).unwrap_or(usize::MAX),
            buf,
            total: 0,
        }
    }

    pub(super) fn put(&mut self, bytes: &[u8]) {
        for byte in bytes {
            if let Some(place) = self.total.checked_sub(self.offset)
                && let Some(slot) = self.buf.get_mut(place)
            {
                *slot = *byte;
            }
            self.total += 1;
        }
    }

    pub(super) fn text(&mut self, text: &str) {
        self.put(text.as_bytes());
    }

    /// A text by its number.
    pub(super) fn packed(&mut self, number: u8) {
        self.spell(&emcy::other_text(number));
    }

    pub(super) fn spell(&mut self, text: &PackedText) {
        text.spell(&mut |letter| self.put(&[letter]));
    }

    /// In decimal, without the formatting of the standard library: that would
    /// take 3 KiB of flash.
    pub(super) fn decimal(&mut self, number: u16) {
        self.digits(number, 10, 1);
    }

    /// In four hexadecimal digits.
    pub(super) fn hexadecimal(&mut self, number: u16) {
        self.digits(number, 16, 4);
    }

    fn digits(&mut self, number: u16, base: u16, at_least: usize) {
        let mut digits = [b'0'; 5];
        let (mut rest, mut used) = (number, 0);
        for digit in digits.iter_mut().rev() {
            if rest == 0 && used >= at_least {
                break;
            }
            let value = (rest % base) as u8;
            *digit = if value < 10 {
                b'0' + value
            } else {
                b'A' + value - 10
            };
            rest /= base;
            used += 1;
        }
        self.put(digits.get(digits.len() - used..).unwrap_or(&digits));
    }

    pub(super) fn chunk(&self) -> Chunk {
        let rest = self.total.saturating_sub(self.offset);
        let len = rest.min(self.buf.len());
        Chunk {
            len,
            size: u32::try_from(self.total).ok(),
            last: len == rest,
        }
    }
}

/// Index, sub-index and size of an entry of a concise DCF.
const ENTRY: usize = 7;

/// A concise DCF (CiA 302-3): the number of entries, then each with its index,
/// sub-index, size and data.
pub(super) fn concise_dcf<I: Iterator<Item = ConfigWrite>>(
    writes: impl Fn() -> I,
    window: &mut Window<'_>,
) {
    let count = u32::try_from(writes().count()).unwrap_or(u32::MAX);
    window.put(&count.to_le_bytes());
    for write in writes() {
        let [low, high] = write.at.index.0.to_le_bytes();
        let len = write.len();
        let [a, b, c, d] = write.bytes();
        // Sizes are below 256.
        let entry = [low, high, write.at.sub.0, len as u8, 0, 0, 0, a, b, c, d];
        window.put(entry.get(..ENTRY + len).unwrap_or(&entry));
    }
}

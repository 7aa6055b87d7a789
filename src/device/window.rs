//! Reading a piece of something that is made anew each time.

use crate::network::ConfigWrite;
use crate::od::Chunk;
use core::fmt;

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

impl fmt::Write for Window<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.put(text.as_bytes());
        Ok(())
    }
}

/// A concise DCF (CiA 302-3): the number of entries, then each with its index,
/// sub-index, size and data.
pub(super) fn concise_dcf<I: Iterator<Item = ConfigWrite>>(
    writes: impl Fn() -> I,
    window: &mut Window<'_>,
) {
    let count = u32::try_from(writes().count()).unwrap_or(u32::MAX);
    window.put(&count.to_le_bytes());
    for write in writes() {
        window.put(&write.at.index.0.to_le_bytes());
        window.put(&[write.at.sub.0]);
        window.put(&(write.len() as u32).to_le_bytes());
        let bytes = write.bytes();
        window.put(bytes.get(..write.len()).unwrap_or(&bytes));
    }
}

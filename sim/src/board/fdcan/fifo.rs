//! Put, get and fill level of a FIFO of three elements.

use super::ram::DEPTH;

/// Position of an Rx or Tx event FIFO.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Fifo {
    get: usize,
    level: usize,
}

impl Fifo {
    pub(super) const fn is_full(&self) -> bool {
        self.level == DEPTH
    }

    /// Takes the next free element; `None` if there is none.
    pub(super) fn put(&mut self) -> Option<usize> {
        if self.is_full() {
            return None;
        }
        let index = (self.get + self.level) % DEPTH;
        self.level += 1;
        Some(index)
    }

    /// Overwrite mode: takes the oldest element when the FIFO is full.
    pub(super) fn put_over(&mut self) -> usize {
        if self.is_full() {
            self.get = (self.get + 1) % DEPTH;
            self.level -= 1;
        }
        let index = (self.get + self.level) % DEPTH;
        self.level += 1;
        index
    }

    /// Acknowledges everything up to element `index`. False if that element
    /// is not one that waits to be read.
    pub(super) fn acknowledge(&mut self, index: usize) -> bool {
        let distance = (index % DEPTH + DEPTH - self.get) % DEPTH + 1;
        if index >= DEPTH || distance > self.level {
            return false;
        }
        self.get = (index + 1) % DEPTH;
        self.level -= distance;
        true
    }

    /// RXFxS and TXEFS without the lost flag: level, get and put index, full.
    pub(super) fn status(&self) -> u32 {
        const GET_SHIFT: u32 = 8;
        const PUT_SHIFT: u32 = 16;
        const FULL: u32 = 1 << 24;
        let put = (self.get + self.level) % DEPTH;
        let full = if self.is_full() { FULL } else { 0 };
        self.level as u32 | (self.get as u32) << GET_SHIFT | (put as u32) << PUT_SHIFT | full
    }
}

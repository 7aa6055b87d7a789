//! The cells of the flash: what they hold, what a cut operation leaves in them.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

use rand::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;
use rsemu::core::space::RamStore;

/// Flash of an STM32G474RE.
pub(crate) const FLASH_BYTES: u32 = 512 * 1024;
/// Half of it.
pub(crate) const BANK_BYTES: u32 = FLASH_BYTES / 2;
/// What is programmed at once, with one error correction code.
pub(crate) const DOUBLE_WORD: u32 = 8;
/// A double word after an erase.
pub(crate) const ERASED: u64 = u64::MAX;
const ERASED_BYTE: u8 = 0xFF;
const BANK_CELLS: u32 = BANK_BYTES / DOUBLE_WORD;

/// What bank 2 holds, to be handed from one board to the next.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BankContents {
    bytes: Vec<u8>,
    /// Double words programmed since their last erase.
    written: Vec<bool>,
    /// Double words whose error correction gives up.
    unreadable: BTreeSet<u32>,
}

impl BankContents {
    /// The bytes, whether the error correction would let them through or not.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Offsets of the double words whose error correction gives up.
    pub fn unreadable(&self) -> impl Iterator<Item = u32> + '_ {
        self.unreadable.iter().map(|cell| cell * DOUBLE_WORD)
    }
}

/// In what a cut operation leaves a double word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Torn {
    /// As it was.
    Before,
    /// As it would have become, but weak: not to be built upon.
    After,
    /// Bits of both that the error correction takes for good.
    Mixed,
    /// Bits of both that the error correction gives up on.
    Unreadable,
}

const TORN: [Torn; 4] = [Torn::Before, Torn::After, Torn::Mixed, Torn::Unreadable];

/// Every double word of the flash.
#[derive(Debug)]
pub(super) struct Array {
    store: Arc<RamStore>,
    written: Vec<bool>,
    unreadable: BTreeSet<u32>,
    random: Pcg32,
}

impl Array {
    /// Erased; what cuts leave behind follows from `seed`.
    pub(super) fn new(seed: u64) -> Self {
        let array = Self {
            store: Arc::new(RamStore::new(u64::from(FLASH_BYTES))),
            written: vec![false; (FLASH_BYTES / DOUBLE_WORD) as usize],
            unreadable: BTreeSet::new(),
            random: Pcg32::seed_from_u64(seed),
        };
        let all = array.store.fill(0, u64::from(FLASH_BYTES), ERASED_BYTE);
        debug_assert!(all.is_ok(), "the range is the store's own");
        array
    }

    /// Where the bytes are: fast reads go there directly.
    pub(super) fn store(&self) -> Arc<RamStore> {
        Arc::clone(&self.store)
    }

    /// Puts bytes in, as a programmer does; false if they do not fit.
    pub(super) fn load(&mut self, offset: u32, bytes: &[u8]) -> bool {
        let fits = self.store.write_at(u64::from(offset), bytes).is_ok();
        if fits {
            let end = offset + bytes.len() as u32;
            for cell in offset / DOUBLE_WORD..end.div_ceil(DOUBLE_WORD) {
                self.written[cell as usize] = true;
                self.unreadable.remove(&cell);
            }
        }
        fits
    }

    pub(super) fn read(&self, offset: u32, bytes: &mut [u8]) {
        // Out of range reads as erased; the address map does not let it happen.
        if self.store.read_at(u64::from(offset), bytes).is_err() {
            bytes.fill(ERASED_BYTE);
        }
    }

    pub(super) fn value(&self, cell: u32) -> u64 {
        let mut bytes = [0; DOUBLE_WORD as usize];
        self.read(cell * DOUBLE_WORD, &mut bytes);
        u64::from_le_bytes(bytes)
    }

    /// Programmed, or touched by an operation that was cut, since its erase.
    pub(super) fn is_written(&self, cell: u32) -> bool {
        self.written[cell as usize]
    }

    /// The error correction gives up on it.
    pub(super) fn is_unreadable(&self, cell: u32) -> bool {
        self.unreadable.contains(&cell)
    }

    pub(super) fn any_unreadable(&self, cells: Range<u32>) -> bool {
        self.unreadable.range(cells).next().is_some()
    }

    fn put(&mut self, cell: u32, value: u64) {
        let at = u64::from(cell * DOUBLE_WORD);
        let done = self.store.write_at(at, &value.to_le_bytes());
        debug_assert!(done.is_ok(), "every cell lies in the store");
    }

    /// Programs a double word. On one that is not erased the result is any.
    pub(super) fn program(&mut self, cell: u32, value: u64) {
        if self.is_written(cell) && value != 0 {
            self.tear(cell, value, Torn::Unreadable);
            return;
        }
        self.put(cell, value);
        self.written[cell as usize] = true;
        self.unreadable.remove(&cell);
    }

    pub(super) fn erase(&mut self, cells: Range<u32>) {
        for cell in cells {
            self.put(cell, ERASED);
            self.written[cell as usize] = false;
            self.unreadable.remove(&cell);
        }
    }

    /// Programming was cut.
    pub(super) fn tear_program(&mut self, cell: u32, value: u64) {
        let torn = TORN[self.random.random_range(0..TORN.len())];
        self.tear(cell, value, torn);
    }

    /// Erasing was cut: the cells may have become erased all, none or some.
    pub(super) fn tear_erase(&mut self, cells: Range<u32>) {
        let torn = TORN[self.random.random_range(0..TORN.len())];
        for cell in cells {
            let torn = match torn {
                Torn::Before | Torn::After => torn,
                _ => TORN[self.random.random_range(0..TORN.len())],
            };
            self.tear(cell, ERASED, torn);
            // Whatever it looks like, it needs another erase.
            self.written[cell as usize] = true;
        }
    }

    fn tear(&mut self, cell: u32, value: u64, torn: Torn) {
        if torn == Torn::Before {
            return;
        }
        self.written[cell as usize] = true;
        let mask: u64 = match torn {
            Torn::After => u64::MAX,
            _ => self.random.random(),
        };
        let old = self.value(cell);
        self.put(cell, value & mask | old & !mask);
        if torn == Torn::Unreadable {
            self.unreadable.insert(cell);
        } else {
            self.unreadable.remove(&cell);
        }
    }

    /// What the second bank holds.
    pub(super) fn bank2(&self) -> BankContents {
        let mut bytes = vec![0; BANK_BYTES as usize];
        self.read(BANK_BYTES, &mut bytes);
        let unreadable = self.unreadable.range(BANK_CELLS..);
        BankContents {
            bytes,
            written: self.written[BANK_CELLS as usize..].to_vec(),
            unreadable: unreadable.map(|cell| cell - BANK_CELLS).collect(),
        }
    }

    /// The second bank gets what another board's held.
    pub(super) fn restore_bank2(&mut self, contents: &BankContents) {
        let done = self.store.write_at(u64::from(BANK_BYTES), &contents.bytes);
        debug_assert!(done.is_ok(), "a bank is a bank");
        self.written[BANK_CELLS as usize..].copy_from_slice(&contents.written);
        self.unreadable.retain(|cell| *cell < BANK_CELLS);
        let unreadable = contents.unreadable.iter();
        self.unreadable
            .extend(unreadable.map(|cell| cell + BANK_CELLS));
    }
}

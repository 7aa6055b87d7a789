//! FLASH: wait states, unlocking, erasing and programming of two banks
//! (RM0440, 3).
//!
//! While a bank is being erased or programmed, what is fetched or read from it
//! waits until the operation ends; the other bank reads on. A reset or a power
//! cut in the middle of an operation leaves anything in the double words
//! concerned. Not modelled: mass erase, fast programming, writing option bytes,
//! read-out protection.

mod array;
mod bits;
mod operation;
#[cfg(test)]
mod tests;

pub use array::BankContents;
pub(crate) use array::{BANK_BYTES, FLASH_BYTES};

use array::{Array, DOUBLE_WORD};
use bits::*;
use operation::Operation;
use std::ops::{Range, RangeInclusive};
use std::sync::Arc;

use rsemu::core::space::RamStore;

use super::pwr::VoltageRange;
use crate::time::Time;

/// The flash of a board.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FlashOptions {
    /// Option bit DBANK: two banks of 256 KiB with pages of 2 KiB, as
    /// delivered; else one of 512 KiB with pages of 4 KiB.
    pub dual_bank: bool,
    /// Pages of bank 2 that the option bytes protect against writing.
    pub protected: Option<RangeInclusive<u8>>,
    /// What bank 2 holds; `None`: it is erased.
    pub bank2: Option<BankContents>,
    /// What operations that are cut leave behind follows from it.
    pub seed: u64,
}

impl Default for FlashOptions {
    fn default() -> Self {
        Self {
            dual_bank: true,
            protected: None,
            bank2: None,
            seed: 0,
        }
    }
}

/// What the flash has been through.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FlashFigures {
    /// Pages erased.
    pub erased: u64,
    /// Double words programmed.
    pub programmed: u64,
    /// Operations cut by a reset or with the power.
    pub cut: u64,
    /// Core cycles spent waiting for a bank.
    pub stalled_cycles: u64,
}

/// The unlock sequence of CR.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Keys {
    /// So many keys were right.
    Given(usize),
    /// A wrong one: nothing helps until the next reset.
    LockedOut,
}

/// The flash interface and the flash behind it.
#[derive(Debug)]
pub(crate) struct Flash {
    acr: u32,
    sr: u32,
    cr: u32,
    eccr: u32,
    optr: u32,
    /// WRP1AR, WRP1BR, WRP2AR, WRP2BR.
    protection: [u32; 4],
    keys: Keys,
    /// The first half of a double word and its offset.
    first_half: Option<(u32, u32)>,
    operation: Option<Operation>,
    array: Array,
    /// The data cache may hold what has been erased or programmed since.
    cache_is_stale: bool,
    nmi: bool,
    figures: FlashFigures,
    /// Mistakes of the program since they were last taken.
    notes: Vec<String>,
}

impl Flash {
    pub(crate) fn new(options: &FlashOptions) -> Self {
        let mut array = Array::new(options.seed);
        if let Some(contents) = &options.bank2 {
            array.restore_bank2(contents);
        }
        let mut protection = [WRP_NONE; 4];
        if let Some(pages) = &options.protected {
            protection[2] = u32::from(*pages.start()) | u32::from(*pages.end()) << WRP_END_SHIFT;
        }
        Self {
            acr: ACR_RESET,
            sr: 0,
            cr: CR_RESET,
            eccr: 0,
            optr: if options.dual_bank {
                OPTR_RESET
            } else {
                OPTR_RESET & !OPTR_DBANK
            },
            protection,
            keys: Keys::Given(0),
            first_half: None,
            operation: None,
            array,
            cache_is_stale: false,
            nmi: false,
            figures: FlashFigures::default(),
            notes: Vec::new(),
        }
    }

    /// Resets the interface at `now`. The flash keeps what it holds, but for
    /// what was being erased or programmed.
    pub(crate) fn reset(&mut self, now: Time) {
        self.advance(now);
        if let Some(operation) = self.operation.take() {
            operation.tear(&mut self.array);
            self.figures.cut += 1;
        }
        self.acr = ACR_RESET;
        self.sr = 0;
        self.cr = CR_RESET;
        self.eccr = 0;
        self.keys = Keys::Given(0);
        self.first_half = None;
        self.cache_is_stale = false;
        self.nmi = false;
    }

    /// Where the bytes of both banks are.
    pub(crate) fn store(&self) -> Arc<RamStore> {
        self.array.store()
    }

    /// Puts bytes in, as a programmer does; false if they do not fit.
    pub(crate) fn load(&mut self, offset: u32, bytes: &[u8]) -> bool {
        self.array.load(offset, bytes)
    }

    /// What bank 2 holds.
    pub(crate) fn bank2(&self) -> BankContents {
        self.array.bank2()
    }

    pub(crate) const fn figures(&self) -> FlashFigures {
        self.figures
    }

    pub(crate) const fn clear_figures(&mut self) {
        self.figures = FlashFigures {
            erased: 0,
            programmed: 0,
            cut: 0,
            stalled_cycles: 0,
        };
    }

    pub(crate) const fn note_stall(&mut self, cycles: u64) {
        self.figures.stalled_cycles += cycles;
    }

    /// Mistakes of the program, in words.
    pub(crate) fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// Whether the error correction has just given up: a non-maskable
    /// interrupt.
    pub(crate) const fn has_nmi(&self) -> bool {
        self.nmi
    }

    /// The same, once.
    pub(crate) const fn take_nmi(&mut self) -> bool {
        std::mem::replace(&mut self.nmi, false)
    }

    /// Whether the interrupt line is high.
    pub(crate) const fn irq(&self) -> bool {
        self.cr & CR_EOPIE != 0 && self.sr & SR_EOP != 0
            || self.cr & CR_ERRIE != 0 && self.sr & SR_OPERR != 0
    }

    const fn is_dual(&self) -> bool {
        self.optr & OPTR_DBANK != 0
    }

    /// The bank that `offset` lies in.
    const fn bank(&self, offset: u32) -> Range<u32> {
        if !self.is_dual() {
            0..FLASH_BYTES
        } else if offset < BANK_BYTES {
            0..BANK_BYTES
        } else {
            BANK_BYTES..FLASH_BYTES
        }
    }

    /// Whether all of bank 1 can be read without a second thought.
    pub(crate) fn bank1_is_plain(&self) -> bool {
        let busy = self
            .operation
            .as_ref()
            .is_some_and(|operation| self.bank(operation.offset()).start == 0);
        !busy && !self.array.any_unreadable(0..BANK_BYTES / DOUBLE_WORD)
    }

    /// Reads bytes of the flash, as core or DMA do. Until when the access has
    /// to wait, if it has to.
    pub(crate) fn read_memory(&mut self, offset: u32, bytes: &mut [u8]) -> Option<Time> {
        self.array.read(offset, bytes);
        let waits = self.operation.as_ref().filter(|operation| {
            let bank = self.bank(operation.offset());
            bank.contains(&offset)
        });
        let (until, changing) = match waits {
            Some(operation) => {
                operation.show(offset, bytes);
                (Some(operation.until()), operation.cells())
            }
            None => (None, 0..0),
        };
        let end = offset + bytes.len() as u32;
        for cell in offset / DOUBLE_WORD..end.div_ceil(DOUBLE_WORD) {
            if self.array.is_unreadable(cell) && !changing.contains(&cell) {
                self.detect(cell);
            }
        }
        until
    }

    /// The error correction gives up on a double word.
    fn detect(&mut self, cell: u32) {
        if self.eccr & ECCR_DETECTED != 0 {
            // The register still tells of the one before.
            return;
        }
        let offset = cell * DOUBLE_WORD;
        let bank = self.bank(offset);
        let second_half = !self.is_dual() && cell % 2 == 1;
        self.eccr &= ECCR_ECCIE | ECCR_FLAGS;
        self.eccr |= offset - bank.start;
        self.eccr |= if second_half { ECCR_ECCD2 } else { ECCR_ECCD };
        if bank.start != 0 {
            self.eccr |= ECCR_BANK;
        }
        self.nmi = true;
    }

    /// Reads a register; `None` where there is none.
    #[must_use]
    pub(crate) const fn read(&self, offset: u32) -> Option<u32> {
        let [wrp1a, wrp1b, wrp2a, wrp2b] = self.protection;
        let busy = if self.operation.is_some() { SR_BSY } else { 0 };
        match offset {
            ACR => Some(self.acr),
            SR => Some(self.sr | busy),
            CR => Some(self.cr),
            ECCR => Some(self.eccr),
            OPTR => Some(self.optr),
            WRP1AR => Some(wrp1a),
            WRP1BR => Some(wrp1b),
            WRP2AR => Some(wrp2a),
            WRP2BR => Some(wrp2b),
            _ if offset <= LAST => Some(0),
            _ => None,
        }
    }

    /// Writes a register at `now`; false where there is none.
    pub(crate) fn write(&mut self, offset: u32, value: u32, now: Time) -> bool {
        match offset {
            ACR => self.write_acr(value),
            KEYR => self.write_key(value),
            SR => self.sr &= !(value & SR_CLEARABLE),
            CR => self.write_cr(value, now),
            ECCR => {
                let flags = self.eccr & !(value & ECCR_FLAGS);
                self.eccr = flags & !ECCR_ECCIE | value & ECCR_ECCIE;
            }
            _ if offset <= LAST => self.note("a register that is not modelled was written"),
            _ => return false,
        }
        true
    }

    fn write_acr(&mut self, value: u32) {
        let was_on = self.acr & ACR_DCEN != 0;
        if value & ACR_DCRST != 0 {
            if was_on {
                self.note("DCRST while the data cache is on: clear DCEN first");
            } else {
                self.cache_is_stale = false;
            }
        }
        if value & ACR_ICRST != 0 && self.acr & ACR_ICEN != 0 {
            self.note("ICRST while the instruction cache is on: clear ICEN first");
        }
        if !was_on && value & ACR_DCEN != 0 && self.cache_is_stale {
            self.note(
                "the data cache is switched on after an erase or a program without DCRST: it may give old contents",
            );
        }
        self.acr = value;
    }

    fn write_key(&mut self, value: u32) {
        if self.cr & CR_LOCK == 0 {
            self.note("KEYR written while CR is unlocked already");
            return;
        }
        self.keys = match self.keys {
            Keys::Given(n) if KEYS.get(n) == Some(&value) => Keys::Given(n + 1),
            _ => Keys::LockedOut,
        };
        if self.keys == Keys::LockedOut {
            self.note("wrong key: the flash stays locked until reset");
        } else if self.keys == Keys::Given(KEYS.len()) {
            self.keys = Keys::Given(0);
            self.cr &= !CR_LOCK;
        }
    }

    fn note(&mut self, text: impl Into<String>) {
        self.notes.push(text.into());
    }

    /// Says what is wrong with HCLK at `hz` in `range`, if something is.
    #[must_use]
    pub(crate) fn check(&self, hz: u64, range: VoltageRange) -> Option<String> {
        /// Clock errors of the oscillator must not count as overclocking.
        const TOLERANCE_HZ: u64 = 200_000;
        const MHZ: u64 = 1_000_000;
        let nominal = hz.saturating_sub(TOLERANCE_HZ);
        if nominal > range.max_hz() {
            return Some(format!(
                "HCLK is {} MHz, but {range:?} range allows {} MHz (PWR_CR5.R1MODE, PWR_CR1.VOS)",
                hz / MHZ,
                range.max_hz() / MHZ
            ));
        }
        let needed = nominal / range.hz_per_wait_state();
        let set = u64::from(self.acr & ACR_LATENCY);
        (set < needed).then(|| {
            format!(
                "HCLK is {} MHz with {set} flash wait states, {needed} are needed (FLASH_ACR.LATENCY)",
                hz / MHZ
            )
        })
    }
}

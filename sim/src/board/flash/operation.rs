//! Erasing and programming: the sequences that the registers ask for
//! (RM0440, 3.3.5 .. 3.3.8) and what goes on behind BSY.

use std::ops::Range;

use super::array::{Array, DOUBLE_WORD, ERASED};
use super::bits::*;
use super::{BANK_BYTES, FLASH_BYTES, Flash};
use crate::time::Time;

/// Typical times of the data sheet (DS12288, flash memory characteristics).
pub(super) const PROGRAM: Time = Time::from_ns(81_690);
pub(super) const ERASE: Time = Time::from_us(22_020);
/// Pages in a bank, and in the whole flash where it is one bank.
const PAGES: u32 = 128;

#[derive(Debug, Clone, PartialEq, Eq)]
enum Kind {
    Program { cell: u32, value: u64 },
    Erase { cells: Range<u32> },
}

/// What is under way.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Operation {
    kind: Kind,
    until: Time,
}

impl Operation {
    pub(super) const fn until(&self) -> Time {
        self.until
    }

    /// The double words that change.
    pub(super) fn cells(&self) -> Range<u32> {
        match &self.kind {
            Kind::Program { cell, .. } => *cell..cell + 1,
            Kind::Erase { cells } => cells.clone(),
        }
    }

    pub(super) fn offset(&self) -> u32 {
        self.cells().start * DOUBLE_WORD
    }

    /// Puts what the flash will hold over the `bytes` read from `offset`.
    pub(super) fn show(&self, offset: u32, bytes: &mut [u8]) {
        let cells = self.cells();
        let value = match self.kind {
            Kind::Program { value, .. } => value,
            Kind::Erase { .. } => ERASED,
        };
        let value = value.to_le_bytes();
        for (at, byte) in (offset..).zip(bytes) {
            if cells.contains(&(at / DOUBLE_WORD)) {
                *byte = value[(at % DOUBLE_WORD) as usize];
            }
        }
    }

    /// It was cut.
    pub(super) fn tear(self, array: &mut Array) {
        match self.kind {
            Kind::Program { cell, value } => array.tear_program(cell, value),
            Kind::Erase { cells } => array.tear_erase(cells),
        }
    }
}

impl Flash {
    /// When the operation that is under way ends.
    pub(crate) fn next_event(&self) -> Option<Time> {
        self.operation.as_ref().map(Operation::until)
    }

    /// Ends what has come to its end.
    pub(crate) fn advance(&mut self, now: Time) {
        let Some(operation) = self.operation.take_if(|operation| operation.until <= now) else {
            return;
        };
        match operation.kind {
            Kind::Program { cell, value } => {
                self.array.program(cell, value);
                self.figures.programmed += 1;
            }
            Kind::Erase { cells } => {
                self.array.erase(cells);
                self.figures.erased += 1;
            }
        }
        self.cr &= !CR_STRT;
        self.cache_is_stale = true;
        if self.cr & CR_EOPIE != 0 {
            self.sr |= SR_EOP;
        }
    }

    fn start(&mut self, kind: Kind, until: Time) {
        if self.is_dual() && self.acr & ACR_DCEN != 0 {
            self.note(
                "erase or program with the data cache on: reads from the other bank may corrupt it (ES0430, 2.2.2); clear ACR.DCEN before, set DCRST after",
            );
        }
        self.operation = Some(Operation { kind, until });
    }

    /// Refuses an operation with an error flag, and says why.
    fn refuse(&mut self, flag: u32, text: impl Into<String>) {
        self.sr |= flag;
        if self.cr & CR_ERRIE != 0 {
            self.sr |= SR_OPERR;
        }
        self.first_half = None;
        self.note(text);
    }

    /// Whether the flags of an earlier operation stand in the way.
    fn refuses_for_old_errors(&mut self) -> bool {
        let old = self.sr & SR_PROGRAM_ERRORS;
        if old != 0 {
            let text = format!(
                "erase or program while SR still shows the errors 0x{old:x} of an earlier one: PGSERR; clear them first"
            );
            self.refuse(SR_PGSERR, text);
        }
        old != 0
    }

    pub(super) fn write_cr(&mut self, value: u32, now: Time) {
        if self.cr & CR_LOCK != 0 {
            self.note("CR written while locked: ignored");
            return;
        }
        if self.operation.is_some() {
            self.note("CR written while BSY is set: ignored; wait for the operation to end");
            return;
        }
        if value & CR_UNMODELLED != 0 {
            self.note("mass erase, fast programming and option bytes are not modelled");
        }
        if value & CR_PG == 0 {
            self.first_half = None;
        }
        // OPTLOCK is cleared by its own keys only.
        self.cr = value & !CR_UNMODELLED & !CR_STRT | CR_OPTLOCK;
        if value & CR_STRT != 0 {
            self.start_erase(now);
        }
    }

    fn start_erase(&mut self, now: Time) {
        if self.refuses_for_old_errors() {
            return;
        }
        if self.cr & CR_PER == 0 || self.cr & CR_PG != 0 {
            self.refuse(
                SR_PGSERR,
                "STRT without PER, or with PG: PGSERR; nothing is erased",
            );
            return;
        }
        let page = self.cr >> CR_PNB_SHIFT & CR_PNB;
        let second = self.cr & CR_BKER != 0;
        if second && !self.is_dual() {
            self.note("BKER is set, but the flash is one bank (OPTR.DBANK = 0): it has no effect");
        }
        let (base, size) = if self.is_dual() {
            (if second { BANK_BYTES } else { 0 }, BANK_BYTES / PAGES)
        } else {
            (0, FLASH_BYTES / PAGES)
        };
        let at = base + page * size;
        if self.is_protected(at) {
            let text = format!("erase of page {page}, which the option bytes protect: WRPERR");
            self.refuse(SR_WRPERR, text);
            return;
        }
        self.cr |= CR_STRT;
        let cells = at / DOUBLE_WORD..(at + size) / DOUBLE_WORD;
        self.start(Kind::Erase { cells }, now + ERASE);
    }

    fn is_protected(&self, offset: u32) -> bool {
        // With one bank, the areas of both registers count its pages.
        let (page, areas) = if self.is_dual() {
            let bank = offset / BANK_BYTES;
            let page = offset % BANK_BYTES / (BANK_BYTES / PAGES);
            let areas = if bank == 0 { 0..2 } else { 2..4 };
            (page, areas)
        } else {
            (offset / (FLASH_BYTES / PAGES), 0..4)
        };
        self.protection[areas].iter().any(|area| {
            let (start, end) = (area & WRP_PAGE, area >> WRP_END_SHIFT & WRP_PAGE);
            (start..=end).contains(&page)
        })
    }

    /// A write to the flash itself, of `bytes` at `offset`.
    pub(crate) fn write_memory(&mut self, offset: u32, bytes: &[u8], now: Time) {
        if self.operation.is_some() {
            self.refuse(
                SR_PGSERR,
                "write to the flash while BSY is set: PGSERR; wait for the operation to end",
            );
            return;
        }
        if self.cr & CR_PG == 0 {
            self.refuse(
                SR_PGSERR,
                "write to the flash without CR.PG (a stray pointer?): PGSERR; nothing is stored",
            );
            return;
        }
        let Ok(word) = bytes.try_into().map(u32::from_le_bytes) else {
            let text = format!(
                "write of {} bytes to the flash: SIZERR; it takes words, two make a double word",
                bytes.len()
            );
            self.refuse(SR_SIZERR, text);
            return;
        };
        if self.refuses_for_old_errors() {
            return;
        }
        match self.first_half {
            None if offset.is_multiple_of(DOUBLE_WORD) => self.first_half = Some((offset, word)),
            Some((first, low)) if offset == first + DOUBLE_WORD / 2 => {
                self.first_half = None;
                let value = u64::from(word) << u32::BITS | u64::from(low);
                self.program(first, value, now);
            }
            _ => self.refuse(
                SR_PGAERR,
                "the two words are not the lower and the upper one of a double word: PGAERR",
            ),
        }
    }

    fn program(&mut self, offset: u32, value: u64, now: Time) {
        let cell = offset / DOUBLE_WORD;
        if self.is_protected(offset) {
            self.refuse(
                SR_WRPERR,
                "program of a page that the option bytes protect: WRPERR",
            );
            return;
        }
        if self.array.value(cell) != ERASED && value != 0 {
            let text = format!(
                "program of the double word at 0x{offset:05x} of the flash, which is not erased: PROGERR"
            );
            self.refuse(SR_PROGERR, text);
            return;
        }
        if self.array.is_written(cell) && value != 0 {
            let text = format!(
                "program of the double word at 0x{offset:05x} of the flash, which looks erased but was touched since its last complete erase: it becomes unreadable"
            );
            self.note(text);
        }
        self.start(Kind::Program { cell, value }, now + PROGRAM);
    }
}

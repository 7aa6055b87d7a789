//! The flash as the core sees it: accesses that wait, notes with their place.

use super::super::flash::{BankContents, Flash, FlashFigures};
use super::{Access, DiagnosticKind, Soc};

impl Soc {
    /// The flash and its interface.
    pub(crate) const fn flash(&self) -> &Flash {
        &self.flash
    }

    /// Puts bytes into the flash, as a programmer does; false if they do not
    /// fit.
    pub(crate) fn load_flash(&mut self, offset: u32, bytes: &[u8]) -> bool {
        self.flash.load(offset, bytes)
    }

    /// What bank 2 holds.
    pub(crate) fn bank2(&self) -> BankContents {
        self.flash.bank2()
    }

    pub(crate) const fn flash_figures(&self) -> FlashFigures {
        self.flash.figures()
    }

    /// Forgets what has been counted of the flash.
    pub(crate) const fn clear_flash_figures(&mut self) {
        self.flash.clear_figures();
    }

    /// Reads the flash. For how many cycles the access waits.
    pub(crate) fn read_flash(&mut self, offset: u32, bytes: &mut [u8], access: Access) -> u64 {
        self.flash.advance(self.clock.time_of(access.cycle));
        let Some(until) = self.flash.read_memory(offset, bytes) else {
            return 0;
        };
        self.clock.cycle_at(until).saturating_sub(access.cycle)
    }

    /// The core waited for the flash.
    pub(crate) const fn note_flash_stall(&mut self, cycles: u64) {
        self.flash.note_stall(cycles);
    }

    /// Writes to the flash itself, not to a register.
    pub(crate) fn write_flash(&mut self, offset: u32, bytes: &[u8], access: Access) {
        let now = self.clock.time_of(access.cycle);
        self.flash.advance(now);
        self.flash.write_memory(offset, bytes, now);
        self.note_flash(access);
    }

    /// Writes a register of FLASH; false where there is none.
    pub(super) fn write_flash_register(&mut self, offset: u32, value: u32, access: Access) -> bool {
        let now = self.clock.time_of(access.cycle);
        self.flash.advance(now);
        let known = self.flash.write(offset, value, now);
        self.note_flash(access);
        self.check_clocks(access);
        known
    }

    /// Reads a register of FLASH; `None` where there is none.
    pub(super) fn read_flash_register(&mut self, offset: u32, access: Access) -> Option<u32> {
        self.flash.advance(self.clock.time_of(access.cycle));
        self.flash.read(offset)
    }

    fn note_flash(&mut self, access: Access) {
        for text in self.flash.take_notes() {
            self.note(access, DiagnosticKind::Flash, format!("FLASH: {text}"));
        }
    }

    /// Whether the error correction has just given up on a double word.
    pub(crate) const fn take_nmi(&mut self) -> bool {
        self.flash.take_nmi()
    }
}

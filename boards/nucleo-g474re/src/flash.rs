//! Bank 2 of the flash as storage, while the program runs on in bank 1.
//!
//! An operation is started and then polled: a page erase takes some 22 ms, a
//! double word some 82 us (DS12288), and nothing waits meanwhile but a read of
//! bank 2. [`embedded_storage::nor_flash::NorFlash`] is there for code that has
//! nothing better to do than to wait; it belongs into the lowest task. No
//! interrupt is held off at any time.
//!
//! While an operation runs the data cache is off, since the other bank is read
//! all the while (errata sheet ES0430, 2.2.2: data cache might be corrupted
//! during flash memory read-while-write operation): constants and literals then
//! cost their wait states.

use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::asm;
use cortex_m_rt::exception;
use embedded_storage::nor_flash::{
    self, ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use stm32g4xx_hal::pac;

/// What is erased at once, in bytes.
pub const PAGE_BYTES: usize = 2048;
/// Pages of the bank.
pub const PAGES: u8 = 128;
/// What is programmed at once, in bytes.
pub const WORD_BYTES: usize = 8;
/// The bank, in bytes.
pub const BYTES: usize = PAGE_BYTES * PAGES as usize;

/// Where bank 2 begins (RM0440, 3.3.1, dual bank).
const BANK_2: usize = 0x0804_0000;
/// Flash size register, in KiB (RM0440, 47.2).
const FLASH_SIZE: *const u16 = 0x1FFF_75E0 as *const u16;
/// Of the STM32G474RE; smaller parts have their bank 2 elsewhere.
const EXPECTED_KIB: u16 = 512;
/// Unlock CR (RM0440, 3.3.5).
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

const SR_PROGERR: u32 = 1 << 3;
const SR_WRPERR: u32 = 1 << 4;
/// OPERR, PROGERR, WRPERR, PGAERR, SIZERR, PGSERR, MISERR, FASTERR, RDERR.
const SR_ERRORS: u32 = 1 << 1 | 0b111_1111 << 3 | 1 << 14;
const ECCR_BANK: u32 = 1 << 21;
const ECCR_ECCIE: u32 = 1 << 24;
const ECCR_ECCD: u32 = 1 << 31;

/// The error correction has given up on a double word of bank 2.
static UNREADABLE: AtomicBool = AtomicBool::new(false);

/// Why nothing can be stored on this board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unavailable {
    /// Option bit DBANK is 0: an erase would stop the program for its 22 ms.
    SingleBank,
    /// Another part than the one on the board: so many KiB of flash.
    Size(u16),
}

impl core::fmt::Display for Unavailable {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::SingleBank => {
                f.write_str("the flash is one bank; set option bit DBANK, then flash again")
            }
            Self::Size(kib) => write!(f, "{kib} KiB of flash, {EXPECTED_KIB} are expected"),
        }
    }
}

impl core::error::Error for Unavailable {}

/// Why an access did not do what it should.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FlashError {
    /// Outside bank 2.
    OutOfBounds,
    /// Not whole pages, or not whole double words.
    NotAligned,
    /// An operation is still under way: poll first.
    Busy,
    /// CR stays locked until the next reset.
    Locked,
    /// Option bytes protect the page.
    Protected,
    /// The double word was programmed already.
    NotErased,
    /// The error correction gives up: programming was cut there.
    Unreadable,
    /// Anything else, as the status register tells it.
    Refused(u32),
}

impl core::fmt::Display for FlashError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::OutOfBounds => f.write_str("outside bank 2 of the flash"),
            Self::NotAligned => f.write_str("not whole pages or double words"),
            Self::Busy => f.write_str("an operation is under way; poll until it ends"),
            Self::Locked => f.write_str("the flash is locked until the next reset"),
            Self::Protected => f.write_str("the page is protected; clear WRP2AR and WRP2BR"),
            Self::NotErased => f.write_str("programmed before; erase the page first"),
            Self::Unreadable => f.write_str("unreadable, torn by a power cut; erase the page"),
            Self::Refused(status) => write!(f, "refused, FLASH_SR = {status:#x}"),
        }
    }
}

impl core::error::Error for FlashError {}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::NotAligned => NorFlashErrorKind::NotAligned,
            _ => NorFlashErrorKind::Other,
        }
    }
}

impl From<NorFlashErrorKind> for FlashError {
    fn from(kind: NorFlashErrorKind) -> Self {
        match kind {
            NorFlashErrorKind::NotAligned => Self::NotAligned,
            _ => Self::OutOfBounds,
        }
    }
}

/// Bank 2. Offsets count from its start.
pub struct Storage {
    registers: pac::FLASH,
    under_way: bool,
    /// Whether the data cache is to be switched on again.
    cache: bool,
}

/// Bank 2 as storage, if the flash is set to two banks.
pub(crate) fn setup(registers: pac::FLASH) -> Result<Storage, Unavailable> {
    // SAFETY: a read-only word of the system memory, there on every STM32G4.
    let kib = unsafe { FLASH_SIZE.read_volatile() };
    if kib != EXPECTED_KIB {
        return Err(Unavailable::Size(kib));
    }
    if registers.optr().read().dbank().bit_is_clear() {
        return Err(Unavailable::SingleBank);
    }
    Ok(Storage {
        registers,
        under_way: false,
        cache: false,
    })
}

impl Storage {
    /// Starts to erase page `page`, 0..=127. [`poll`](Self::poll) tells when it
    /// is done.
    ///
    /// # Errors
    /// [`FlashError::OutOfBounds`], [`FlashError::Busy`],
    /// [`FlashError::Locked`].
    pub fn start_erase(&mut self, page: u8) -> Result<(), FlashError> {
        if page >= PAGES {
            return Err(FlashError::OutOfBounds);
        }
        self.begin()?;
        let control = self.registers.cr();
        // SAFETY: any page number of seven bits is a page of bank 2, which no
        // code or constant lies in: the linker script gives the program bank 1.
        control.modify(|_, w| unsafe { w.per().set_bit().bker().set_bit().pnb().bits(page) });
        control.modify(|_, w| w.strt().set_bit());
        Ok(())
    }

    /// Starts to program the double word at `offset`, a multiple of 8, which
    /// was not programmed since its page was erased. [`poll`](Self::poll) tells
    /// when it is done.
    ///
    /// # Errors
    /// [`FlashError::OutOfBounds`], [`FlashError::NotAligned`],
    /// [`FlashError::Busy`], [`FlashError::Locked`].
    pub fn start_program(&mut self, offset: u32, word: [u8; WORD_BYTES]) -> Result<(), FlashError> {
        nor_flash::check_write(self, offset, WORD_BYTES)?;
        self.begin()?;
        self.registers.cr().modify(|_, w| w.pg().set_bit());
        asm::dsb();
        let [a, b, c, d, e, f, g, h] = word;
        let to = (BANK_2 + offset as usize) as *mut u32;
        // SAFETY: both words lie in bank 2 and are aligned (checked above); no
        // reference to it exists, reads are volatile; PG is set, so that the
        // write is a command to the flash interface.
        unsafe {
            to.write_volatile(u32::from_le_bytes([a, b, c, d]));
            // The lower word first, whatever the bus does.
            asm::isb();
            to.add(1).write_volatile(u32::from_le_bytes([e, f, g, h]));
        }
        asm::dsb();
        Ok(())
    }

    /// `None` while an operation is under way, then how it ended.
    pub fn poll(&mut self) -> Option<Result<(), FlashError>> {
        if !self.under_way {
            return Some(Ok(()));
        }
        let status = self.registers.sr().read();
        if status.bsy().bit_is_set() {
            return None;
        }
        let errors = status.bits() & SR_ERRORS;
        self.end();
        Some(match errors {
            0 => Ok(()),
            errors if errors & SR_WRPERR != 0 => Err(FlashError::Protected),
            errors if errors & SR_PROGERR != 0 => Err(FlashError::NotErased),
            errors => Err(FlashError::Refused(errors)),
        })
    }

    /// Unlocks the interface and switches the data cache off.
    fn begin(&mut self) -> Result<(), FlashError> {
        if self.under_way || self.registers.sr().read().bsy().bit_is_set() {
            return Err(FlashError::Busy);
        }
        self.clear_errors();
        if self.registers.cr().read().lock().bit_is_set() {
            for key in KEYS {
                // SAFETY: the sequence that the register is for.
                self.registers.keyr().write(|w| unsafe { w.bits(key) });
            }
            if self.registers.cr().read().lock().bit_is_set() {
                return Err(FlashError::Locked);
            }
        }
        let access = self.registers.acr();
        self.cache = access.read().dcen().bit_is_set();
        access.modify(|_, w| w.dcen().clear_bit());
        self.under_way = true;
        Ok(())
    }

    /// Locks the interface; the data cache starts afresh, since it may hold
    /// what is no longer true.
    fn end(&mut self) {
        self.clear_errors();
        let control = self.registers.cr();
        control.modify(|_, w| w.pg().clear_bit().per().clear_bit().bker().clear_bit());
        control.modify(|_, w| w.lock().set_bit());
        let access = self.registers.acr();
        access.modify(|_, w| w.dcrst().set_bit());
        access.modify(|_, w| w.dcrst().clear_bit());
        if self.cache {
            access.modify(|_, w| w.dcen().set_bit());
        }
        self.under_way = false;
    }

    fn clear_errors(&mut self) {
        // SAFETY: flags that are cleared by writing 1.
        self.registers.sr().write(|w| unsafe { w.bits(SR_ERRORS) });
    }

    fn wait(&mut self) -> Result<(), FlashError> {
        loop {
            if let Some(result) = self.poll() {
                return result;
            }
        }
    }
}

impl ErrorType for Storage {
    type Error = FlashError;
}

impl ReadNorFlash for Storage {
    const READ_SIZE: usize = 1;

    /// Refused while an operation is under way: the core would stand still
    /// until its end.
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        nor_flash::check_read(self, offset, bytes.len())?;
        if self.under_way {
            return Err(FlashError::Busy);
        }
        UNREADABLE.store(false, Ordering::Relaxed);
        let from = (BANK_2 + offset as usize) as *const u8;
        for (n, byte) in bytes.iter_mut().enumerate() {
            // SAFETY: within bank 2 (checked above); volatile, since the
            // interface changes it.
            *byte = unsafe { from.add(n).read_volatile() };
        }
        // The interrupt of a failed read has been taken behind these.
        asm::dsb();
        asm::isb();
        if UNREADABLE.load(Ordering::Relaxed) {
            return Err(FlashError::Unreadable);
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

/// Waits for the end of each operation.
impl NorFlash for Storage {
    const WRITE_SIZE: usize = WORD_BYTES;
    const ERASE_SIZE: usize = PAGE_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        nor_flash::check_erase(self, from, to)?;
        for at in (from..to).step_by(PAGE_BYTES) {
            self.start_erase((at as usize / PAGE_BYTES) as u8)?;
            self.wait()?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        nor_flash::check_write(self, offset, bytes.len())?;
        let (words, _) = bytes.as_chunks::<WORD_BYTES>();
        for (at, word) in (offset..).step_by(WORD_BYTES).zip(words) {
            self.start_program(at, *word)?;
            self.wait()?;
        }
        Ok(())
    }
}

/// The error correction gives up on a double word (RM0440, 3.3.3): in bank 2
/// one that a power cut tore, which the read then reports; in bank 1 the
/// program is damaged.
///
/// # Panics
///
/// If it is not bank 2: going on would run anything.
#[exception]
unsafe fn NonMaskableInt() {
    // SAFETY: of all registers only ECCR, which nobody else writes.
    let flash = unsafe { &*pac::FLASH::ptr() };
    let status = flash.eccr().read().bits();
    assert!(
        status & ECCR_ECCD != 0 && status & ECCR_BANK != 0,
        "non-maskable interrupt, FLASH_ECCR = {status:#x}: the program's flash is damaged, flash it again"
    );
    UNREADABLE.store(true, Ordering::Relaxed);
    // SAFETY: the flag is cleared by writing 1.
    flash
        .eccr()
        .write(|w| unsafe { w.bits(status & (ECCR_ECCIE | ECCR_ECCD)) });
}

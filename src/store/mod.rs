//! Settings that survive a power cut: a log in two pages of flash.
//!
//! A save appends a record behind the newest one, and goes on in the other page,
//! erased first, where there is no room. A record is written header first and
//! checksum last, and no page that holds the newest record is ever erased, so
//! that a power cut at any word or in any erase leaves the old set or the new
//! one. Flash words that a cut left half written are neither trusted nor written
//! again: they may be unreadable (ECC), and each word can be programmed only
//! once after an erase.

mod crc32;

use crate::sdo::AbortCode;
use crc32::Crc32;
use embedded_storage::nor_flash::{NorFlash, NorFlashError, NorFlashErrorKind};

/// The unit in which records are read and written: a flash word of the STM32G4
/// and a multiple of what most other flashes have.
const WORD: usize = 8;
/// The flash taken by one record.
const RECORD: usize = 512;
/// What a record carries at most: all but header and checksum.
pub const CAPACITY: usize = RECORD - 2 * WORD;
/// Marks a record, together with the version of its layout.
const MAGIC: u16 = 0xC301;
/// The bytes of erased flash.
const ERASED: u8 = 0xFF;
/// Where length and sequence number begin in the header.
const LENGTH_AT: u32 = 16;
const SEQUENCE_AT: u32 = 32;

/// Why a set of settings was not stored or read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum StoreError {
    /// The flash refused the access.
    Flash,
    /// The two pages are not two pages of this flash.
    Pages,
    /// More than [`CAPACITY`] bytes.
    TooLong {
        /// How many.
        len: usize,
    },
    /// What was written does not read back: the pages are worn out.
    Worn,
    /// The buffer is too short for the set that is stored.
    Buffer {
        /// How many bytes it takes.
        len: usize,
    },
}

impl core::fmt::Display for StoreError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            StoreError::Flash => {
                f.write_str("the flash refused the access; check its protection bits")
            }
            StoreError::Pages => f.write_str("the settings need two different pages of the flash"),
            StoreError::TooLong { len } => {
                write!(f, "{len} bytes of settings, at most {CAPACITY} fit")
            }
            StoreError::Worn => {
                f.write_str("the flash does not keep what is written; replace the board")
            }
            StoreError::Buffer { len } => write!(f, "the settings need a buffer of {len} bytes"),
        }
    }
}

impl core::error::Error for StoreError {}

/// What a client of 1010h is told.
impl From<StoreError> for AbortCode {
    fn from(error: StoreError) -> AbortCode {
        match error {
            StoreError::Flash | StoreError::Worn => AbortCode::HARDWARE,
            StoreError::TooLong { .. } => AbortCode::OUT_OF_MEMORY,
            StoreError::Pages | StoreError::Buffer { .. } => AbortCode::CANNOT_STORE,
        }
    }
}

/// A record that was found good.
#[derive(Clone, Copy, Debug)]
struct Newest {
    /// Where it begins.
    at: u32,
    sequence: u32,
    len: usize,
}

/// Stores one set of bytes, the newest, in two pages of a flash.
#[derive(Debug)]
pub struct Store<F> {
    flash: F,
    /// Where the two pages begin.
    pages: [u32; 2],
    newest: Option<Newest>,
}

impl<F: NorFlash> Store<F> {
    const PAGE: u32 = F::ERASE_SIZE as u32;
    const FITS: () = assert!(
        WORD.is_multiple_of(F::WRITE_SIZE)
            && WORD.is_multiple_of(F::READ_SIZE)
            && F::ERASE_SIZE.is_multiple_of(RECORD),
        "the flash has words that are too long or pages that are too short"
    );

    /// Looks for the newest good record in the pages that begin at `pages`.
    ///
    /// # Errors
    /// [`StoreError::Pages`] unless they are two different pages of the flash.
    pub fn new(flash: F, pages: [u32; 2]) -> Result<Store<F>, StoreError> {
        const { Self::FITS }
        let capacity = u32::try_from(flash.capacity()).unwrap_or(u32::MAX);
        let last = capacity.saturating_sub(Self::PAGE);
        let fits = |at: u32| at.is_multiple_of(Self::PAGE) && last >= at;
        let [a, b] = pages;
        if a == b || !fits(a) || !fits(b) {
            return Err(StoreError::Pages);
        }
        let mut store = Store {
            flash,
            pages,
            newest: None,
        };
        for page in pages {
            let mut at = page;
            while at < page + Self::PAGE {
                let found = store.check(at);
                let newer = |found: &Newest| {
                    store
                        .newest
                        .is_none_or(|newest| found.sequence >= newest.sequence)
                };
                if found.as_ref().is_some_and(newer) {
                    store.newest = found;
                }
                at += RECORD as u32;
            }
        }
        Ok(store)
    }

    /// The set stored last, or `None` if there is none yet.
    ///
    /// # Errors
    /// [`StoreError::Buffer`] if `buf` is too short, [`StoreError::Flash`] if it
    /// cannot be read any more.
    pub fn load<'b>(&mut self, buf: &'b mut [u8]) -> Result<Option<&'b [u8]>, StoreError> {
        let Some(newest) = self.newest else {
            return Ok(None);
        };
        let len = newest.len;
        let into = buf.get_mut(..len).ok_or(StoreError::Buffer { len })?;
        let mut at = newest.at;
        let mut word = [0; WORD];
        for part in into.chunks_mut(WORD) {
            at += WORD as u32;
            if !self.read(at, &mut word) {
                return Err(StoreError::Flash);
            }
            if let Some(word) = word.get(..part.len()) {
                part.copy_from_slice(word);
            }
        }
        Ok(Some(into))
    }

    /// Stores a set: afterwards it, and until then the old one, is what
    /// [`load`](Self::load) yields, whenever the power goes.
    ///
    /// Takes a few milliseconds, or some 25 ms where a page has to be erased.
    ///
    /// # Errors
    /// [`StoreError::TooLong`], [`StoreError::Worn`], [`StoreError::Flash`]; the
    /// old set is still stored.
    pub fn save(&mut self, data: &[u8]) -> Result<(), StoreError> {
        let len = data.len();
        if len > CAPACITY {
            return Err(StoreError::TooLong { len });
        }
        let (sequence, pages) = match self.newest {
            None => (1, self.pages),
            Some(newest) => {
                let sequence = newest.sequence.wrapping_add(1);
                let next = newest.at + RECORD as u32;
                let page = newest.at - newest.at % Self::PAGE;
                if self.append(next, page, sequence, data).is_ok() {
                    return Ok(());
                }
                // The page that holds the newest record stays.
                let [a, b] = self.pages;
                let other = if page == a { b } else { a };
                (sequence, [other; 2])
            }
        };
        let [first, second] = pages;
        self.refill(first, sequence, data)
            .or_else(|_| self.refill(second, sequence, data))
    }

    /// The flash, given back.
    pub fn release(self) -> F {
        self.flash
    }

    fn refill(&mut self, page: u32, sequence: u32, data: &[u8]) -> Result<(), StoreError> {
        let end = page + Self::PAGE;
        self.flash.erase(page, end).map_err(flash_error)?;
        self.append(page, page, sequence, data)
    }

    /// Writes the record into the first blank place of `page` from `at` on that
    /// keeps it.
    fn append(&mut self, at: u32, page: u32, sequence: u32, data: &[u8]) -> Result<(), StoreError> {
        let mut at = at;
        let mut result = Err(StoreError::Worn);
        while at < page + Self::PAGE {
            if self.is_blank(at) {
                result = self.write(at, sequence, data);
            }
            if result.is_ok() {
                let written = self.check(at);
                match written {
                    Some(new) if new.sequence == sequence && new.len == data.len() => {
                        self.newest = written;
                        return Ok(());
                    }
                    _ => result = Err(StoreError::Worn),
                }
            }
            at += RECORD as u32;
        }
        result
    }

    fn write(&mut self, at: u32, sequence: u32, data: &[u8]) -> Result<(), StoreError> {
        let words = data.len().div_ceil(WORD);
        let mut crc = Crc32::new();
        for n in 0..words + 2 {
            let word = match n.checked_sub(1) {
                None => header(data.len(), sequence).to_le_bytes(),
                Some(n) if n == words => trailer(crc.value()).to_le_bytes(),
                Some(n) => {
                    let mut word = [ERASED; WORD];
                    for (to, from) in word.iter_mut().zip(data.iter().skip(n * WORD)) {
                        *to = *from;
                    }
                    word
                }
            };
            crc.update(&word);
            let at = at + (n * WORD) as u32;
            self.flash.write(at, &word).map_err(flash_error)?;
        }
        Ok(())
    }

    /// The record in this place, if it is whole.
    fn check(&mut self, record: u32) -> Option<Newest> {
        let mut word = [0; WORD];
        if !self.read(record, &mut word) {
            return None;
        }
        let first = u64::from_le_bytes(word);
        let len = usize::from((first >> LENGTH_AT) as u16);
        if first as u16 != MAGIC || len > CAPACITY {
            return None;
        }
        let mut crc = Crc32::new();
        let mut at = record;
        // The last word read is the checksum.
        for _ in 0..=len.div_ceil(WORD) {
            crc.update(&word);
            at += WORD as u32;
            if !self.read(at, &mut word) {
                return None;
            }
        }
        (u64::from_le_bytes(word) == trailer(crc.value())).then_some(Newest {
            at: record,
            sequence: (first >> SEQUENCE_AT) as u32,
            len,
        })
    }

    fn is_blank(&mut self, at: u32) -> bool {
        let mut word = [0; WORD];
        (0..RECORD / WORD)
            .all(|n| self.read(at + (n * WORD) as u32, &mut word) && word == [ERASED; WORD])
    }

    /// Reads a word; `false` if it cannot be read, as one that a power cut tore.
    fn read(&mut self, at: u32, word: &mut [u8; WORD]) -> bool {
        self.flash.read(at, word).is_ok()
    }
}

const fn header(len: usize, sequence: u32) -> u64 {
    MAGIC as u64 | (len as u64) << LENGTH_AT | (sequence as u64) << SEQUENCE_AT
}

/// The checksum and its complement: neither erased nor cleared flash looks like
/// this.
const fn trailer(crc: u32) -> u64 {
    (!crc as u64) << u32::BITS | crc as u64
}

fn flash_error<E: NorFlashError>(error: E) -> StoreError {
    match error.kind() {
        NorFlashErrorKind::OutOfBounds | NorFlashErrorKind::NotAligned => StoreError::Pages,
        _ => StoreError::Flash,
    }
}

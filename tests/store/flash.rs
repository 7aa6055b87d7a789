//! A flash with 64-bit words that are programmed once after each erase, whose
//! power can be cut in the middle of every operation.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};

pub(crate) const PAGE: usize = 2048;
const WORD: usize = 8;
const PAGES: usize = 4;
const BLANK: [u8; WORD] = [0xFF; WORD];

/// In what a cut leaves the word that is being programmed, or the words of the
/// page that is being erased.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Torn {
    /// As before.
    Before,
    /// As it would have been.
    After,
    /// Bits of both.
    Mixed,
    /// The error correction gives up.
    Unreadable,
}

impl Torn {
    pub(crate) const ALL: [Torn; 4] = [Torn::Before, Torn::After, Torn::Mixed, Torn::Unreadable];
}

#[derive(Clone, Copy, Debug)]
enum Cell {
    Blank,
    Written([u8; WORD]),
    Unreadable,
}

#[derive(Debug)]
pub(crate) struct Flash {
    cells: Vec<Cell>,
    /// Whether a word has been touched since its erase, whatever it looks like.
    programmed: Vec<bool>,
    random: u64,
    operations: u32,
    erases: u32,
    cut: Option<(u32, Torn)>,
    off: bool,
}

impl Flash {
    pub(crate) fn new(seed: u64) -> Flash {
        let words = PAGES * PAGE / WORD;
        Flash {
            cells: vec![Cell::Blank; words],
            programmed: vec![false; words],
            random: seed | 1,
            operations: 0,
            erases: 0,
            cut: None,
            off: false,
        }
    }

    /// Cuts the power in the operation after the next `n`.
    pub(crate) fn cut_after(self, n: u32, torn: Torn) -> Flash {
        let cut = Some((self.operations + n, torn));
        Flash { cut, ..self }
    }

    pub(crate) fn power_on(self) -> Flash {
        Flash {
            off: false,
            cut: None,
            ..self
        }
    }

    /// Random content everywhere.
    pub(crate) fn filled(mut self) -> Flash {
        for n in 0..self.cells.len() {
            self.cells[n] = match self.next() % 4 {
                0 => Cell::Unreadable,
                1 => Cell::Blank,
                _ => Cell::Written(self.next().to_le_bytes()),
            };
            self.programmed[n] = true;
        }
        self
    }

    pub(crate) fn operations(&self) -> u32 {
        self.operations
    }

    pub(crate) fn erases(&self) -> u32 {
        self.erases
    }

    pub(crate) fn untouched_outside(&self, pages: &[u32]) -> bool {
        (0..PAGES)
            .filter(|page| !pages.contains(&((page * PAGE) as u32)))
            .all(|page| {
                let words = page * PAGE / WORD..(page + 1) * PAGE / WORD;
                self.programmed[words].iter().all(|programmed| !programmed)
            })
    }

    /// xorshift64
    fn next(&mut self) -> u64 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        self.random
    }

    /// How the operation that begins now is torn, if it is.
    fn begin(&mut self) -> Result<Option<Torn>, NorFlashErrorKind> {
        if self.off {
            return Err(NorFlashErrorKind::Other);
        }
        let torn = self.cut.filter(|(at, _)| *at == self.operations);
        self.operations += 1;
        self.off = torn.is_some();
        Ok(torn.map(|(_, torn)| torn))
    }

    fn end(&self) -> Result<(), NorFlashErrorKind> {
        if self.off {
            Err(NorFlashErrorKind::Other)
        } else {
            Ok(())
        }
    }

    fn bytes(&self, word: usize) -> [u8; WORD] {
        match self.cells[word] {
            Cell::Written(bytes) => bytes,
            _ => BLANK,
        }
    }

    fn mix(&mut self, a: [u8; WORD], b: [u8; WORD]) -> Cell {
        let mask = self.next();
        let (a, b) = (u64::from_le_bytes(a), u64::from_le_bytes(b));
        Cell::Written((a & mask | b & !mask).to_le_bytes())
    }
}

impl ErrorType for Flash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        for (n, byte) in bytes.iter_mut().enumerate() {
            let at = offset as usize + n;
            let cell = self.cells.get(at / WORD);
            *byte = match cell.ok_or(NorFlashErrorKind::OutOfBounds)? {
                Cell::Blank => 0xFF,
                Cell::Written(word) => word[at % WORD],
                Cell::Unreadable => return Err(NorFlashErrorKind::Other),
            };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        PAGES * PAGE
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        let (from, to) = (from as usize, to as usize);
        assert!(from.is_multiple_of(PAGE) && to == from + PAGE && to <= PAGES * PAGE);
        let torn = self.begin()?;
        for word in from / WORD..to / WORD {
            let old = self.bytes(word);
            match torn {
                None | Some(Torn::After) => self.cells[word] = Cell::Blank,
                Some(Torn::Before) => continue,
                Some(Torn::Mixed) => self.cells[word] = self.mix(old, BLANK),
                Some(Torn::Unreadable) => self.cells[word] = Cell::Unreadable,
            }
            // A page whose erase was cut has to be erased again, even if it
            // looks blank.
            self.programmed[word] = torn.is_some();
        }
        self.erases += 1;
        self.end()
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        assert!((offset as usize).is_multiple_of(WORD) && bytes.len().is_multiple_of(WORD));
        for (n, bytes) in bytes.chunks(WORD).enumerate() {
            let word = offset as usize / WORD + n;
            let new: [u8; WORD] = bytes.try_into().unwrap();
            let torn = self.begin()?;
            assert!(
                !std::mem::replace(&mut self.programmed[word], torn != Some(Torn::Before)),
                "the word at {offset:#X} is programmed twice"
            );
            match torn {
                None | Some(Torn::After) => self.cells[word] = Cell::Written(new),
                Some(Torn::Before) => {}
                Some(Torn::Mixed) => self.cells[word] = self.mix(BLANK, new),
                Some(Torn::Unreadable) => self.cells[word] = Cell::Unreadable,
            }
            self.end()?;
        }
        Ok(())
    }
}

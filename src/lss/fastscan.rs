//! Finding a node that nothing is known of, bit by bit (CiA 305, 3.11.3).

use super::address::{LssAddress, Part};
use super::command::Request;

/// `bitCheck` that makes all nodes start anew.
pub(super) const RESTART: u8 = 0x80;
const HIGHEST_BIT: u8 = 31;

/// How one number of the LSS address is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ScanPart {
    /// Bit by bit: 33 questions.
    Unknown,
    /// It is known and only confirmed: one question. Nodes with another number
    /// are left out.
    Known(u32),
}

/// The questions of one scan and what follows from the answers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fastscan {
    parts: [ScanPart; 4],
    found: LssAddress,
    at: Question,
}

#[derive(Clone, Copy, Debug)]
enum Question {
    /// Is there anybody?
    Anybody,
    /// Is this bit of this part 0?
    Bit(Part, u8),
    /// Is this the whole number?
    Confirm(Part),
}

/// What an answer, or its absence, leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    Continue,
    /// The node with this address is in configuration.
    Found(LssAddress),
    /// Nobody is without node-ID.
    Nobody,
    /// This number was not confirmed.
    Lost(Part),
}

impl Fastscan {
    pub(crate) const fn new(parts: [ScanPart; 4]) -> Fastscan {
        Fastscan {
            parts,
            found: LssAddress {
                vendor: 0,
                product: 0,
                revision: 0,
                serial: 0,
            },
            at: Question::Anybody,
        }
    }

    pub(crate) fn question(&self) -> Request {
        match self.at {
            Question::Anybody => Request::Fastscan {
                id: 0,
                bit: RESTART,
                sub: 0,
                next: 0,
            },
            Question::Bit(part, bit) => Request::Fastscan {
                id: self.found.part(part),
                bit,
                sub: part.position(),
                next: part.position(),
            },
            Question::Confirm(part) => Request::Fastscan {
                id: self.found.part(part),
                bit: 0,
                sub: part.position(),
                // After the last part the node enters configuration.
                next: part.next().map_or(0, Part::position),
            },
        }
    }

    pub(crate) fn answer(&mut self, yes: bool) -> Verdict {
        match (self.at, yes) {
            (Question::Anybody, false) => return Verdict::Nobody,
            (Question::Anybody, true) => self.begin(Part::Vendor),
            (Question::Bit(part, bit), yes) => {
                if !yes {
                    let number = self.found.part(part) | 1 << bit;
                    self.found.set(part, number);
                }
                self.at = match bit.checked_sub(1) {
                    Some(bit) => Question::Bit(part, bit),
                    None => Question::Confirm(part),
                };
            }
            (Question::Confirm(part), false) => return Verdict::Lost(part),
            (Question::Confirm(part), true) => match part.next() {
                Some(next) => self.begin(next),
                None => return Verdict::Found(self.found),
            },
        }
        Verdict::Continue
    }

    fn begin(&mut self, part: Part) {
        let known = self.parts.get(usize::from(part.position()));
        self.at = match known {
            Some(ScanPart::Known(number)) => {
                self.found.set(part, *number);
                Question::Confirm(part)
            }
            _ => Question::Bit(part, HIGHEST_BIT),
        };
    }
}

//! Finding a node that nothing is known of, bit by bit (CiA 305, 3.11.3).

use super::address::{LssAddress, Part};
use super::command::Request;

/// `bitCheck` that makes all nodes start anew.
pub(super) const RESTART: u8 = 0x80;
const BITS: u8 = 32;

/// The questions of one scan and what follows from the answers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fastscan {
    found: [u32; 4],
    part: Part,
    /// Bits of the part that are not known yet; 0: the whole number is to be
    /// confirmed; [`RESTART`]: is there anybody?
    left: u8,
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
    /// Nothing has been asked yet.
    pub(crate) const fn new() -> Fastscan {
        Fastscan {
            found: [0; 4],
            part: Part::Vendor,
            left: RESTART,
        }
    }

    pub(crate) fn question(&self) -> Request {
        let sub = self.part.position();
        Request::Fastscan {
            id: self.number(),
            bit: match self.left {
                RESTART => RESTART,
                left => left.saturating_sub(1),
            },
            sub,
            next: match self.left {
                // After the last part the node enters configuration.
                0 => (sub + 1) % Part::ALL.len() as u8,
                _ => sub,
            },
        }
    }

    /// Numbers that are `known` are only confirmed.
    pub(crate) fn answer(&mut self, yes: bool, known: impl FnOnce(Part) -> Option<u32>) -> Verdict {
        self.part = match (self.left, yes) {
            (RESTART, false) => return Verdict::Nobody,
            (RESTART, true) => Part::Vendor,
            (0, false) => return Verdict::Lost(self.part),
            (0, true) => match self.part.next() {
                Some(next) => next,
                None => return Verdict::Found(LssAddress::from(self.found)),
            },
            (_, yes) => {
                self.left -= 1;
                if !yes {
                    self.set(self.number() | 1 << self.left);
                }
                return Verdict::Continue;
            }
        };
        self.left = BITS;
        if let Some(number) = known(self.part) {
            self.set(number);
            self.left = 0;
        }
        Verdict::Continue
    }

    fn number(&self) -> u32 {
        let found = self.found.get(usize::from(self.part.position()));
        found.copied().unwrap_or_default()
    }

    fn set(&mut self, number: u32) {
        if let Some(found) = self.found.get_mut(usize::from(self.part.position())) {
            *found = number;
        }
    }
}

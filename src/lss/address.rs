//! The LSS address of a node (CiA 305, 3.2).

use crate::words::in_words;

/// One of the four numbers of an LSS address.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Part {
    /// 1018h:01
    Vendor,
    /// 1018h:02
    Product,
    /// 1018h:03
    Revision,
    /// 1018h:04
    Serial,
}

impl Part {
    /// All of them in their order.
    pub const ALL: [Part; 4] = [Part::Vendor, Part::Product, Part::Revision, Part::Serial];

    /// The position, 0..=3, as fastscan counts.
    pub const fn position(self) -> u8 {
        self as u8
    }

    /// The part at `position`.
    pub fn at(position: u8) -> Option<Part> {
        Part::ALL.get(usize::from(position)).copied()
    }

    /// The part after this one.
    pub fn next(self) -> Option<Part> {
        Part::at(self.position() + 1)
    }
}

/// What tells a node from every other: the identity object 1018h.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct LssAddress {
    /// 1018h:01
    pub vendor: u32,
    /// 1018h:02
    pub product: u32,
    /// 1018h:03
    pub revision: u32,
    /// 1018h:04
    pub serial: u32,
}

impl LssAddress {
    /// One of the numbers.
    pub const fn part(&self, part: Part) -> u32 {
        match part {
            Part::Vendor => self.vendor,
            Part::Product => self.product,
            Part::Revision => self.revision,
            Part::Serial => self.serial,
        }
    }
}

impl From<[u32; 4]> for LssAddress {
    /// The numbers in their order.
    fn from([vendor, product, revision, serial]: [u32; 4]) -> LssAddress {
        LssAddress {
            vendor,
            product,
            revision,
            serial,
        }
    }
}

in_words!(LssAddress {
    LssAddress { vendor, product, revision, serial } => (
        "vendor {:08X}h, product {:08X}h, revision {:08X}h, serial {:08X}h",
        vendor, product, revision, serial
    ),
});

//! The standard table of bit rates (CiA 305, 3.9.3).

/// A bit rate of the standard table, table selector 0. Unknown indices survive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[expect(missing_docs, reason = "the names say it")]
pub enum BitRate {
    Kbit1000,
    Kbit800,
    Kbit500,
    Kbit250,
    Kbit125,
    Kbit50,
    Kbit20,
    Kbit10,
    /// Detected by the node itself.
    Automatic,
    Other(u8),
}

impl BitRate {
    /// The table selector of the standard table.
    pub const STANDARD_TABLE: u8 = 0;

    /// The index in the table.
    pub const fn index(self) -> u8 {
        match self {
            BitRate::Kbit1000 => 0,
            BitRate::Kbit800 => 1,
            BitRate::Kbit500 => 2,
            BitRate::Kbit250 => 3,
            BitRate::Kbit125 => 4,
            BitRate::Kbit50 => 6,
            BitRate::Kbit20 => 7,
            BitRate::Kbit10 => 8,
            BitRate::Automatic => 9,
            BitRate::Other(index) => index,
        }
    }

    /// The bit rate with this index; 5 is reserved.
    pub const fn from_index(index: u8) -> BitRate {
        match index {
            0 => BitRate::Kbit1000,
            1 => BitRate::Kbit800,
            2 => BitRate::Kbit500,
            3 => BitRate::Kbit250,
            4 => BitRate::Kbit125,
            6 => BitRate::Kbit50,
            7 => BitRate::Kbit20,
            8 => BitRate::Kbit10,
            9 => BitRate::Automatic,
            index => BitRate::Other(index),
        }
    }

    /// In bit/s; `None` for automatic and unknown ones.
    pub const fn bits_per_second(self) -> Option<u32> {
        let kbit = match self {
            BitRate::Kbit1000 => 1000,
            BitRate::Kbit800 => 800,
            BitRate::Kbit500 => 500,
            BitRate::Kbit250 => 250,
            BitRate::Kbit125 => 125,
            BitRate::Kbit50 => 50,
            BitRate::Kbit20 => 20,
            BitRate::Kbit10 => 10,
            BitRate::Automatic | BitRate::Other(_) => return None,
        };
        Some(kbit * 1000)
    }
}

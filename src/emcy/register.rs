//! The error register (CiA 301, 7.5.2.2).

use crate::words::in_words;
use core::fmt;

/// The error register, object 1001h (CiA 301, 7.5.2.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ErrorRegister(pub u8);

impl ErrorRegister {
    /// Some error is present.
    pub const GENERIC: ErrorRegister = ErrorRegister(0x01);
    /// Current.
    pub const CURRENT: ErrorRegister = ErrorRegister(0x02);
    /// Voltage.
    pub const VOLTAGE: ErrorRegister = ErrorRegister(0x04);
    /// Temperature.
    pub const TEMPERATURE: ErrorRegister = ErrorRegister(0x08);
    /// Communication: overrun, error state.
    pub const COMMUNICATION: ErrorRegister = ErrorRegister(0x10);
    /// As the device profile has it.
    pub const PROFILE: ErrorRegister = ErrorRegister(0x20);
    /// Always 0.
    pub const RESERVED: ErrorRegister = ErrorRegister(0x40);
    /// As the manufacturer has it.
    pub const MANUFACTURER: ErrorRegister = ErrorRegister(0x80);

    /// Whether all bits of `other` are set.
    pub const fn contains(self, other: ErrorRegister) -> bool {
        self.0 & other.0 == other.0
    }

    /// The bits of both.
    pub const fn union(self, other: ErrorRegister) -> ErrorRegister {
        ErrorRegister(self.0 | other.0)
    }

    /// The bits that are set.
    fn bits(self) -> impl Iterator<Item = Bit> {
        let all = (0..u8::BITS as u8).map(Bit);
        all.filter(move |bit| self.0 & 1 << bit.0 != 0)
    }
}

impl fmt::Display for ErrorRegister {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for bit in self.bits() {
            write!(f, "{separator}{bit}")?;
            separator = ", ";
        }
        match separator {
            "" => f.write_str("no error"),
            _ => Ok(()),
        }
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for ErrorRegister {
    fn format(&self, f: defmt::Formatter<'_>) {
        let mut any = false;
        for bit in self.bits() {
            if any {
                defmt::write!(f, ", ");
            }
            any = true;
            defmt::write!(f, "{}", bit);
        }
        if !any {
            defmt::write!(f, "no error");
        }
    }
}

/// A bit by its number.
#[derive(Clone, Copy)]
struct Bit(u8);

impl Bit {
    #[cfg(feature = "defmt")]
    const fn number(&self) -> u8 {
        self.0
    }
}

in_words!(Bit by Bit::number {
    Bit(0) => ("generic"),
    Bit(1) => ("current"),
    Bit(2) => ("voltage"),
    Bit(3) => ("temperature"),
    Bit(4) => ("communication"),
    Bit(5) => ("device profile"),
    Bit(6) => ("reserved"),
    _ => ("manufacturer"),
});

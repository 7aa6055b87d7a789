//! The error register (CiA 301, 7.5.2.2).

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

    const NAMES: [(ErrorRegister, &'static str); 8] = [
        (ErrorRegister::GENERIC, "generic"),
        (ErrorRegister::CURRENT, "current"),
        (ErrorRegister::VOLTAGE, "voltage"),
        (ErrorRegister::TEMPERATURE, "temperature"),
        (ErrorRegister::COMMUNICATION, "communication"),
        (ErrorRegister::PROFILE, "device profile"),
        (ErrorRegister::RESERVED, "reserved"),
        (ErrorRegister::MANUFACTURER, "manufacturer"),
    ];

    /// Whether all bits of `other` are set.
    pub const fn contains(self, other: ErrorRegister) -> bool {
        self.0 & other.0 == other.0
    }

    /// The bits of both.
    pub const fn union(self, other: ErrorRegister) -> ErrorRegister {
        ErrorRegister(self.0 | other.0)
    }
}

impl fmt::Display for ErrorRegister {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0 == 0 {
            return f.write_str("no error");
        }
        let set = ErrorRegister::NAMES
            .iter()
            .filter(|(bit, _)| self.contains(*bit));
        for (i, (_, name)) in set.enumerate() {
            let separator = if i == 0 { "" } else { ", " };
            write!(f, "{separator}{name}")?;
        }
        Ok(())
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for ErrorRegister {
    fn format(&self, f: defmt::Formatter<'_>) {
        if self.0 == 0 {
            defmt::write!(f, "no error");
        } else {
            defmt::write!(f, "{}", BitsFrom(self.0, 0));
        }
    }
}

/// The set bits of a register from the one with this number on.
#[cfg(feature = "defmt")]
struct BitsFrom(u8, u8);

#[cfg(feature = "defmt")]
impl defmt::Format for BitsFrom {
    fn format(&self, f: defmt::Formatter<'_>) {
        let BitsFrom(register, first) = *self;
        let Some(bit) = (first..8).find(|bit| register & (1 << bit) != 0) else {
            return defmt::write!(f, "");
        };
        let name = match bit {
            0 => defmt::intern!("generic"),
            1 => defmt::intern!("current"),
            2 => defmt::intern!("voltage"),
            3 => defmt::intern!("temperature"),
            4 => defmt::intern!("communication"),
            5 => defmt::intern!("device profile"),
            6 => defmt::intern!("reserved"),
            _ => defmt::intern!("manufacturer"),
        };
        let rest = BitsFrom(register, bit + 1);
        if register >> bit > 1 {
            defmt::write!(f, "{=istr}, {}", name, rest);
        } else {
            defmt::write!(f, "{=istr}", name);
        }
    }
}

//! Objects of a dictionary: where, of which type, with which access
//! (CiA 301, 7.4).

use std::fmt;

/// Index and sub-index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address {
    /// The index.
    pub index: u16,
    /// The sub-index.
    pub sub: u8,
}

impl Address {
    /// The entry `sub` of the object `index`.
    pub const fn new(index: u16, sub: u8) -> Address {
        Address { index, sub }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h:{:02X}", self.index, self.sub)
    }
}

/// A data type of the standard (CiA 301, 7.4.7, table 44).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DataType {
    /// BOOLEAN
    Boolean,
    /// INTEGER of so many bits.
    Integer(u8),
    /// UNSIGNED of so many bits.
    Unsigned(u8),
    /// REAL of so many bits.
    Real(u8),
    /// VISIBLE_STRING
    VisibleString,
    /// OCTET_STRING
    OctetString,
    /// UNICODE_STRING
    UnicodeString,
    /// TIME_OF_DAY
    TimeOfDay,
    /// TIME_DIFFERENCE
    TimeDifference,
    /// DOMAIN
    Domain,
    /// A code that the standard does not have for simple types.
    Other(u16),
}

/// Codes of the types of fixed size that are numbers.
const NUMBERS: [(u16, DataType); 19] = [
    (0x01, DataType::Boolean),
    (0x02, DataType::Integer(8)),
    (0x03, DataType::Integer(16)),
    (0x04, DataType::Integer(32)),
    (0x05, DataType::Unsigned(8)),
    (0x06, DataType::Unsigned(16)),
    (0x07, DataType::Unsigned(32)),
    (0x08, DataType::Real(32)),
    (0x10, DataType::Integer(24)),
    (0x11, DataType::Real(64)),
    (0x12, DataType::Integer(40)),
    (0x13, DataType::Integer(48)),
    (0x14, DataType::Integer(56)),
    (0x15, DataType::Integer(64)),
    (0x16, DataType::Unsigned(24)),
    (0x18, DataType::Unsigned(40)),
    (0x19, DataType::Unsigned(48)),
    (0x1A, DataType::Unsigned(56)),
    (0x1B, DataType::Unsigned(64)),
];
/// Codes of the others.
const OTHERS: [(u16, DataType); 6] = [
    (0x09, DataType::VisibleString),
    (0x0A, DataType::OctetString),
    (0x0B, DataType::UnicodeString),
    (0x0C, DataType::TimeOfDay),
    (0x0D, DataType::TimeDifference),
    (0x0F, DataType::Domain),
];
const TIME_BITS: u8 = 48;

impl DataType {
    /// The type with this code.
    pub fn from_code(code: u16) -> DataType {
        NUMBERS
            .iter()
            .chain(&OTHERS)
            .find(|(known, _)| *known == code)
            .map_or(DataType::Other(code), |(_, data_type)| *data_type)
    }

    /// The code.
    pub fn code(self) -> u16 {
        if let DataType::Other(code) = self {
            return code;
        }
        NUMBERS
            .iter()
            .chain(&OTHERS)
            .find(|(_, known)| *known == self)
            .map_or(0, |(code, _)| *code)
    }

    /// The length in bits; `None` where it varies.
    pub fn bits(self) -> Option<u8> {
        match self {
            DataType::Boolean => Some(1),
            DataType::Integer(bits) | DataType::Unsigned(bits) | DataType::Real(bits) => Some(bits),
            DataType::TimeOfDay | DataType::TimeDifference => Some(TIME_BITS),
            _ => None,
        }
    }

    /// Whether values are negative, too.
    pub fn is_signed(self) -> bool {
        matches!(self, DataType::Integer(_))
    }

    /// The lowest and highest value; `None` for what is not a whole number.
    pub fn range(self) -> Option<(i128, i128)> {
        match self {
            DataType::Boolean => Some((0, 1)),
            DataType::Unsigned(bits) => Some((0, (1 << bits) - 1)),
            DataType::Integer(bits) => Some((-(1 << (bits - 1)), (1 << (bits - 1)) - 1)),
            _ => None,
        }
    }
}

impl fmt::Display for DataType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DataType::Boolean => f.write_str("BOOLEAN"),
            DataType::Integer(bits) => write!(f, "INTEGER{bits}"),
            DataType::Unsigned(bits) => write!(f, "UNSIGNED{bits}"),
            DataType::Real(bits) => write!(f, "REAL{bits}"),
            DataType::VisibleString => f.write_str("VISIBLE_STRING"),
            DataType::OctetString => f.write_str("OCTET_STRING"),
            DataType::UnicodeString => f.write_str("UNICODE_STRING"),
            DataType::TimeOfDay => f.write_str("TIME_OF_DAY"),
            DataType::TimeDifference => f.write_str("TIME_DIFFERENCE"),
            DataType::Domain => f.write_str("DOMAIN"),
            DataType::Other(code) => write!(f, "data type {code:04X}h"),
        }
    }
}

/// Access of an entry as an EDS has it (CiA 306, AccessType).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// `ro`
    ReadOnly,
    /// `wo`
    WriteOnly,
    /// `rw`
    ReadWrite,
    /// `rwr`: read and write, process input: the device transmits it.
    ReadWriteRead,
    /// `rww`: read and write, process output: the device receives it.
    ReadWriteWrite,
    /// `const`
    Constant,
}

/// The words of an EDS.
const ACCESS: [(&str, Access); 6] = [
    ("ro", Access::ReadOnly),
    ("wo", Access::WriteOnly),
    ("rw", Access::ReadWrite),
    ("rwr", Access::ReadWriteRead),
    ("rww", Access::ReadWriteWrite),
    ("const", Access::Constant),
];

impl Access {
    /// The access of this name, in upper or lower case.
    pub fn from_word(word: &str) -> Option<Access> {
        ACCESS
            .iter()
            .find(|(known, _)| known.eq_ignore_ascii_case(word))
            .map(|(_, access)| *access)
    }

    /// The word.
    pub fn word(self) -> &'static str {
        ACCESS
            .iter()
            .find(|(_, access)| *access == self)
            .map_or("", |(word, _)| word)
    }

    /// Whether an SDO client may write it.
    pub fn is_writable(self) -> bool {
        !matches!(self, Access::ReadOnly | Access::Constant)
    }

    /// Whether a mappable entry may be in a PDO of this direction.
    pub fn allows(self, direction: Direction) -> bool {
        match direction {
            Direction::Receive => matches!(
                self,
                Access::WriteOnly | Access::ReadWrite | Access::ReadWriteWrite
            ),
            Direction::Transmit => !matches!(self, Access::WriteOnly | Access::ReadWriteWrite),
        }
    }
}

/// Whether a node receives or transmits a PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Direction {
    /// RPDO
    Receive,
    /// TPDO
    Transmit,
}

impl Direction {
    /// `RPDO` or `TPDO`.
    pub fn word(self) -> &'static str {
        match self {
            Direction::Receive => "RPDO",
            Direction::Transmit => "TPDO",
        }
    }

    /// First index of the communication parameters (CiA 301, 7.5.2.35, 7.5.2.37).
    pub fn communication(self) -> u16 {
        match self {
            Direction::Receive => 0x1400,
            Direction::Transmit => 0x1800,
        }
    }

    /// First index of the mapping parameters (CiA 301, 7.5.2.36, 7.5.2.38).
    pub fn mapping(self) -> u16 {
        match self {
            Direction::Receive => 0x1600,
            Direction::Transmit => 0x1A00,
        }
    }

    /// The identifier without node-ID of PDO 1 ..= 4 (CiA 301, 7.3.5).
    pub fn function_code(self, number: u8) -> u16 {
        let first = match self {
            Direction::Receive => 0x200,
            Direction::Transmit => 0x180,
        };
        first + (u16::from(number) - 1) * 0x100
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_of_a_type_survives() {
        for code in 0..=u16::from(u8::MAX) {
            assert_eq!(DataType::from_code(code).code(), code);
        }
    }

    #[test]
    fn ranges() {
        assert_eq!(DataType::Integer(8).range(), Some((-128, 127)));
        assert_eq!(DataType::Unsigned(24).range(), Some((0, 0xFF_FFFF)));
        let u64_range = Some((0, i128::from(u64::MAX)));
        assert_eq!(DataType::Unsigned(64).range(), u64_range);
        assert_eq!(DataType::Real(32).range(), None);
    }

    #[test]
    fn direction_follows_from_access() {
        let both = |access: Access| {
            (
                access.allows(Direction::Receive),
                access.allows(Direction::Transmit),
            )
        };
        assert_eq!(both(Access::ReadOnly), (false, true));
        assert_eq!(both(Access::Constant), (false, true));
        assert_eq!(both(Access::WriteOnly), (true, false));
        assert_eq!(both(Access::ReadWrite), (true, true));
        assert_eq!(both(Access::ReadWriteRead), (false, true));
        assert_eq!(both(Access::ReadWriteWrite), (true, false));
        assert_eq!(Access::from_word("RWW"), Some(Access::ReadWriteWrite));
        assert_eq!(Access::from_word("rx"), None);
    }

    #[test]
    fn the_predefined_connection_set() {
        assert_eq!(Direction::Receive.function_code(1), 0x200);
        assert_eq!(Direction::Receive.function_code(4), 0x500);
        assert_eq!(Direction::Transmit.function_code(1), 0x180);
        assert_eq!(Direction::Transmit.function_code(4), 0x480);
    }
}

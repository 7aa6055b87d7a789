//! SDO abort codes (CiA 301, 7.2.4.3.17).

use crate::words::in_words;

/// The reason for which an SDO transfer was aborted (CiA 301, 7.2.4.3.17,
/// table 22). Codes that the standard does not know survive a round trip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AbortCode(pub u32);

macro_rules! abort_codes {
    ($($(#[$doc:meta])* $name:ident = $code:literal, $words:literal;)*) => {
        impl AbortCode {
            $($(#[$doc])* #[doc = concat!("`", stringify!($code), "`: ", $words, ".")]
              pub const $name: AbortCode = AbortCode($code);)*

            /// Every code with a name here, in ascending order.
            pub const KNOWN: &'static [AbortCode] = &[$(AbortCode::$name),*];

            /// What the code says in words; `None` if neither the standard nor
            /// the EPOS4 documentation knows it.
            pub const fn meaning(self) -> Option<&'static str> {
                match self.0 {
                    $($code => Some($words),)*
                    _ => None,
                }
            }
        }

        in_words!(Meaning by Meaning::place {
            $(Meaning(AbortCode($code)) => ($words),)*
            _ => ("code of the manufacturer"),
        });
    };
}

abort_codes! {
    TOGGLE = 0x0503_0000, "toggle bit not alternated";
    TIMEOUT = 0x0504_0000, "SDO protocol timed out";
    COMMAND = 0x0504_0001, "command specifier not valid or unknown";
    BLOCK_SIZE = 0x0504_0002, "invalid block size";
    SEQUENCE_NUMBER = 0x0504_0003, "invalid sequence number";
    CRC = 0x0504_0004, "CRC error";
    OUT_OF_MEMORY = 0x0504_0005, "out of memory";
    UNSUPPORTED_ACCESS = 0x0601_0000, "unsupported access to an object";
    WRITE_ONLY = 0x0601_0001, "attempt to read a write-only object";
    READ_ONLY = 0x0601_0002, "attempt to write a read-only object";
    /// The entry cannot be written while sub-index 0 is not 0: mappings.
    SUB0_NOT_ZERO = 0x0601_0003, "sub-index cannot be written while sub-index 0 is not 0";
    NO_SUCH_OBJECT = 0x0602_0000, "object does not exist in the object dictionary";
    NOT_MAPPABLE = 0x0604_0041, "object cannot be mapped to the PDO";
    PDO_LENGTH = 0x0604_0042, "mapped objects would exceed the PDO length";
    PARAMETER_INCOMPATIBLE = 0x0604_0043, "general parameter incompatibility";
    INTERNAL_INCOMPATIBLE = 0x0604_0047, "general internal incompatibility in the device";
    HARDWARE = 0x0606_0000, "access failed due to a hardware error";
    LENGTH_MISMATCH = 0x0607_0010, "data type does not match, length of parameter does not match";
    TOO_LONG = 0x0607_0012, "data type does not match, length of parameter too high";
    TOO_SHORT = 0x0607_0013, "data type does not match, length of parameter too low";
    NO_SUCH_SUB_INDEX = 0x0609_0011, "sub-index does not exist";
    VALUE_RANGE = 0x0609_0030, "value range of parameter exceeded";
    VALUE_TOO_HIGH = 0x0609_0031, "value of parameter too high";
    VALUE_TOO_LOW = 0x0609_0032, "value of parameter too low";
    MAXIMUM_BELOW_MINIMUM = 0x0609_0036, "maximum value is less than minimum value";
    RESOURCE = 0x060A_0023, "resource not available: SDO connection";
    GENERAL = 0x0800_0000, "general error";
    CANNOT_STORE = 0x0800_0020, "data cannot be transferred or stored";
    LOCAL_CONTROL = 0x0800_0021, "data cannot be transferred or stored because of local control";
    DEVICE_STATE = 0x0800_0022, "data cannot be transferred or stored in the present device state";
    OD_GENERATION = 0x0800_0023, "object dictionary not present or its dynamic generation failed";
    NO_DATA = 0x0800_0024, "no data available";
    /// maxon EPOS4.
    EPOS4_PASSWORD = 0x0F00_FFBE, "password is wrong (EPOS4)";
    /// maxon EPOS4.
    EPOS4_ILLEGAL_COMMAND = 0x0F00_FFBF, "illegal command (EPOS4)";
    /// maxon EPOS4.
    EPOS4_NMT_STATE = 0x0F00_FFC0, "device is in the wrong NMT state (EPOS4)";
}

in_words!(AbortCode {
    code => ("{:08X}h ({})", code.0, Meaning(code)),
});

/// What a code says.
#[derive(Clone, Copy)]
struct Meaning(AbortCode);

impl Meaning {
    /// Its place in [`AbortCode::KNOWN`], or behind that.
    #[cfg(feature = "defmt")]
    fn place(&self) -> u8 {
        let mut known = AbortCode::KNOWN.iter();
        let place = known.position(|code| *code == self.0);
        place.unwrap_or(AbortCode::KNOWN.len()) as u8
    }
}

impl core::error::Error for AbortCode {}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn every_known_code_has_words_and_the_list_ascends() {
        for pair in AbortCode::KNOWN.windows(2) {
            assert!(pair[0] < pair[1]);
        }
        for code in AbortCode::KNOWN {
            assert!(code.meaning().is_some_and(|words| !words.is_empty()));
        }
        assert_eq!(AbortCode::KNOWN.len(), 35);
    }

    #[test]
    fn unknown_codes_keep_their_number() {
        let code = AbortCode(0x1234_5678);
        assert_eq!(code.meaning(), None);
        assert_eq!(code.to_string(), "12345678h (code of the manufacturer)");
        assert_eq!(
            AbortCode::NO_SUCH_OBJECT.to_string(),
            "06020000h (object does not exist in the object dictionary)"
        );
    }
}

//! Emergency error codes: CiA 301, 7.2.7.1, table 26; CiA 402-2; EPOS4.

use super::texts::{self, Meaning};
use crate::words::{PackedText, in_words};

/// How the master takes an emergency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Class {
    /// 0000h: the node reports that an error is gone, or all are.
    Reset,
    /// To be logged; the drive goes on.
    Warning,
    /// The drive reacts, so the group has to. Unknown codes count as faults.
    Fault,
}

/// An emergency error code. Unknown codes survive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct EmcyCode(pub u16);

impl EmcyCode {
    /// Error reset, no error.
    pub const NO_ERROR: EmcyCode = EmcyCode(0x0000);
    /// Generic error.
    pub const GENERIC: EmcyCode = EmcyCode(0x1000);
    /// CAN overrun, objects lost.
    pub const CAN_OVERRUN: EmcyCode = EmcyCode(0x8110);
    /// CAN in error passive mode.
    pub const ERROR_PASSIVE: EmcyCode = EmcyCode(0x8120);
    /// Life guard or heartbeat error.
    pub const HEARTBEAT: EmcyCode = EmcyCode(0x8130);
    /// Recovered from bus-off.
    pub const BUS_OFF_RECOVERED: EmcyCode = EmcyCode(0x8140);
    /// EPOS4: CAN bus-off.
    pub const EPOS4_BUS_OFF: EmcyCode = EmcyCode(0x81FD);
    /// CAN-ID collision.
    pub const COB_ID_COLLISION: EmcyCode = EmcyCode(0x8150);
    /// A PDO was too short to be processed.
    pub const PDO_TOO_SHORT: EmcyCode = EmcyCode(0x8210);
    /// A PDO was longer than mapped.
    pub const PDO_TOO_LONG: EmcyCode = EmcyCode(0x8220);
    /// The data length of a SYNC was not the one expected.
    pub const SYNC_LENGTH: EmcyCode = EmcyCode(0x8240);
    /// An RPDO did not arrive in time.
    pub const RPDO_TIMEOUT: EmcyCode = EmcyCode(0x8250);
    /// Following error.
    pub const FOLLOWING_ERROR: EmcyCode = EmcyCode(0x8611);
    /// EPOS4: system overloaded, a warning.
    pub const EPOS4_OVERLOAD: EmcyCode = EmcyCode(0xFF01);

    /// Whether the group has to react.
    pub const fn class(self) -> Class {
        match self {
            EmcyCode::NO_ERROR => Class::Reset,
            EmcyCode::EPOS4_OVERLOAD => Class::Warning,
            _ => Class::Fault,
        }
    }

    /// Whether the node has missed the bus or its master: what was sent to it
    /// meanwhile, a reset as well, did not reach it.
    pub const fn is_cut_off(self) -> bool {
        matches!(
            self,
            EmcyCode::ERROR_PASSIVE
                | EmcyCode::HEARTBEAT
                | EmcyCode::BUS_OFF_RECOVERED
                | EmcyCode::EPOS4_BUS_OFF
        )
    }

    /// The code in words: exactly if it is known, else by its range; `None` if
    /// neither is.
    pub const fn meaning(self) -> Option<&'static str> {
        texts::of(self)
    }

    /// What the code means, or that nobody knows.
    pub fn text(self) -> &'static str {
        self.meaning()
            .unwrap_or("unknown error, treated as a fault")
    }

    /// [`text`](Self::text) as it lies in flash.
    pub(crate) fn packed_text(self) -> PackedText {
        texts::packed_of(self)
    }
}

in_words!(EmcyCode {
    code => ("{:04X}h ({})", code.0, Meaning(code)),
});

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn only_known_harmless_codes_are_no_faults() {
        for code in 0..=u16::MAX {
            let class = EmcyCode(code).class();
            match code {
                0x0000 => assert_eq!(class, Class::Reset),
                0xFF01 => assert_eq!(class, Class::Warning),
                _ => assert_eq!(class, Class::Fault),
            }
        }
    }

    #[test]
    fn a_node_that_missed_the_bus_says_so() {
        let cut_off: std::vec::Vec<u16> = (0..=u16::MAX)
            .filter(|&code| EmcyCode(code).is_cut_off())
            .collect();
        assert_eq!(cut_off, [0x8120, 0x8130, 0x8140, 0x81FD]);
    }

    #[test]
    fn codes_have_words() {
        assert_eq!(EmcyCode(0x8611).to_string(), "8611h (following error)");
        assert_eq!(EmcyCode(0x1083).to_string(), "1083h (initialisation error)");
        assert_eq!(EmcyCode(0x2399).to_string(), "2399h (current, output side)");
        assert_eq!(
            EmcyCode(0xB000).to_string(),
            "B000h (unknown error, treated as a fault)"
        );
    }
}

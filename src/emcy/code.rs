//! Emergency error codes: CiA 301, 7.2.7.1, table 26; CiA 402-2; EPOS4.

use core::fmt;

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

    /// The code in words: exactly if it is known, else by its range; `None` if
    /// neither is.
    pub fn meaning(self) -> Option<&'static str> {
        self.exact().or_else(|| self.range())
    }

    /// What the code means, or that nobody knows.
    pub fn text(self) -> &'static str {
        self.meaning().unwrap_or(UNKNOWN)
    }

    fn exact(self) -> Option<&'static str> {
        TEXTS
            .binary_search_by_key(&self.0, |&(code, _)| code)
            .ok()
            .and_then(|position| TEXTS.get(position))
            .map(|&(_, text)| text)
    }

    fn range(self) -> Option<&'static str> {
        RANGES
            .iter()
            .find(|(first, last, _)| (*first..=*last).contains(&self.0))
            .map(|&(_, _, text)| text)
    }
}

impl fmt::Display for EmcyCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = self.text();
        write!(f, "{:04X}h ({text})", self.0)
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for EmcyCode {
    fn format(&self, f: defmt::Formatter<'_>) {
        let text = self.text();
        defmt::write!(f, "{=u16:04X}h ({=str})", self.0, text)
    }
}

const UNKNOWN: &str = "unknown error, treated as a fault";

/// Codes with a text of their own, ascending.
const TEXTS: &[(u16, &str)] = &[
    (0x0000, "error reset or no error"),
    (0x1000, "generic error"),
    (0x1090, "firmware incompatible"),
    (0x2310, "overcurrent"),
    (0x2320, "power stage protection"),
    (0x3210, "supply overvoltage"),
    (0x3220, "supply undervoltage"),
    (0x4210, "power stage too hot"),
    (0x4380, "motor too hot"),
    (0x5113, "logic supply voltage too low"),
    (0x5280, "hardware defect"),
    (0x5281, "hardware incompatible"),
    (0x6080, "sign of life error"),
    (0x6081, "extension 1 watchdog"),
    (0x6320, "software parameter error"),
    (0x6380, "persistent parameters corrupt"),
    (0x7320, "position sensor error"),
    (0x7380, "position sensor breach"),
    (0x7381, "position sensor resolution error"),
    (0x7382, "position sensor index error"),
    (0x7388, "Hall sensor error"),
    (0x7389, "Hall sensor not found"),
    (0x738A, "Hall angle detection error"),
    (0x738C, "SSI sensor error"),
    (0x738D, "SSI sensor frame error"),
    (0x8110, "CAN overrun, objects lost"),
    (0x8111, "CAN receive queue overrun"),
    (0x8120, "CAN controller error passive"),
    (0x8130, "heartbeat or life guarding of the master lost"),
    (0x8140, "recovered from bus-off"),
    (0x8150, "another node sends on one of its identifiers"),
    (0x81FD, "CAN bus-off"),
    (0x81FE, "CAN receive queue overflow"),
    (0x81FF, "CAN transmit queue overflow"),
    (0x8210, "PDO shorter than mapped, not processed"),
    (0x8220, "PDO longer than mapped"),
    (
        0x8230,
        "destination object of a multiplexed PDO not available",
    ),
    (0x8240, "SYNC with an unexpected data length"),
    (0x8250, "RPDO did not arrive in time"),
    (0x8611, "following error"),
    (0x8A80, "negative limit switch"),
    (0x8A81, "positive limit switch"),
    (0x8A82, "software position limit"),
    (0x8A88, "safe torque off active"),
    (0xFF01, "system overloaded"),
    (0xFF02, "watchdog"),
    (0xFF0B, "system peak overcurrent"),
    (0xFF10, "controller gain error"),
];

/// What the remaining codes are about. The narrow ranges come first.
const RANGES: &[(u16, u16, &str)] = &[
    (0x1080, 0x1088, "initialisation error"),
    (0x5480, 0x5483, "hardware error"),
    (0x6180, 0x61F0, "internal software error"),
    (0x7390, 0x7392, "sensor error"),
    (0xFF11, 0xFF24, "auto tuning or sensor configuration error"),
    (0x1000, 0x10FF, "generic error"),
    (0x2000, 0x20FF, "current"),
    (0x2100, 0x21FF, "current, input side"),
    (0x2200, 0x22FF, "current inside the device"),
    (0x2300, 0x23FF, "current, output side"),
    (0x3000, 0x30FF, "voltage"),
    (0x3100, 0x31FF, "mains voltage"),
    (0x3200, 0x32FF, "voltage inside the device"),
    (0x3300, 0x33FF, "output voltage"),
    (0x4000, 0x40FF, "temperature"),
    (0x4100, 0x41FF, "ambient temperature"),
    (0x4200, 0x42FF, "device temperature"),
    (0x4300, 0x43FF, "drive temperature"),
    (0x5000, 0x5FFF, "device hardware"),
    (0x6000, 0x60FF, "device software"),
    (0x6100, 0x61FF, "internal software"),
    (0x6200, 0x62FF, "user software"),
    (0x6300, 0x63FF, "data set"),
    (0x7000, 0x7FFF, "additional modules"),
    (0x8000, 0x80FF, "monitoring"),
    (0x8100, 0x81FF, "communication"),
    (0x8200, 0x82FF, "protocol error"),
    (0x8300, 0x83FF, "torque control"),
    (0x8400, 0x84FF, "velocity speed controller"),
    (0x8500, 0x85FF, "position controller"),
    (0x8600, 0x86FF, "positioning controller"),
    (0x8700, 0x87FF, "synchronisation controller"),
    (0x9000, 0x90FF, "external error"),
    (0xF000, 0xF0FF, "additional functions"),
    (0xFF00, 0xFFFF, "device specific"),
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn the_texts_ascend() {
        assert!(TEXTS.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert!(RANGES.iter().all(|(first, last, _)| first <= last));
    }

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

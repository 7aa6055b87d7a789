//! The words of the emergency error codes; and, because texts that are packed together
//! take less, all others that the object dictionary has for people.

use super::EmcyCode;
use crate::words::{Packed, PackedText, in_words, packed};

/// From one list of codes and their words: those for the host and the log, and those
/// for the object dictionary, which lie in flash and are packed for that.
macro_rules! texts {
    ($($first:literal..=$last:literal => $text:literal,)*) => {
        /// The words of a code.
        pub(super) const fn of(code: EmcyCode) -> Option<&'static str> {
            match code.0 {
                $($first..=$last => Some($text),)*
                _ => None,
            }
        }

        in_words!(Meaning by Meaning::place {
            $(Meaning(EmcyCode($first..=$last)) => ($text),)*
            _ => ("unknown error, treated as a fault"),
        });

        const RANGES: &[(u16, u16)] = &[$(($first, $last)),*];

        packed!(
            WORDS: $($text,)* "unknown error, treated as a fault",
            "not started yet",
            "boot-up frame awaited",
            "identity is checked",
            "configuring, ",
            "lost, to be booted again",
            "configured, heartbeat awaited",
            "ready to be started",
            "operational",
            "was operational already and is left running",
            "not in the list of this master",
            "no boot-up frame",
            "restarts again and again",
            "no answer to an access",
            "an access was refused",
            "wrong answer to an access",
            "not the expected device",
            "does not tell its NMT state",
            "no heartbeat after the configuration",
            "not operational after NMT start",
            "not in the network",
            "no emergency",
            " (boot status ",
            " writes"
        );
    };
}

// The first line that a code is within counts: single codes come before ranges, narrow
// ranges before wide ones.
texts! {
    0x0000..=0x0000 => "error reset or no error",
    0x1000..=0x1000 => "generic error",
    0x1090..=0x1090 => "firmware incompatible",
    0x2310..=0x2310 => "overcurrent",
    0x2320..=0x2320 => "power stage protection",
    0x3210..=0x3210 => "supply overvoltage",
    0x3220..=0x3220 => "supply undervoltage",
    0x4210..=0x4210 => "power stage too hot",
    0x4380..=0x4380 => "motor too hot",
    0x5113..=0x5113 => "logic supply voltage too low",
    0x5280..=0x5280 => "hardware defect",
    0x5281..=0x5281 => "hardware incompatible",
    0x6080..=0x6080 => "sign of life error",
    0x6081..=0x6081 => "extension 1 watchdog",
    0x6320..=0x6320 => "software parameter error",
    0x6380..=0x6380 => "persistent parameters corrupt",
    0x7320..=0x7320 => "position sensor error",
    0x7380..=0x7380 => "position sensor breach",
    0x7381..=0x7381 => "position sensor resolution error",
    0x7382..=0x7382 => "position sensor index error",
    0x7388..=0x7388 => "Hall sensor error",
    0x7389..=0x7389 => "Hall sensor not found",
    0x738A..=0x738A => "Hall angle detection error",
    0x738C..=0x738C => "SSI sensor error",
    0x738D..=0x738D => "SSI sensor frame error",
    0x8110..=0x8110 => "CAN overrun, objects lost",
    0x8111..=0x8111 => "CAN receive queue overrun",
    0x8120..=0x8120 => "CAN controller error passive",
    0x8130..=0x8130 => "heartbeat or life guarding of the master lost",
    0x8140..=0x8140 => "recovered from bus-off",
    0x8150..=0x8150 => "another node sends on one of its identifiers",
    0x81FD..=0x81FD => "CAN bus-off",
    0x81FE..=0x81FE => "CAN receive queue overflow",
    0x81FF..=0x81FF => "CAN transmit queue overflow",
    0x8210..=0x8210 => "PDO shorter than mapped, not processed",
    0x8220..=0x8220 => "PDO longer than mapped",
    0x8230..=0x8230 => "destination object of a multiplexed PDO not available",
    0x8240..=0x8240 => "SYNC with an unexpected data length",
    0x8250..=0x8250 => "RPDO did not arrive in time",
    0x8611..=0x8611 => "following error",
    0x8A80..=0x8A80 => "negative limit switch",
    0x8A81..=0x8A81 => "positive limit switch",
    0x8A82..=0x8A82 => "software position limit",
    0x8A88..=0x8A88 => "safe torque off active",
    0xFF01..=0xFF01 => "system overloaded",
    0xFF02..=0xFF02 => "watchdog",
    0xFF0B..=0xFF0B => "system peak overcurrent",
    0xFF10..=0xFF10 => "controller gain error",
    0x1080..=0x1088 => "initialisation error",
    0x5480..=0x5483 => "hardware error",
    0x6180..=0x61F0 => "internal software error",
    0x7390..=0x7392 => "sensor error",
    0xFF11..=0xFF24 => "auto tuning or sensor configuration error",
    0x1000..=0x10FF => "generic error",
    0x2000..=0x20FF => "current",
    0x2100..=0x21FF => "current, input side",
    0x2200..=0x22FF => "current inside the device",
    0x2300..=0x23FF => "current, output side",
    0x3000..=0x30FF => "voltage",
    0x3100..=0x31FF => "mains voltage",
    0x3200..=0x32FF => "voltage inside the device",
    0x3300..=0x33FF => "output voltage",
    0x4000..=0x40FF => "temperature",
    0x4100..=0x41FF => "ambient temperature",
    0x4200..=0x42FF => "device temperature",
    0x4300..=0x43FF => "drive temperature",
    0x5000..=0x5FFF => "device hardware",
    0x6000..=0x60FF => "device software",
    0x6100..=0x61FF => "internal software",
    0x6200..=0x62FF => "user software",
    0x6300..=0x63FF => "data set",
    0x7000..=0x7FFF => "additional modules",
    0x8000..=0x80FF => "monitoring",
    0x8100..=0x81FF => "communication",
    0x8200..=0x82FF => "protocol error",
    0x8300..=0x83FF => "torque control",
    0x8400..=0x84FF => "velocity speed controller",
    0x8500..=0x85FF => "position controller",
    0x8600..=0x86FF => "positioning controller",
    0x8700..=0x87FF => "synchronisation controller",
    0x9000..=0x90FF => "external error",
    0xF000..=0xF0FF => "additional functions",
    0xFF00..=0xFFFF => "device specific",
}

/// What a code says.
#[derive(Clone, Copy)]
pub(super) struct Meaning(pub(super) EmcyCode);

impl Meaning {
    /// In the order of the texts.
    #[cfg(feature = "defmt")]
    fn place(&self) -> u8 {
        find(self.0)
    }
}

/// The words of a code, or that nobody knows it, packed.
pub(super) fn packed_of(code: EmcyCode) -> PackedText {
    text(find(code))
}

/// The text with this number of those that are not of emergencies.
pub(crate) fn other(number: u8) -> PackedText {
    text(OTHERS + number)
}

/// The first text behind those of the codes and of unknown ones.
const OTHERS: u8 = RANGES.len() as u8 + 1;

/// The place of a code's line, or the one behind the last.
#[inline(never)]
fn find(code: EmcyCode) -> u8 {
    let mut place = 0;
    for (first, span) in FIRSTS.iter().zip(&CODES) {
        let span = SPANS.get(usize::from(*span)).copied().unwrap_or(0);
        if code.0.wrapping_sub(*first) <= span {
            break;
        }
        place += 1;
    }
    place
}

/// The text with this number: it begins where those before it end.
#[inline(never)]
fn text(number: u8) -> PackedText {
    let (mut start, mut len) = (0, 0);
    for next in WORDS.lengths.iter().take(usize::from(number) + 1) {
        start += len;
        len = usize::from(*next);
    }
    WORDS.text(start, len)
}

/// How many codes follow the first one of a line.
const SPANS: [u16; 8] = [0x000, 0x002, 0x003, 0x008, 0x013, 0x070, 0x0FF, 0xFFF];

/// The first code of each line.
static FIRSTS: [u16; RANGES.len()] = lines().0;
/// How many follow it, by the place in [`SPANS`].
static CODES: [u8; RANGES.len()] = lines().1;

/// # Panics
/// While it is compiled, if there is a span that is not in the list.
#[expect(clippy::indexing_slicing, reason = "evaluated by the compiler only")]
const fn lines() -> ([u16; RANGES.len()], [u8; RANGES.len()]) {
    let (mut firsts, mut codes) = ([0; RANGES.len()], [0; RANGES.len()]);
    let mut n = 0;
    while n < RANGES.len() {
        let (first, last) = RANGES[n];
        firsts[n] = first;
        while SPANS[codes[n] as usize] != last - first {
            codes[n] += 1;
        }
        n += 1;
    }
    (firsts, codes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::{String, ToString};

    #[test]
    fn packed_words_are_the_same() {
        for code in (0..=u16::MAX).map(EmcyCode) {
            let mut spelled = String::new();
            packed_of(code).spell(&mut |letter| spelled.push(char::from(letter)));
            assert_eq!(spelled, Meaning(code).to_string());
            assert_eq!(spelled, code.text());
        }
    }

    #[test]
    fn no_entry_hides_a_later_one() {
        for (n, (first, last)) in RANGES.iter().enumerate() {
            let mut codes = (*first..=*last).map(EmcyCode);
            let seen = codes.any(|code| usize::from(find(code)) == n);
            assert!(seen, "{first:04X}h");
        }
    }
}

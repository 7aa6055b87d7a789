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
        find(self.0).0
    }
}

/// The words of a code, or that nobody knows it, packed.
pub(super) fn packed_of(code: EmcyCode) -> PackedText {
    let (place, start) = find(code);
    let entry = ENTRIES.get(usize::from(place));
    let len = entry.map_or(UNKNOWN, |entry| entry.bytes);
    WORDS.text(start, usize::from(len))
}

/// The place of a code's line, or the one behind the last, and where its packed words
/// begin.
fn find(code: EmcyCode) -> (u8, usize) {
    let (mut place, mut start) = (0, 0);
    for entry in &ENTRIES {
        if entry.contains(code.0) {
            break;
        }
        place += 1;
        start += usize::from(entry.bytes);
    }
    (place, start)
}

/// A line in four bytes.
#[derive(Clone, Copy)]
struct Entry {
    first: u16,
    /// How many codes follow the first one, by its place in [`SPANS`].
    span: u8,
    /// How many bytes the packed words have. They begin where those of the line before
    /// end.
    bytes: u8,
}

/// How many codes follow the first one of an entry.
const SPANS: [u16; 8] = [0x000, 0x002, 0x003, 0x008, 0x013, 0x070, 0x0FF, 0xFFF];

impl Entry {
    const NONE: Entry = Entry {
        first: 0,
        span: 0,
        bytes: 0,
    };

    /// # Panics
    /// While it is compiled, if there is no such span.
    const fn new((first, last): (u16, u16), bytes: u8) -> Entry {
        let mut spans: &[u16] = &SPANS;
        while let [others @ .., span] = spans {
            if last - first == *span {
                return Entry {
                    first,
                    span: others.len() as u8,
                    bytes,
                };
            }
            assert!(!others.is_empty(), "a span that is not in the list");
            spans = others;
        }
        Entry::NONE
    }

    fn contains(&self, code: u16) -> bool {
        let span = SPANS.get(usize::from(self.span)).copied().unwrap_or(0);
        code.wrapping_sub(self.first) <= span
    }
}

static ENTRIES: [Entry; RANGES.len()] = entries();

#[expect(clippy::indexing_slicing, reason = "evaluated by the compiler only")]
const fn entries() -> [Entry; RANGES.len()] {
    let mut entries = [Entry::NONE; RANGES.len()];
    let mut n = 0;
    while n < RANGES.len() {
        entries[n] = Entry::new(RANGES[n], WORDS.lengths[n]);
        n += 1;
    }
    entries
}

/// Bytes of the words behind those of the codes.
const UNKNOWN: u8 = match WORDS.lengths.split_at(RANGES.len()) {
    (_, [unknown, ..]) => *unknown,
    _ => 0,
};

/// How many texts are not of emergencies.
const OTHERS: usize = 23;

/// Their lengths, and where the first begins.
static OTHER_LENGTHS: [u8; OTHERS] = others().0;
const OTHERS_START: usize = others().1;

/// The text with this number of those that are not of emergencies.
pub(crate) fn other(number: u8) -> PackedText {
    let (mut start, mut len) = (OTHERS_START, 0);
    for next in OTHER_LENGTHS.iter().take(usize::from(number) + 1) {
        start += len;
        len = usize::from(*next);
    }
    WORDS.text(start, len)
}

#[expect(clippy::indexing_slicing, reason = "evaluated by the compiler only")]
const fn others() -> ([u8; OTHERS], usize) {
    let (mut lengths, mut start) = ([0; OTHERS], 0);
    let first = RANGES.len() + 1;
    let mut n = 0;
    while n < first {
        start += WORDS.lengths[n] as usize;
        n += 1;
    }
    while n < WORDS.lengths.len() {
        lengths[n - first] = WORDS.lengths[n];
        n += 1;
    }
    (lengths, start)
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
            let seen = codes.any(|code| usize::from(find(code).0) == n);
            assert!(seen, "{first:04X}h");
        }
    }
}

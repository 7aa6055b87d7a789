//! The words of the emergency error codes, packed: one text, and for each code
//! where in it its words end. A table of string slices would take twice as much
//! flash as it has letters.

/// The first and the last code that mean this, in words. The first entry that a
/// code is within counts: single codes come before ranges, narrow ranges before
/// wide ones.
const TEXTS: [(u16, u16, &str); 83] = [
    (0x0000, 0x0000, "error reset or no error"),
    (0x1000, 0x1000, "generic error"),
    (0x1090, 0x1090, "firmware incompatible"),
    (0x2310, 0x2310, "overcurrent"),
    (0x2320, 0x2320, "power stage protection"),
    (0x3210, 0x3210, "supply overvoltage"),
    (0x3220, 0x3220, "supply undervoltage"),
    (0x4210, 0x4210, "power stage too hot"),
    (0x4380, 0x4380, "motor too hot"),
    (0x5113, 0x5113, "logic supply voltage too low"),
    (0x5280, 0x5280, "hardware defect"),
    (0x5281, 0x5281, "hardware incompatible"),
    (0x6080, 0x6080, "sign of life error"),
    (0x6081, 0x6081, "extension 1 watchdog"),
    (0x6320, 0x6320, "software parameter error"),
    (0x6380, 0x6380, "persistent parameters corrupt"),
    (0x7320, 0x7320, "position sensor error"),
    (0x7380, 0x7380, "position sensor breach"),
    (0x7381, 0x7381, "position sensor resolution error"),
    (0x7382, 0x7382, "position sensor index error"),
    (0x7388, 0x7388, "Hall sensor error"),
    (0x7389, 0x7389, "Hall sensor not found"),
    (0x738A, 0x738A, "Hall angle detection error"),
    (0x738C, 0x738C, "SSI sensor error"),
    (0x738D, 0x738D, "SSI sensor frame error"),
    (0x8110, 0x8110, "CAN overrun, objects lost"),
    (0x8111, 0x8111, "CAN receive queue overrun"),
    (0x8120, 0x8120, "CAN controller error passive"),
    (
        0x8130,
        0x8130,
        "heartbeat or life guarding of the master lost",
    ),
    (0x8140, 0x8140, "recovered from bus-off"),
    (
        0x8150,
        0x8150,
        "another node sends on one of its identifiers",
    ),
    (0x81FD, 0x81FD, "CAN bus-off"),
    (0x81FE, 0x81FE, "CAN receive queue overflow"),
    (0x81FF, 0x81FF, "CAN transmit queue overflow"),
    (0x8210, 0x8210, "PDO shorter than mapped, not processed"),
    (0x8220, 0x8220, "PDO longer than mapped"),
    (
        0x8230,
        0x8230,
        "destination object of a multiplexed PDO not available",
    ),
    (0x8240, 0x8240, "SYNC with an unexpected data length"),
    (0x8250, 0x8250, "RPDO did not arrive in time"),
    (0x8611, 0x8611, "following error"),
    (0x8A80, 0x8A80, "negative limit switch"),
    (0x8A81, 0x8A81, "positive limit switch"),
    (0x8A82, 0x8A82, "software position limit"),
    (0x8A88, 0x8A88, "safe torque off active"),
    (0xFF01, 0xFF01, "system overloaded"),
    (0xFF02, 0xFF02, "watchdog"),
    (0xFF0B, 0xFF0B, "system peak overcurrent"),
    (0xFF10, 0xFF10, "controller gain error"),
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

/// A line of [`TEXTS`] in four bytes.
struct Entry {
    first: u16,
    /// How many codes follow the first one, by its place in [`SPANS`].
    span: u8,
    /// How many letters the words have. They begin in [`WORDS`] where those of the
    /// entry before end.
    letters: u8,
}

/// How many codes follow the first one of an entry.
const SPANS: [u16; 8] = [0x000, 0x002, 0x003, 0x008, 0x013, 0x070, 0x0FF, 0xFFF];

static ENTRIES: [Entry; TEXTS.len()] = entries();

impl Entry {
    const NONE: Entry = Entry {
        first: 0,
        span: 0,
        letters: 0,
    };

    /// # Panics
    /// While it is compiled, if there are too many letters or no such span.
    const fn new(first: u16, last: u16, text: &str) -> Entry {
        assert!(text.len() <= u8::MAX as usize, "the words are too long");
        let mut spans: &[u16] = &SPANS;
        while let [others @ .., span] = spans {
            if last - first == *span {
                return Entry {
                    first,
                    span: others.len() as u8,
                    letters: text.len() as u8,
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

static WORDS: &str = match core::str::from_utf8(&LETTERS) {
    Ok(words) => words,
    Err(_) => "",
};

const LETTERS: [u8; length()] = letters();

/// The words of a code.
pub(super) fn of(code: u16) -> Option<&'static str> {
    let mut start = 0;
    for entry in &ENTRIES {
        let end = start + usize::from(entry.letters);
        if entry.contains(code) {
            return WORDS.get(start..end);
        }
        start = end;
    }
    None
}

const fn length() -> usize {
    let mut length = 0;
    let mut rest: &[(u16, u16, &str)] = &TEXTS;
    while let [(_, _, text), tail @ ..] = rest {
        length += text.len();
        rest = tail;
    }
    length
}

#[expect(clippy::indexing_slicing, reason = "evaluated by the compiler only")]
const fn entries() -> [Entry; TEXTS.len()] {
    let mut entries = [const { Entry::NONE }; TEXTS.len()];
    let mut n = 0;
    while n < TEXTS.len() {
        let (first, last, text) = TEXTS[n];
        entries[n] = Entry::new(first, last, text);
        n += 1;
    }
    entries
}

#[expect(clippy::indexing_slicing, reason = "evaluated by the compiler only")]
const fn letters() -> [u8; length()] {
    let mut letters = [0; length()];
    let (mut n, mut at) = (0, 0);
    while n < TEXTS.len() {
        let text = TEXTS[n].2.as_bytes();
        let mut letter = 0;
        while letter < text.len() {
            letters[at] = text[letter];
            letter += 1;
            at += 1;
        }
        n += 1;
    }
    letters
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_entry_keeps_its_words() {
        let mut start = 0;
        for ((first, last, text), entry) in TEXTS.iter().zip(&ENTRIES) {
            assert!(entry.contains(*first) && entry.contains(*last));
            assert!(*first == 0 || !entry.contains(first - 1));
            assert!(*last == u16::MAX || !entry.contains(last + 1));
            let end = start + usize::from(entry.letters);
            assert_eq!(&WORDS[start..end], *text);
            start = end;
        }
        assert_eq!(start, WORDS.len());
    }

    #[test]
    fn no_entry_hides_a_later_one() {
        for (n, (first, last, text)) in TEXTS.iter().enumerate() {
            let seen = (*first..=*last).any(|code| of(code) == Some(text));
            assert!(seen, "entry {n}: {text}");
        }
    }
}

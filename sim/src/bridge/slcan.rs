//! The words of the protocol (Lawicel CAN232 and CANUSB manuals): ASCII lines
//! that end with CR, upper-case commands, hexadecimal numbers.

use crate::frame::{MAX_DATA, WireFrame, WireId};

/// Ends a command and every answer; alone: done.
pub const OK: u8 = b'\r';
/// Not done.
pub const BELL: u8 = 0x07;
/// The longest command: `T`, identifier, length, eight bytes.
pub const LONGEST: usize = 1 + EXTENDED_DIGITS + 1 + 2 * MAX_DATA;

/// Bit rates of `S0` to `S8`.
const BIT_RATES: [u32; 9] = [
    10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000,
];
const STANDARD_DIGITS: usize = 3;
const STANDARD_MAX: u32 = 0x7FF;
const EXTENDED_DIGITS: usize = 8;
const EXTENDED_MAX: u32 = 0x1FFF_FFFF;
/// Time stamps count milliseconds and start again every minute.
const STAMP_MS: u64 = 60_000;

/// What a client may ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// An empty line: nothing to do.
    Nothing,
    /// `S`: bits per second.
    BitRate(u32),
    /// `O`
    Open,
    /// `C`
    Close,
    /// `t`, `T`, `r`, `R`
    Send(WireFrame),
    /// `F`
    Flags,
    /// `V`
    Version,
    /// `N`
    Serial,
    /// `Z`: whether frames carry a time stamp.
    Stamps(bool),
}

impl Command {
    /// A line without its CR; `None` if it is none of the protocol.
    pub fn parse(line: &[u8]) -> Option<Command> {
        let Some((&word, rest)) = line.split_first() else {
            return Some(Command::Nothing);
        };
        match (word, rest) {
            (b'S', [digit]) => {
                let index = hex_digit(*digit)? as usize;
                BIT_RATES.get(index).copied().map(Command::BitRate)
            }
            (b'O', []) => Some(Command::Open),
            (b'C', []) => Some(Command::Close),
            (b'F', []) => Some(Command::Flags),
            (b'V', []) => Some(Command::Version),
            (b'N', []) => Some(Command::Serial),
            (b'Z', b"0") => Some(Command::Stamps(false)),
            (b'Z', b"1") => Some(Command::Stamps(true)),
            (b't' | b'T' | b'r' | b'R', rest) => frame(word, rest).map(Command::Send),
            _ => None,
        }
    }
}

/// The frame that `word` and the rest of its line describe.
fn frame(word: u8, rest: &[u8]) -> Option<WireFrame> {
    let extended = word.is_ascii_uppercase();
    let remote = word.eq_ignore_ascii_case(&b'r');
    let (digits, max) = if extended {
        (EXTENDED_DIGITS, EXTENDED_MAX)
    } else {
        (STANDARD_DIGITS, STANDARD_MAX)
    };
    let (id, rest) = rest.split_at_checked(digits)?;
    let id = Some(hex(id)?).filter(|id| *id <= max)?;
    let id = if extended {
        WireId::Extended(id)
    } else {
        WireId::Standard(u16::try_from(id).ok()?)
    };
    let (&length, data) = rest.split_first()?;
    let length = hex_digit(length)? as usize;
    let told = if remote { 0 } else { length };
    if length > MAX_DATA || data.len() != 2 * told {
        return None;
    }
    if remote {
        return Some(WireFrame::remote(id, length as u8));
    }
    let mut bytes = [0; MAX_DATA];
    for (byte, digits) in bytes.iter_mut().zip(data.chunks_exact(2)) {
        *byte = hex(digits)? as u8;
    }
    Some(WireFrame {
        id,
        rtr: false,
        dlc: length as u8,
        data: bytes,
    })
}

/// At most eight digits.
fn hex(digits: &[u8]) -> Option<u32> {
    digits
        .iter()
        .try_fold(0, |value, digit| Some(value << 4 | hex_digit(*digit)?))
}

fn hex_digit(digit: u8) -> Option<u32> {
    char::from(digit).to_digit(16)
}

/// The line that tells a client of a frame, CR included. `stamp` is the
/// moment in milliseconds, if the client wants to know it.
pub fn received(frame: &WireFrame, stamp: Option<u64>) -> String {
    let word = if frame.rtr { 'r' } else { 't' };
    let dlc = usize::from(frame.dlc).min(MAX_DATA);
    let mut line = match frame.id {
        WireId::Standard(id) => format!("{word}{id:03X}{dlc}"),
        WireId::Extended(id) => format!("{}{id:08X}{dlc}", word.to_ascii_uppercase()),
    };
    for byte in frame.payload() {
        line.push_str(&format!("{byte:02X}"));
    }
    if let Some(ms) = stamp {
        line.push_str(&format!("{:04X}", ms % STAMP_MS));
    }
    line.push(char::from(OK));
    line
}

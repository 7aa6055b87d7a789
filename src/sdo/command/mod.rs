//! The bytes of SDO frames: every command of the expedited, segmented and block
//! protocols, both ways (CiA 301, 7.2.4.3).
//!
//! Decoding never fails on a length, because every SDO frame has eight bytes;
//! it yields `None` for command specifiers that the standard does not know.
//! Segments of a block carry no command specifier: see [`BlockSegment`].

mod answer;
mod request;

pub use answer::Answer;
pub use request::Request;

use crate::id::{Address, Index, SubIndex};

/// The data bytes of an SDO frame.
pub type Bytes = [u8; 8];

/// Data bytes in an expedited transfer.
pub const EXPEDITED_MAX: usize = 4;
/// Data bytes in a segment.
pub const SEGMENT_MAX: usize = 7;
/// Segments in a block (CiA 301, 7.2.4.3.10).
pub const BLOCK_MAX: u8 = 127;

const SPECIFIER_SHIFT: u8 = 5;
const TOGGLE: u8 = 0x10;
const EXPEDITED: u8 = 0x02;
const SIZE_TOLD: u8 = 0x01;
const LAST: u8 = 0x01;
const ABORT: u8 = 0x80;

/// Sub-commands of the block protocols.
mod block {
    pub(super) const SUB_MASK: u8 = 0x03;
    pub(super) const INITIATE: u8 = 0;
    pub(super) const END: u8 = 1;
    pub(super) const ACKNOWLEDGE: u8 = 2;
    pub(super) const START: u8 = 3;
    /// `cc` and `sc`: this side computes the CRC.
    pub(super) const CRC: u8 = 0x04;
    pub(super) const SIZE_TOLD: u8 = 0x02;
    /// In the download command the sub-command has one bit only.
    pub(super) const DOWNLOAD_END: u8 = 0x01;
    pub(super) const UNUSED_SHIFT: u8 = 2;
    pub(super) const UNUSED_MASK: u8 = 0x07;
    /// `c` of a segment.
    pub(super) const LAST: u8 = 0x80;
    pub(super) const SEQUENCE_MASK: u8 = 0x7F;
}

/// What an initiate command says of the data (CiA 301, 7.2.4.3.3, 7.2.4.3.6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Initiate {
    /// The data itself: four bytes, `len` of them (1..=4) meant. `None`: the
    /// sender does not tell how many, the receiver takes what the type needs.
    Expedited {
        /// The four bytes; those past `len` are zero.
        data: [u8; EXPEDITED_MAX],
        /// How many are meant.
        len: Option<u8>,
    },
    /// Segments follow, of this many bytes in all if told.
    Segmented {
        /// Bytes in all.
        size: Option<u32>,
    },
}

impl Initiate {
    /// An expedited transfer of `data`; `None` unless it has 1..=4 bytes.
    pub fn expedited(data: &[u8]) -> Option<Initiate> {
        if data.is_empty() {
            return None;
        }
        let mut bytes = [0; EXPEDITED_MAX];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        Some(Initiate::Expedited {
            data: bytes,
            len: Some(data.len() as u8),
        })
    }

    fn parse(bytes: Bytes) -> Initiate {
        let [command, _, _, _, a, b, c, d] = bytes;
        let told = command & SIZE_TOLD != 0;
        if command & EXPEDITED == 0 {
            let size = told.then(|| u32::from_le_bytes([a, b, c, d]));
            return Initiate::Segmented { size };
        }
        let len = told.then_some(EXPEDITED_MAX as u8 - ((command >> 2) & 0x03));
        let mut data = [a, b, c, d];
        for byte in data.iter_mut().skip(len.map_or(EXPEDITED_MAX, usize::from)) {
            *byte = 0;
        }
        Initiate::Expedited { data, len }
    }

    fn emit(self, specifier: u8, at: Address) -> Bytes {
        let (flags, data) = match self {
            Initiate::Expedited { data, len: None } => (EXPEDITED, data),
            Initiate::Expedited {
                data,
                len: Some(len),
            } => {
                let unused = (EXPEDITED_MAX as u8).saturating_sub(len) & 0x03;
                (EXPEDITED | SIZE_TOLD | unused << 2, data)
            }
            Initiate::Segmented { size: None } => (0, [0; 4]),
            Initiate::Segmented { size: Some(size) } => (SIZE_TOLD, size.to_le_bytes()),
        };
        addressed(specifier << SPECIFIER_SHIFT | flags, at, data)
    }
}

/// One segment of up to seven bytes (CiA 301, 7.2.4.3.4, 7.2.4.3.7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Segment {
    /// Alternates, starting with `false`.
    pub toggle: bool,
    /// No segment follows.
    pub last: bool,
    len: u8,
    data: [u8; SEGMENT_MAX],
}

impl Segment {
    /// `None` if `data` has more than seven bytes.
    pub fn new(toggle: bool, last: bool, data: &[u8]) -> Option<Segment> {
        let mut bytes = [0; SEGMENT_MAX];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        Some(Segment {
            toggle,
            last,
            len: data.len() as u8,
            data: bytes,
        })
    }

    /// The 0..=7 data bytes.
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&[])
    }

    /// Neither data nor the end: a transfer of such segments would never end.
    pub(super) const fn is_fruitless(&self) -> bool {
        self.len == 0 && !self.last
    }

    fn parse(bytes: Bytes) -> Segment {
        let [command, data @ ..] = bytes;
        let len = SEGMENT_MAX as u8 - ((command >> 1) & 0x07);
        let mut data = data;
        for byte in data.iter_mut().skip(usize::from(len)) {
            *byte = 0;
        }
        Segment {
            toggle: command & TOGGLE != 0,
            last: command & LAST != 0,
            len,
            data,
        }
    }

    fn emit(self, specifier: u8) -> Bytes {
        let unused = (SEGMENT_MAX as u8).saturating_sub(self.len);
        let command = specifier << SPECIFIER_SHIFT
            | toggle_bit(self.toggle)
            | unused << 1
            | u8::from(self.last);
        let [a, b, c, d, e, f, g] = self.data;
        [command, a, b, c, d, e, f, g]
    }
}

/// One segment of a block: seven bytes and a sequence number instead of a
/// command specifier (CiA 301, 7.2.4.3.10, 7.2.4.3.14).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BlockSegment {
    /// The last segment of the transfer, not merely of the block.
    pub last: bool,
    /// 1..=127.
    pub sequence: u8,
    /// How many of the last segment's bytes are meant is told by the end
    /// command.
    pub data: [u8; SEGMENT_MAX],
}

impl BlockSegment {
    /// `None` if the sequence number is 0, as in an abort (0x80).
    pub fn decode(bytes: Bytes) -> Option<BlockSegment> {
        let [head, data @ ..] = bytes;
        let sequence = head & block::SEQUENCE_MASK;
        (sequence != 0).then_some(BlockSegment {
            last: head & block::LAST != 0,
            sequence,
            data,
        })
    }

    /// The eight bytes of the frame.
    pub const fn encode(&self) -> Bytes {
        let last = if self.last { block::LAST } else { 0 };
        let [a, b, c, d, e, f, g] = self.data;
        let head = last | (self.sequence & block::SEQUENCE_MASK);
        [head, a, b, c, d, e, f, g]
    }
}

/// Index and sub-index in bytes 1..=3.
pub(super) const fn address(bytes: Bytes) -> Address {
    let [_, low, high, sub, ..] = bytes;
    Address {
        index: Index(u16::from_le_bytes([low, high])),
        sub: SubIndex(sub),
    }
}

/// The number in bytes 4..=7.
const fn tail(bytes: Bytes) -> u32 {
    let [.., a, b, c, d] = bytes;
    u32::from_le_bytes([a, b, c, d])
}

const fn addressed(command: u8, at: Address, data: [u8; 4]) -> Bytes {
    let [low, high] = at.index.0.to_le_bytes();
    let [a, b, c, d] = data;
    [command, low, high, at.sub.0, a, b, c, d]
}

const fn bare(command: u8) -> Bytes {
    [command, 0, 0, 0, 0, 0, 0, 0]
}

const fn toggle_bit(toggle: bool) -> u8 {
    if toggle { TOGGLE } else { 0 }
}

const fn crc_bit(crc: bool) -> u8 {
    if crc { block::CRC } else { 0 }
}

fn block_initiate(specifier: u8, at: Address, crc: bool, size: Option<u32>) -> Bytes {
    let told = if size.is_some() { block::SIZE_TOLD } else { 0 };
    addressed(
        specifier << SPECIFIER_SHIFT | crc_bit(crc) | told,
        at,
        size.unwrap_or(0).to_le_bytes(),
    )
}

const fn block_end(specifier: u8, unused: u8, crc: u16) -> Bytes {
    let unused = (unused & block::UNUSED_MASK) << block::UNUSED_SHIFT;
    let [low, high] = crc.to_le_bytes();
    let command = specifier << SPECIFIER_SHIFT | unused | block::END;
    [command, low, high, 0, 0, 0, 0, 0]
}

const fn block_acknowledge(specifier: u8, sequence: u8, block_size: u8) -> Bytes {
    let command = specifier << SPECIFIER_SHIFT | block::ACKNOWLEDGE;
    [command, sequence, block_size, 0, 0, 0, 0, 0]
}

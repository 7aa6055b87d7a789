//! A classical CAN frame as it is on the wire, exact to the stuff bit
//! (ISO 11898-1:2015, 10.4 "MAC frame structure" and 10.5 "frame coding").

use canmaster::{CobId, Frame};
use std::fmt;

/// The longest data field of a classical frame in bytes.
pub const MAX_DATA: usize = 8;
/// Bits of the intermission that follows every frame.
pub const INTERMISSION_BITS: u32 = 3;
/// CRC delimiter, acknowledge slot, acknowledge delimiter and end of frame:
/// the part that is not stuffed.
pub const TAIL_BITS: u32 = 10;

/// Generator polynomial of the CRC-15: x^15+x^14+x^10+x^8+x^7+x^4+x^3+1.
const CRC_POLYNOMIAL: u16 = 0x4599;
const CRC_BITS: u32 = 15;
const CRC_MASK: u16 = (1 << CRC_BITS) - 1;
/// After this many equal bits the transmitter inserts one of the other value.
const STUFF_RUN: u32 = 5;
const STANDARD_ID_MASK: u16 = 0x7FF;
const EXTENDED_ID_MASK: u32 = 0x1FFF_FFFF;
const EXTENSION_BITS: u32 = 18;
const EXTENSION_MASK: u32 = (1 << EXTENSION_BITS) - 1;
const DLC_MASK: u8 = 0x0F;

/// An identifier on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum WireId {
    /// Base format, 11 bits.
    Standard(u16),
    /// Extended format, 29 bits.
    Extended(u32),
}

/// A classical CAN frame. Bits of `id` beyond its format and bytes of `data`
/// beyond the DLC are not on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct WireFrame {
    /// Identifier and format.
    pub id: WireId,
    /// A remote frame: no data, whatever `dlc` says.
    pub rtr: bool,
    /// Data length code, 0..=15; 9..=15 mean 8 bytes.
    pub dlc: u8,
    /// The data; the first [`WireFrame::len`] bytes are sent.
    pub data: [u8; MAX_DATA],
}

impl WireFrame {
    /// A data frame with a base identifier. Data beyond 8 bytes is cut off.
    pub fn standard(id: u16, data: &[u8]) -> WireFrame {
        Self::with_data(WireId::Standard(id & STANDARD_ID_MASK), data)
    }

    /// A data frame with an extended identifier. Data beyond 8 bytes is cut
    /// off.
    pub fn extended(id: u32, data: &[u8]) -> WireFrame {
        Self::with_data(WireId::Extended(id & EXTENDED_ID_MASK), data)
    }

    fn with_data(id: WireId, data: &[u8]) -> WireFrame {
        let len = data.len().min(MAX_DATA);
        let mut bytes = [0; MAX_DATA];
        bytes[..len].copy_from_slice(&data[..len]);
        WireFrame {
            id,
            rtr: false,
            dlc: len as u8,
            data: bytes,
        }
    }

    /// A remote frame.
    pub fn remote(id: WireId, dlc: u8) -> WireFrame {
        WireFrame {
            id,
            rtr: true,
            dlc: dlc & DLC_MASK,
            data: [0; MAX_DATA],
        }
    }

    /// Number of data bytes on the wire.
    pub fn len(&self) -> usize {
        if self.rtr {
            0
        } else {
            usize::from(self.dlc & DLC_MASK).min(MAX_DATA)
        }
    }

    /// Whether there is no data field.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The data field.
    pub fn payload(&self) -> &[u8] {
        &self.data[..self.len()]
    }

    /// Whether both are the same bits on the wire.
    pub fn same_on_wire(&self, other: &WireFrame) -> bool {
        self.id == other.id
            && self.rtr == other.rtr
            && self.dlc == other.dlc
            && self.payload() == other.payload()
    }

    /// SOF to the end of the data field without stuffing: the bits,
    /// right-aligned, and their number.
    fn header_and_data(&self) -> (u128, u32) {
        let mut bits: u128 = 0;
        let mut n = 0;
        let mut push = |value: u32, width: u32| {
            bits = (bits << width) | u128::from(value);
            n += width;
        };
        let rtr = u32::from(self.rtr);
        push(0, 1); // SOF
        match self.id {
            WireId::Standard(id) => {
                push(u32::from(id & STANDARD_ID_MASK), 11);
                push(rtr, 1);
                push(0, 2); // IDE, r0 (FDF)
            }
            WireId::Extended(id) => {
                push((id & EXTENDED_ID_MASK) >> EXTENSION_BITS, 11);
                push(0b11, 2); // SRR, IDE
                push(id & EXTENSION_MASK, EXTENSION_BITS);
                push(rtr, 1);
                push(0, 2); // r1 (FDF), r0
            }
        }
        push(u32::from(self.dlc & DLC_MASK), 4);
        for &byte in self.payload() {
            push(u32::from(byte), 8);
        }
        (bits, n)
    }

    /// The arbitration field, left-aligned, without SOF: of frames that start
    /// together the one with the lowest key wins. Base frames put the dominant
    /// IDE after the RTR bit, so that the formats compare as on the wire.
    pub fn arbitration_key(&self) -> u32 {
        let rtr = u32::from(self.rtr);
        match self.id {
            WireId::Standard(id) => (u32::from(id & STANDARD_ID_MASK) << 21) | (rtr << 20),
            WireId::Extended(id) => {
                let id = id & EXTENDED_ID_MASK;
                ((id >> EXTENSION_BITS) << 21) | (0b11 << 19) | ((id & EXTENSION_MASK) << 1) | rtr
            }
        }
    }

    /// The exact bit sequence from SOF to the end of EOF, as the transmitter
    /// sends it (the acknowledge slot recessive).
    pub fn encode(&self) -> BitString {
        let (bits, n) = self.header_and_data();
        let crc = (0..n)
            .rev()
            .fold(0, |crc, i| crc15(crc, bits >> i & 1 != 0));
        let (bits, n) = ((bits << CRC_BITS) | u128::from(crc), n + CRC_BITS);

        let mut out = BitString::new();
        let (mut last, mut run) = (true, 0);
        for i in (0..n).rev() {
            let bit = bits >> i & 1 != 0;
            out.push(bit);
            run = if bit == last { run + 1 } else { 1 };
            last = bit;
            if run == STUFF_RUN {
                out.push(!bit);
                last = !bit;
                run = 1;
            }
        }
        out.stuffed = out.len;
        for _ in 0..TAIL_BITS {
            out.push(true);
        }
        out
    }

    /// Bits that the frame takes on the bus, stuff bits and the interframe
    /// space of 3 bits included: the figure for bus load.
    pub fn bits(&self) -> u32 {
        self.encode().len() + INTERMISSION_BITS
    }
}

/// Steps the CRC-15 by one bit of the unstuffed stream.
pub(crate) fn crc15(crc: u16, bit: bool) -> u16 {
    let invert = bit != (crc >> (CRC_BITS - 1) & 1 != 0);
    let shifted = (crc << 1) & CRC_MASK;
    if invert {
        shifted ^ CRC_POLYNOMIAL
    } else {
        shifted
    }
}

/// The bits of one frame, recessive = true. Fits the longest classical frame
/// without allocation.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct BitString {
    words: [u64; Self::WORDS],
    len: u32,
    stuffed: u32,
}

impl BitString {
    // 118 bits SOF to CRC with 29 stuff bits and 10 bits of tail: 157.
    const WORDS: usize = 3;

    const fn new() -> BitString {
        BitString {
            words: [0; Self::WORDS],
            len: 0,
            stuffed: 0,
        }
    }

    fn push(&mut self, bit: bool) {
        self.words[(self.len / u64::BITS) as usize] |= u64::from(bit) << (self.len % u64::BITS);
        self.len += 1;
    }

    /// Number of bits, SOF to the end of EOF.
    pub const fn len(&self) -> u32 {
        self.len
    }

    /// Whether there are no bits; no frame is empty.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Number of bits from SOF to the end of the CRC sequence, its stuff bits
    /// included: the index of the CRC delimiter.
    pub const fn stuffed_len(&self) -> u32 {
        self.stuffed
    }

    /// Bit `i` after SOF, true = recessive; past the end the bus is recessive.
    pub fn get(&self, i: u32) -> bool {
        if i >= self.len {
            return true;
        }
        self.words[(i / u64::BITS) as usize] >> (i % u64::BITS) & 1 != 0
    }

    /// All bits from SOF on.
    pub fn iter(&self) -> impl Iterator<Item = bool> + '_ {
        (0..self.len).map(|i| self.get(i))
    }

    /// Where bit `plain` of the stream without stuffing is on the wire.
    pub fn wire_index(&self, plain: u32) -> u32 {
        let (mut run, mut index) = (0, 0);
        for _ in 0..plain {
            run = match index {
                0 => 1,
                _ if self.get(index) == self.get(index - 1) => run + 1,
                _ => 1,
            };
            index += 1;
            if run == STUFF_RUN {
                run = 1;
                index += 1;
            }
        }
        index
    }

    /// Index of the last recessive to dominant edge, SOF counting as one.
    pub fn last_falling_edge(&self) -> u32 {
        (1..self.stuffed)
            .rev()
            .find(|&i| self.get(i - 1) && !self.get(i))
            .unwrap_or(0)
    }
}

/// As zeros and ones.
impl fmt::Debug for BitString {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.iter()
            .try_for_each(|bit| f.write_str(if bit { "1" } else { "0" }))
    }
}

impl From<Frame> for WireFrame {
    fn from(frame: Frame) -> WireFrame {
        WireFrame {
            id: WireId::Standard(frame.id().get()),
            rtr: frame.is_remote(),
            dlc: frame.dlc(),
            data: frame.padded(),
        }
    }
}

/// Why a frame of the wire is none of the library's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NotCanopen {
    /// CANopen as used here has 11-bit identifiers.
    #[error("extended identifier {0:08X}h: only 11-bit identifiers are used here")]
    Extended(u32),
    /// A base identifier has 11 bits.
    #[error("identifier {0:04X}h has more than 11 bits")]
    IdRange(u16),
    /// Classical CAN allows 9..=15, CANopen does not.
    #[error("data length code {0}: CANopen allows 0 to 8")]
    Dlc(u8),
}

impl TryFrom<WireFrame> for Frame {
    type Error = NotCanopen;

    fn try_from(frame: WireFrame) -> Result<Frame, NotCanopen> {
        let id = match frame.id {
            WireId::Standard(id) => CobId::new(id).ok_or(NotCanopen::IdRange(id))?,
            WireId::Extended(id) => return Err(NotCanopen::Extended(id)),
        };
        let dlc = NotCanopen::Dlc(frame.dlc);
        if usize::from(frame.dlc) > MAX_DATA {
            return Err(dlc);
        }
        if frame.rtr {
            Frame::remote_frame(id, frame.dlc).ok_or(dlc)
        } else {
            Frame::data_frame(id, frame.payload()).ok_or(dlc)
        }
    }
}

#[cfg(test)]
mod tests;

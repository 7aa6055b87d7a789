//! The receiving half of a controller: takes the stuffed bits in, one by one.

use crate::frame::{MAX_DATA, WireFrame, WireId, crc15};

/// After this many equal bits a stuff bit of the other value must follow.
const STUFF_RUN: u32 = 5;
const CRC_BITS: u32 = 15;
/// Bits from SOF to the end of the DLC.
const BASE_HEADER: u32 = 19;
const EXTENDED_HEADER: u32 = 39;
/// Index of the IDE bit, in both formats.
const IDE: u32 = 13;

/// What a bit did to the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Progress {
    /// More bits of the stuffed part follow.
    More,
    /// That was the last one; the CRC delimiter follows.
    Complete,
    /// A sixth equal bit.
    StuffError,
}

/// SOF to CRC of the frame that is coming in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Decoder {
    /// The bits without stuffing, the newest at the right.
    bits: u128,
    len: u32,
    /// Known once the DLC is in.
    total: u32,
    crc: u16,
    last: bool,
    run: u32,
}

impl Decoder {
    pub(super) fn new() -> Decoder {
        Decoder {
            bits: 0,
            len: 0,
            total: u32::MAX,
            crc: 0,
            last: true,
            run: 0,
        }
    }

    /// Index of the next bit in the stream without stuffing, SOF = 0.
    pub(super) fn len(&self) -> u32 {
        self.len
    }

    /// Whether the next bit is a stuff bit.
    pub(super) fn expects_stuff_bit(&self) -> bool {
        self.run == STUFF_RUN
    }

    pub(super) fn push(&mut self, bit: bool) -> Progress {
        if self.expects_stuff_bit() {
            if bit == self.last {
                return Progress::StuffError;
            }
            self.run = 1;
        } else {
            self.run = if bit == self.last { self.run + 1 } else { 1 };
            self.bits = self.bits << 1 | u128::from(bit);
            self.len += 1;
            self.crc = crc15(self.crc, bit);
            self.note_length();
        }
        self.last = bit;
        if self.len == self.total && !self.expects_stuff_bit() {
            Progress::Complete
        } else {
            Progress::More
        }
    }

    /// Bit `i` since SOF.
    fn bit(&self, i: u32) -> bool {
        self.bits >> (self.len - 1 - i) & 1 != 0
    }

    /// `width` bits from `first` on.
    fn field(&self, first: u32, width: u32) -> u32 {
        (self.bits >> (self.len - first - width)) as u32 & ((1 << width) - 1)
    }

    fn note_length(&mut self) {
        let header = self.len == BASE_HEADER || self.len == EXTENDED_HEADER;
        if header && self.total == u32::MAX && (self.bit(IDE) == (self.len == EXTENDED_HEADER)) {
            self.total = self.len + 8 * self.frame().len() as u32 + CRC_BITS;
        }
    }

    /// Whether the CRC sequence matches: dividing data and CRC leaves nothing.
    pub(super) fn crc_matches(&self) -> bool {
        self.crc == 0
    }

    /// The frame, as far as it is in; the header must be.
    pub(super) fn frame(&self) -> WireFrame {
        let extended = self.bit(IDE);
        let (id, rtr, header) = if extended {
            let id = self.field(1, 11) << 18 | self.field(IDE + 1, 18);
            (WireId::Extended(id), self.bit(32), EXTENDED_HEADER)
        } else {
            let id = self.field(1, 11) as u16;
            (WireId::Standard(id), self.bit(12), BASE_HEADER)
        };
        let mut frame = WireFrame {
            id,
            rtr,
            dlc: self.field(header - 4, 4) as u8,
            data: [0; MAX_DATA],
        };
        let here = (self.len - header) as usize / 8;
        for i in 0..frame.len().min(here) {
            frame.data[i] = self.field(header + 8 * i as u32, 8) as u8;
        }
        frame
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(frame: &WireFrame) -> Decoder {
        let bits = frame.encode();
        let mut decoder = Decoder::new();
        for i in 0..bits.stuffed_len() {
            let last = i + 1 == bits.stuffed_len();
            let expected = if last {
                Progress::Complete
            } else {
                Progress::More
            };
            assert_eq!(decoder.push(bits.get(i)), expected, "{frame:?} bit {i}");
        }
        decoder
    }

    #[test]
    fn takes_in_what_the_encoder_sends() {
        for n in 0..=8usize {
            let data = [0x00, 0xFF, 0x55, 0x0F, 0xF0, 0x80, 0x01, 0x7E];
            let ids = (0..0x800)
                .step_by(7)
                .map(|id| WireFrame::standard(id, &data[..n]));
            let extended = (0..40).map(|i| WireFrame::extended(0x0123_4567 * i, &data[..n]));
            let remotes = [
                WireFrame::remote(WireId::Standard(0x701), n as u8),
                WireFrame::remote(WireId::Extended(0x1FFF_FFFF), n as u8),
            ];
            for frame in ids.chain(extended).chain(remotes) {
                let decoder = decode(&frame);
                assert!(decoder.crc_matches());
                assert_eq!(decoder.frame(), frame);
            }
        }
    }

    #[test]
    fn every_single_flipped_bit_is_noticed() {
        let frame = WireFrame::standard(0x181, &[1, 2, 3, 4, 5, 6]);
        let bits = frame.encode();
        for flipped in 0..bits.stuffed_len() {
            let mut decoder = Decoder::new();
            let mut seen = (0..bits.len()).map(|i| bits.get(i) != (i == flipped));
            let end = seen
                .by_ref()
                .map(|bit| decoder.push(bit))
                .find(|p| *p != Progress::More);
            let noticed = match end {
                Some(Progress::StuffError) | None => true,
                // The form (the delimiters) or the CRC gives it away.
                _ => !decoder.crc_matches() || seen.any(|bit| !bit),
            };
            assert!(noticed || flipped == 0, "bit {flipped}");
        }
    }
}

//! Data for tests of a transfer: as much as one likes, without a buffer.
//!
//! The bytes are those of little-endian 32-bit words. Word `k` is
//! h(seed + k * 9E3779B9h) modulo 2^32, where h(x) is x ^= x >> 16,
//! x *= 7FEB352Dh, x ^= x >> 15, x *= 846CA68Bh, x ^= x >> 16. Any byte can be
//! made by itself, so that what was lost on the way can be sent again.

use super::abort::AbortCode;
use super::channel::Payload;

/// Bytes of a word.
const WORD: u32 = 4;
const STEP: u32 = 0x9E37_79B9;
const FIRST_FACTOR: u32 = 0x7FEB_352D;
const SECOND_FACTOR: u32 = 0x846C_A68B;

/// Makes the data of a download and checks that of an upload.
#[derive(Clone, Copy, Debug)]
pub struct TestData {
    seed: u32,
    reached: u32,
}

impl TestData {
    /// The data of a seed.
    pub const fn new(seed: u32) -> TestData {
        TestData { seed, reached: 0 }
    }

    /// Up to where the data were made or found right.
    pub const fn reached(&self) -> u32 {
        self.reached
    }

    /// Byte number `at`.
    pub const fn byte(&self, at: u32) -> u8 {
        let (word, byte) = (at / WORD, at % WORD);
        let x = self.seed.wrapping_add(word.wrapping_mul(STEP));
        let x = (x ^ x >> 16).wrapping_mul(FIRST_FACTOR);
        let x = (x ^ x >> 15).wrapping_mul(SECOND_FACTOR);
        ((x ^ x >> 16) >> (u8::BITS * byte)) as u8
    }
}

impl Payload for TestData {
    fn read(&mut self, offset: u32, buf: &mut [u8]) {
        let mut at = offset;
        for byte in buf {
            *byte = self.byte(at);
            at = at.wrapping_add(1);
        }
        self.reached = at.max(self.reached);
    }

    fn begin(&mut self, _: Option<u32>) -> Result<(), AbortCode> {
        Ok(())
    }

    /// # Errors
    /// 06090030h for data that are not the seed's.
    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), AbortCode> {
        let mut at = offset;
        for byte in data {
            if *byte != self.byte(at) {
                return Err(AbortCode::VALUE_RANGE);
            }
            at = at.wrapping_add(1);
        }
        self.reached = at;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Worked out from the definition by other means.
    #[test]
    fn the_bytes_of_a_seed() {
        let mut data = TestData::new(0);
        let mut bytes = [0; 12];
        data.read(0, &mut bytes);
        assert_eq!(
            bytes,
            [
                0x00, 0x00, 0x00, 0x00, 0x52, 0xE5, 0xFC, 0x01, 0x9E, 0xD2, 0xF8, 0x04
            ]
        );
        assert_eq!(data.reached(), 12);
        let mut tail = [0; 5];
        data.read(7, &mut tail);
        assert_eq!(tail, bytes[7..]);
        assert_eq!(data.reached(), 12, "sent again");
    }

    #[test]
    fn other_data_are_refused_and_where_is_told() {
        let mut source = TestData::new(7);
        let mut bytes = [0; 21];
        source.read(0, &mut bytes);
        let mut check = TestData::new(7);
        check.write(0, &bytes[..7]).unwrap();
        check.write(7, &bytes[7..14]).unwrap();
        bytes[20] ^= 1;
        assert_eq!(check.write(14, &bytes[14..]), Err(AbortCode::VALUE_RANGE));
        assert_eq!(check.reached(), 14);
    }
}

//! An object for tests of a client: a domain of any size whose bytes follow from
//! a seed. What is read is made, what is written is checked. No EPOS4 has it.
//!
//! The bytes are those of little-endian 32-bit words. Word `k` is
//! h(seed + k * 9E3779B9h) modulo 2^32, with h(x): x ^= x >> 16, x *= 7FEB352Dh,
//! x ^= x >> 15, x *= 846CA68Bh, x ^= x >> 16.

use canmaster::od::{Chunk, Part};
use canmaster::sdo::AbortCode;

/// Where the object is.
pub const INDEX: u16 = 0x2FF0;

const STEP: u32 = 0x9E37_79B9;
const FACTORS: [u32; 2] = [0x7FEB_352D, 0x846C_A68B];

/// The object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TestData {
    seed: u32,
    size: u32,
    received: u32,
    first_wrong: Option<u32>,
    complete: bool,
}

impl TestData {
    /// `size` bytes that follow from `seed`.
    pub const fn new(seed: u32, size: u32) -> TestData {
        TestData {
            seed,
            size,
            received: 0,
            first_wrong: None,
            complete: false,
        }
    }

    /// Byte number `i`.
    pub fn byte(&self, i: u32) -> u8 {
        let mut word = self.seed.wrapping_add((i / 4).wrapping_mul(STEP));
        word ^= word >> 16;
        word = word.wrapping_mul(FACTORS[0]);
        word ^= word >> 15;
        word = word.wrapping_mul(FACTORS[1]);
        word ^= word >> 16;
        word.to_le_bytes()[(i % 4) as usize]
    }

    /// Bytes that the last download brought so far.
    pub const fn received(&self) -> u32 {
        self.received
    }

    /// The first byte of the last download that is not what it should be.
    pub const fn first_wrong(&self) -> Option<u32> {
        self.first_wrong
    }

    /// The last download came to its end, with all bytes and every one right.
    pub const fn is_sound(&self) -> bool {
        self.complete && self.received == self.size && self.first_wrong.is_none()
    }

    pub(super) fn read(&self, offset: u32, buf: &mut [u8]) -> Chunk {
        let left = self.size.saturating_sub(offset);
        let len = buf.len().min(left as usize);
        for (byte, i) in buf.iter_mut().zip(offset..self.size) {
            *byte = self.byte(i);
        }
        Chunk {
            len,
            size: Some(self.size),
            last: len == left as usize,
        }
    }

    pub(super) fn write(&mut self, part: Part<'_>) -> Result<(), AbortCode> {
        if part.size.is_some_and(|told| told != self.size) {
            return Err(AbortCode::LENGTH_MISMATCH);
        }
        if part.offset == 0 {
            *self = TestData::new(self.seed, self.size);
        }
        for (byte, i) in part.data.iter().zip(part.offset..) {
            if *byte != self.byte(i) {
                self.first_wrong.get_or_insert(i);
            }
        }
        self.received = part.offset + part.data.len() as u32;
        self.complete = part.last;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bytes_follow_from_the_seed() {
        let data = TestData::new(1, 10);
        let mut all = [0; 16];
        let chunk = data.read(0, &mut all);
        assert_eq!((chunk.len, chunk.size, chunk.last), (10, Some(10), true));
        // Pieces are the same as the whole.
        for at in 0..10 {
            let mut piece = [0; 3];
            let chunk = data.read(at, &mut piece);
            let at = at as usize;
            assert_eq!(piece[..chunk.len], all[at..at + chunk.len]);
        }
        assert_ne!(data.byte(0), TestData::new(2, 10).byte(0));
    }

    fn part(data: &[u8], last: bool) -> Part<'_> {
        Part {
            offset: 0,
            data,
            size: Some(3),
            last,
        }
    }

    #[test]
    fn a_wrong_byte_shows() {
        let mut data = TestData::new(7, 3);
        let mut bytes: Vec<u8> = (0..3).map(|i| data.byte(i)).collect();
        data.write(part(&bytes, false)).unwrap();
        assert!(!data.is_sound(), "not complete");
        data.write(part(&bytes, true)).unwrap();
        assert!(data.is_sound());
        bytes[1] ^= 1;
        data.write(part(&bytes, true)).unwrap();
        assert_eq!(data.first_wrong(), Some(1));
        assert!(!data.is_sound());
    }
}

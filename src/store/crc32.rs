//! CRC-32 as Ethernet has it, computed bit by bit: a record is checked a few
//! times in the life of a program.

/// The polynomial, least significant bit first.
const POLYNOMIAL: u32 = 0xEDB8_8320;

/// CRC-32 (ISO-HDLC): reflected, initial value and final xor all ones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crc32(u32);

impl Crc32 {
    pub(super) const fn new() -> Crc32 {
        Crc32(u32::MAX)
    }

    pub(super) fn update(&mut self, data: &[u8]) {
        for byte in data {
            self.0 ^= u32::from(*byte);
            for _ in 0..u8::BITS {
                let odd = self.0 & 1 != 0;
                self.0 = self.0 >> 1 ^ if odd { POLYNOMIAL } else { 0 };
            }
        }
    }

    pub(super) const fn value(self) -> u32 {
        !self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_value_of_the_catalogue() {
        let mut crc = Crc32::new();
        crc.update(b"12345");
        crc.update(b"6789");
        assert_eq!(crc.value(), 0xCBF4_3926);
    }
}

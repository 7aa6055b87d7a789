//! The checksum of block transfers (CiA 301, 7.2.4.3.16).

/// CRC-16 with the polynomial x^16 + x^12 + x^5 + 1, most significant bit
/// first, initial value 0, no final inversion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Crc16(u16);

const POLYNOMIAL: u16 = 0x1021;

/// The effect of one byte.
const fn step(crc: u16, byte: u8) -> u16 {
    let mut crc = crc ^ (byte as u16) << 8;
    let mut bit = 0;
    while bit < u8::BITS {
        crc = if crc & 0x8000 != 0 {
            crc << 1 ^ POLYNOMIAL
        } else {
            crc << 1
        };
        bit += 1;
    }
    crc
}

impl Crc16 {
    /// Of no data.
    pub const fn new() -> Crc16 {
        Crc16(0)
    }

    /// Of the data so far and `data`.
    #[must_use]
    pub const fn update(self, data: &[u8]) -> Crc16 {
        let (mut crc, mut left) = (self.0, data);
        while let Some((byte, others)) = left.split_first() {
            crc = step(crc, *byte);
            left = others;
        }
        Crc16(crc)
    }

    /// The checksum.
    pub const fn get(self) -> u16 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_value_of_the_standard() {
        assert_eq!(Crc16::new().update(b"123456789").get(), 0x31C3);
        let halves = Crc16::new().update(b"1234").update(b"56789");
        assert_eq!(halves.get(), 0x31C3);
        assert_eq!(Crc16::new().update(&[0; 100]).get(), 0);
    }
}

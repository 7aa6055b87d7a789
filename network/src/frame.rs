//! How long a frame is on the wire.

/// A data frame with an 11-bit identifier and `bytes` of data, in bits, with
/// interframe space and without stuff bits.
pub const fn shortest_bits(bytes: u8) -> u32 {
    47 + 8 * bytes as u32
}

/// The same with the most stuff bits there can be: 34 + 8n bits are stuffed, and
/// after the first five one in four is a stuff bit.
pub const fn longest_bits(bytes: u8) -> u32 {
    const BEFORE_DATA_AND_CRC: u32 = 33;
    shortest_bits(bytes) + (BEFORE_DATA_AND_CRC + 8 * bytes as u32) / 4
}

/// Every SDO frame has eight bytes (CiA 301, 7.2.4.3).
pub const SDO_BYTES: u8 = 8;
/// SYNC without counter (CiA 301, 7.2.5).
pub const SYNC_BYTES: u8 = 0;
/// Heartbeat (CiA 301, 7.2.8.3.2.2).
pub const HEARTBEAT_BYTES: u8 = 1;
/// EMCY (CiA 301, 7.2.7.2).
pub const EMCY_BYTES: u8 = 8;
/// TIME (CiA 301, 7.2.6), longer than any NMT command.
pub const TIME_BYTES: u8 = 6;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_of_every_frame() {
        let shortest = [47, 55, 63, 71, 79, 87, 95, 103, 111];
        let longest = [55, 65, 75, 85, 95, 105, 115, 125, 135];
        for (bytes, (short, long)) in (0..).zip(shortest.into_iter().zip(longest)) {
            assert_eq!((shortest_bits(bytes), longest_bits(bytes)), (short, long));
        }
    }
}

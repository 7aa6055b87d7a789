//! How many nodes can be updated in 0.1 s: by SDO and by PDO.
//!
//! Each node gets controlword, target velocity, profile acceleration and profile
//! deceleration: by four SDO downloads with their answers and 8 ms of spacing
//! that the drive asks for; or by two RPDOs of 8 and 6 bytes, and one SYNC for
//! all nodes.

use crate::frame::{SDO_BYTES, SYNC_BYTES, longest_bits};

/// The most nodes of a network (CiA 301, 7.3.5).
pub const NODES_MAX: u32 = 127;
/// The bit rates of the table.
pub const BIT_RATES: [u32; 9] = [
    1_000_000, 800_000, 500_000, 250_000, 125_000, 100_000, 50_000, 20_000, 10_000,
];

/// Intervals in a second: 0.1 s.
const PER_SECOND: u64 = 10;
/// What the drive wants between requests, all four together, ms.
const SPACING_MS: u64 = 8;
const MS_PER_SECOND: u64 = 1000;
/// Bytes of each of the four parameters.
const PARAMETERS: [u8; 4] = [2, 4, 4, 4];
/// Bytes of the two RPDOs.
const RPDOS: [u8; 2] = [8, 6];
/// Command byte, index, sub-index.
const SDO_HEAD: u8 = 4;

/// One bit rate of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
    /// bit/s
    pub bit_rate: u32,
    /// SDO, with frames as long as what they carry, as the paper counts them.
    pub sdo_paper: u32,
    /// SDO, with frames of eight bytes (CiA 301).
    pub sdo_exact: u32,
    /// PDO, as the paper counts them, before the limit of 127.
    pub pdo_paper_uncapped: u32,
    /// PDO by CiA 301, before the limit of 127: a PDO is as long as what it
    /// carries, so it is the same.
    pub pdo_exact_uncapped: u32,
}

impl Row {
    /// The row of a bit rate.
    pub fn new(bit_rate: u32) -> Row {
        let paper: u32 = PARAMETERS
            .iter()
            .map(|bytes| longest_bits(SDO_HEAD + bytes) + longest_bits(SDO_HEAD))
            .sum();
        let exact: u32 = PARAMETERS.iter().map(|_| 2 * longest_bits(SDO_BYTES)).sum();
        let node: u32 = RPDOS.iter().map(|bytes| longest_bits(*bytes)).sum();
        Row {
            bit_rate,
            sdo_paper: by_sdo(bit_rate, paper),
            sdo_exact: by_sdo(bit_rate, exact),
            pdo_paper_uncapped: by_pdo(bit_rate, node),
            pdo_exact_uncapped: by_pdo(bit_rate, node),
        }
    }

    /// PDO as the paper counts, at most 127.
    pub fn pdo_paper(&self) -> u32 {
        self.pdo_paper_uncapped.min(NODES_MAX)
    }

    /// PDO by CiA 301, at most 127.
    pub fn pdo_exact(&self) -> u32 {
        self.pdo_exact_uncapped.min(NODES_MAX)
    }
}

/// floor(0.1 / (bits / rate + 0.008)), in whole numbers.
fn by_sdo(bit_rate: u32, bits: u32) -> u32 {
    let rate = u64::from(bit_rate);
    let of_a_node = u64::from(bits) * MS_PER_SECOND + SPACING_MS * rate;
    (rate * (MS_PER_SECOND / PER_SECOND) / of_a_node) as u32
}

/// floor((0.1 - sync / rate) / (bits / rate)), in whole numbers.
fn by_pdo(bit_rate: u32, bits: u32) -> u32 {
    let interval = bit_rate / PER_SECOND as u32;
    interval.saturating_sub(longest_bits(SYNC_BYTES)) / bits
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_the_paper() {
        let rows = BIT_RATES.map(Row::new);
        assert_eq!(rows.map(|r| r.sdo_paper), [11, 10, 10, 8, 6, 5, 3, 1, 1]);
        let uncapped = [399, 319, 199, 99, 49, 39, 19, 7, 3];
        assert_eq!(rows.map(|r| r.pdo_paper_uncapped), uncapped);
        let capped = [127, 127, 127, 99, 49, 39, 19, 7, 3];
        assert_eq!(rows.map(|r| r.pdo_paper()), capped);
    }

    #[test]
    fn exact_lengths() {
        let rows = BIT_RATES.map(Row::new);
        assert_eq!(rows.map(|r| r.sdo_exact), [11, 10, 9, 8, 6, 5, 3, 1, 0]);
        assert_eq!(
            rows.map(|r| r.pdo_exact_uncapped),
            rows.map(|r| r.pdo_paper_uncapped)
        );
    }
}

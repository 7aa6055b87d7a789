//! The bit rates of the drive: 2001h, in the codes of LSS (CiA 305, 3.9.3).

use canmaster::lss::BitRate;

/// Whether the drive has the bit rate with this code.
pub(super) fn exists(code: u8) -> bool {
    use BitRate::*;
    matches!(
        BitRate::from_index(code),
        Kbit1000 | Kbit800 | Kbit500 | Kbit250 | Kbit125 | Kbit50 | Kbit20 | Automatic
    )
}

/// The bit rate of `code` in bit/s. Automatic finds that of the bus, `bus`, at
/// once: how the real drive searches is not modelled.
pub(super) fn bits_per_second(code: u8, bus: u32) -> u32 {
    BitRate::from_index(code).bits_per_second().unwrap_or(bus)
}

//! A serial number from the chip's unique device ID (RM0440, 48.1).

/// Where the 96 bits are.
const UID: *const u32 = 0x1FFF_7590 as *const u32;
const WORDS: usize = 3;
/// Keeps equal bits of two words apart.
const ROTATION: u32 = 11;

/// 32 bits made of the chip's 96: the same at every start, and hardly ever those
/// of another chip.
pub fn serial_number() -> u32 {
    (0..WORDS).fold(0, |serial: u32, word| {
        // SAFETY: three aligned words of read-only memory that every chip of
        // this family has.
        serial.rotate_left(ROTATION) ^ unsafe { UID.add(word).read_volatile() }
    })
}

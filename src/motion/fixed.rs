//! Fixed-point numbers, by 32-bit instructions only.

/// Bits behind the point of positions and velocities.
const BITS: u32 = 32;
/// One increment.
const ONE: f32 = 4_294_967_296.0;
/// Bits that accelerations have more.
pub(super) const MORE: u32 = 12;
const MORE_ONE: f32 = 4096.0;
/// What a float keeps behind a whole number is taken over with so many bits.
const REST: f32 = 2_147_483_648.0;

/// `x` in 2^-32.
pub(super) const fn whole(x: i32) -> i64 {
    (x as i64) << BITS
}

/// The nearest whole number.
pub(super) const fn round(x: i64) -> i32 {
    const HALF: i64 = 1 << (BITS - 1);
    (x.wrapping_add(HALF) >> BITS) as i32
}

/// A number in 2^-32 as it is. The halves are converted by themselves, as the
/// hardware can.
#[inline(never)]
pub(super) const fn float(x: i64) -> f32 {
    float_here(x)
}

/// The same, where every cycle counts.
#[inline(always)]
pub(super) const fn float_here(x: i64) -> f32 {
    (x >> BITS) as i32 as f32 + x as u32 as f32 * (1.0 / ONE)
}

/// `x`, below 2^31, in 2^-32.
#[inline(never)]
pub(super) fn fixed(x: f32) -> i64 {
    fixed_here(x)
}

/// The same, where every cycle counts.
#[inline(always)]
pub(super) fn fixed_here(x: f32) -> i64 {
    let whole = x as i32;
    let rest = ((x - whole as f32) * REST) as i32;
    ((whole as i64) << BITS).wrapping_add((rest as i64) << 1)
}

/// `x`, below 2^19, in 2^-44.
pub(super) fn fine(x: f32) -> i64 {
    fixed(x * MORE_ONE)
}

/// The same, where every cycle counts.
#[inline(always)]
pub(super) fn fine_here(x: f32) -> i64 {
    fixed_here(x * MORE_ONE)
}

/// `x / by`, rounded toward zero; `by` below 2^24. Eight bits at a time.
#[inline(never)]
pub(super) fn div(x: i64, by: u32) -> i64 {
    let by = by.max(1);
    let (mut quotient, mut rest) = (0u64, 0u32);
    for byte in x.unsigned_abs().to_be_bytes() {
        rest = rest << u8::BITS | u32::from(byte);
        quotient = quotient << u8::BITS | u64::from(rest / by);
        rest %= by;
    }
    if x < 0 {
        (quotient as i64).wrapping_neg()
    } else {
        quotient as i64
    }
}

/// The smallest whole number that is at least `x`, which is not negative.
#[inline(never)]
pub(super) fn ceil(x: f32) -> u32 {
    let whole = x as u32;
    whole.saturating_add(u32::from(x > whole as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_division_is_that_of_the_processor() {
        for x in [0, 1, -1, 7, 1 << 40, -(1 << 62), i64::MAX, i64::MIN + 1] {
            for by in [1, 2, 3, 10, 255, 256, 65_537, (1 << 24) - 1] {
                assert_eq!(div(x, by), x / i64::from(by), "{x} / {by}");
            }
        }
        assert_eq!(div(5, 0), 5);
    }

    #[test]
    fn there_and_back() {
        for x in [0.0, 1.0, -1.0, 0.5, -0.25, 1e-6, -1234.5, 500_000.0] {
            assert!(
                (float(fixed(x)) - x).abs() <= x.abs() * 1e-7 + 4.7e-10,
                "{x}"
            );
            assert!((float(fine(x) >> MORE) - x).abs() <= x.abs() * 1e-7 + 2.4e-10);
        }
        assert_eq!(round(fixed(2.5)), 3);
        assert_eq!(round(fixed(-2.5)), -2);
        assert_eq!(round(whole(i32::MIN)), i32::MIN);
        assert_eq!((ceil(0.0), ceil(1.0), ceil(1.01)), (0, 1, 2));
    }
}

//! Bit timing of the FDCAN (RM0440, FDCAN_NBTP) and the limits of CiA 301.

/// How the controller makes a bit: `prescaler` clocks are a quantum, and a bit
/// is one quantum, segment 1 and segment 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTiming {
    /// 1 ..= 512
    pub prescaler: u16,
    /// Quanta before the sample point, without the first: 1 ..= 255; the register
    /// holds 256, the firmware's driver does not.
    pub seg1: u16,
    /// Quanta after it: 1 ..= 128.
    pub seg2: u16,
}

/// The CAN controller runs on the crystal: 24 MHz.
pub const CLOCK_HZ: u32 = 24_000_000;

/// The bit rates of CiA 301, 5.1, table 1.
pub const BIT_RATES: [u32; 8] = [
    1_000_000, 800_000, 500_000, 250_000, 125_000, 50_000, 20_000, 10_000,
];

/// Recommended sample point, per mille.
pub const SAMPLE_POINT: u32 = 875;

const PER_MILLE: u32 = 1000;
const PRESCALER_MAX: u32 = 512;
const SEG1_MAX: u32 = 255;
const SEG2_MAX: u32 = 128;
/// Quanta of a bit: fewer place the sample point too coarsely.
const QUANTA_MIN: u32 = 8;
const QUANTA_MAX: u32 = 1 + SEG1_MAX + SEG2_MAX;
/// How far from the wanted sample point is near enough, per mille.
const NEAR: u32 = 10;

/// Where the sample point may lie, per mille (CiA 301, 5.1, table 1): 75 .. 90 %
/// at 800 kbit/s and above, 85 .. 90 % below. Devices in the field keep to it:
/// Beckhoff's EL6751 samples at 75 % (1 Mbit/s), 80 % (800 kbit/s) and 87 % (all
/// others).
pub fn sample_point_limits(bit_rate: u32) -> (u32, u32) {
    const FAST: u32 = 800_000;
    if bit_rate >= FAST {
        (750, 900)
    } else {
        (850, 900)
    }
}

impl BitTiming {
    /// The timing for a bit rate and a sample point in per mille: that with the
    /// nearest sample point, and of equals that with the most quanta. `None` if
    /// the clock gives no such rate exactly, or no such sample point.
    pub fn find(bit_rate: u32, sample_point: u32) -> Option<BitTiming> {
        let clocks = CLOCK_HZ.checked_div(bit_rate)?;
        if !CLOCK_HZ.is_multiple_of(bit_rate) {
            return None;
        }
        let mut best: Option<(u32, BitTiming)> = None;
        for prescaler in 1..=PRESCALER_MAX {
            let quanta = clocks / prescaler;
            if clocks % prescaler != 0 || !(QUANTA_MIN..=QUANTA_MAX).contains(&quanta) {
                continue;
            }
            let before = (quanta * sample_point + PER_MILLE / 2) / PER_MILLE;
            let (seg1, seg2) = (before.saturating_sub(1), quanta.saturating_sub(before));
            if !(1..=SEG1_MAX).contains(&seg1) || !(1..=SEG2_MAX).contains(&seg2) {
                continue;
            }
            let timing = BitTiming {
                prescaler: prescaler as u16,
                seg1: seg1 as u16,
                seg2: seg2 as u16,
            };
            let off = timing.sample_point().abs_diff(sample_point);
            if best.is_none_or(|(least, _)| off < least) {
                best = Some((off, timing));
            }
        }
        best.filter(|(off, _)| *off <= NEAR)
            .map(|(_, timing)| timing)
    }

    /// Its sample point, per mille.
    pub fn sample_point(self) -> u32 {
        let before = 1 + u32::from(self.seg1);
        before * PER_MILLE / (before + u32::from(self.seg2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_megabit_at_24_mhz() {
        let expected = BitTiming {
            prescaler: 1,
            seg1: 20,
            seg2: 3,
        };
        assert_eq!(BitTiming::find(1_000_000, SAMPLE_POINT), Some(expected));
    }

    #[test]
    fn every_bit_rate_of_the_standard_is_exact() {
        for rate in BIT_RATES {
            let timing = BitTiming::find(rate, SAMPLE_POINT).unwrap();
            let quanta = 1 + u32::from(timing.seg1) + u32::from(timing.seg2);
            assert_eq!(u32::from(timing.prescaler) * quanta * rate, CLOCK_HZ);
            assert!(
                timing.sample_point().abs_diff(SAMPLE_POINT) <= NEAR,
                "{rate}"
            );
        }
    }

    #[test]
    fn no_segment_is_longer_than_the_driver_takes() {
        for rate in BIT_RATES {
            for sample_point in 750..=900 {
                let timing = BitTiming::find(rate, sample_point);
                assert!(timing.is_none_or(|t| t.seg1 <= 255 && t.seg2 <= 128));
            }
        }
    }

    #[test]
    fn what_the_clock_cannot_give() {
        for rate in [0, 7, 900_000, 999_999, 24_000_000, u32::MAX] {
            assert_eq!(BitTiming::find(rate, SAMPLE_POINT), None, "{rate}");
        }
        assert_eq!(BitTiming::find(1_000_000, 1000), None);
        assert_eq!(BitTiming::find(1_000_000, 0), None);
    }
}

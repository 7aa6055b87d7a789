//! Frequencies with their error, and the core's cycles against virtual time.

use crate::time::Time;

/// Picoseconds in a second times microhertz in a hertz: cycles times this over
/// a frequency in microhertz gives picoseconds.
const PS_MICROHERTZ: u128 = 1_000_000_000_000_000_000;
/// Microhertz in a hertz.
const MICRO: u64 = 1_000_000;

/// A frequency in microhertz, so that an error of parts per billion survives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Frequency(u64);

impl Frequency {
    /// A frequency of `hz` hertz.
    #[must_use]
    pub(crate) const fn from_hz(hz: u32) -> Self {
        Self(hz as u64 * MICRO)
    }

    /// The same oscillator, off by `ppb` parts per billion.
    #[must_use]
    pub(crate) fn with_error_ppb(self, ppb: i64) -> Self {
        const BILLION: i128 = 1_000_000_000;
        let scaled = i128::from(self.0) * (BILLION + i128::from(ppb)) / BILLION;
        Self(u64::try_from(scaled.max(1)).unwrap_or(u64::MAX))
    }

    /// Multiplied by `n` and divided by `m`, as a PLL or a prescaler does.
    #[must_use]
    pub(crate) fn scaled(self, n: u32, m: u32) -> Self {
        Self(self.0 * u64::from(n) / u64::from(m.max(1)))
    }

    /// Rounded to whole hertz.
    #[must_use]
    pub(crate) fn hz(self) -> u64 {
        (self.0 + MICRO / 2) / MICRO
    }

    /// How long `cycles` cycles take, in picoseconds, rounded down.
    #[must_use]
    pub(crate) fn duration_ps(self, cycles: u64) -> u64 {
        let ps = u128::from(cycles) * PS_MICROHERTZ / u128::from(self.0.max(1));
        u64::try_from(ps).unwrap_or(u64::MAX)
    }
}

/// Relates the core's cycle count to virtual time.
///
/// The relation is piecewise linear: it is anchored anew whenever the core's
/// clock changes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CoreClock {
    frequency: Frequency,
    anchor_cycle: u64,
    anchor: Time,
}

impl CoreClock {
    /// A clock that counts from `cycle` at `time`.
    #[must_use]
    pub(crate) const fn new(frequency: Frequency, cycle: u64, time: Time) -> Self {
        Self {
            frequency,
            anchor_cycle: cycle,
            anchor: time,
        }
    }

    /// The frequency that holds now.
    #[must_use]
    pub(crate) const fn frequency(&self) -> Frequency {
        self.frequency
    }

    /// When cycle `cycle` begins; the anchor for anything before it.
    #[must_use]
    pub(crate) fn time_of(&self, cycle: u64) -> Time {
        let since = cycle.saturating_sub(self.anchor_cycle);
        Time(self.anchor.0 + self.frequency.duration_ps(since))
    }

    /// The first cycle that begins at `time` or after it.
    #[must_use]
    pub(crate) fn cycle_at(&self, time: Time) -> u64 {
        let since = time.0.saturating_sub(self.anchor.0);
        let scaled = u128::from(since) * u128::from(self.frequency.0);
        let cycles = scaled.div_ceil(PS_MICROHERTZ);
        self.anchor_cycle + u64::try_from(cycles).unwrap_or(u64::MAX / 2)
    }

    /// Goes on from `cycle` with another frequency.
    pub(crate) fn change(&mut self, frequency: Frequency, cycle: u64) {
        *self = Self::new(frequency, cycle, self.time_of(cycle));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fast_crystal_makes_a_second_shorter() {
        let nominal = Frequency::from_hz(24_000_000);
        let fast = nominal.with_error_ppb(100_000);
        assert_eq!(nominal.duration_ps(24_000_000), 1_000_000_000_000);
        assert_eq!(fast.duration_ps(24_000_000), 999_900_009_999);
        assert_eq!(fast.scaled(85, 12).hz(), 170_017_000);
    }

    #[test]
    fn cycles_and_times_agree_across_a_change() {
        let mut clock = CoreClock::new(Frequency::from_hz(16_000_000), 0, Time(0));
        assert_eq!(clock.time_of(16), Time(1_000_000));
        clock.change(Frequency::from_hz(170_000_000), 16);
        assert_eq!(clock.time_of(16 + 170), Time(2_000_000));
        for ps in [1_000_001, 1_005_882, 1_005_883, 987_654_321] {
            let cycle = clock.cycle_at(Time(ps));
            assert!(clock.time_of(cycle).0 + 1 >= ps);
            assert!(clock.time_of(cycle - 1).0 < ps);
        }
    }
}

//! The drive's own crystal: durations that it measures are off by its error.

use crate::time::{PS_PER_S, PS_PER_US, Time};
use canmaster::Instant;

/// Length of the control cycle by the drive's clock, microseconds.
const CYCLE_US: u64 = 400;

/// A clock that starts at power-on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    start: Time,
    /// Own time over true time.
    rate: f64,
}

impl Clock {
    /// A clock that is `ppm` parts per million fast.
    pub(super) fn new(start: Time, ppm: f64) -> Clock {
        Clock {
            start,
            rate: 1.0 + ppm * 1e-6,
        }
    }

    /// The true length of `us` own microseconds.
    pub(super) fn span(&self, us: u64) -> Time {
        Time::from_ps((us as f64 * PS_PER_US as f64 / self.rate).round() as u64)
    }

    /// The moment by the own clock, as the library counts.
    pub(super) fn own(&self, at: Time) -> Instant {
        let us = at.since(self.start).as_us_f64() * self.rate;
        Instant::from_micros(us as u64)
    }

    /// When the own clock shows `instant`, never too early.
    pub(super) fn when(&self, instant: Instant) -> Time {
        self.start + self.span(instant.as_micros() + 1)
    }

    /// The true length of a control cycle.
    pub(super) fn cycle(&self) -> Time {
        self.span(CYCLE_US)
    }

    /// The length of a control cycle in own seconds and in true ones.
    pub(super) fn cycle_seconds(&self) -> (f64, f64) {
        let own = CYCLE_US as f64 * 1e-6;
        (own, self.cycle().as_ps() as f64 / PS_PER_S as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fast_clock_has_short_milliseconds() {
        let clock = Clock::new(Time::from_s(1), 100.0);
        assert_eq!(clock.span(1_000_000).as_ns(), 999_900_009);
        assert_eq!(
            clock.own(Time::from_s(11)),
            Instant::from_micros(10_001_000)
        );
    }

    #[test]
    fn a_deadline_has_come_when_it_is_said_to() {
        for ppm in [-100.0, -3.3, 0.0, 7.7, 100.0] {
            let clock = Clock::new(Time::from_us(123), ppm);
            for us in [1, 999, 1_000_000, 59_999_999] {
                let instant = Instant::from_micros(us);
                assert!(clock.own(clock.when(instant)) >= instant);
            }
        }
    }
}

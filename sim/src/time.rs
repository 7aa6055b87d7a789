//! Virtual time: picoseconds since power-on, shared by everything simulated.

use canmaster::Instant;
use std::fmt;
use std::ops::{Add, AddAssign, Mul, Sub};

/// Picoseconds in a nanosecond.
pub const PS_PER_NS: u64 = 1_000;
/// Picoseconds in a microsecond.
pub const PS_PER_US: u64 = 1_000_000;
/// Picoseconds in a millisecond.
pub const PS_PER_MS: u64 = 1_000_000_000;
/// Picoseconds in a second.
pub const PS_PER_S: u64 = 1_000_000_000_000;

/// A moment, or the time between two moments, in picoseconds.
///
/// A picosecond resolves clock errors of a part per million on a bit of a
/// microsecond; 64 bits last for 213 days of simulated time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Time(pub u64);

impl Time {
    /// Power-on; also no time at all.
    pub const ZERO: Time = Time(0);
    /// Never: later than every moment that is simulated.
    pub const MAX: Time = Time(u64::MAX);

    /// `ps` picoseconds.
    pub const fn from_ps(ps: u64) -> Time {
        Time(ps)
    }

    /// `ns` nanoseconds.
    pub const fn from_ns(ns: u64) -> Time {
        Time(ns * PS_PER_NS)
    }

    /// `us` microseconds.
    pub const fn from_us(us: u64) -> Time {
        Time(us * PS_PER_US)
    }

    /// `ms` milliseconds.
    pub const fn from_ms(ms: u64) -> Time {
        Time(ms * PS_PER_MS)
    }

    /// `s` seconds.
    pub const fn from_s(s: u64) -> Time {
        Time(s * PS_PER_S)
    }

    /// `s` seconds, rounded to the picosecond; negative and absurd values
    /// saturate.
    pub fn from_secs_f64(s: f64) -> Time {
        Time((s * PS_PER_S as f64).round() as u64)
    }

    /// The time that `cycles` periods of a clock of `hz` take, rounded down.
    /// Exact over any number of cycles: no error adds up.
    pub const fn from_cycles(cycles: u64, hz: u64) -> Time {
        Time((cycles as u128 * PS_PER_S as u128 / hz as u128) as u64)
    }

    /// Whole periods of a clock of `hz` in this time, rounded down.
    pub const fn as_cycles(self, hz: u64) -> u64 {
        (self.0 as u128 * hz as u128 / PS_PER_S as u128) as u64
    }

    /// Picoseconds.
    pub const fn as_ps(self) -> u64 {
        self.0
    }

    /// Whole nanoseconds, rounded down.
    pub const fn as_ns(self) -> u64 {
        self.0 / PS_PER_NS
    }

    /// Whole microseconds, rounded down.
    pub const fn as_us(self) -> u64 {
        self.0 / PS_PER_US
    }

    /// Whole milliseconds, rounded down.
    pub const fn as_ms(self) -> u64 {
        self.0 / PS_PER_MS
    }

    /// Seconds.
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 / PS_PER_S as f64
    }

    /// Microseconds with their fraction.
    pub fn as_us_f64(self) -> f64 {
        self.0 as f64 / PS_PER_US as f64
    }

    /// The time since `earlier`; zero if `earlier` is later.
    pub const fn since(self, earlier: Time) -> Time {
        Time(self.0.saturating_sub(earlier.0))
    }

    /// The sum, or [`Time::MAX`].
    pub const fn saturating_add(self, other: Time) -> Time {
        Time(self.0.saturating_add(other.0))
    }

    /// The same moment as the library counts it, in microseconds.
    pub const fn to_instant(self) -> Instant {
        Instant::from_micros(self.as_us())
    }
}

impl From<Instant> for Time {
    fn from(at: Instant) -> Time {
        Time::from_us(at.as_micros())
    }
}

impl From<canmaster::Duration> for Time {
    fn from(d: canmaster::Duration) -> Time {
        Time::from_us(u64::from(d.as_micros()))
    }
}

impl Add for Time {
    type Output = Time;
    fn add(self, other: Time) -> Time {
        Time(self.0 + other.0)
    }
}

impl AddAssign for Time {
    fn add_assign(&mut self, other: Time) {
        *self = *self + other;
    }
}

/// Overflow traps: subtract only what is known to be earlier, or use
/// [`Time::since`].
impl Sub for Time {
    type Output = Time;
    fn sub(self, other: Time) -> Time {
        Time(self.0 - other.0)
    }
}

impl Mul<u64> for Time {
    type Output = Time;
    fn mul(self, n: u64) -> Time {
        Time(self.0 * n)
    }
}

/// Seconds with six decimals, as log lines have them.
impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let us = self.as_us();
        write!(
            f,
            "{}.{:06}",
            self.0 / PS_PER_S,
            us % (PS_PER_S / PS_PER_US)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_agree() {
        assert_eq!(Time::from_s(1), Time::from_ms(1000));
        assert_eq!(Time::from_ms(1), Time::from_us(1000));
        assert_eq!(Time::from_us(1), Time::from_ns(1000));
        assert_eq!(Time::from_ns(1), Time::from_ps(1000));
        assert_eq!(Time::from_secs_f64(0.25), Time::from_ms(250));
        assert_eq!(Time::from_secs_f64(-1.0), Time::ZERO);
    }

    #[test]
    fn cycles_do_not_accumulate_rounding() {
        const CORE_HZ: u64 = 170_000_000;
        assert_eq!(Time::from_cycles(CORE_HZ, CORE_HZ), Time::from_s(1));
        assert_eq!(
            Time::from_cycles(CORE_HZ * 86_400, CORE_HZ),
            Time::from_s(86_400)
        );
        assert_eq!(Time::from_cycles(1, CORE_HZ), Time::from_ps(5882));
        assert_eq!(Time::from_s(2).as_cycles(CORE_HZ), 2 * CORE_HZ);
    }

    #[test]
    fn a_moment_prints_as_in_a_log() {
        assert_eq!(
            (Time::from_s(12) + Time::from_us(34)).to_string(),
            "12.000034"
        );
        assert_eq!(Time::ZERO.to_string(), "0.000000");
    }

    #[test]
    fn the_library_sees_microseconds() {
        let t = Time::from_us(7) + Time::from_ns(999);
        assert_eq!(t.to_instant(), Instant::from_micros(7));
        assert_eq!(Time::from(t.to_instant()), Time::from_us(7));
    }

    #[test]
    fn since_never_wraps() {
        assert_eq!(Time::ZERO.since(Time::from_s(1)), Time::ZERO);
        assert_eq!(Time::MAX.saturating_add(Time::from_s(1)), Time::MAX);
    }
}

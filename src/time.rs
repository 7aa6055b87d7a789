//! Time as the library sees it: microseconds, handed in by the caller.

use core::ops::{Add, AddAssign, Sub};

/// A moment: microseconds since an origin that the caller chooses (the
/// firmware: power-on). 64 bits last for half a million years.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Instant(u64);

impl Instant {
    /// The origin.
    pub const ZERO: Instant = Instant(0);
    /// Later than everything: the deadline of what has none.
    pub(crate) const NEVER: Instant = Instant(u64::MAX);

    /// `us` microseconds after the origin.
    pub const fn from_micros(us: u64) -> Instant {
        Instant(us)
    }

    /// Microseconds since the origin.
    pub const fn as_micros(self) -> u64 {
        self.0
    }

    /// A deadline that may be none.
    pub(crate) fn of(deadline: Option<Instant>) -> Instant {
        deadline.unwrap_or(Instant::NEVER)
    }

    /// The deadline, unless there is none.
    pub(crate) fn deadline(self) -> Option<Instant> {
        (self != Instant::NEVER).then_some(self)
    }

    /// The time since `earlier`; zero if `earlier` is later. Saturates at
    /// [`Duration::MAX`].
    pub const fn since(self, earlier: Instant) -> Duration {
        let us = self.0.saturating_sub(earlier.0);
        if us > u32::MAX as u64 {
            Duration::MAX
        } else {
            Duration(us as u32)
        }
    }
}

impl Add<Duration> for Instant {
    type Output = Instant;
    fn add(self, d: Duration) -> Instant {
        // Never wraps: see the type. Saturating would be paid for at each of the
        // many places where a deadline is set.
        Instant(self.0.wrapping_add(d.0 as u64))
    }
}

impl AddAssign<Duration> for Instant {
    fn add_assign(&mut self, d: Duration) {
        *self = *self + d;
    }
}

impl Sub<Instant> for Instant {
    type Output = Duration;
    fn sub(self, earlier: Instant) -> Duration {
        self.since(earlier)
    }
}

/// A span of time: 0 .. 71 minutes in microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Duration(u32);

impl Duration {
    /// No time at all.
    pub const ZERO: Duration = Duration(0);
    /// The longest span, some 71 minutes.
    pub const MAX: Duration = Duration(u32::MAX);

    /// `us` microseconds.
    pub const fn from_micros(us: u32) -> Duration {
        Duration(us)
    }

    /// `ms` milliseconds, at most [`Duration::MAX`].
    pub const fn from_millis(ms: u32) -> Duration {
        Duration(ms.saturating_mul(1000))
    }

    /// Microseconds.
    pub const fn as_micros(self) -> u32 {
        self.0
    }

    /// Half of it, rounded down.
    pub const fn half(self) -> Duration {
        Duration(self.0 / 2)
    }

    /// Whole milliseconds, rounded down.
    pub const fn as_millis(self) -> u32 {
        self.0 / 1000
    }
}

impl Add for Duration {
    type Output = Duration;
    fn add(self, other: Duration) -> Duration {
        Duration(self.0.saturating_add(other.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_wraps() {
        let t = Instant::from_micros(5);
        assert_eq!(t - Instant::from_micros(9), Duration::ZERO);
        assert_eq!(Instant::from_micros(u64::MAX) - t, Duration::MAX);
        assert_eq!(Duration::from_millis(u32::MAX), Duration::MAX);
        assert_eq!(Duration::MAX + Duration::MAX, Duration::MAX);
    }
}

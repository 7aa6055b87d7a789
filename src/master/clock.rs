//! A clock that does not wrap, made of a 32-bit counter of microseconds.

use crate::time::Instant;
use core::sync::atomic::{AtomicU32, Ordering};

const HALF_BIT: u32 = 31;

/// Extends a 32-bit microsecond counter to 64 bits, without locks.
///
/// It counts the *half* periods of the counter (35.8 minutes each). A reader
/// that runs between the counter's change of halves and the next
/// [`keep`](ExtendedClock::keep) sees from the counter's top bit that the count
/// is one behind, so every reader is right at any time, as long as `keep` is
/// called at least once in each half period.
#[derive(Debug)]
pub struct ExtendedClock {
    halves: AtomicU32,
}

impl ExtendedClock {
    /// A clock whose counter starts at 0.
    pub const fn new() -> ExtendedClock {
        ExtendedClock {
            halves: AtomicU32::new(0),
        }
    }

    /// Takes note of the counter's half. For one task only.
    pub fn keep(&self, counter: u32) {
        let halves = self.halves.load(Ordering::Relaxed);
        if halves & 1 != counter >> HALF_BIT {
            self.halves.store(halves.wrapping_add(1), Ordering::Relaxed);
        }
    }

    /// The moment at which `read` reads the counter. For any task.
    pub fn now(&self, read: impl FnOnce() -> u32) -> Instant {
        // The count first: taken after the counter, it could be one ahead.
        let halves = self.halves.load(Ordering::Acquire);
        let counter = read();
        let behind = (halves & 1) ^ (counter >> HALF_BIT);
        let halves = u64::from(halves) + u64::from(behind);
        let low = counter & !(1 << HALF_BIT);
        Instant::from_micros((halves << HALF_BIT) + u64::from(low))
    }
}

impl Default for ExtendedClock {
    fn default() -> ExtendedClock {
        ExtendedClock::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_runs_on_over_the_wrap() {
        let clock = ExtendedClock::new();
        let step = 0x3000_0001_u64;
        for tick in 0..100 {
            let t = tick * step;
            let counter = t as u32;
            // Before and after the count is kept up.
            assert_eq!(clock.now(|| counter).as_micros(), t);
            clock.keep(counter);
            assert_eq!(clock.now(|| counter).as_micros(), t);
        }
    }

    #[test]
    fn it_may_be_kept_as_often_as_one_likes() {
        let clock = ExtendedClock::new();
        for _ in 0..5 {
            clock.keep(1 << 31);
        }
        assert_eq!(clock.now(|| 1 << 31).as_micros(), 1 << 31);
    }
}

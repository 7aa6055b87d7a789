//! The clock of a device without one, and the producer of TIME.

use super::{MS_PER_DAY, TimeOfDay};
use crate::frame::Frame;
use crate::id::CobId;
use crate::time::{Duration, Instant};

const US_PER_MS: u64 = 1000;

/// A clock that runs from the moment it is set.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clock {
    set: Option<(TimeOfDay, Instant)>,
}

impl Clock {
    /// A clock that nobody has set.
    pub const fn new() -> Clock {
        Clock { set: None }
    }

    /// Sets it.
    pub fn set(&mut self, time: TimeOfDay, now: Instant) {
        self.set = Some((time, now));
    }

    /// The time; `None` before it was set.
    pub fn time(&self, now: Instant) -> Option<TimeOfDay> {
        let (time, at) = self.set?;
        let passed = now.as_micros().saturating_sub(at.as_micros()) / US_PER_MS;
        let ms = u64::from(time.ms) + passed;
        let day = u64::from(MS_PER_DAY);
        Some(TimeOfDay {
            // 65536 days end in 2163; then the count starts again, as it does
            // on the wire.
            days: time.days.wrapping_add((ms / day) as u16),
            ms: (ms % day) as u32,
        })
    }
}

/// Sends TIME every so often.
#[derive(Clone, Copy, Debug, Default)]
pub struct Producer {
    period: Duration,
    next: Option<Instant>,
}

impl Producer {
    /// A producer that is switched off.
    pub const fn new() -> Producer {
        Producer {
            period: Duration::ZERO,
            next: None,
        }
    }

    /// Sets the period; the first message is due at once. Zero switches it off.
    pub fn set_period(&mut self, period: Duration, now: Instant) {
        self.period = period;
        self.next = (period != Duration::ZERO).then_some(now);
    }

    /// When the next message is due.
    pub const fn next_deadline(&self) -> Option<Instant> {
        self.next
    }

    /// The message that is due, if one is and the clock was set.
    pub fn poll(&mut self, now: Instant, clock: &Clock, id: CobId) -> Option<Frame> {
        let due = self.next?;
        if now < due {
            return None;
        }
        let after = due + self.period;
        self.next = Some(if after > now {
            after
        } else {
            now + self.period
        });
        Some(clock.time(now)?.frame(id))
    }
}

//! The clock of a device without one, and the producer of TIME.

use super::TimeOfDay;
use crate::frame::Frame;
use crate::id::CobId;
use crate::time::{Duration, Instant};

const US_PER_MS: u32 = 1000;
const MS_PER_HOUR: u32 = 3_600_000;
const US_PER_HOUR: u32 = MS_PER_HOUR * US_PER_MS;

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
        let passed = now.as_micros().saturating_sub(at.as_micros());
        let passed = u32::try_from(passed).unwrap_or(u32::MAX);
        Some(time.after_ms(passed / US_PER_MS))
    }

    /// Lets an hour pass, if one has: to be called at least once an hour. What
    /// [`Clock::time`] has to divide then fits 32 bits, which a controller does
    /// in one instruction.
    pub fn advance(&mut self, now: Instant) {
        if let Some((time, at)) = &mut self.set
            && now.as_micros().saturating_sub(at.as_micros()) >= u64::from(US_PER_HOUR)
        {
            *at += Duration::from_micros(US_PER_HOUR);
            *time = time.after_ms(MS_PER_HOUR);
        }
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

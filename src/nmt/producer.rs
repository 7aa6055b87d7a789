//! Heartbeat producer (CiA 301, 7.2.8.3.2.2, 7.5.2.20).

use super::error_control::ErrorControl;
use super::state::State;
use crate::frame::Frame;
use crate::id::NodeId;
use crate::time::{Duration, Instant};

/// Sends a heartbeat every producer heartbeat time (1017h).
#[derive(Clone, Debug)]
pub struct Producer {
    node: NodeId,
    period: Duration,
    next: Option<Instant>,
}

impl Producer {
    /// A producer that is switched off.
    pub const fn new(node: NodeId) -> Producer {
        Producer {
            node,
            period: Duration::ZERO,
            next: None,
        }
    }

    /// Sets the producer heartbeat time; zero switches it off. The first
    /// heartbeat is due at once: after the boot-up message the producer is
    /// started by calling this one period later, or by [`Producer::start`].
    pub fn set_period(&mut self, period: Duration, now: Instant) {
        self.period = period;
        self.next = (period != Duration::ZERO).then_some(now);
    }

    /// Restarts the period: the boot-up message of `now` takes the place of the
    /// first heartbeat.
    pub fn start(&mut self, now: Instant) {
        self.next = (self.period != Duration::ZERO).then_some(now + self.period);
    }

    /// The producer heartbeat time.
    pub const fn period(&self) -> Duration {
        self.period
    }

    /// When the next heartbeat is due.
    pub const fn next_deadline(&self) -> Option<Instant> {
        self.next
    }

    /// The heartbeat that is due, if one is. Heartbeats keep to a grid; those
    /// missed are not made up for. None is sent while initialising.
    pub fn poll(&mut self, now: Instant, state: State) -> Option<Frame> {
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
        (state != State::Initialising).then(|| ErrorControl::heartbeat(self.node, state).frame())
    }
}

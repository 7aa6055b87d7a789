//! When a PDO is sent, and when what it brought takes effect
//! (CiA 301, 7.2.2.2, 7.2.2.5).

use super::PDO_MAX;
use super::transmission::Transmission;
use crate::time::{Duration, Instant};

/// What became of a received PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Received {
    /// To be taken over now.
    Now([u8; PDO_MAX]),
    /// Kept until the next SYNC.
    AtSync,
    /// Discarded; the node reports it as emergency 8210h.
    TooShort {
        /// Bytes mapped.
        expected: usize,
        /// Bytes received.
        received: usize,
    },
}

/// The reception of one RPDO.
#[derive(Clone, Copy, Debug, Default)]
pub struct RpdoState {
    latched: Option<[u8; PDO_MAX]>,
}

impl RpdoState {
    /// Nothing received yet.
    pub const fn new() -> RpdoState {
        RpdoState { latched: None }
    }

    /// Takes in a PDO of which `mapped` bytes are mapped. Of several between
    /// two SYNCs the last one counts.
    pub fn receive(&mut self, data: &[u8], mapped: usize, transmission: Transmission) -> Received {
        if data.len() < mapped {
            return Received::TooShort {
                expected: mapped,
                received: data.len(),
            };
        }
        let mut bytes = [0; PDO_MAX];
        for (to, from) in bytes.iter_mut().zip(data).take(mapped) {
            *to = *from;
        }
        if transmission.is_synchronous() {
            self.latched = Some(bytes);
            Received::AtSync
        } else {
            Received::Now(bytes)
        }
    }

    /// A SYNC: what was received since the last one takes effect.
    pub fn sync(&mut self) -> Option<[u8; PDO_MAX]> {
        self.latched.take()
    }

    /// Forgets what waits: the node left operational, or the PDO was
    /// reconfigured.
    pub fn reset(&mut self) {
        self.latched = None;
    }
}

/// The transmission of one TPDO.
#[derive(Clone, Copy, Debug, Default)]
pub struct TpdoState {
    /// SYNCs until the next transmission; `None` while the start value of the
    /// SYNC counter is awaited or counting has not begun.
    countdown: Option<u8>,
    pending: bool,
    last: Option<Instant>,
}

impl TpdoState {
    /// Not sent yet.
    pub const fn new() -> TpdoState {
        TpdoState {
            countdown: None,
            pending: false,
            last: None,
        }
    }

    /// The node enters operational: event-driven PDOs are sent once, counting
    /// of SYNCs starts anew.
    pub fn start(&mut self) {
        *self = TpdoState {
            pending: true,
            ..TpdoState::new()
        };
    }

    /// Something mapped has changed, or the device has another reason to send.
    pub fn trigger(&mut self) {
        self.pending = true;
    }

    /// A SYNC: whether the PDO is to be sent now. `counter` is that of the
    /// SYNC, if it has one; `start` is sub-index 6 of the communication
    /// parameter.
    pub fn sync(&mut self, transmission: Transmission, counter: Option<u8>, start: u8) -> bool {
        match transmission {
            Transmission::SynchronousAcyclic => core::mem::take(&mut self.pending),
            Transmission::Synchronous(n) => self.cyclic(n, counter, start),
            _ => false,
        }
    }

    fn cyclic(&mut self, n: u8, counter: Option<u8>, start: u8) -> bool {
        let left = match (self.countdown, counter) {
            // The SYNC with the start value is the first one counted: the PDO
            // goes out with it and then with every n-th.
            (None, Some(counter)) if start != 0 => {
                if counter != start {
                    return false;
                }
                1
            }
            (None, _) => n,
            (Some(left), _) => left.min(n),
        };
        let due = left <= 1;
        self.countdown = Some(if due { n } else { left - 1 });
        due
    }

    /// Whether an event-driven PDO is to be sent now: after an event and not
    /// within the inhibit time, or when the event timer has run out.
    pub fn poll(&mut self, now: Instant, inhibit: Duration, event_timer: Duration) -> bool {
        let due = match self.next_deadline(inhibit, event_timer) {
            Some(deadline) => now >= deadline,
            None => false,
        };
        if due {
            self.pending = false;
            self.last = Some(now);
        }
        due
    }

    /// When [`TpdoState::poll`] has something to send.
    pub fn next_deadline(&self, inhibit: Duration, event_timer: Duration) -> Option<Instant> {
        let by_timer = (event_timer != Duration::ZERO)
            .then(|| self.last.map(|last| last + event_timer.max(inhibit)))
            .flatten();
        if self.pending {
            let by_event = self.last.map_or(Instant::ZERO, |last| last + inhibit);
            Some(by_timer.map_or(by_event, |timer| timer.min(by_event)))
        } else {
            by_timer
        }
    }
}

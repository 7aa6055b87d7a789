//! Emergency producer: the device's own errors (CiA 301, 7.2.7.2).

use super::history::History;
use super::{Emcy, EmcyCobId, EmcyCode, ErrorRegister};
use crate::frame::Frame;
use crate::nmt::{Service, State};
use crate::time::{Duration, Instant};
use heapless::{Deque, Vec};

/// The errors that 1003h keeps: as many as the object is worth reading.
pub const ERROR_FIELD: usize = 8;
/// Errors that can be present at once, and messages that can wait.
const ACTIVE: usize = 8;
/// The unit of the inhibit time (1015h).
const INHIBIT_UNIT_US: u32 = 100;

/// Sends emergencies, and holds error register (1001h) and pre-defined error
/// field (1003h).
///
/// An error is raised once and stays until it is cleared; the error register is
/// made of those that are there. Messages wait while the NMT state forbids them
/// and for the inhibit time; of too many, the oldest go.
#[derive(Clone, Debug, Default)]
// In this order, so that what is used most is near: it takes shorter instructions.
#[repr(C)]
pub struct Producer {
    field: History<u32, ERROR_FIELD>,
    active: Vec<Emcy, ACTIVE>,
    waiting: Deque<Emcy, ACTIVE>,
    free_at: Instant,
}

impl Producer {
    /// No error.
    pub const fn new() -> Producer {
        Producer {
            active: Vec::new(),
            waiting: Deque::new(),
            field: History::new(),
            free_at: Instant::ZERO,
        }
    }

    /// The error register, object 1001h.
    pub fn register(&self) -> ErrorRegister {
        self.active
            .iter()
            .fold(ErrorRegister::default(), |all, error| {
                all.union(error.register).union(ErrorRegister::GENERIC)
            })
    }

    /// The pre-defined error field, object 1003h, newest first: the code in the
    /// low, the manufacturer's first two bytes in the high word.
    pub const fn field(&self) -> &History<u32, ERROR_FIELD> {
        &self.field
    }

    /// Forgets the pre-defined error field: 0 was written to 1003h:00.
    pub fn clear_field(&mut self) {
        self.field.clear();
    }

    /// Whether an error of this code is present.
    pub fn is_active(&self, code: EmcyCode) -> bool {
        self.active.iter().any(|error| error.code == code)
    }

    /// An error has come. `error.register` names the bits of this error alone.
    /// One that is there already, code and manufacturer's bytes being the same,
    /// is not reported again.
    pub fn raise(&mut self, error: Emcy) {
        if self.active.iter().any(|active| same(active, &error)) {
            return;
        }
        if self.active.is_full() {
            self.active.remove(0);
        }
        // There is room now.
        let _ = self.active.push(error);
        let [a, b, ..] = error.manufacturer;
        let additional = u32::from(u16::from_le_bytes([a, b]));
        self.field
            .push(additional << u16::BITS | u32::from(error.code.0));
        self.send(error);
    }

    /// An error has gone: its code and the manufacturer's bytes are those that
    /// it was raised with.
    pub fn clear(&mut self, error: Emcy) {
        self.clear_all(&|active| same(active, &error));
    }

    /// All errors that `gone` picks have gone; they are told of by one message.
    pub fn clear_all(&mut self, gone: &dyn Fn(&Emcy) -> bool) {
        let before = self.active.len();
        self.active.retain(|active| !gone(active));
        if self.active.len() != before {
            let none = Emcy::new(EmcyCode::NO_ERROR, ErrorRegister::default());
            self.send(none);
        }
    }

    fn send(&mut self, emcy: Emcy) {
        if self.waiting.is_full() {
            self.waiting.pop_front();
        }
        let register = self.register();
        // There is room now.
        let _ = self.waiting.push_back(Emcy { register, ..emcy });
    }

    /// When [`poll`](Self::poll) has something to do, if the NMT state allows
    /// it.
    pub fn next_deadline(&self) -> Option<Instant> {
        (!self.waiting.is_empty()).then_some(self.free_at)
    }

    /// The next message, if one may be sent: `cob_id` is 1014h, `inhibit` 1015h
    /// in units of 100 us.
    pub fn poll(
        &mut self,
        now: Instant,
        state: State,
        cob_id: EmcyCobId,
        inhibit: u16,
    ) -> Option<Frame> {
        if !state.allows(Service::Emergency) || now < self.free_at {
            return None;
        }
        let Some(id) = cob_id.id() else {
            self.waiting.clear();
            return None;
        };
        let emcy = self.waiting.pop_front()?;
        self.free_at = now + Duration::from_micros(u32::from(inhibit) * INHIBIT_UNIT_US);
        Some(Frame::full(id, emcy.encode()))
    }
}

fn same(a: &Emcy, b: &Emcy) -> bool {
    a.code == b.code && a.manufacturer == b.manufacturer
}

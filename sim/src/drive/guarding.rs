//! Node guarding, for drives that are said to have it (CiA 301, 7.2.8.3.2.1);
//! the EPOS4 has not.

use super::objects::{GUARD_TIME, LIFE_TIME_FACTOR};
use super::{Drive, errors};
use canmaster::id::FunctionCode;
use canmaster::nmt::{ErrorControl, Service};
use canmaster::{CobId, Duration, Frame, Instant};

/// The node's side of guarding.
#[derive(Clone, Debug, Default)]
pub(super) struct Guarding {
    /// Bit 7 of the next answer: 0 first after a reset of the communication.
    toggle: bool,
    /// When the master asked last; life guarding begins with its first
    /// question.
    asked: Option<Instant>,
}

impl Drive {
    /// A remote frame asks for the NMT state. A drive that produces heartbeats
    /// does not answer: it has one kind of error control at a time.
    pub(super) fn on_guard_request(&mut self, frame: &Frame) {
        let id = CobId::of(FunctionCode::ErrorControl, self.nmt.id());
        let asked = frame.is_remote() && frame.id() == id;
        let heartbeat = self.od.number(0x1017, 0) != 0;
        let able = self.config.node_guarding && self.nmt.allows(Service::ErrorControl);
        if !asked || heartbeat || !able || self.heartbeat_lost() {
            return;
        }
        let answer = ErrorControl {
            node: self.nmt.id(),
            state: self.nmt.state(),
            toggle: self.guarding.toggle,
        };
        self.guarding.toggle = !self.guarding.toggle;
        self.guarding.asked = Some(self.clock.own(self.now));
        self.transmit_latest(answer.frame().into());
    }

    /// When the life time ends: 100Ch times 100Dh after the last question.
    pub(super) fn life_guard_deadline(&self) -> Option<Instant> {
        let asked = self.guarding.asked?;
        let life = self.od.number(GUARD_TIME, 0) * self.od.number(LIFE_TIME_FACTOR, 0);
        (life != 0).then(|| asked + Duration::from_millis(life as u32))
    }

    pub(super) fn poll_life_guard(&mut self) {
        let now = self.clock.own(self.now);
        if self.life_guard_deadline().is_some_and(|end| now >= end) {
            self.guarding.asked = None;
            self.connection_lost(errors::HEARTBEAT);
        }
    }
}

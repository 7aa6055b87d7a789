//! NMT, heartbeat in both directions, EMCY (CiA 301, 7.2.7, 7.2.8).

use super::life::Life;
use super::{Drive, errors};
use crate::drive::config::DriveFault;
use crate::frame::WireFrame;
use crate::time::Time;
use canmaster::nmt::{
    Command, Consumer, ErrorControl, NodeEvent, Producer, Service, State as NmtState,
};
use canmaster::{CobId, Duration, Frame, NodeId};

/// Entries of 1016h.
const CONSUMERS: u8 = 2;
/// 1029h: to stopped.
const TO_STOPPED: i64 = 2;
/// 1029h: stay.
const STAY: i64 = 1;

/// Heartbeat, produced and consumed.
#[derive(Clone, Debug)]
pub(super) struct Watch {
    producer: Producer,
    consumers: Vec<(u8, Consumer)>,
}

impl Watch {
    pub(super) fn new(node: NodeId) -> Watch {
        Watch {
            producer: Producer::new(node),
            consumers: Vec::new(),
        }
    }

    /// Nothing is sent and nobody watched.
    pub(super) fn clear(&mut self) {
        self.producer.set_period(Duration::ZERO, Default::default());
        self.consumers.clear();
    }
}

impl Drive {
    /// The next moment at which a timer of the protocol runs out.
    pub(super) fn next_timer(&self) -> Option<Time> {
        if self.life != Life::Running {
            return None;
        }
        let consumers = self.watch.consumers.iter();
        let timers = consumers
            .filter_map(|(_, consumer)| consumer.next_deadline())
            .chain(self.watch.producer.next_deadline())
            .chain(self.life_guard_deadline())
            .chain(self.service.next_deadline().filter(|_| self.answer_fits()));
        timers.min().map(|instant| self.clock.when(instant))
    }

    pub(super) fn on_timer(&mut self) {
        let now = self.clock.own(self.now);
        if let Some(frame) = self.watch.producer.poll(now, self.nmt.state())
            && !self.heartbeat_lost()
        {
            self.transmit_latest(frame.into());
        }
        let consumers = self.watch.consumers.iter_mut();
        let lost = consumers.fold(false, |lost, (_, c)| c.poll(now).is_some() || lost);
        if lost {
            self.connection_lost(errors::HEARTBEAT);
        }
        self.poll_life_guard();
        self.poll_server();
    }

    pub(super) fn heartbeat_lost(&self) -> bool {
        let since = |fault: &DriveFault| match *fault {
            DriveFault::HeartbeatLost { at } => self.now >= at,
            _ => false,
        };
        self.config.faults.iter().any(since)
    }

    /// After the boot-up message: 1016h and 1017h count.
    pub(super) fn start_watch(&mut self) {
        let now = self.clock.own(self.now);
        let period = self.producer_time();
        self.watch.producer.set_period(period, now);
        self.watch.producer.start(now);
        for sub in 1..=CONSUMERS {
            self.set_consumer(sub);
        }
    }

    /// 1017h.
    fn producer_time(&self) -> Duration {
        Duration::from_millis(self.od.number(0x1017, 0) as u32)
    }

    /// 1017h was written.
    pub(super) fn set_producer(&mut self) {
        let now = self.clock.own(self.now);
        let period = self.producer_time();
        self.watch.producer.set_period(period, now);
    }

    /// 1016h was written: watching starts anew with the next heartbeat.
    pub(super) fn set_consumer(&mut self, sub: u8) {
        self.watch.consumers.retain(|(entry, _)| *entry != sub);
        let value = self.od.number(0x1016, sub) as u32;
        let time = Duration::from_millis(value & 0xFFFF);
        if let Some(node) = NodeId::new((value >> 16) as u8)
            && time != Duration::ZERO
        {
            self.watch.consumers.push((sub, Consumer::new(node, time)));
        }
    }

    pub(super) fn on_network_frame(&mut self, frame: &Frame) {
        match self.nmt.on_frame(frame) {
            Some(NodeEvent::Changed { from, to }) => self.on_nmt_change(from, to),
            Some(NodeEvent::ResetNode) => self.reset_node(),
            Some(NodeEvent::ResetCommunication) => self.reset_communication(),
            None => {}
        }
        // A boot-up message is no heartbeat: it neither starts nor ends the
        // watch.
        if ErrorControl::decode(frame).is_some_and(|e| e.state != NmtState::Initialising) {
            let now = self.clock.own(self.now);
            for (_, consumer) in &mut self.watch.consumers {
                consumer.on_frame(frame, now);
            }
        }
    }

    fn on_nmt_change(&mut self, from: NmtState, to: NmtState) {
        self.od.operational = to == NmtState::Operational;
        if from == NmtState::Operational {
            self.exchange.clear_pending();
            self.axis.connection_ends(&self.od);
        }
        if to == NmtState::Operational {
            self.exchange.enter_operational();
        }
        if to == NmtState::Stopped {
            self.service.reset(&mut self.od);
        }
    }

    /// Heartbeat lost, error passive, bus-off: error, and 1029h.
    pub(super) fn connection_lost(&mut self, code: u16) {
        self.raise(code, false);
        let command = match self.od.number(0x1029, 1) {
            STAY => return,
            TO_STOPPED => Command::Stop,
            _ if self.nmt.state() == NmtState::Operational => Command::EnterPreOperational,
            _ => return,
        };
        if let Some(NodeEvent::Changed { from, to }) = self.nmt.command(command) {
            self.on_nmt_change(from, to);
        }
    }

    /// An EMCY with this code; 0 = all errors are reset.
    pub(super) fn send_emcy(&mut self, code: u16) {
        self.last_emcy = Some(code);
        if self.life != Life::Running || !self.nmt.allows(Service::Emergency) {
            return;
        }
        let [low, high] = code.to_le_bytes();
        let register = self.od.errors.register();
        let id = self.od.number(0x1014, 0) as u16;
        let data = [low, high, register, 0, 0, 0, 0, 0];
        self.transmit(WireFrame::standard(id, &data));
    }

    /// Whether `frame` is the SYNC: a data frame. A remote frame with its
    /// identifier means nothing to a drive.
    pub(super) fn is_sync(&self, frame: &Frame) -> bool {
        frame.id() == CobId::SYNC && !frame.is_remote() && self.nmt.allows(Service::Sync)
    }
}

//! SYNC and PDOs (CiA 301, 7.2.2, 7.2.5).

use super::config::DriveFault;
use super::dictionary::Dictionary;
use super::objects::PDOS;
use super::pdo::{EVERY_SYNC, Pdo};
use super::{Drive, Job, errors};
use crate::frame::WireFrame;
use crate::time::Time;
use canmaster::nmt::Service;
use canmaster::pdo::{Direction, Received, RpdoState};
use canmaster::{CobId, Frame};

/// Unit of the inhibit time, microseconds.
const INHIBIT_US: u64 = 100;

/// A TPDO with what the drive remembers of it.
#[derive(Clone, Debug)]
struct Transmitted {
    pdo: Pdo,
    last: Option<Vec<u8>>,
    inhibited_until: Time,
}

/// An RPDO with the data that waits for the SYNC.
#[derive(Clone, Debug)]
struct Reception {
    pdo: Pdo,
    state: RpdoState,
}

/// The PDOs that exist, in the order of their numbers.
#[derive(Clone, Debug, Default)]
pub(super) struct Exchange {
    receive: Vec<Reception>,
    transmit: Vec<Transmitted>,
}

impl Exchange {
    /// The parameters have changed.
    pub(super) fn reload(&mut self, od: &Dictionary) {
        let all = |direction| (0..PDOS).filter_map(move |n| Pdo::read(od, direction, n));
        self.receive = all(Direction::Receive)
            .map(|pdo| Reception {
                pdo,
                state: RpdoState::new(),
            })
            .collect();
        self.transmit = all(Direction::Transmit)
            .map(|pdo| Transmitted {
                pdo,
                last: None,
                inhibited_until: Time::ZERO,
            })
            .collect();
    }

    /// No PDOs.
    pub(super) fn clear(&mut self) {
        *self = Exchange::default();
    }

    /// Data that waits for a SYNC is dropped.
    pub(super) fn clear_pending(&mut self) {
        for reception in &mut self.receive {
            reception.state.reset();
        }
    }

    /// Event-driven TPDOs are sent once at the start.
    pub(super) fn enter_operational(&mut self) {
        for transmitted in &mut self.transmit {
            transmitted.last = None;
        }
    }

    /// Whether a TPDO is sent without being asked for.
    pub(super) fn has_events(&self) -> bool {
        self.transmit
            .iter()
            .any(|t| t.pdo.transmission.is_event_driven())
    }
}

impl Drive {
    pub(super) fn on_process_frame(&mut self, frame: &Frame) {
        if self.is_sync(frame) {
            self.on_sync();
        }
        if !self.nmt.allows(Service::Pdo) {
            return;
        }
        let id = frame.id();
        if frame.is_remote() {
            self.on_request(id);
            return;
        }
        if self.exchange.transmit.iter().any(|t| t.pdo.id == id) {
            self.raise(errors::COB_ID_COLLISION, false);
        }
        let found = self.exchange.receive.iter_mut().find(|r| r.pdo.id == id);
        let Some(Reception { pdo, state }) = found else {
            return;
        };
        match state.receive(frame.data(), pdo.mapping.bytes(), pdo.transmission) {
            Received::AtSync => {}
            Received::Now(data) => {
                pdo.unpack(data, &mut self.od);
                self.after_write();
            }
            Received::TooShort { .. } => self.raise(errors::PDO_LENGTH, false),
        }
    }

    /// Actual values are taken first, then the commands act: what a TPDO
    /// reports is from before this SYNC's commands.
    fn on_sync(&mut self) {
        if !self.nmt.allows(Service::Pdo) {
            return;
        }
        self.warn();
        let delay = self.config.tpdo_delay.draw(&mut self.random);
        let at = self.now + self.clock.span(delay);
        let sampled: Vec<_> = self
            .exchange
            .transmit
            .iter()
            .filter(|t| t.pdo.transmission == EVERY_SYNC)
            .map(|t| WireFrame::standard(t.pdo.id.get(), &t.pdo.pack(&mut self.od)))
            .collect();
        for frame in sampled {
            self.plan(at, Job::Transmit(frame));
        }
        for Reception { pdo, state } in &mut self.exchange.receive {
            if let Some(data) = state.sync() {
                pdo.unpack(data, &mut self.od);
            }
        }
        self.after_write();
    }

    /// A remote frame asks for a TPDO.
    fn on_request(&mut self, id: CobId) {
        let asked = self
            .exchange
            .transmit
            .iter()
            .find(|t| t.pdo.id == id && t.pdo.on_request);
        if let Some(asked) = asked {
            let frame = WireFrame::standard(id.get(), &asked.pdo.pack(&mut self.od));
            self.send_tpdo(frame);
        }
    }

    /// Once per control cycle: TPDOs whose data has changed.
    pub(super) fn send_events(&mut self) {
        if !self.nmt.allows(Service::Pdo) {
            return;
        }
        let mut frames = Vec::new();
        for transmitted in &mut self.exchange.transmit {
            let pdo = &transmitted.pdo;
            if !pdo.transmission.is_event_driven() || self.now < transmitted.inhibited_until {
                continue;
            }
            let data = pdo.pack(&mut self.od);
            if transmitted.last.as_ref() != Some(&data) {
                let pause = self.clock.span(u64::from(pdo.inhibit) * INHIBIT_US);
                transmitted.inhibited_until = self.now + pause;
                frames.push(WireFrame::standard(pdo.id.get(), &data));
                transmitted.last = Some(data);
            }
        }
        for frame in frames {
            self.send_tpdo(frame);
        }
    }

    /// A TPDO is ready, unless operational was left meanwhile.
    pub(super) fn send_tpdo(&mut self, frame: WireFrame) {
        let since = |fault: &DriveFault| match *fault {
            DriveFault::TpdosLost { at } => self.now >= at,
            _ => false,
        };
        let lost = self.config.faults.iter().any(since);
        if self.nmt.allows(Service::Pdo) && !lost {
            self.transmit_latest(frame);
        }
    }
}

//! SDO server of the drive: requests wait in a queue and are answered after
//! the drive's latency (CiA 301, 7.2.4).

use super::config::DriveFault;
use super::dictionary::Dictionary;
use super::objects::PDOS;
use super::{Drive, Job, errors};
use canmaster::nmt;
use canmaster::pdo::{RPDO_COMMUNICATION, TPDO_MAPPING};
use canmaster::sdo::{AbortCode, Server};
use canmaster::{Duration, Frame, Instant, NodeId};
use std::collections::VecDeque;

/// Requests that can wait.
const QUEUE: usize = 8;
/// After this the server gives up a transfer that stands still.
const TIMEOUT: Duration = Duration::from_millis(1000);
/// First byte of an abort.
const ABORT: u8 = 0x80;

/// The service.
#[derive(Clone, Debug)]
pub(super) struct SdoService {
    server: Server,
    waiting: VecDeque<Frame>,
}

impl SdoService {
    pub(super) fn new(node: NodeId) -> SdoService {
        SdoService {
            server: Server::new(node, TIMEOUT),
            waiting: VecDeque::new(),
        }
    }

    /// Ends everything without a word.
    pub(super) fn reset(&mut self, od: &mut Dictionary) {
        self.server.reset(od);
        self.waiting.clear();
    }

    pub(super) fn next_deadline(&self) -> Option<Instant> {
        self.server.next_deadline()
    }
}

impl Drive {
    pub(super) fn on_service_frame(&mut self, frame: &Frame) {
        let service = &mut self.service;
        let request = frame.id() == service.server.request_id() && !frame.is_remote();
        if !request || !self.nmt.allows(nmt::Service::Sdo) || self.sdo_dead() {
            return;
        }
        if self.service.waiting.len() >= QUEUE {
            self.raise(errors::RECEIVE_QUEUE, false);
            return;
        }
        self.service.waiting.push_back(*frame);
        if self.service.waiting.len() == 1 {
            self.plan_serving();
        }
    }

    fn plan_serving(&mut self) {
        let latency = self.config.sdo_latency.draw(&mut self.random);
        self.plan(self.now + self.clock.span(latency), Job::Serve);
    }

    /// The first request has been worked on: the answer goes out.
    pub(super) fn serve(&mut self) {
        // Leaving the services meanwhile emptied the queue.
        let Some(frame) = self.service.waiting.pop_front() else {
            return;
        };
        let now = self.clock.own(self.now);
        let answer = self.service.server.on_frame(&frame, now, &mut self.od);
        self.after_write();
        if let Some(answer) = answer {
            self.transmit(as_epos4(answer));
        }
        if !self.service.waiting.is_empty() {
            self.plan_serving();
        }
    }

    pub(super) fn poll_server(&mut self) {
        let now = self.clock.own(self.now);
        while let Some(frame) = self.service.server.poll(now, &mut self.od) {
            self.transmit(frame);
        }
    }

    fn sdo_dead(&self) -> bool {
        let since = |fault: &DriveFault| match *fault {
            DriveFault::SdoDead { at } => self.now >= at,
            _ => false,
        };
        self.config.faults.iter().any(since)
    }

    /// What follows from entries that were written.
    pub(super) fn after_write(&mut self) {
        let mut pdos = false;
        for at in self.od.take_written() {
            match at.index.0 {
                0x1016 => self.set_consumer(at.sub.0),
                0x1017 => self.set_producer(),
                0x6040 => self.on_controlword(),
                RPDO_COMMUNICATION..=LAST_PDO_OBJECT => pdos = true,
                _ => {}
            }
        }
        if pdos {
            self.exchange.reload(&self.od);
        }
    }
}

/// The last object of the PDO parameters.
const LAST_PDO_OBJECT: u16 = TPDO_MAPPING + PDOS - 1;

/// The EPOS4 has one code for a length that does not fit from above.
fn as_epos4(answer: Frame) -> Frame {
    let mut bytes = answer.padded();
    if bytes[0] == ABORT && bytes[4..] == AbortCode::TOO_LONG.0.to_le_bytes() {
        bytes[4..].copy_from_slice(&AbortCode::LENGTH_MISMATCH.0.to_le_bytes());
    }
    Frame::full(answer.id(), bytes)
}

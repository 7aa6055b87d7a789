//! SDO server of the drive: requests wait in a queue and are answered after
//! the drive's latency (CiA 301, 7.2.4).

use super::config::DriveFault;
use super::dictionary::Dictionary;
use super::mangle::Answer;
use super::objects::PDOS;
use super::{Drive, Job, errors};
use crate::frame::WireId;
use crate::time::Time;
use canmaster::nmt;
use canmaster::pdo::{RPDO_COMMUNICATION, TPDO_MAPPING};
use canmaster::sdo::{AbortCode, Server};
use canmaster::{Duration, Frame, Instant, NodeId};
use std::collections::VecDeque;

/// Requests that can wait.
const QUEUE: usize = 8;
/// After this the server gives up a transfer that stands still.
const TIMEOUT: Duration = Duration::from_millis(1000);
/// First byte of an expedited download, the size aside.
const DOWNLOAD: u8 = 0x22;
const DOWNLOAD_MASK: u8 = 0xE2;
/// First byte of an abort.
const ABORT: u8 = 0x80;
/// First byte of the answer that opens a block download, whatever its CRC bit.
const BLOCK_DOWNLOAD: u8 = 0xA0;
const CRC_SUPPORTED: u8 = 0x04;
/// First byte of the answer to a block of segments.
const BLOCK_ANSWER: u8 = 0xA2;
/// Answers that may wait in the controller: one on the wire, one behind it, so
/// that the segments of a block upload follow each other without a gap.
const ANSWERS_WAITING: usize = 2;

/// The service.
#[derive(Clone, Debug)]
pub(super) struct SdoService {
    server: Server,
    waiting: VecDeque<Frame>,
    /// Segments of a block download follow: nobody answers them, so they do
    /// not wait either.
    segments: bool,
}

impl SdoService {
    pub(super) fn new(node: NodeId, block_size: u8) -> SdoService {
        SdoService {
            server: Server::new(node, TIMEOUT).with_block_size(block_size),
            waiting: VecDeque::new(),
            segments: false,
        }
    }

    /// Ends everything without a word.
    pub(super) fn reset(&mut self, od: &mut Dictionary) {
        self.server.reset(od);
        self.waiting.clear();
        self.segments = false;
    }

    /// The server's deadline: a timeout, or the next segment of a block
    /// upload.
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
        if self.service.segments {
            if let Some(answer) = self.work(frame).and_then(|a| self.mangled(a, false)) {
                let at = self.now + self.latency();
                self.plan(at, Job::Answer(answer));
            }
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

    fn latency(&mut self) -> Time {
        self.clock
            .span(self.config.sdo_latency.draw(&mut self.random))
    }

    fn plan_serving(&mut self) {
        let mut at = self.now + self.latency();
        if self.service.waiting.front().is_some_and(is_store) {
            let us = self.config.store_time.draw(&mut self.random);
            at += self.clock.span(us);
        }
        self.plan(at, Job::Serve);
    }

    /// The first request has been worked on: the answer goes out.
    pub(super) fn serve(&mut self) {
        // Leaving the services meanwhile emptied the queue.
        let Some(frame) = self.service.waiting.pop_front() else {
            return;
        };
        if let Some(answer) = self.work(&frame).and_then(|a| self.mangled(a, false)) {
            self.transmit(answer);
        }
        if !self.service.waiting.is_empty() {
            self.plan_serving();
        }
    }

    fn work(&mut self, frame: &Frame) -> Option<Frame> {
        let now = self.clock.own(self.now);
        let answer = self.service.server.on_frame(frame, now, &mut self.od);
        self.after_write();
        let answer = as_epos4(answer?);
        let command = answer.padded()[0];
        self.service.segments =
            command == BLOCK_ANSWER || command & !CRC_SUPPORTED == BLOCK_DOWNLOAD;
        Some(answer)
    }

    /// Whether the controller takes another answer.
    pub(super) fn answer_fits(&self) -> bool {
        let id = WireId::Standard(self.od.number(0x1200, 2) as u16);
        self.controller.waiting(id) < ANSWERS_WAITING
    }

    /// A timer of the server has run out.
    pub(super) fn poll_server(&mut self) {
        let now = self.clock.own(self.now);
        if self.answer_fits()
            && let Some(frame) = self.service.server.poll(now, &mut self.od)
        {
            let block_segment = !self.service.segments && frame.padded()[0] != ABORT;
            if let Some(frame) = self.mangled(frame, block_segment) {
                self.transmit(frame);
            }
        }
        if self.service.server.is_idle() {
            self.service.segments = false;
        }
    }

    /// An answer as the faults of the drive leave it.
    fn mangled(&self, frame: Frame, block_segment: bool) -> Option<Frame> {
        let wrong = self.config.faults.iter().find_map(|fault| match fault {
            DriveFault::SdoWrong(wrong) => Some(*wrong),
            _ => None,
        });
        match wrong {
            Some(wrong) => wrong.mangle(Answer {
                frame,
                block_segment,
            }),
            None => Some(frame),
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
                index @ (0x607A | 0x60FF | 0x6071) => {
                    let now_s = self.own_seconds();
                    self.axis.set(index, &self.od, now_s);
                }
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

/// Whether a request writes to 1010h or 1011h, expedited: that takes longer.
fn is_store(request: &Frame) -> bool {
    let [command, low, high, ..] = request.padded();
    let index = u16::from_le_bytes([low, high]);
    command & DOWNLOAD_MASK == DOWNLOAD && matches!(index, 0x1010 | 0x1011)
}

/// The EPOS4 has one code for a length that does not fit from above.
fn as_epos4(answer: Frame) -> Frame {
    let mut bytes = answer.padded();
    if bytes[0] == ABORT && bytes[4..] == AbortCode::TOO_LONG.0.to_le_bytes() {
        bytes[4..].copy_from_slice(&AbortCode::LENGTH_MISMATCH.0.to_le_bytes());
    }
    Frame::full(answer.id(), bytes)
}

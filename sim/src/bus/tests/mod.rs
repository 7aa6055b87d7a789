//! The bus as its users see it: nodes with queues, events out.

use super::*;
use crate::frame::{WireFrame, WireId};
use std::collections::VecDeque;

mod anything;
mod arbitration;
mod errors;
mod faults;
mod sameness;
mod timing;

/// A bus with nodes that retransmit like any controller.
struct Net {
    bus: Bus,
    queues: Vec<VecDeque<(WireFrame, Time)>>,
    retransmit: bool,
    log: Vec<Event>,
    now: Time,
}

const RATE: u32 = 1_000_000;

impl Net {
    fn new(nodes: usize) -> Net {
        Net::with_clocks(&vec![0.0; nodes])
    }

    /// Nodes at 1 Mbit/s whose clocks are so many ppm fast.
    fn with_clocks(ppm: &[f64]) -> Net {
        let timings = ppm.iter().map(|ppm| Some(BitTiming::new(RATE, *ppm)));
        Net::with_timings(Bus::new(1), timings.collect())
    }

    fn with_timings(mut bus: Bus, timings: Vec<Option<BitTiming>>) -> Net {
        for (i, timing) in timings.iter().enumerate() {
            let port = bus.attach(&format!("node {i}"));
            bus.set_timing(port, *timing, Time::ZERO);
        }
        Net {
            queues: vec![VecDeque::new(); bus.ports()],
            bus,
            retransmit: true,
            log: Vec::new(),
            now: Time::ZERO,
        }
    }

    /// Until all nodes have joined.
    fn settled(mut self) -> Net {
        self.run(Time::from_us(50));
        self.log.clear();
        self
    }

    fn send(&mut self, port: usize, frame: WireFrame, at: Time) {
        self.queues[port].push_back((frame, at));
        self.offer(port);
    }

    fn offer(&mut self, port: usize) {
        let head = self.queues[port].front().copied();
        self.bus.offer(
            PortId(port),
            head.map(|(frame, ready_at)| Offer {
                frame,
                ready_at,
                tag: port as u32,
            }),
        );
    }

    /// Up to `until`, in steps of the bus's own events.
    fn run(&mut self, until: Time) {
        loop {
            let next = self.bus.next_event().filter(|at| *at <= until);
            let mut events = Vec::new();
            self.bus.advance(next.unwrap_or(until), &mut events);
            for event in events {
                self.on_event(event);
            }
            if next.is_none() {
                break;
            }
        }
        self.now = until;
    }

    fn on_event(&mut self, event: Event) {
        let port = event.port.0;
        match event.kind {
            EventKind::TxDone { .. } => {
                self.queues[port].pop_front();
                self.offer(port);
            }
            EventKind::ArbitrationLost { .. } => self.offer(port),
            EventKind::TxError { .. } if self.retransmit => self.offer(port),
            _ => {}
        }
        self.log.push(event);
    }

    fn kinds(&self, port: usize) -> Vec<EventKind> {
        let mine = self.log.iter().filter(|e| e.port.0 == port);
        mine.map(|e| e.kind).collect()
    }

    /// Identifiers of the frames that a node received, in order.
    fn received(&self, port: usize) -> Vec<WireId> {
        let rx = self.kinds(port).into_iter().filter_map(|kind| match kind {
            EventKind::Rx { frame, .. } => Some(frame.id),
            _ => None,
        });
        rx.collect()
    }

    fn errors(&self, port: usize) -> Vec<WireError> {
        let errors = self.kinds(port).into_iter().filter_map(|kind| match kind {
            EventKind::TxError { error, .. } | EventKind::RxError { error } => Some(error),
            _ => None,
        });
        errors.collect()
    }

    /// The last counters that a node was told.
    fn counters(&self, port: usize) -> (u16, u16, ErrorState) {
        let told = self
            .kinds(port)
            .into_iter()
            .rev()
            .find_map(|kind| match kind {
                EventKind::Counters { tec, rec, state } => Some((tec, rec, state)),
                _ => None,
            });
        told.unwrap_or((0, 0, ErrorState::Active))
    }

    fn done(&self, port: usize) -> usize {
        let done = |kind: &EventKind| matches!(kind, EventKind::TxDone { .. });
        self.kinds(port).iter().filter(|kind| done(kind)).count()
    }
}

fn std_id(id: u16) -> WireId {
    WireId::Standard(id)
}

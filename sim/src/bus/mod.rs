//! A CAN bus in virtual time (ISO 11898-1:2015, classical frames).
//!
//! Every node has its own clock and its own grid of bits; it synchronises hard
//! on a start of frame and again on every recessive to dominant edge, within
//! its jump width. A frame starts only on its sender's own bit boundary. Who
//! waits for the bus when the first start of frame falls begins with it, and
//! the arbitration decides.
//!
//! Undisturbed frames are computed as a whole (module `express`); everything
//! else, errors above all, is worked out bit by bit by a complete protocol
//! controller per node (modules `controller` and `wire`). Both give the same
//! events; a test holds them against each other.
//!
//! Simplifications: propagation takes no time; edges are seen at once instead
//! of at the next time quantum; where several nodes arbitrate, an undisturbed
//! frame is timed by the winner's clock from the start of frame on, and all
//! its receivers are told at one moment (differences of a few nanoseconds);
//! noise and flipped bits last one bit time; controllers never ask for time by
//! overload frames of their own, but answer others'.

mod confinement;
mod controller;
mod decoder;
mod express;
mod faults;
pub mod log;
mod node;
mod record;
mod signalling;
mod types;
mod wire;

pub use types::{
    BitTiming, BusFault, ErrorState, Event, EventKind, Offer, PortId, RecordKind, WireError,
    WireRecord,
};

use crate::time::{PS_PER_US, Time};
use express::Plan;
use faults::Faults;
use node::Node;
use record::Recorder;

/// How the bus is being worked out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    /// Every node is idle.
    Quiet,
    /// An undisturbed frame is on its way.
    Express,
    /// Bit by bit.
    Bitwise,
}

/// The bus with all its nodes. Everything on it follows from the calls and
/// the seed.
#[derive(Debug)]
pub struct Bus {
    nodes: Vec<Node>,
    now: u64,
    mode: Mode,
    plan: Plan,
    faults: Faults,
    recorder: Recorder,
    /// Events that came up outside of [`Bus::advance`].
    unheard: Vec<Event>,
    /// How many of each node's next events have been told already, by a frame
    /// that was planned as undisturbed and then was not.
    repeats: Vec<usize>,
    /// Whether undisturbed frames are computed as a whole.
    express: bool,
}

impl Bus {
    /// A bus without nodes. `seed` decides on the noise.
    pub fn new(seed: u64) -> Bus {
        Bus {
            nodes: Vec::new(),
            now: 0,
            mode: Mode::Quiet,
            plan: Plan::default(),
            faults: Faults::new(seed),
            recorder: Recorder::default(),
            unheard: Vec::new(),
            repeats: Vec::new(),
            express: true,
        }
    }

    /// Works everything out bit by bit, as a reference. Many times slower.
    pub fn without_express(mut self) -> Bus {
        self.express = false;
        self
    }

    /// Wires a node to the bus. It takes no part until it has a timing.
    pub fn attach(&mut self, name: &str) -> PortId {
        self.nodes.push(Node::new(name));
        self.repeats.push(0);
        PortId(self.nodes.len() - 1)
    }

    /// The name under which the node was attached.
    pub fn name(&self, port: PortId) -> &str {
        &self.nodes[port.0].name
    }

    /// Number of nodes attached.
    pub fn ports(&self) -> usize {
        self.nodes.len()
    }

    /// The moment up to which the bus has been worked out.
    pub fn now(&self) -> Time {
        Time(self.now)
    }

    /// Tells a node's bit timing. `None` = INIT or without power: it takes no
    /// part, what it was sending breaks off without an event, its offer is
    /// forgotten. A new timing lets it join after 11 recessive bits. A node
    /// that is bus-off stays off until a timing is told again; it then needs
    /// 129 times 11 recessive bits and comes back with counters at zero. The
    /// same timing again changes nothing else. The counters survive INIT; see
    /// [`Bus::reset`].
    ///
    /// `now` is a moment not before the last [`Bus::advance`].
    pub fn set_timing(&mut self, port: PortId, timing: Option<BitTiming>, now: Time) {
        let node = &self.nodes[port.0];
        let waits = timing.is_some() && node.controller.is_off();
        if node.timing == timing && !waits {
            return;
        }
        self.interrupt(now);
        let now = self.now;
        self.nodes[port.0].set_timing(timing, now);
        self.repeats[port.0] = 0;
        let mut out = std::mem::take(&mut self.unheard);
        self.refresh(now, &mut out);
        self.unheard = out;
        if timing.is_none() {
            self.drop_lead(port.0, now);
        }
        self.leave_bitwise(now);
    }

    /// Takes a node off the bus and clears its error counters, as a power
    /// cycle or a reset of the controller does.
    pub fn reset(&mut self, port: PortId, now: Time) {
        self.set_timing(port, None, now);
        self.nodes[port.0].controller.counters = Default::default();
    }

    /// What this controller would send next; may change until
    /// [`EventKind::TxStarted`]. Then the bus forgets the offer: offer the
    /// next one, or the same again, after `TxDone`, `ArbitrationLost` or
    /// `TxError`.
    pub fn offer(&mut self, port: PortId, offer: Option<Offer>) {
        self.nodes[port.0].offer = offer;
    }

    /// Orders a disturbance.
    pub fn inject(&mut self, fault: BusFault) {
        if self.mode == Mode::Express {
            self.interrupt(Time(self.now));
        }
        let bits = self.nodes.iter().filter(|n| n.timing.is_some());
        let bit = bits.map(|n| n.bit).min().unwrap_or(PS_PER_US);
        self.faults.add(fault, self.now, bit);
    }

    /// When [`Bus::advance`] has something to do; `None` = never, as things
    /// stand. While the bus is worked out bit by bit this is the next moment
    /// at which something may have happened.
    pub fn next_event(&self) -> Option<Time> {
        if let Some(event) = self.unheard.first() {
            return Some(event.at);
        }
        let at = match self.mode {
            Mode::Quiet => self.next_start().min(self.faults.next_change()),
            Mode::Express => self.plan.next_due(),
            Mode::Bitwise => self.bitwise_slice_end(),
        };
        (at != u64::MAX).then_some(Time(at))
    }

    /// The first moment at which a node on the quiet bus starts a frame.
    fn next_start(&self) -> u64 {
        let mut first = u64::MAX;
        for node in &self.nodes {
            if let Some(offer) = node.offer.filter(|_| node.controller.is_idle()) {
                first = first.min(node.boundary_from(offer.ready_at.0.max(self.now)));
            }
        }
        first
    }

    /// Works the bus out up to and including `to` and appends what the nodes
    /// learn, ordered by time.
    pub fn advance(&mut self, to: Time, out: &mut Vec<Event>) {
        out.append(&mut self.unheard);
        self.run(to.0, out);
        self.now = self.now.max(to.0);
    }

    fn run(&mut self, to: u64, out: &mut Vec<Event>) {
        loop {
            match self.mode {
                Mode::Quiet => {
                    let start = self.next_start();
                    let at = start.min(self.faults.next_change());
                    if at > to {
                        return;
                    }
                    self.now = self.now.max(at);
                    if !(self.express && at == start && self.try_express(at)) {
                        self.enter_bitwise(at);
                    }
                }
                Mode::Express => {
                    self.run_express(to, out);
                    if self.mode == Mode::Express {
                        return;
                    }
                }
                Mode::Bitwise => {
                    let told = out.len();
                    self.run_bitwise(to, out);
                    self.drop_repeats(told, out);
                    if self.mode == Mode::Bitwise {
                        return;
                    }
                    self.repeats.fill(0);
                }
            }
        }
    }

    /// Brings the bus to `now`, bit by bit from here on.
    fn interrupt(&mut self, now: Time) {
        let mut out = std::mem::take(&mut self.unheard);
        self.advance(now, &mut out);
        self.unheard = out;
        match self.mode {
            Mode::Quiet => self.enter_bitwise(self.now),
            Mode::Express => self.leave_express(),
            Mode::Bitwise => {}
        }
    }

    /// Everything that was on the wire since the last call, in order.
    pub fn take_records(&mut self) -> Vec<WireRecord> {
        self.recorder.take()
    }
}

#[cfg(test)]
mod tests;

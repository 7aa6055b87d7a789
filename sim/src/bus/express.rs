//! The express way for what is nearly all of the traffic: a frame of which it
//! is certain beforehand that nobody will disturb it. Its outcome is computed
//! at once and handed out piece by piece as time reaches it. Should something
//! happen on the way after all (a node switched off, a fault ordered), the
//! frame is run again bit by bit from its start to that moment.

use super::node::Node;
use super::types::{Event, EventKind, Offer, PortId, RecordKind, WireRecord};
use super::{Bus, Mode};
use crate::frame::{INTERMISSION_BITS, WireFrame};
use crate::time::Time;

/// A node follows a sender whose clock differs by less than this share of the
/// bit without ever missing an edge by more than the jump width; what differs
/// more is worked out bit by bit.
const CLOCK_TOLERANCE: u64 = 1000;
/// No frame with its interframe space is longer than this many bits.
const LONGEST_FRAME: u64 = 200;
/// Samples after the start of the acknowledge slot: the last but one bit of
/// EOF, the last one, and the last of the intermission.
const ACK_TO_VALID: u64 = 7;
const ACK_TO_DONE: u64 = 8;
const ACK_TO_FREE: u64 = 11;

/// An undisturbed frame on its way.
#[derive(Debug, Default)]
pub(super) struct Plan {
    sof: u64,
    /// Who wanted to send, with what; the first is the sender.
    joined: Vec<(usize, Offer)>,
    /// How many of `joined` send the winning frame.
    winners: usize,
    bits: u32,
    /// The edge of the acknowledge slot, on which all nodes synchronise.
    ack: u64,
    end: u64,
    /// All nodes have seen the intermission.
    over_at: u64,
    events: Vec<Event>,
    told: usize,
}

impl Plan {
    /// When something of it is due.
    pub(super) fn next_due(&self) -> u64 {
        self.events.get(self.told).map_or(self.over_at, |e| e.at.0)
    }

    fn tell(&mut self, at: u64, port: usize, kind: EventKind) {
        self.events.push(Event {
            at: Time(at),
            port: PortId(port),
            kind,
        });
    }
}

fn follows(node: &Node, sender: u64) -> bool {
    node.bit.abs_diff(sender) * CLOCK_TOLERANCE < sender
}

impl Bus {
    /// Plans the frame that starts at `sof`, on the quiet bus. False if it is
    /// not certain to get through.
    pub(super) fn try_express(&mut self, sof: u64) -> bool {
        let mut plan = std::mem::take(&mut self.plan);
        let certain = self.make_plan(sof, &mut plan);
        if certain {
            for (port, _) in &plan.joined {
                self.nodes[*port].offer = None;
            }
            self.mode = Mode::Express;
        }
        self.plan = plan;
        certain
    }

    fn make_plan(&self, sof: u64, plan: &mut Plan) -> bool {
        if !self.choose_winner(sof, plan) {
            return false;
        }
        let (lead, offer) = plan.joined[0];
        let frame = offer.frame;
        let bit = self.nodes[lead].bit;
        let undisturbed_until = sof + LONGEST_FRAME * bit;
        if self.faults.any_active() || self.faults.next_change() <= undisturbed_until {
            return false;
        }

        let sends = |port: usize| plan.joined[..plan.winners].iter().any(|j| j.0 == port);
        let mut fastest = u64::MAX;
        for (port, node) in self.listening() {
            if !follows(node, bit) {
                return false;
            }
            if !sends(port) {
                fastest = fastest.min(node.bit);
            }
        }
        if fastest == u64::MAX {
            return false; // Nobody there to acknowledge.
        }
        // All have synchronised on the sender's last edge before the
        // acknowledge slot; the fastest of them makes the edge in it.
        let wire = frame.encode();
        let edge = wire.last_falling_edge();
        let ack_slot = wire.stuffed_len() + 1;
        let ack = sof + u64::from(edge) * bit + u64::from(ack_slot - edge) * fastest;

        let (mut valid, mut over_at, mut free_from) = (0, 0, u64::MAX);
        for (_, node) in self.listening() {
            valid = valid.max(ack + ACK_TO_VALID * node.bit + node.sample);
            over_at = over_at.max(ack + ACK_TO_FREE * node.bit + node.sample);
            free_from = free_from.min(ack + (ACK_TO_FREE + 1) * node.bit);
        }
        if free_from <= over_at {
            return false; // Someone could start into another's intermission.
        }
        plan.sof = sof;
        plan.bits = wire.len() + INTERMISSION_BITS;
        plan.ack = ack;
        plan.end = ack + (ACK_TO_FREE + 1) * bit;
        plan.over_at = over_at;
        self.plan_events(plan, &frame, valid);
        true
    }

    fn listening(&self) -> impl Iterator<Item = (usize, &Node)> {
        let nodes = self.nodes.iter().enumerate();
        nodes.filter(|(_, node)| !node.controller.is_off())
    }

    /// Collects who waits for the bus and sorts the winners to the front.
    /// False if the arbitration has no clear winner.
    fn choose_winner(&self, sof: u64, plan: &mut Plan) -> bool {
        plan.joined.clear();
        let mut best = u32::MAX;
        for (port, node) in self.listening() {
            let Some(offer) = node.offer.filter(|offer| offer.ready_at.0 <= sof) else {
                continue;
            };
            if self.faults.awaits(offer.frame.id) {
                return false;
            }
            best = best.min(offer.frame.arbitration_key());
            plan.joined.push((port, offer));
        }
        let wins = |joined: &(usize, Offer)| joined.1.frame.arbitration_key() == best;
        plan.joined.sort_by_key(|joined| !wins(joined));
        plan.winners = plan.joined.iter().filter(|joined| wins(joined)).count();
        let Some(((_, first), others)) = plan.joined[..plan.winners].split_first() else {
            return false;
        };
        others
            .iter()
            .all(|(_, other)| other.frame.same_on_wire(&first.frame))
    }

    fn plan_events(&self, plan: &mut Plan, frame: &WireFrame, valid: u64) {
        plan.events.clear();
        plan.told = 0;
        let (sof, ack, winners) = (plan.sof, plan.ack, plan.winners);
        for i in 0..plan.joined.len() {
            let (port, offer) = plan.joined[i];
            plan.tell(sof, port, EventKind::TxStarted { tag: offer.tag });
        }
        if winners < plan.joined.len() {
            plan.events.sort_by_key(|event| event.port);
            self.plan_losers(plan, frame);
        }
        let sends = |plan: &Plan, port| plan.joined[..winners].iter().any(|j| j.0 == port);
        for (port, node) in self.listening() {
            if sends(plan, port) {
                continue;
            }
            let kind = EventKind::Rx {
                frame: *frame,
                sof: Time(sof),
            };
            plan.tell(valid, port, kind);
            let mut counters = node.controller.counters;
            counters.received();
            if counters != node.controller.counters {
                plan.tell(valid, port, counters.report());
            }
        }
        for i in 0..winners {
            let (port, offer) = plan.joined[i];
            let node = &self.nodes[port];
            let done = ack + ACK_TO_DONE * node.bit + node.sample;
            let kind = EventKind::TxDone {
                tag: offer.tag,
                sof: Time(sof),
            };
            plan.tell(done, port, kind);
            let mut counters = node.controller.counters;
            counters.transmitted();
            if counters != node.controller.counters {
                plan.tell(done, port, counters.report());
            }
        }
        if winners > 1 {
            plan.events.sort_by_key(|event| event.at);
        }
    }

    fn plan_losers(&self, plan: &mut Plan, frame: &WireFrame) {
        let wire = frame.encode();
        let key = frame.arbitration_key();
        let first = plan.events.len();
        for i in plan.winners..plan.joined.len() {
            let (port, offer) = plan.joined[i];
            let node = &self.nodes[port];
            // SOF comes before the first bit of the key.
            let differs = 1 + (key ^ offer.frame.arbitration_key()).leading_zeros();
            let index = u64::from(wire.wire_index(differs));
            let at = plan.sof + index * node.bit + node.sample;
            plan.tell(at, port, EventKind::ArbitrationLost { tag: offer.tag });
        }
        plan.events[first..].sort_by_key(|event| (event.at, event.port));
    }

    /// Hands out what is due up to `to`; at its end the bus is free again.
    pub(super) fn run_express(&mut self, to: u64, out: &mut Vec<Event>) {
        while let Some(event) = self.plan.events.get(self.plan.told) {
            if event.at.0 > to {
                return;
            }
            out.push(*event);
            self.plan.told += 1;
        }
        if self.plan.over_at <= to {
            self.finish_express();
        }
    }

    fn finish_express(&mut self) {
        let Plan {
            ack, winners, end, ..
        } = self.plan;
        let senders = &self.plan.joined[..winners];
        let mut suspended = false;
        for (port, node) in self.nodes.iter_mut().enumerate() {
            if node.controller.is_off() {
                continue;
            }
            node.settle(ack + ACK_TO_FREE * node.bit);
            if senders.iter().any(|joined| joined.0 == port) {
                suspended |= node.controller.has_transmitted();
            } else {
                node.controller.counters.received();
            }
        }
        let (_, offer) = senders[0];
        self.recorder.push(WireRecord {
            sof: Time(self.plan.sof),
            end: Time(end),
            bits: self.plan.bits,
            transmitters: senders.iter().map(|joined| PortId(joined.0)).collect(),
            kind: RecordKind::Frame(offer.frame),
        });
        self.now = self.now.max(self.plan.over_at);
        self.mode = if suspended {
            Mode::Bitwise
        } else {
            Mode::Quiet
        };
    }

    /// Something unforeseen happens now: the frame is run again bit by bit up
    /// to here, without telling anybody twice.
    pub(super) fn leave_express(&mut self) {
        let plan = std::mem::take(&mut self.plan);
        let now = self.now;
        let offers: Vec<_> = self.nodes.iter_mut().map(|n| n.offer.take()).collect();
        for (port, offer) in &plan.joined {
            self.nodes[*port].offer = Some(*offer);
        }
        self.enter_bitwise(plan.sof);
        let mut again = Vec::new();
        self.run_bitwise(now, &mut again);
        for (node, offer) in self.nodes.iter_mut().zip(offers) {
            node.offer = offer;
        }
        // Each node has been told a beginning of the same sequence.
        for event in &plan.events[..plan.told] {
            self.repeats[event.port.0] += 1;
        }
        self.plan = plan;
        self.drop_repeats(0, &mut again);
        self.unheard.append(&mut again);
    }

    /// Takes what has been told before out of `events`, from `first` on.
    pub(super) fn drop_repeats(&mut self, first: usize, events: &mut Vec<Event>) {
        if self.repeats.iter().all(|n| *n == 0) {
            return;
        }
        let mut index = 0;
        events.retain(|event| {
            index += 1;
            let repeats = &mut self.repeats[event.port.0];
            if index <= first || *repeats == 0 {
                return true;
            }
            *repeats -= 1;
            false
        });
    }
}

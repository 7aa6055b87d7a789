//! The bus bit by bit: every node steps through its own bits, and every edge
//! reaches every node. Used whenever an undisturbed frame is not certain.

use super::controller::{DOMINANT, Mac, RECESSIVE};
use super::node::{Node, Step};
use super::types::{ErrorState, Event, EventKind};
use super::{Bus, Mode};

impl Bus {
    /// Starts stepping at `now`; whatever is due at `now` is still to come.
    pub(super) fn enter_bitwise(&mut self, now: u64) {
        for node in &mut self.nodes {
            if node.controller.is_idle() {
                node.catch_up(now);
            }
        }
        self.mode = Mode::Bitwise;
    }

    /// When the next bit step is due, faults included.
    fn next_due(&self) -> Option<(u64, Step, usize)> {
        let mut best: Option<(u64, Step, usize)> = None;
        for (port, node) in self.nodes.iter().enumerate() {
            if node.controller.is_off() {
                continue;
            }
            let (at, step) = node.next_step();
            if best.is_none_or(|b| (at, step, port) < b) {
                best = Some((at, step, port));
            }
        }
        best
    }

    /// A moment at which every node has made a step: finer slices would only
    /// cost time.
    pub(super) fn bitwise_slice_end(&self) -> u64 {
        let steps = self.nodes.iter().filter(|n| !n.controller.is_off());
        let last = steps.map(|n| n.next_step().0).max();
        last.unwrap_or(u64::MAX).min(self.faults.next_change())
    }

    /// Steps up to and including `to`, or until the bus is idle.
    pub(super) fn run_bitwise(&mut self, to: u64, out: &mut Vec<Event>) {
        loop {
            let change = self.faults.next_change();
            let due = self.next_due();
            let step_at = due.map_or(u64::MAX, |(at, ..)| at);
            let at = step_at.min(change);
            if at > to {
                return;
            }
            self.now = self.now.max(at);
            if change <= step_at {
                self.faults.apply(change);
                self.refresh(change, out);
                if self.leave_bitwise(change) {
                    return;
                }
                continue;
            }
            let Some((at, step, port)) = due else {
                return;
            };
            match step {
                Step::BeginBit => self.begin_bit(port, at, out),
                Step::Sample => {
                    let before = self.nodes[port].controller.mac;
                    self.sample(port, at, out);
                    let after = self.nodes[port].controller.mac;
                    if self.note_transition(port, at, before, after, out) {
                        return;
                    }
                }
            }
        }
    }

    fn begin_bit(&mut self, port: usize, at: u64, out: &mut Vec<Event>) {
        let driven = self.nodes[port].controller.drive;
        let told = out.len();
        self.nodes[port].begin_bit(port, at, out);
        self.record(port, told, out);
        let node = &self.nodes[port];
        let mut changed = driven != node.controller.drive;
        if let Some((frame, index)) = node.controller.sending() {
            changed |= self.faults.on_bit(frame, index, at, node.bit);
        }
        if changed {
            self.refresh(at, out);
        }
    }

    fn sample(&mut self, port: usize, at: u64, out: &mut Vec<Event>) {
        let told = out.len();
        let level = self.nodes[port].sees;
        self.nodes[port].take_sample(port, at, level, out);
        self.record(port, told, out);
    }

    /// Keeps the records; true if the bus has come to rest.
    fn note_transition(
        &mut self,
        port: usize,
        at: u64,
        before: Mac,
        after: Mac,
        out: &mut Vec<Event>,
    ) -> bool {
        if before == after {
            return false;
        }
        let node = &self.nodes[port];
        let end = match (before, after) {
            (Mac::Intermission(_), Mac::Idle | Mac::Suspend(_))
            | (Mac::Integrating { .. }, Mac::Idle) => Some(node.bit_start + node.bit),
            // The third bit was the next frame's start.
            (Mac::Intermission(_), Mac::Stuffed) => Some(node.bit_start),
            _ => None,
        };
        if let Some(end) = end {
            self.recorder.interframe_over(port, end, node.bit);
        }
        match after {
            Mac::Off => {
                self.refresh(at, out);
                self.drop_lead(port, at);
                self.leave_bitwise(at)
            }
            Mac::Idle => self.leave_bitwise(at),
            _ => false,
        }
    }

    /// A node left the bus: another one ends the open record.
    pub(super) fn drop_lead(&mut self, port: usize, at: u64) {
        if self.recorder.lead() != Some(port) {
            return;
        }
        let on = |p: &usize| !self.nodes[*p].controller.is_off() && !self.faults.isolates(*p);
        match (0..self.nodes.len()).find(on) {
            Some(other) => self.recorder.set_lead(other),
            None => self.recorder.close(at, self.nodes[port].bit),
        }
    }

    /// Ends stepping if every node is idle and nothing disturbs the bus.
    pub(super) fn leave_bitwise(&mut self, at: u64) -> bool {
        let common = self.faults.common();
        let quiet = !common.dominant
            && !common.inverted
            && self.nodes.iter().all(|node| {
                let c = &node.controller;
                c.is_off() || (c.is_idle() && node.sees == RECESSIVE && !c.drives_dominant())
            });
        if quiet {
            self.mode = Mode::Quiet;
            if let Some(lead) = self.recorder.lead() {
                self.recorder.close(at, self.nodes[lead].bit);
            }
        }
        quiet
    }

    /// Works out what every node sees, and lets those that see an edge
    /// synchronise on it.
    pub(super) fn refresh(&mut self, at: u64, out: &mut Vec<Event>) {
        loop {
            let common = self.faults.common();
            let disturbed = self.faults.any_active();
            let isolated = |port: usize| disturbed && self.faults.isolates(port);
            let shared = self.nodes.iter().enumerate();
            let dominant = common.dominant
                || shared
                    .filter(|(port, _)| !isolated(*port))
                    .any(|(_, node)| node.controller.drives_dominant());
            let mut restarted = None;
            for port in 0..self.nodes.len() {
                let node = &self.nodes[port];
                let own = node.controller.drives_dominant();
                let mut level = if isolated(port) { !own } else { !dominant };
                if disturbed && (common.inverted != self.faults.inverted_for(port)) {
                    level = !level;
                }
                let node = &mut self.nodes[port];
                let fell = node.sees == RECESSIVE && level == DOMINANT;
                node.sees = level;
                if fell && !node.controller.is_off() && node.edge(at) {
                    restarted = Some(port);
                    break;
                }
            }
            // The bit that begins may be this node's own start of frame.
            match restarted {
                Some(port) => {
                    let told = out.len();
                    self.nodes[port].begin_bit(port, at, out);
                    self.record(port, told, out);
                    let node = &self.nodes[port];
                    if let Some((frame, index)) = node.controller.sending() {
                        self.faults.on_bit(frame, index, at, node.bit);
                    }
                }
                None => return,
            }
        }
    }

    /// Feeds what `port` has just told into the records.
    fn record(&mut self, port: usize, told: usize, out: &[Event]) {
        if told == out.len() || self.faults.isolates(port) {
            return;
        }
        let node = &self.nodes[port];
        let sof = node.controller.sof();
        let flags = self.flags_errors(node);
        for event in &out[told..] {
            if let EventKind::TxStarted { .. } = event.kind
                && let Some((frame, _)) = node.controller.sending()
            {
                self.recorder.started(port, *frame, sof, node.bit);
            }
            self.recorder.told(port, &event.kind, sof, flags);
            if let EventKind::ArbitrationLost { .. } = event.kind {
                let lead = self.recorder.lead().unwrap_or(port);
                if let Some((frame, _)) = self.nodes[lead].controller.sending() {
                    self.recorder.carries(*frame);
                }
            }
        }
    }

    fn flags_errors(&self, node: &Node) -> bool {
        node.controller.counters.state() < ErrorState::Passive
            || matches!(node.controller.mac, Mac::Flag { .. })
    }
}

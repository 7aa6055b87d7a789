//! Start of the network: CiA 302-2, "NMT start-up".

use super::event::{Action, Event};
use super::node::NodeBoot;
use crate::frame::Frame;
use crate::id::FunctionCode;
use crate::network::Network;
use crate::nmt::{Command, ErrorControl, NodeControl};
use crate::time::{Duration, Instant};
use heapless::{Deque, Vec};

/// Actions of the network itself that one stimulus can cause at most.
const OUTBOX: usize = 4;
/// Heartbeats of a node that may pass until one says operational.
const HEARTBEATS_AWAITED: u32 = 3;
/// The time that a node without heartbeat is given to become operational.
const UNWATCHED_START: Duration = Duration::from_millis(100);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Nothing is sent, so that drives left running miss the master's
    /// heartbeat and come to rest.
    Silent {
        until: Instant,
    },
    /// NMT reset communication is sent; the nodes boot, each at its own pace.
    Booting,
    /// SYNC runs; after a few of them the nodes are started.
    Synchronising {
        until: Instant,
    },
    /// NMT start is sent; every node has to report operational.
    Starting {
        deadline: Instant,
    },
    Running,
    Failed,
}

/// Boot-up of a network of at most `N` nodes.
#[derive(Debug)]
pub struct NetworkBoot<const N: usize> {
    network: &'static Network,
    nodes: Vec<NodeBoot, N>,
    phase: Phase,
    /// Where the last round over the nodes stopped, so that none starves.
    next: usize,
    outbox: Deque<Action, OUTBOX>,
}

impl<const N: usize> NetworkBoot<N> {
    /// Begins with the silent phase at `now`. Nodes beyond the first `N` are
    /// left out; [`len`](Self::len) tells how many there are.
    pub fn new(network: &'static Network, now: Instant) -> NetworkBoot<N> {
        NetworkBoot {
            network,
            nodes: network
                .nodes
                .iter()
                .take(N)
                .map(|node| NodeBoot::new(network, node))
                .collect(),
            phase: Phase::Silent {
                until: now + network.master.silence,
            },
            next: 0,
            outbox: Deque::new(),
        }
    }

    /// How many nodes are booted.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether there is no node at all.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Whether the silent phase after a reset is still on: the master's
    /// heartbeat waits for its end.
    pub fn is_silent(&self) -> bool {
        matches!(self.phase, Phase::Silent { .. })
    }

    /// Whether every mandatory node is checked, configured and operational.
    pub fn is_ready(&self) -> bool {
        self.phase == Phase::Running
    }

    /// Whether a mandatory node failed. Nothing leads out but a new start.
    pub fn is_failed(&self) -> bool {
        self.phase == Phase::Failed
    }

    /// Takes in a frame from an SDO server or from error control; all others
    /// are left alone.
    pub fn on_frame(&mut self, frame: &Frame, now: Instant) {
        let Some((function, id)) = frame.id().split() else {
            return;
        };
        let booting = !self.is_ready() && !self.is_failed();
        let Some(node) = self.nodes.iter_mut().find(|boot| boot.node().id == id) else {
            return;
        };
        match function {
            FunctionCode::SdoResponse => node.on_sdo(frame, now),
            // Once the network runs, or has failed, it is left to supervision.
            FunctionCode::ErrorControl if booting => {
                if let Some(heard) = ErrorControl::decode(frame) {
                    node.on_error_control(heard.state);
                }
            }
            _ => {}
        }
    }

    /// The next thing to do, if there is one now: to be called until it
    /// returns `None`, after every frame and at every deadline.
    pub fn poll(&mut self, now: Instant) -> Option<Action> {
        if let Some(action) = self.outbox.pop_front() {
            return Some(action);
        }
        for _ in 0..self.nodes.len() {
            let index = self.next % self.nodes.len();
            let action = self.nodes.get_mut(index).and_then(|node| node.poll(now));
            if action.is_some() {
                return action;
            }
            self.next = index + 1;
        }
        self.advance(now);
        self.outbox.pop_front()
    }

    /// When [`poll`](Self::poll) has to be called again at the latest.
    pub fn next_deadline(&self) -> Option<Instant> {
        let own = match self.phase {
            Phase::Silent { until } | Phase::Synchronising { until } => Some(until),
            Phase::Starting { deadline } => Some(deadline),
            Phase::Booting | Phase::Running | Phase::Failed => None,
        };
        self.nodes
            .iter()
            .filter_map(NodeBoot::next_deadline)
            .chain(own)
            .min()
    }

    fn advance(&mut self, now: Instant) {
        match self.phase {
            Phase::Silent { until } if now >= until => self.reset(now),
            Phase::Booting => self.finish_booting(now),
            Phase::Synchronising { until } if now >= until => self.start(now),
            Phase::Starting { deadline } => self.finish_starting(deadline, now),
            _ => {}
        }
    }

    fn reset(&mut self, now: Instant) {
        self.push(Action::Send(
            NodeControl::all(Command::ResetCommunication).frame(),
        ));
        self.push(Action::Report(Event::ResetSent));
        for node in &mut self.nodes {
            node.start(now);
        }
        self.phase = Phase::Booting;
    }

    /// All nodes are waited for even when one has failed, so that one run
    /// names everything that is wrong.
    fn finish_booting(&mut self, now: Instant) {
        if !self
            .nodes
            .iter()
            .all(|boot| boot.is_ready() || boot.is_failed())
        {
            return;
        }
        if self.mandatory_failed() {
            return self.fail();
        }
        self.push(Action::ProduceSync);
        let syncs = u32::from(self.network.master.syncs_before_start);
        let span = self.network.cycle.as_micros().saturating_mul(syncs);
        self.phase = Phase::Synchronising {
            until: now + Duration::from_micros(span),
        };
    }

    /// By broadcast where all are to start, else one by one: a node that
    /// failed must stay where it is (1F80h, bit 1).
    fn start(&mut self, now: Instant) {
        if self.nodes.iter().all(NodeBoot::is_ready) {
            self.push(Action::Send(NodeControl::all(Command::Start).frame()));
        } else {
            for boot in &mut self.nodes {
                if boot.is_ready() {
                    boot.send(Command::Start);
                }
            }
        }
        self.push(Action::Report(Event::StartSent));
        let slowest = self
            .nodes
            .iter()
            .map(|boot| {
                Duration::from_millis(u32::from(boot.node().heartbeat_ms) * HEARTBEATS_AWAITED)
            })
            .max();
        let patience = slowest.unwrap_or_default().max(UNWATCHED_START);
        self.phase = Phase::Starting {
            deadline: now + patience,
        };
    }

    fn finish_starting(&mut self, deadline: Instant, now: Instant) {
        let waiting = |boot: &NodeBoot| {
            !boot.is_failed()
                && !(boot.is_ready() && (boot.is_operational() || boot.node().heartbeat_ms == 0))
        };
        if !self.nodes.iter().any(waiting) {
            self.push(Action::Report(Event::NetworkReady));
            self.phase = Phase::Running;
        } else if now >= deadline {
            for boot in self.nodes.iter_mut().filter(|boot| waiting(boot)) {
                boot.fail_to_start();
            }
            if self.mandatory_failed() {
                self.fail();
            }
        }
    }

    fn mandatory_failed(&self) -> bool {
        self.nodes
            .iter()
            .any(|boot| boot.is_failed() && boot.node().mandatory)
    }

    fn fail(&mut self) {
        self.push(Action::Report(Event::NetworkFailed));
        self.phase = Phase::Failed;
    }

    fn push(&mut self, action: Action) {
        // The outbox holds what one stimulus can cause; it is emptied before
        // the next one.
        let _ = self.outbox.push_back(action);
    }
}

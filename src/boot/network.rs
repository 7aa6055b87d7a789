//! The boot-up of a network, as its caller sees it.

use super::bus_off::Pauses;
use super::event::{Action, Event};
use super::factory::Factory;
use super::failure::BootResult;
use super::node::{NodeBoot, Trait};
use super::phase::Phase;
use super::settings::{Settings, Startup};
use crate::frame::Frame;
use crate::id::{CobId, FunctionCode, NodeId};
use crate::network::Network;
use crate::nmt::Command;
use crate::time::Instant;
use core::mem::MaybeUninit;
use heapless::{Deque, Vec};

/// Actions of the network itself that one stimulus can cause at most.
const OUTBOX: usize = 4;

/// Boot-up of a network of at most `N` nodes.
///
/// NMT start is never sent while a mandatory node is not booted. A node that
/// is lost later is taken through boot-up again while the others run on.
#[derive(Debug)]
#[repr(C)]
pub struct NetworkBoot<const N: usize> {
    // In this order, small ones first: instructions that reach the first 32 bytes
    // are shorter.
    pub(super) phase: Phase,
    /// Where bus-off leads back to, if the network was halted before.
    pub(super) halted: Option<Phase>,
    /// Every mandatory node is operational, and that has been told.
    pub(super) ready: bool,
    /// The start came to its end once: a mandatory node that fails is waited for.
    pub(super) ran: bool,
    /// The application ordered the start that 1F80h, bit 2, leaves to it.
    pub(super) ordered: bool,
    /// Nodes without node-ID were or are looked for.
    pub(super) searched: bool,
    pub(super) network: &'static Network,
    pub(super) startup: Startup,
    /// The time of what is being done.
    pub(super) now: Instant,
    /// The end of a phase that time alone leads out of.
    pub(super) until: Instant,
    /// Where the last round over the nodes stopped, so that none starves.
    next: usize,
    pauses: Pauses,
    pub(super) factory: Factory,
    outbox: Deque<Action, OUTBOX>,
    pub(super) nodes: Vec<NodeBoot, N>,
}

impl<const N: usize> NetworkBoot<N> {
    /// Begins with the silent phase at `now`, with the settings of the network's
    /// design. Nodes beyond the first `N` are left out; [`len`](Self::len)
    /// tells how many there are.
    pub fn new(network: &'static Network, now: Instant) -> NetworkBoot<N> {
        NetworkBoot::with_settings(network, &Settings::of(network), now)
    }

    /// The same with other settings. If this device is not the NMT master (1F80h,
    /// bit 0), nothing is ever done.
    pub fn with_settings(
        network: &'static Network,
        settings: &Settings<N>,
        now: Instant,
    ) -> NetworkBoot<N> {
        let mut boot = NetworkBoot::without_nodes(network, settings, now);
        boot.add_nodes(settings);
        boot
    }

    /// As [`NetworkBoot::with_settings`], made where it is to stay, without a copy
    /// on the stack.
    pub fn new_in<'a>(
        place: &'a mut MaybeUninit<NetworkBoot<N>>,
        network: &'static Network,
        settings: &Settings<N>,
        now: Instant,
    ) -> &'a mut NetworkBoot<N> {
        let boot = place.write(NetworkBoot::without_nodes(network, settings, now));
        boot.add_nodes(settings);
        boot
    }

    fn add_nodes(&mut self, settings: &Settings<N>) {
        let boot_time = settings.boot_time;
        for (place, settings) in settings.nodes.iter().enumerate() {
            if let Some(node) = self.network.nodes.get(place) {
                // There is room: there are `N` settings.
                let _ = self
                    .nodes
                    .push(NodeBoot::new(self.network, node, *settings, boot_time));
            }
        }
    }

    fn without_nodes(
        network: &'static Network,
        settings: &Settings<N>,
        now: Instant,
    ) -> NetworkBoot<N> {
        NetworkBoot {
            network,
            startup: settings.startup,
            now,
            until: now + network.master.silence,
            nodes: Vec::new(),
            phase: if settings.startup.has(Startup::MASTER) {
                Phase::Silent
            } else {
                Phase::NotMaster
            },
            ready: false,
            ran: false,
            ordered: false,
            searched: false,
            factory: Factory::new(network.nodes),
            halted: None,
            pauses: Pauses::new(),
            next: 0,
            outbox: Deque::new(),
        }
    }

    /// Takes over changed settings. What was done to a node already is done again
    /// only at its next boot-up; whether this device is the NMT master can be
    /// changed only in the silent phase.
    pub fn set_settings(&mut self, settings: &Settings<N>) {
        self.startup = settings.startup;
        if self.phase == Phase::Silent && !self.startup.has(Startup::MASTER) {
            self.phase = Phase::NotMaster;
        }
        let boot_time = settings.boot_time;
        for (place, settings) in settings.nodes.iter().enumerate() {
            if let Some(node) = self.nodes.get_mut(place) {
                node.set_settings(*settings, boot_time);
            }
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

    /// Whether the master is to be silent, as after a reset and after bus-off:
    /// its heartbeat waits for the end.
    pub fn is_silent(&self) -> bool {
        matches!(self.phase, Phase::Silent | Phase::BusOff)
    }

    /// Whether every mandatory node is checked, configured and operational.
    pub fn is_ready(&self) -> bool {
        self.ready
    }

    /// The nodes that are operational, as far as they told: bit n for the one at
    /// place n in the network.
    pub fn operational(&self) -> u32 {
        self.which(Trait::OPERATIONAL)
    }

    /// The mandatory nodes that were given up, or not seen in their boot time, in the
    /// same way: without them the network does not become ready.
    pub fn missing(&self) -> u32 {
        self.which(Trait::MANDATORY_FAILED)
    }

    #[inline(never)]
    fn which(&self, what: Trait) -> u32 {
        let bits = self.nodes.iter().rev();
        bits.fold(0, |bits, node| bits << 1 | u32::from(node.has(what)))
    }

    /// Whether a node of the list was given up, or not seen in its boot time.
    pub fn any_given_up(&self) -> bool {
        self.any(Trait::GIVEN_UP)
    }

    /// Whether a mandatory node failed in the start. Nothing leads out but a new
    /// start, or a [`request`](Self::request) to reset all nodes.
    pub fn is_failed(&self) -> bool {
        self.phase == Phase::Failed
    }

    /// How far the boot-up of a node came; `None` for a node that the network
    /// does not name.
    pub fn result(&self, node: NodeId) -> Option<BootResult> {
        self.nodes
            .iter()
            .find(|boot| boot.node().id == node)
            .map(NodeBoot::result)
    }

    /// Takes in a frame from an SDO server, from error control or from an LSS
    /// slave; all others are left alone.
    #[inline(never)]
    pub fn on_frame(&mut self, frame: &Frame, now: Instant) {
        if !self.phase.listens() {
            return;
        }
        self.set_now(now);
        if frame.id() == CobId::LSS_SLAVE {
            if self.searched
                && let Some(event) = self.factory.on_frame(frame)
            {
                self.found(event);
            }
            return;
        }
        let Some((function, id)) = frame.id().split() else {
            return;
        };
        let Some(node) = self.node_mut(id) else {
            return;
        };
        match function {
            FunctionCode::SdoResponse => node.on_sdo(frame),
            FunctionCode::ErrorControl => node.on_error_control(frame),
            _ => {}
        }
    }

    /// The heartbeat of a node stayed away, or it does not answer to node
    /// guarding: whoever consumes it tells so. `false`: it is being booted, and
    /// that is what it takes.
    pub fn node_lost(&mut self, id: NodeId) -> bool {
        self.node_mut(id).is_some_and(|node| node.lose(false))
    }

    /// The node tells that it has missed the bus or the master
    /// ([`EmcyCode::is_cut_off`](crate::emcy::EmcyCode::is_cut_off)) while nobody
    /// expected it to be operational: it is reset and booted again.
    /// Some drives leave such an error only by that.
    pub fn node_cut_off(&mut self, id: NodeId, now: Instant) {
        self.set_now(now);
        if self.phase.listens()
            && let Some(node) = self.node_mut(id)
        {
            node.reset_by_request(Command::ResetCommunication);
        }
    }

    /// The controller is bus-off. After a pause [`Action::RestartController`]
    /// comes, then the silent phase, and the nodes are booted again, unless the
    /// start was halted or another device is the master.
    #[inline(never)]
    pub fn bus_off(&mut self, now: Instant) {
        self.set_now(now);
        let pause = self.pauses.next(now);
        self.halted = match self.phase {
            Phase::NotMaster | Phase::Failed | Phase::Stopped => Some(self.phase),
            Phase::BusOff => self.halted,
            _ => None,
        };
        self.until = now + pause;
        let pause_ms = pause.as_millis();
        self.report(Event::BusOff { pause_ms });
        self.halt(Phase::BusOff);
    }

    /// The next thing to do, if there is one now: to be called until it
    /// returns `None`, after every frame and at every deadline.
    #[inline(never)]
    pub fn poll(&mut self, now: Instant) -> Option<Action> {
        if let Some(action) = self.outbox.pop_front() {
            return Some(action);
        }
        self.set_now(now);
        for _ in 0..self.nodes.len() {
            let index = self.next % self.nodes.len();
            let action = self.nodes.get_mut(index).and_then(NodeBoot::poll);
            if action.is_some() {
                return action;
            }
            self.next = index + 1;
        }
        self.next = 0;
        self.advance();
        // What the network did may let a node go on.
        self.outbox
            .pop_front()
            .or_else(|| self.nodes.iter_mut().find_map(NodeBoot::poll))
    }

    /// When [`poll`](Self::poll) has to be called again at the latest.
    #[inline(never)]
    pub fn next_deadline(&self) -> Option<Instant> {
        let mut next = Instant::NEVER;
        if self.phase.is_timed() {
            next = self.until;
        }
        if self.phase.listens() {
            next = next.min(self.factory.next_deadline());
        }
        for node in &self.nodes {
            next = next.min(node.next_deadline());
        }
        next.deadline()
    }

    /// What follows is done at `now`. Not inlined, here and below: the nodes are
    /// gone through in many places.
    #[inline(never)]
    pub(super) fn set_now(&mut self, now: Instant) {
        self.now = now;
        for node in &mut self.nodes {
            node.set_now(now);
        }
    }

    /// Whether any node has it.
    #[inline(never)]
    pub(super) fn any(&self, one: Trait) -> bool {
        self.nodes.iter().any(|node| node.has(one))
    }

    #[inline(never)]
    pub(super) fn node_mut(&mut self, id: NodeId) -> Option<&mut NodeBoot> {
        self.nodes.iter_mut().find(|boot| boot.node().id == id)
    }

    pub(super) fn report(&mut self, event: Event) {
        self.push(Action::Report(event));
    }

    /// Not inlined: it is called from everywhere.
    #[inline(never)]
    pub(super) fn push(&mut self, action: Action) {
        // The outbox holds what one stimulus can cause; it is emptied before
        // the next one.
        let _ = self.outbox.push_back(action);
    }
}

//! Start of the network and what follows: CiA 302-2, "NMT start-up" and "Error
//! handler".

use super::event::{Action, Event};
use super::network::NetworkBoot;
use super::node::Trait;
use super::phase::Phase;
use super::settings::Startup;
use crate::nmt::{Command, NodeControl};
use crate::time::Duration;

impl<const N: usize> NetworkBoot<N> {
    #[inline(never)]
    pub(super) fn advance(&mut self) {
        match self.phase {
            Phase::Silent if self.now >= self.until => self.reset_all(),
            Phase::BusOff if self.now >= self.until => {
                self.push(Action::RestartController);
                self.report(Event::BusRestarted);
                self.until = self.now + self.network.master.silence;
                self.phase = self.halted.unwrap_or(Phase::Silent);
            }
            phase => {
                if phase.listens() && !self.search() {
                    self.handle_lost();
                    self.advance_start();
                }
            }
        }
    }

    fn advance_start(&mut self) {
        match self.phase {
            Phase::Booting => self.finish_booting(),
            Phase::Synchronising if self.now >= self.until => self.start(),
            Phase::Starting if !self.any(Trait::STARTING) => {
                if self.mandatory_failed() && !self.ran {
                    self.fail();
                } else {
                    self.phase = Phase::Running;
                    self.tell_ready();
                }
            }
            Phase::Running if !self.ran && self.mandatory_failed() => self.fail(),
            Phase::Running => {
                if !self.startup.has(Startup::NO_START) && self.mandatory_up() {
                    self.send_start();
                }
                self.tell_ready();
            }
            _ => {}
        }
    }

    /// Whoever is to be kept alive is reset only if it turns out not to run.
    pub(super) fn reset_all(&mut self) {
        let alone = self.any(Trait::KEPT_ALIVE);
        if !alone {
            self.broadcast(Command::ResetCommunication);
        }
        self.report(Event::ResetSent);
        self.begin_all(alone);
    }

    pub(super) fn begin_all(&mut self, reset: bool) {
        for node in &mut self.nodes {
            node.begin(reset);
            node.allow_search(!self.searched);
        }
        self.ordered = false;
        self.phase = Phase::Booting;
        self.tell_ready();
    }

    /// LSS is required where a node that the network names by its serial number
    /// did not boot: it may have no node-ID. Whether there is something to tell or
    /// to send.
    fn search(&mut self) -> bool {
        if !self.searched {
            if !self.any(Trait::MISSING) {
                return false;
            }
            self.searched = true;
            for node in &mut self.nodes {
                node.allow_search(false);
            }
            self.report(Event::Scanning);
        }
        let nodes = &self.nodes;
        let missing = |place: usize| {
            nodes
                .get(place)
                .is_some_and(|node| node.has(Trait::MISSING))
        };
        match self.factory.poll(self.now, missing) {
            Some(Action::Report(event)) => self.found(event),
            Some(action) => self.push(action),
            None => {
                let over = self.factory.is_over();
                let mut nodes = self.nodes.iter_mut();
                // It is told before what follows from it.
                return over && nodes.any(|node| node.not_found());
            }
        }
        true
    }

    /// What the search has to tell.
    #[inline(never)]
    pub(super) fn found(&mut self, event: Event) {
        if let Event::IdGiven { node, .. } = event
            && let Some(node) = self.node_mut(node)
        {
            node.await_boot_up();
        }
        self.report(event);
    }

    /// All nodes are waited for even when one has failed, so that one run
    /// names everything that is wrong.
    fn finish_booting(&mut self) {
        if self.any(Trait::UNSETTLED) {
            return;
        }
        if self.mandatory_up() {
            if self.startup.has(Startup::NOT_BY_ITSELF) && !self.ordered {
                self.report(Event::StartAwaited);
                self.phase = Phase::AwaitingOrder;
            } else {
                self.synchronise();
            }
        } else if !self.ran {
            self.fail();
        }
    }

    pub(super) fn synchronise(&mut self) {
        self.push(Action::ProduceSync);
        let syncs = u32::from(self.network.master.syncs_before_start);
        let span = self.network.cycle.as_micros().saturating_mul(syncs);
        self.until = self.now + Duration::from_micros(span);
        self.phase = Phase::Synchronising;
    }

    fn start(&mut self) {
        if !self.mandatory_up() {
            // One was lost on the way.
            self.phase = Phase::Booting;
        } else if self.startup.has(Startup::NO_START) {
            self.report(Event::StartLeft);
            self.ran = true;
            self.phase = Phase::Running;
        } else {
            self.send_start();
            self.report(Event::StartSent);
            self.phase = Phase::Starting;
        }
    }

    /// Starts those that wait for it: by broadcast where all do (1F80h, bit 1),
    /// else one by one, since a node that failed must stay where it is.
    pub(super) fn send_start(&mut self) {
        let all = self.startup.has(Startup::START_ALL)
            && !self.nodes.is_empty()
            && !self.any(Trait::NOT_STARTABLE);
        if all {
            self.broadcast(Command::Start);
        }
        for node in self
            .nodes
            .iter_mut()
            .filter(|node| !node.has(Trait::NOT_STARTABLE))
        {
            node.start(!all);
        }
    }

    /// What the error of a node means for the others (CiA 302-2, "Error
    /// handler"): as 1F80h says if the node is mandatory, else nothing.
    fn handle_lost(&mut self) {
        if self.phase == Phase::Running && self.any(Trait::MANDATORY_LOST) {
            if self.startup.has(Startup::STOP_ALL) {
                self.broadcast(Command::Stop);
                self.report(Event::NetworkStopped);
                return self.halt(Phase::Stopped);
            }
            if self.startup.has(Startup::RESET_ALL) {
                return self.reset_all();
            }
        }
        for node in &mut self.nodes {
            node.recover();
        }
    }

    pub(super) fn mandatory_up(&self) -> bool {
        !self.any(Trait::MANDATORY_DOWN)
    }

    fn mandatory_failed(&self) -> bool {
        self.any(Trait::MANDATORY_FAILED)
    }

    fn fail(&mut self) {
        self.report(Event::NetworkFailed);
        self.halt(Phase::Failed);
    }

    pub(super) fn halt(&mut self, phase: Phase) {
        for node in &mut self.nodes {
            node.halt();
        }
        self.phase = phase;
        self.tell_ready();
    }

    /// Tells when the network becomes ready, and when it ceases to be.
    pub(super) fn tell_ready(&mut self) {
        let ready = self.phase == Phase::Running && !self.any(Trait::MANDATORY_INCOMPLETE);
        if ready == self.ready {
            return;
        }
        self.ready = ready;
        self.ran |= ready;
        self.report(if ready {
            Event::NetworkReady
        } else {
            Event::NetworkDown
        });
    }

    #[inline(never)]
    pub(super) fn broadcast(&mut self, command: Command) {
        self.push(Action::Send(NodeControl::all(command).frame()));
    }
}

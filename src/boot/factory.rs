//! Giving node-IDs to drives that have none, by the serial numbers that the
//! network names (CiA 305).

use super::event::{Action, Event};
use crate::frame::Frame;
use crate::lss::{LssMaster, Mode, Outcome, Progress, ScanPart, Service};
use crate::network::Node;
use crate::time::{Duration, Instant};

/// How long every node has to answer a question of fastscan.
const SCAN_TIMEOUT: Duration = Duration::from_millis(50);
/// How long a node has to answer otherwise. Storing may mean an erase.
const ANSWER_TIMEOUT: Duration = Duration::from_millis(500);

#[derive(Clone, Copy, Debug)]
enum Step {
    /// All nodes to waiting; a node that was given a node-ID boots with it.
    Leave,
    /// Is the node there? It is selected if it is.
    Scan,
    /// Its node-ID.
    Give,
    /// For the next power-on.
    Store,
    /// Is there anybody else?
    Strangers,
}

/// The search for the nodes of a network that have no node-ID.
#[derive(Debug)]
pub(super) struct Factory {
    lss: LssMaster,
    step: Step,
    /// The request of the step is out.
    asked: bool,
    /// The node looked for.
    place: usize,
    given: bool,
    /// Nothing is left to be found.
    over: bool,
}

impl Factory {
    pub(super) const fn new() -> Factory {
        Factory {
            lss: LssMaster::new(SCAN_TIMEOUT),
            step: Step::Leave,
            asked: false,
            place: 0,
            given: false,
            over: false,
        }
    }

    /// `Some` at the end: whether any node was given a node-ID.
    pub(super) fn finished(&self) -> Option<bool> {
        (self.over && !self.asked && !matches!(self.step, Step::Leave)).then_some(self.given)
    }

    pub(super) fn next_deadline(&self) -> Option<Instant> {
        self.lss.next_deadline()
    }

    pub(super) fn on_frame(&mut self, frame: &Frame, nodes: &'static [Node]) -> Option<Action> {
        let progress = self.lss.on_frame(frame);
        self.on_progress(progress, nodes)
    }

    /// The next thing to do. `wanted` tells which nodes are looked for.
    pub(super) fn poll(
        &mut self,
        now: Instant,
        nodes: &'static [Node],
        wanted: impl Fn(usize) -> bool,
    ) -> Option<Action> {
        loop {
            if self.asked {
                match self.lss.poll(now) {
                    Progress::Nothing => return None,
                    progress => {
                        if let Some(action) = self.on_progress(progress, nodes) {
                            return Some(action);
                        }
                    }
                }
            } else if self.finished().is_some() {
                return None;
            } else {
                return self.ask(now, nodes, &wanted);
            }
        }
    }

    fn ask(
        &mut self,
        now: Instant,
        nodes: &'static [Node],
        wanted: &impl Fn(usize) -> bool,
    ) -> Option<Action> {
        if matches!(self.step, Step::Scan) {
            match (self.place..nodes.len()).find(|place| wanted(*place)) {
                Some(place) => self.place = place,
                None => self.step = Step::Strangers,
            }
        }
        let node = nodes.get(self.place);
        let (service, timeout) = match self.step {
            Step::Leave => (Service::SwitchGlobal(Mode::Waiting), ANSWER_TIMEOUT),
            Step::Scan => (Service::Fastscan(node.map(parts)?), SCAN_TIMEOUT),
            Step::Give => (Service::ConfigureNodeId(Some(node?.id)), ANSWER_TIMEOUT),
            Step::Store => (Service::Store, ANSWER_TIMEOUT),
            Step::Strangers => (Service::Fastscan([ScanPart::Unknown; 4]), SCAN_TIMEOUT),
        };
        self.lss = LssMaster::new(timeout);
        let frame = self.lss.start(service, now).ok()?;
        self.asked = true;
        Some(Action::Send(frame))
    }

    fn on_progress(&mut self, progress: Progress, nodes: &'static [Node]) -> Option<Action> {
        let result = match progress {
            Progress::Nothing | Progress::SwitchBitRate => return None,
            Progress::Send(frame) => return Some(Action::Send(frame)),
            Progress::Done(outcome) => Ok(outcome),
            Progress::Failed(error) => Err(error),
        };
        self.asked = false;
        let node = nodes.get(self.place).map(|node| node.id);
        let (step, event) = match (self.step, result) {
            (Step::Leave, _) => (Step::Scan, None),
            (Step::Scan, Ok(Outcome::Found(_))) => (Step::Give, None),
            // Not among them, or not to be understood: on to the next.
            (Step::Scan, Err(_)) => {
                self.place += 1;
                (Step::Scan, None)
            }
            (Step::Give, Ok(_)) => (Step::Store, None),
            (Step::Give, Err(error)) => {
                (self.leave(), node.map(|node| Event::IdFailed(node, error)))
            }
            (Step::Store, result) => {
                self.given = true;
                let stored = result.is_ok();
                (
                    self.leave(),
                    node.map(|node| Event::IdGiven { node, stored }),
                )
            }
            (Step::Strangers, Ok(Outcome::Found(address))) => {
                self.over = true;
                (Step::Leave, Some(Event::Stranger(address)))
            }
            (Step::Scan | Step::Strangers, _) => {
                self.over = true;
                (Step::Scan, None)
            }
        };
        self.step = step;
        event.map(Action::Report)
    }

    fn leave(&mut self) -> Step {
        self.place += 1;
        Step::Leave
    }
}

/// What the network names is confirmed, the rest is found out bit by bit.
fn parts(node: &Node) -> [ScanPart; 4] {
    let identity = &node.identity;
    [
        identity.vendor,
        identity.product,
        identity.revision,
        identity.serial,
    ]
    .map(|number| number.map_or(ScanPart::Unknown, ScanPart::Known))
}

//! Giving node-IDs to drives that have none, by the serial numbers that the
//! network names (CiA 305).
//!
//! Only the few services that this needs are here; [`LssMaster`] has them all.
//!
//! [`LssMaster`]: crate::lss::LssMaster

use super::event::{Action, Event};
use crate::frame::Frame;
use crate::lss::{Answer, ConfigurationResult, Fastscan, Mode, Request, ScanPart, Verdict};
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
    /// Nothing is left to be found.
    Over,
}

/// The search for the nodes of a network that have no node-ID.
#[derive(Debug)]
pub(super) struct Factory {
    step: Step,
    /// A request of the step is out, until then.
    asked: Option<Instant>,
    scan: Fastscan,
    /// Somebody answered to the question that is out.
    yes: bool,
    /// The node looked for.
    place: usize,
    given: bool,
    /// What [`Step::Leave`] leads to.
    over: bool,
}

impl Factory {
    pub(super) const fn new() -> Factory {
        Factory {
            step: Step::Leave,
            asked: None,
            scan: Fastscan::new([ScanPart::Unknown; 4]),
            yes: false,
            place: 0,
            given: false,
            over: false,
        }
    }

    /// `Some` at the end: whether any node was given a node-ID.
    pub(super) const fn finished(&self) -> Option<bool> {
        match self.step {
            Step::Over => Some(self.given),
            _ => None,
        }
    }

    pub(super) const fn next_deadline(&self) -> Option<Instant> {
        self.asked
    }

    /// Takes in the answer of an LSS slave.
    pub(super) fn on_frame(&mut self, frame: &Frame, nodes: &'static [Node]) -> Option<Action> {
        match (self.step, Answer::decode(frame)?) {
            // Several nodes may answer, each in its own time: the next question
            // waits until all have had theirs.
            (Step::Scan | Step::Strangers, Answer::Identified) => {
                self.yes = true;
                None
            }
            (Step::Give, Answer::NodeId(result)) | (Step::Store, Answer::Store(result)) => {
                self.configured(Some(result), nodes)
            }
            _ => None,
        }
    }

    /// The next thing to do. `wanted` tells which nodes are looked for.
    pub(super) fn poll(
        &mut self,
        now: Instant,
        nodes: &'static [Node],
        wanted: impl Fn(usize) -> bool,
    ) -> Option<Action> {
        if let Some(until) = self.asked {
            if now < until {
                return None;
            }
            let action = self.time_is_over(now, nodes);
            if action.is_some() || self.asked.is_some() {
                return action;
            }
        }
        if matches!(self.step, Step::Scan) {
            match (self.place..nodes.len()).find(|place| wanted(*place)) {
                Some(place) => self.place = place,
                None => self.step = Step::Strangers,
            }
        }
        let node = nodes.get(self.place);
        let (request, time) = match self.step {
            Step::Leave => (Request::SwitchGlobal(Mode::Waiting), Duration::ZERO),
            Step::Scan | Step::Strangers => {
                let known = node.filter(|_| matches!(self.step, Step::Scan)).map(parts);
                self.scan = Fastscan::new(known.unwrap_or([ScanPart::Unknown; 4]));
                (self.scan.question(), SCAN_TIMEOUT)
            }
            Step::Give => (Request::NodeId(Some(node?.id)), ANSWER_TIMEOUT),
            Step::Store => (Request::Store, ANSWER_TIMEOUT),
            Step::Over => return None,
        };
        Some(self.ask(request, now + time))
    }

    fn ask(&mut self, request: Request, until: Instant) -> Action {
        self.asked = Some(until);
        self.yes = false;
        Action::Send(request.frame())
    }

    fn time_is_over(&mut self, now: Instant, nodes: &'static [Node]) -> Option<Action> {
        let strangers = match self.step {
            Step::Scan => false,
            Step::Strangers => true,
            Step::Leave => {
                self.enter(if self.over { Step::Over } else { Step::Scan });
                return None;
            }
            _ => return self.configured(None, nodes),
        };
        match self.scan.answer(self.yes) {
            Verdict::Continue => {
                let question = self.scan.question();
                return Some(self.ask(question, now + SCAN_TIMEOUT));
            }
            Verdict::Found(address) if strangers => {
                self.over = true;
                self.enter(Step::Leave);
                return Some(Action::Report(Event::Stranger(address)));
            }
            Verdict::Found(_) => self.enter(Step::Give),
            Verdict::Lost(_) if !strangers => {
                // It is not among them.
                self.place += 1;
                self.enter(Step::Scan);
            }
            Verdict::Lost(_) | Verdict::Nobody => self.enter(Step::Over),
        }
        None
    }

    /// What came of giving or storing a node-ID; `None` if there was no answer.
    fn configured(
        &mut self,
        result: Option<ConfigurationResult>,
        nodes: &'static [Node],
    ) -> Option<Action> {
        let node = nodes.get(self.place)?.id;
        let ok = result.is_some_and(ConfigurationResult::is_ok);
        let event = match (self.step, result) {
            (Step::Give, _) if ok => {
                self.enter(Step::Store);
                return None;
            }
            (Step::Give, Some(ConfigurationResult { error, specific })) => Event::IdRefused {
                node,
                error,
                specific,
            },
            (Step::Give, None) => Event::IdUnanswered(node),
            _ => {
                self.given = true;
                Event::IdGiven { node, stored: ok }
            }
        };
        self.place += 1;
        self.enter(Step::Leave);
        Some(Action::Report(event))
    }

    const fn enter(&mut self, step: Step) {
        self.step = step;
        self.asked = None;
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

//! Giving node-IDs to drives that have none, by the serial numbers that the
//! network names (CiA 305).
//!
//! Only the few services that this needs are here; [`LssMaster`] has them all.
//!
//! [`LssMaster`]: crate::lss::LssMaster

use super::event::{Action, Event};
use crate::frame::Frame;
use crate::id::CobId;
use crate::lss::{Awaited, ConfigurationResult, Fastscan, Mode, Part, Request, Verdict};
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
    /// Who is looked for next? When all were, anybody else: first one of the same
    /// kind, which takes less time, then any.
    Next,
    /// Is the node there? It is selected if it is.
    Scan,
    /// Its node-ID.
    Give,
    /// For the next power-on.
    Store,
    /// Nothing is left to be found.
    Over,
}

/// The search for the nodes of a network that have no node-ID.
#[derive(Debug)]
pub(super) struct Factory {
    step: Step,
    /// A request of the step is out, until then; [`Instant::NEVER`]: none is.
    asked: Instant,
    nodes: &'static [Node],
    scan: Fastscan,
    /// Somebody answered to the question that is out.
    yes: bool,
    /// The node looked for; behind the last one: anybody else.
    place: usize,
    /// What [`Step::Leave`] leads to.
    after: Step,
}

impl Factory {
    pub(super) const fn new(nodes: &'static [Node]) -> Factory {
        Factory {
            step: Step::Leave,
            asked: Instant::NEVER,
            nodes,
            scan: Fastscan::new(),
            yes: false,
            place: 0,
            after: Step::Next,
        }
    }

    /// Nobody is looked for any more.
    pub(super) const fn is_over(&self) -> bool {
        matches!(self.step, Step::Over)
    }

    pub(super) const fn next_deadline(&self) -> Instant {
        self.asked
    }

    /// Takes in the answer of an LSS slave. Not inlined, here and below: the three
    /// stay small by themselves.
    #[inline(never)]
    pub(super) fn on_frame(&mut self, frame: &Frame) -> Option<Event> {
        let awaited = match self.step {
            Step::Scan => Awaited::Identified,
            Step::Give => Awaited::NodeId,
            Step::Store => Awaited::Store,
            _ => return None,
        };
        let result = ConfigurationResult::decode(frame, awaited)?;
        if matches!(awaited, Awaited::Identified) {
            // Several nodes may answer, each in its own time: the next question
            // waits until all have had theirs.
            self.yes = true;
            return None;
        }
        self.settle(Some(result))
    }

    /// The next thing to do. `wanted` tells which nodes are looked for.
    #[inline(never)]
    pub(super) fn poll(&mut self, now: Instant, wanted: impl Fn(usize) -> bool) -> Option<Action> {
        if self.asked != Instant::NEVER {
            if now < self.asked {
                return None;
            }
            if let Some(event) = self.settle(None) {
                return Some(Action::Report(event));
            }
        }
        if matches!(self.step, Step::Next) {
            while self.place < self.nodes.len() && !wanted(self.place) {
                self.place += 1;
            }
            if self.place > self.nodes.len() + 1 {
                self.step = Step::Over;
                return None;
            }
            self.scan = Fastscan::new();
            self.step = Step::Scan;
        }
        let (number, time) = match self.step {
            Step::Leave => (
                Request::SwitchGlobal(Mode::Waiting).number(),
                Duration::ZERO,
            ),
            Step::Scan => (self.scan.question().number(), SCAN_TIMEOUT),
            Step::Give => {
                let node = self.nodes.get(self.place).map(|node| node.id);
                (Request::NodeId(node).number(), ANSWER_TIMEOUT)
            }
            Step::Store => (Request::Store.number(), ANSWER_TIMEOUT),
            Step::Next | Step::Over => return None,
        };
        self.asked = now + time;
        self.yes = false;
        let frame = Frame::full(CobId::LSS_MASTER, number.to_le_bytes());
        Some(Action::Send(frame))
    }

    /// The request that is out has had its time, or its answer.
    #[inline(never)]
    fn settle(&mut self, result: Option<ConfigurationResult>) -> Option<Event> {
        self.asked = Instant::NEVER;
        let (nodes, place) = (self.nodes, self.place);
        let node = nodes.get(place).map(|node| node.id);
        // Behind the last one: of the same kind as the first, but for the serial
        // number; then anything.
        let known = |part: Part| {
            let like = match nodes.get(place) {
                None if place == nodes.len() && part != Part::Serial => nodes.first(),
                node => node,
            };
            like?.number(part.position() + 1)
        };
        let ok = result.is_some_and(ConfigurationResult::is_ok);
        let event = match (self.step, node) {
            (Step::Leave, _) => {
                self.step = self.after;
                return None;
            }
            (Step::Scan, node) => match (self.scan.answer(self.yes, known), node) {
                (Verdict::Continue, _) => return None,
                (Verdict::Found(_), Some(_)) => {
                    self.step = Step::Give;
                    return None;
                }
                (Verdict::Found(address), None) => {
                    self.after = Step::Over;
                    Event::Stranger(address)
                }
                // It is not among them.
                (Verdict::Lost(_), _) => {
                    self.place += 1;
                    self.step = Step::Next;
                    return None;
                }
                (Verdict::Nobody, _) => {
                    self.step = Step::Over;
                    return None;
                }
            },
            (Step::Give, Some(node)) => match result {
                Some(_) if ok => {
                    self.step = Step::Store;
                    return None;
                }
                Some(ConfigurationResult { error, specific }) => Event::IdRefused {
                    node,
                    error,
                    specific,
                },
                None => Event::IdUnanswered(node),
            },
            (Step::Store, Some(node)) => Event::IdGiven { node, stored: ok },
            _ => return None,
        };
        self.place += 1;
        self.step = Step::Leave;
        Some(event)
    }
}

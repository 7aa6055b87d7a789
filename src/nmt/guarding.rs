//! Node guarding: error control by remote frames, for devices that have no
//! heartbeat (CiA 301, 7.2.8.3.2.1).

use super::consumer::{Heard, Lost};
use super::error_control::ErrorControl;
use super::state::State;
use crate::frame::Frame;
use crate::id::{CobId, FunctionCode, NodeId};
use crate::time::{Duration, Instant};

/// The error control frame has one byte.
const DLC: u8 = 1;

/// What guarding has to do now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Guard {
    /// Ask: send this remote frame.
    Ask(Frame),
    /// The node did not answer, nor did it when it was asked again.
    Lost(Lost),
}

/// Guards one node: the master's side.
///
/// Every guard time a remote frame asks for its state. After the first answer,
/// one request that is not answered and as many retries as configured make a
/// loss. An answer whose toggle bit does not alternate counts as none.
#[derive(Clone, Debug)]
pub struct Guardian {
    node: NodeId,
    time: Duration,
    retries: u8,
    /// What the next answer must carry.
    toggle: bool,
    /// Requests since the last answer.
    unanswered: u16,
    next: Option<Instant>,
    state: Option<State>,
    lost: bool,
}

impl Guardian {
    /// A guardian that is switched off. `time` and `retries` are bits 31..16 and
    /// 15..8 of 1F81h (CiA 302-2); a time of zero never guards.
    pub const fn new(node: NodeId, time: Duration, retries: u8) -> Guardian {
        Guardian {
            node,
            time,
            retries,
            toggle: false,
            unanswered: 0,
            next: None,
            state: None,
            lost: false,
        }
    }

    /// The node guarded.
    pub const fn node(&self) -> NodeId {
        self.node
    }

    /// Begins to guard: the first request is due at once. To be called after
    /// the node's boot-up message, since only a reset of its communication lets
    /// the toggle bit begin with 0.
    pub fn start(&mut self, now: Instant) {
        self.stop();
        self.next = (self.time != Duration::ZERO).then_some(now);
    }

    /// Ends guarding.
    pub fn stop(&mut self) {
        *self = Guardian::new(self.node, self.time, self.retries);
    }

    /// The last state heard; `None` before the first answer and after the loss.
    pub const fn state(&self) -> Option<State> {
        if self.lost { None } else { self.state }
    }

    /// Whether the node was lost and has not answered since.
    pub const fn is_lost(&self) -> bool {
        self.lost
    }

    /// When [`poll`](Self::poll) has something to do.
    pub const fn next_deadline(&self) -> Option<Instant> {
        self.next
    }

    /// To be called until it returns `None`: asks when the guard time is over,
    /// and reports the loss once. A lost node is still asked.
    pub fn poll(&mut self, now: Instant) -> Option<Guard> {
        let due = self.next?;
        if now < due {
            return None;
        }
        if let Some(last) = self.state()
            && self.unanswered > u16::from(self.retries)
        {
            self.lost = true;
            return Some(Guard::Lost(Lost {
                node: self.node,
                last,
            }));
        }
        let after = due + self.time;
        self.next = Some(if after > now { after } else { now + self.time });
        self.unanswered = self.unanswered.saturating_add(1);
        let id = CobId::of(FunctionCode::ErrorControl, self.node);
        Frame::remote_frame(id, DLC).map(Guard::Ask)
    }

    /// Takes in a frame; `None` if it is not the node's error control, or an
    /// answer that counts as none.
    ///
    /// A boot-up message starts the toggle bit anew.
    pub fn on_frame(&mut self, frame: &Frame, now: Instant) -> Option<Heard> {
        let control = ErrorControl::decode(frame).filter(|c| c.node == self.node)?;
        let before = self.state();
        if control.state == State::Initialising && !control.toggle {
            let was_monitored = before.is_some();
            self.start(now);
            return Some(Heard::BootUp { was_monitored });
        }
        if self.next.is_none() || control.toggle != self.toggle {
            return None;
        }
        let to = control.state;
        self.toggle = !self.toggle;
        self.unanswered = 0;
        self.state = Some(to);
        self.lost = false;
        Some(match before {
            None => Heard::First(to),
            Some(from) if from != to => Heard::Changed { from, to },
            Some(_) => Heard::Same(to),
        })
    }
}

/// What the life guarding of a node noticed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LifeGuarding {
    /// The master has not asked for the node life time: emergency 8130h, and
    /// what 1029h says.
    Occurred,
    /// It asks again.
    Resolved,
}

/// Answers node guarding: the node's side, with life guarding of the master
/// (100Ch, 100Dh; CiA 301, 7.5.2.11, 7.5.2.12).
#[derive(Clone, Debug)]
pub struct Guarded {
    node: NodeId,
    life_time: Duration,
    toggle: bool,
    deadline: Option<Instant>,
    lost: bool,
}

impl Guarded {
    /// Answers for `node`. `life_time` is guard time times life time factor;
    /// zero: the node does not watch the master.
    pub const fn new(node: NodeId, life_time: Duration) -> Guarded {
        Guarded {
            node,
            life_time,
            toggle: false,
            deadline: None,
            lost: false,
        }
    }

    /// Reset communication: the toggle bit begins with 0, and life guarding with
    /// the next request.
    pub fn reset(&mut self) {
        *self = Guarded::new(self.node, self.life_time);
    }

    /// Changes the life time: 100Ch or 100Dh was written.
    pub fn set_life_time(&mut self, life_time: Duration) {
        self.life_time = life_time;
        self.deadline = None;
        self.lost = false;
    }

    /// The answer to a frame, if it asks this node in a state in which it
    /// answers, and whether the master is back with it.
    pub fn on_frame(
        &mut self,
        frame: &Frame,
        state: State,
        now: Instant,
    ) -> Option<(Frame, Option<LifeGuarding>)> {
        let id = CobId::of(FunctionCode::ErrorControl, self.node);
        if frame.id() != id || !frame.is_remote() || state == State::Initialising {
            return None;
        }
        let answer = ErrorControl {
            node: self.node,
            state,
            toggle: self.toggle,
        };
        self.toggle = !self.toggle;
        self.deadline = (self.life_time != Duration::ZERO).then(|| now + self.life_time);
        let resolved = core::mem::take(&mut self.lost).then_some(LifeGuarding::Resolved);
        Some((answer.frame(), resolved))
    }

    /// When [`poll`](Self::poll) will notice that the master is gone.
    pub const fn next_deadline(&self) -> Option<Instant> {
        self.deadline
    }

    /// Notices, once, that the master stopped asking.
    pub fn poll(&mut self, now: Instant) -> Option<LifeGuarding> {
        if now < self.deadline? {
            return None;
        }
        self.deadline = None;
        self.lost = true;
        Some(LifeGuarding::Occurred)
    }
}

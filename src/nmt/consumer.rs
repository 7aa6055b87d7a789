//! Heartbeat consumer (CiA 301, 7.2.8.3.2.2, 7.5.2.19).

use super::error_control::ErrorControl;
use super::state::State;
use crate::frame::Frame;
use crate::id::NodeId;
use crate::time::{Duration, Instant};

/// What a frame told of the node watched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Heard {
    /// The boot-up message: the node has been reset. Monitoring ends until its
    /// next heartbeat, since the reset may have switched that off.
    BootUp {
        /// Monitoring was under way: the reset came unasked or the node was
        /// told to.
        was_monitored: bool,
    },
    /// The first heartbeat: monitoring has begun.
    First(State),
    /// A heartbeat with another state than the one before.
    Changed {
        /// The state before.
        from: State,
        /// The state now.
        to: State,
    },
    /// A heartbeat with the same state.
    Same(State),
}

/// The heartbeat did not arrive within the consumer heartbeat time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Lost {
    /// Who.
    pub node: NodeId,
    /// Its last state.
    pub last: State,
}

/// Watches the heartbeat of one node.
///
/// Monitoring begins with the first heartbeat, not with the boot-up message; a
/// node that never sent one never times out here: its boot time is watched by
/// the network's boot-up.
#[derive(Clone, Debug)]
pub struct Consumer {
    node: NodeId,
    time: Duration,
    state: Option<State>,
    heard: Instant,
    lost: bool,
}

impl Consumer {
    /// Watches `node` with this consumer heartbeat time; zero: states are
    /// followed, but a missing heartbeat is not noticed.
    pub const fn new(node: NodeId, time: Duration) -> Consumer {
        Consumer {
            node,
            time,
            state: None,
            heard: Instant::ZERO,
            lost: false,
        }
    }

    /// The node watched.
    pub const fn node(&self) -> NodeId {
        self.node
    }

    /// The last state heard; `None` before the first heartbeat, after a boot-up
    /// message, and after the loss.
    pub const fn state(&self) -> Option<State> {
        if self.lost { None } else { self.state }
    }

    /// Whether the heartbeat is there and watched.
    pub const fn is_monitoring(&self) -> bool {
        self.state.is_some() && !self.lost
    }

    /// Whether the heartbeat was lost and has not come back.
    pub const fn is_lost(&self) -> bool {
        self.lost
    }

    /// Starts anew: monitoring begins with the next heartbeat.
    pub fn reset(&mut self) {
        self.state = None;
        self.lost = false;
    }

    /// Changes the consumer heartbeat time and starts anew
    /// (CiA 301, 7.5.2.19).
    pub fn set_time(&mut self, time: Duration) {
        self.time = time;
        self.reset();
    }

    /// Takes in a frame; `None` if it is not the node's error control.
    pub fn on_frame(&mut self, frame: &Frame, now: Instant) -> Option<Heard> {
        let control = ErrorControl::decode(frame)?;
        (control.node == self.node).then(|| self.heard(control.state, now))
    }

    /// Takes in the state that the node's error control frame carried.
    pub fn heard(&mut self, state: State, now: Instant) -> Heard {
        let before = self.state();
        if state == State::Initialising {
            self.reset();
            return Heard::BootUp {
                was_monitored: before.is_some(),
            };
        }
        self.state = Some(state);
        self.heard = now;
        self.lost = false;
        match before {
            None => Heard::First(state),
            Some(from) if from != state => Heard::Changed { from, to: state },
            Some(_) => Heard::Same(state),
        }
    }

    /// When [`Consumer::poll`] will notice the loss.
    pub fn next_deadline(&self) -> Option<Instant> {
        let watched = self.is_monitoring() && self.time != Duration::ZERO;
        watched.then(|| self.heard + self.time)
    }

    /// Notices, once, that the heartbeat has been missing for the consumer
    /// heartbeat time.
    #[inline(never)]
    pub fn poll(&mut self, now: Instant) -> Option<Lost> {
        let deadline = self.next_deadline()?;
        let last = self.state?;
        if now < deadline {
            return None;
        }
        self.lost = true;
        Some(Lost {
            node: self.node,
            last,
        })
    }
}

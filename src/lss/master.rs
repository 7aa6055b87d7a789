//! The master's end of the layer setting services (CiA 305).

use super::address::{LssAddress, Part};
use super::command::{Answer, ConfigurationResult, Mode, Request};
use super::fastscan::{Fastscan, Verdict};
use crate::frame::Frame;
use crate::id::NodeId;
use crate::time::{Duration, Instant};
use core::fmt;

/// A service of the LSS master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Service {
    /// All nodes to waiting or configuration.
    SwitchGlobal(Mode),
    /// The node with this address to configuration.
    Select(LssAddress),
    /// Gives the selected node a node-ID, or takes it away.
    ConfigureNodeId(Option<NodeId>),
    /// Gives all nodes in configuration a bit rate.
    ConfigureBitTiming {
        /// 0: the standard table.
        table: u8,
        /// See [`BitRate`](super::BitRate).
        index: u8,
    },
    /// Switches the bit rate everywhere.
    ActivateBitTiming {
        /// Silence before and after the switch, in milliseconds.
        delay: u16,
    },
    /// Makes the selected node keep its configuration.
    Store,
    /// Reads a number of the selected node's address.
    Inquire(Part),
    /// Reads the selected node's node-ID.
    InquireNodeId,
    /// Finds one node without node-ID and selects it. The numbers of its LSS
    /// address that are known are only confirmed, by one question each, and nodes
    /// with others left out; each of the rest is found bit by bit, by 33.
    Fastscan([Option<u32>; 4]),
}

/// What the caller has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[must_use = "it may hold a frame that has to be sent"]
pub enum Progress {
    /// Nothing.
    Nothing,
    /// Send this frame.
    Send(Frame),
    /// Switch the own bit rate now.
    SwitchBitRate,
    /// The service is done.
    Done(Outcome),
    /// The service has failed.
    Failed(LssError),
}

/// The result of a service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Outcome {
    /// Done; there is nothing to tell.
    Confirmed,
    /// A number of the address.
    Number(u32),
    /// The node-ID, if there is one.
    Node(Option<NodeId>),
    /// Fastscan has found and selected this node.
    Found(LssAddress),
    /// Fastscan: every node has a node-ID.
    Nobody,
}

/// Why a service failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum LssError {
    /// Another service is under way.
    Busy,
    /// No answer in time.
    Timeout,
    /// The node refused.
    Refused(ConfigurationResult),
    /// Fastscan: no node confirmed the number found bit by bit, because a node
    /// vanished or answers were lost or late.
    Lost(Part),
}

impl fmt::Display for LssError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LssError::Busy => f.write_str("another LSS service is under way; await its end"),
            LssError::Timeout => f.write_str(
                "no node answered; is one selected, and is it stopped or without node-ID?",
            ),
            LssError::Refused(result) => write!(
                f,
                "the node refused with error {}, specific error {}",
                result.error, result.specific
            ),
            LssError::Lost(part) => write!(
                f,
                "fastscan: the {} number was not confirmed; scan again with a longer timeout",
                match part {
                    Part::Vendor => "vendor",
                    Part::Product => "product",
                    Part::Revision => "revision",
                    Part::Serial => "serial",
                }
            ),
        }
    }
}

impl core::error::Error for LssError {}

/// The LSS master: one service at a time.
#[derive(Clone, Debug)]
pub struct LssMaster {
    timeout: Duration,
    deadline: Instant,
    state: State,
}

#[derive(Clone, Copy, Debug)]
enum State {
    Idle,
    /// Unconfirmed: done at once.
    Sent,
    /// Frames of switch mode selective from `next` on are to be sent.
    Selecting {
        address: LssAddress,
        next: Part,
    },
    Waiting(Service),
    /// A question is out. Several nodes may answer it, each in its own time: the
    /// next one is asked only when all have had theirs, or a late answer would
    /// be taken for the answer to that.
    Scanning {
        known: [Option<u32>; 4],
        scan: Fastscan,
        yes: bool,
    },
    /// Silence before (`true`) or after the switch of the bit rate.
    Silence {
        delay: Duration,
        before: bool,
    },
}

impl LssMaster {
    /// A master that waits `timeout` for each answer. In a fastscan every
    /// question takes so long, 33 for each number that is not known, so it
    /// should be little more than the slowest node needs.
    pub const fn new(timeout: Duration) -> LssMaster {
        LssMaster {
            timeout,
            deadline: Instant::ZERO,
            state: State::Idle,
        }
    }

    /// Starts a service. Returns the frame to send.
    ///
    /// # Errors
    /// If another one is under way.
    pub fn start(&mut self, service: Service, now: Instant) -> Result<Frame, LssError> {
        if !matches!(self.state, State::Idle) {
            return Err(LssError::Busy);
        }
        let mut wait = self.timeout;
        let (state, request) = match service {
            Service::SwitchGlobal(mode) => {
                wait = Duration::ZERO;
                (State::Sent, Request::SwitchGlobal(mode))
            }
            Service::Select(address) => {
                wait = Duration::ZERO;
                let next = Part::Product;
                let first = Request::Select(Part::Vendor, address.vendor);
                (State::Selecting { address, next }, first)
            }
            Service::ActivateBitTiming { delay } => {
                wait = Duration::from_millis(u32::from(delay));
                let silence = State::Silence {
                    delay: wait,
                    before: true,
                };
                (silence, Request::Activate { delay })
            }
            Service::Fastscan(known) => {
                let (scan, yes) = (Fastscan::new(), false);
                (State::Scanning { known, scan, yes }, scan.question())
            }
            Service::ConfigureNodeId(node) => (State::Waiting(service), Request::NodeId(node)),
            Service::ConfigureBitTiming { table, index } => {
                (State::Waiting(service), Request::BitTiming { table, index })
            }
            Service::Store => (State::Waiting(service), Request::Store),
            Service::Inquire(part) => (State::Waiting(service), Request::Inquire(part)),
            Service::InquireNodeId => (State::Waiting(service), Request::InquireNodeId),
        };
        self.state = state;
        self.deadline = now + wait;
        Ok(request.frame())
    }

    /// When [`LssMaster::poll`] has something to do.
    pub const fn next_deadline(&self) -> Option<Instant> {
        match self.state {
            State::Idle => None,
            _ => Some(self.deadline),
        }
    }

    /// Lets time pass. To be called until it returns [`Progress::Nothing`].
    pub fn poll(&mut self, now: Instant) -> Progress {
        if now < self.deadline {
            return Progress::Nothing;
        }
        match self.state {
            State::Idle => Progress::Nothing,
            State::Sent => self.done(Outcome::Confirmed),
            State::Selecting { address, next } => {
                let request = Request::Select(next, address.part(next));
                match next.next() {
                    Some(next) => self.state = State::Selecting { address, next },
                    None => {
                        self.state = State::Waiting(Service::Select(address));
                        self.deadline = now + self.timeout;
                    }
                }
                Progress::Send(request.frame())
            }
            State::Waiting(_) => self.failed(LssError::Timeout),
            State::Scanning { known, scan, yes } => self.scan(known, scan, yes, now),
            State::Silence {
                delay,
                before: true,
            } => {
                self.deadline = now + delay;
                self.state = State::Silence {
                    delay,
                    before: false,
                };
                Progress::SwitchBitRate
            }
            State::Silence { before: false, .. } => self.done(Outcome::Confirmed),
        }
    }

    /// Takes in a frame; what does not answer the service under way is
    /// ignored.
    pub fn on_frame(&mut self, frame: &Frame) -> Progress {
        let Some(answer) = Answer::decode(frame) else {
            return Progress::Nothing;
        };
        match (self.state, answer) {
            (State::Scanning { known, scan, .. }, Answer::Identified) => {
                let yes = true;
                self.state = State::Scanning { known, scan, yes };
                Progress::Nothing
            }
            (State::Waiting(Service::Select(_)), Answer::Selected) => self.done(Outcome::Confirmed),
            (State::Waiting(Service::ConfigureNodeId(_)), Answer::NodeId(result))
            | (State::Waiting(Service::ConfigureBitTiming { .. }), Answer::BitTiming(result))
            | (State::Waiting(Service::Store), Answer::Store(result)) => {
                if result.is_ok() {
                    self.done(Outcome::Confirmed)
                } else {
                    self.failed(LssError::Refused(result))
                }
            }
            (State::Waiting(Service::Inquire(part)), Answer::Inquire(of, number)) if of == part => {
                self.done(Outcome::Number(number))
            }
            (State::Waiting(Service::InquireNodeId), Answer::InquireNodeId(node)) => {
                self.done(Outcome::Node(node))
            }
            _ => Progress::Nothing,
        }
    }

    fn scan(
        &mut self,
        known: [Option<u32>; 4],
        mut scan: Fastscan,
        yes: bool,
        now: Instant,
    ) -> Progress {
        let number = |part: Part| known.get(usize::from(part.position())).copied().flatten();
        match scan.answer(yes, number) {
            Verdict::Continue => {
                let yes = false;
                self.state = State::Scanning { known, scan, yes };
                self.deadline = now + self.timeout;
                Progress::Send(scan.question().frame())
            }
            Verdict::Found(address) => self.done(Outcome::Found(address)),
            Verdict::Nobody => self.done(Outcome::Nobody),
            Verdict::Lost(part) => self.failed(LssError::Lost(part)),
        }
    }

    fn done(&mut self, outcome: Outcome) -> Progress {
        self.state = State::Idle;
        Progress::Done(outcome)
    }

    fn failed(&mut self, error: LssError) -> Progress {
        self.state = State::Idle;
        Progress::Failed(error)
    }
}

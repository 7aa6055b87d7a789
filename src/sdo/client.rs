//! The client: one channel to the default server of one node
//! (CiA 301, 7.2.4).
//!
//! An answer completes a request only if its command, index, sub-index and
//! toggle are the ones expected. What does not fit is discarded if it can be
//! the late answer to an earlier request, and ends the transfer with an abort
//! if it cannot.
//!
//! After a timeout or a violation of the protocol the channel stays closed for
//! a quarantine, by default as long as the timeout, and discards what arrives:
//! a node that is merely slow would otherwise answer the old request to the
//! new one. One confusion remains possible: the answer to a request for the
//! same entry that arrives later than timeout and quarantine together is taken
//! for the answer to a newer request for that entry.

use super::abort::AbortCode;
use super::command::{Answer, Bytes, EXPEDITED_MAX, Initiate, Request, SEGMENT_MAX, Segment};
use super::error::SdoError;
use super::response::{RESPONSE_MAX, Response};
use crate::frame::Frame;
use crate::id::{Address, CobId, FunctionCode, NodeId};
use crate::time::{Duration, Instant};
use core::fmt;

/// What the caller of the client has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[must_use = "it may hold a frame that has to be sent"]
pub enum Progress {
    /// Nothing.
    Nothing,
    /// Send this frame.
    Send(Frame),
    /// The request is done.
    Done(Response),
    /// The request has failed; send the abort if there is one.
    Failed(SdoError, Option<Frame>),
}

/// Why a request cannot be started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum StartError {
    /// Another request is under way.
    Busy,
    /// The channel is closed after a failure.
    Quarantine {
        /// When it opens.
        until: Instant,
    },
    /// More than [`RESPONSE_MAX`] bytes, or none.
    Length(usize),
}

impl fmt::Display for StartError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StartError::Busy => f.write_str("another request is under way; await its end"),
            StartError::Quarantine { .. } => {
                f.write_str("the channel is closed for a while after a failure; try again later")
            }
            StartError::Length(len) => {
                write!(f, "{len} bytes cannot be sent, only 1 to {RESPONSE_MAX}")
            }
        }
    }
}

impl core::error::Error for StartError {}

/// An SDO client with a channel to one node.
#[derive(Clone, Debug)]
pub struct Client {
    node: NodeId,
    timeout: Duration,
    quarantine: Duration,
    /// End of the wait or of the quarantine.
    deadline: Instant,
    state: State,
}

#[derive(Clone, Copy, Debug)]
enum State {
    Idle,
    Quarantine,
    /// An initiate of a download was sent; `data` is what follows it.
    Download {
        data: Response,
        expedited: bool,
    },
    /// A segment was sent; the first `sent` bytes are.
    DownloadSegment {
        data: Response,
        sent: usize,
        toggle: bool,
    },
    Upload {
        at: Address,
    },
    UploadSegment {
        data: Response,
        size: Option<u32>,
        toggle: bool,
    },
}

impl Client {
    /// A channel to the default server of `node` that waits `timeout` for each
    /// answer.
    pub const fn new(node: NodeId, timeout: Duration) -> Client {
        Client {
            node,
            timeout,
            quarantine: timeout,
            deadline: Instant::ZERO,
            state: State::Idle,
        }
    }

    /// The same with another quarantine.
    pub const fn with_quarantine(self, quarantine: Duration) -> Client {
        Client { quarantine, ..self }
    }

    /// The node at the other end.
    pub const fn node(&self) -> NodeId {
        self.node
    }

    /// The identifier that answers arrive on.
    pub const fn response_id(&self) -> CobId {
        CobId::of(FunctionCode::SdoResponse, self.node)
    }

    /// Whether a request could be started at `now`.
    pub fn is_ready(&self, now: Instant) -> bool {
        match self.state {
            State::Idle => true,
            State::Quarantine => now >= self.deadline,
            _ => false,
        }
    }

    /// Writes `data`, 1..=[`RESPONSE_MAX`] bytes: expedited up to four bytes,
    /// else in segments. Returns the frame to send.
    ///
    /// # Errors
    /// If the channel is not free or the length is wrong.
    pub fn download(
        &mut self,
        at: Address,
        data: &[u8],
        now: Instant,
    ) -> Result<Frame, StartError> {
        self.ready(now)?;
        let mut kept = Response::empty(at);
        if data.is_empty() || !kept.append(data) {
            return Err(StartError::Length(data.len()));
        }
        let expedited = data.len() <= EXPEDITED_MAX;
        let initiate = Initiate::expedited(data).unwrap_or(Initiate::Segmented {
            size: Some(data.len() as u32),
        });
        let state = State::Download {
            data: kept,
            expedited,
        };
        Ok(self.send(state, Request::Download { at, data: initiate }, now))
    }

    /// Reads an entry. Returns the frame to send.
    ///
    /// # Errors
    /// If the channel is not free.
    pub fn upload(&mut self, at: Address, now: Instant) -> Result<Frame, StartError> {
        self.ready(now)?;
        Ok(self.send(State::Upload { at }, Request::Upload { at }, now))
    }

    /// Ends the request under way, if there is one, with an abort to the
    /// server.
    pub fn cancel(&mut self, code: AbortCode, now: Instant) -> Progress {
        match self.address() {
            Some(at) => self.close(SdoError::Cancelled { at, code }, code, now),
            None => Progress::Nothing,
        }
    }

    /// Forgets everything without a word: the node was reset.
    pub fn reset(&mut self) {
        self.state = State::Idle;
    }

    /// When [`poll`](Client::poll) has something to do.
    pub const fn next_deadline(&self) -> Option<Instant> {
        match self.state {
            State::Idle => None,
            _ => Some(self.deadline),
        }
    }

    /// Lets time pass: notices the timeout and the end of the quarantine.
    pub fn poll(&mut self, now: Instant) -> Progress {
        if now < self.deadline {
            return Progress::Nothing;
        }
        match self.address() {
            Some(at) => {
                let error = SdoError::Timeout {
                    at,
                    waited: self.timeout,
                };
                self.close(error, AbortCode::TIMEOUT, now)
            }
            None => {
                self.state = State::Idle;
                Progress::Nothing
            }
        }
    }

    /// Takes in a frame. Frames of others, frames without eight bytes and what
    /// does not fit the request are ignored.
    pub fn on_frame(&mut self, frame: &Frame, now: Instant) -> Progress {
        if frame.id() != self.response_id() || frame.data().len() != size_of::<Bytes>() {
            return Progress::Nothing;
        }
        let (Some(at), Some(answer)) = (self.address(), Answer::decode(frame.padded())) else {
            return Progress::Nothing;
        };
        match (self.state, answer) {
            (_, Answer::Abort { at: of, code }) if of == at => {
                self.state = State::Idle;
                Progress::Failed(SdoError::Aborted { at, code }, None)
            }
            (State::Download { data, expedited }, Answer::Download { at: of }) if of == at => {
                if expedited {
                    self.done(Response::empty(at))
                } else {
                    self.send_segment(data, 0, false, now)
                }
            }
            (
                State::DownloadSegment { data, sent, toggle },
                Answer::DownloadSegment { toggle: got },
            ) => {
                if got != toggle {
                    self.violation(at, AbortCode::TOGGLE, now)
                } else if sent >= data.data().len() {
                    self.done(Response::empty(at))
                } else {
                    self.send_segment(data, sent, !toggle, now)
                }
            }
            (State::Upload { .. }, Answer::Upload { at: of, data }) if of == at => {
                self.upload_initiated(at, data, now)
            }
            (State::UploadSegment { data, size, toggle }, Answer::UploadSegment(segment)) => {
                if segment.toggle != toggle {
                    self.violation(at, AbortCode::TOGGLE, now)
                } else {
                    self.upload_segment(data, size, segment, now)
                }
            }
            _ => Progress::Nothing,
        }
    }

    fn upload_initiated(&mut self, at: Address, initiate: Initiate, now: Instant) -> Progress {
        let mut data = Response::empty(at);
        match initiate {
            Initiate::Expedited { data: bytes, len } => {
                let len = len.map_or(EXPEDITED_MAX, usize::from);
                data.append(bytes.get(..len).unwrap_or(&bytes));
                self.done(data)
            }
            Initiate::Segmented { size: Some(size) } if size as usize > RESPONSE_MAX => {
                let error = SdoError::NoRoom { at, size };
                self.close(error, error.code(), now)
            }
            Initiate::Segmented { size } => {
                let toggle = false;
                let state = State::UploadSegment { data, size, toggle };
                Progress::Send(self.send(state, Request::UploadSegment { toggle }, now))
            }
        }
    }

    fn upload_segment(
        &mut self,
        mut data: Response,
        size: Option<u32>,
        segment: Segment,
        now: Instant,
    ) -> Progress {
        let at = data.at;
        let received = (data.data().len() + segment.data().len()) as u32;
        let lied = size.filter(|&size| received > size || segment.last && received < size);
        if let Some(announced) = lied {
            let error = SdoError::Size {
                at,
                announced,
                received,
            };
            return self.close(error, error.code(), now);
        }
        if !data.append(segment.data()) {
            let error = SdoError::NoRoom { at, size: received };
            return self.close(error, error.code(), now);
        }
        if segment.last {
            return self.done(data);
        }
        let toggle = !segment.toggle;
        let state = State::UploadSegment { data, size, toggle };
        Progress::Send(self.send(state, Request::UploadSegment { toggle }, now))
    }

    fn send_segment(
        &mut self,
        data: Response,
        from: usize,
        toggle: bool,
        now: Instant,
    ) -> Progress {
        let at = data.at;
        let rest = data.data().get(from..).unwrap_or(&[]);
        let len = rest.len().min(SEGMENT_MAX);
        let last = len == rest.len();
        let piece = rest.get(..len).unwrap_or(&[]);
        let Some(segment) = Segment::new(toggle, last, piece) else {
            return self.violation(at, AbortCode::GENERAL, now);
        };
        let state = State::DownloadSegment {
            data,
            sent: from + len,
            toggle,
        };
        Progress::Send(self.send(state, Request::DownloadSegment(segment), now))
    }

    fn ready(&self, now: Instant) -> Result<(), StartError> {
        match self.state {
            _ if self.is_ready(now) => Ok(()),
            State::Quarantine => Err(StartError::Quarantine {
                until: self.deadline,
            }),
            _ => Err(StartError::Busy),
        }
    }

    fn send(&mut self, state: State, request: Request, now: Instant) -> Frame {
        self.state = state;
        self.deadline = now + self.timeout;
        self.frame(request)
    }

    fn done(&mut self, response: Response) -> Progress {
        self.state = State::Idle;
        Progress::Done(response)
    }

    fn violation(&mut self, at: Address, code: AbortCode, now: Instant) -> Progress {
        self.close(SdoError::Protocol { at, code }, code, now)
    }

    /// Fails the request, tells the server, and keeps the channel closed.
    fn close(&mut self, error: SdoError, code: AbortCode, now: Instant) -> Progress {
        self.state = State::Quarantine;
        self.deadline = now + self.quarantine;
        let at = error.address();
        Progress::Failed(error, Some(self.frame(Request::Abort { at, code })))
    }

    /// The entry of the request under way.
    const fn address(&self) -> Option<Address> {
        match &self.state {
            State::Idle | State::Quarantine => None,
            State::Upload { at } => Some(*at),
            State::Download { data, .. }
            | State::DownloadSegment { data, .. }
            | State::UploadSegment { data, .. } => Some(data.at),
        }
    }

    fn frame(&self, request: Request) -> Frame {
        let id = CobId::of(FunctionCode::SdoRequest, self.node);
        Frame::full(id, request.encode())
    }
}

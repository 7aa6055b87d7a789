//! The client's end of a channel to one server: transfers of any length in
//! both directions, without a buffer for the data (CiA 301, 7.2.4).
//!
//! The data belongs to the caller, who hands it in as a [`Payload`] with every
//! frame. [`Client`](super::Client) wraps this for small objects.
//!
//! An answer completes a request only if its command, index, sub-index and
//! toggle are the ones expected. What does not fit is discarded if it can be
//! the late answer to an earlier request, and ends the transfer with an abort
//! if it cannot.
//!
//! After a timeout or a violation of the protocol the channel stays closed for
//! a quarantine, by default as long as the timeout, and discards what arrives:
//! a node that is merely slow would otherwise answer the old request to the
//! new one.
//!
//! What remains possible, because the protocol has nothing to tell it by: an
//! answer that arrives later than timeout and quarantine together is taken for
//! the answer to a newer request, if that is for the same entry by the same
//! command. Segments, and the acknowledgements of segments, name no entry at
//! all: one that is so late can join a newer transfer of another entry where its
//! toggle bit, or its sequence number, happens to be the one awaited. The size
//! that was announced, and the checksum of a block transfer, then end the
//! transfer in most cases. The remedy is a timeout longer than the node ever
//! takes, or a longer quarantine ([`Channel::with_quarantine`]).

mod block;
mod segmented;

use super::abort::AbortCode;
use super::block::{Receiver, Sender};
use super::command::{Answer, BLOCK_MAX, Bytes, Command};
use super::error::SdoError;
use super::progress::{Progress, StartError};
use crate::frame::Frame;
use crate::id::{Address, CobId, FunctionCode, NodeId};
use crate::time::{Duration, Instant};

/// The data of a transfer.
pub trait Payload {
    /// A download needs `buf.len()` bytes from `offset` on. The same bytes may
    /// be asked for again.
    fn read(&mut self, offset: u32, buf: &mut [u8]);

    /// An upload begins, of `size` bytes if the server tells.
    ///
    /// # Errors
    /// The code to refuse it with, 05040005h for instance if there is no room.
    fn begin(&mut self, size: Option<u32>) -> Result<(), AbortCode>;

    /// An upload has brought bytes; they come in order and without gaps. They
    /// are to be trusted only once the transfer is done.
    ///
    /// # Errors
    /// The code to end the transfer with.
    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), AbortCode>;
}

/// How data is to be transferred.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Protocol {
    /// Expedited up to four bytes, else in segments that are confirmed one by
    /// one.
    Normal,
    /// In blocks of segments that are confirmed together. If the server does
    /// not know this (05040001h), the transfer is done as [`Protocol::Normal`],
    /// and so are all later ones on this channel.
    Block,
}

/// A finished transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Transfer {
    /// The entry read or written.
    pub at: Address,
    /// How many bytes were transferred.
    pub len: u32,
}

/// A channel to the SDO server of one node.
#[derive(Clone, Debug)]
pub struct Channel {
    node: NodeId,
    timeout: Duration,
    quarantine: Duration,
    /// The server is not known to refuse block transfers.
    block: bool,
    /// End of the wait or of the quarantine.
    deadline: Instant,
    /// The entry of the transfer under way.
    at: Address,
    /// Bytes of the transfer under way: to be sent, or announced by the
    /// server.
    size: Option<u32>,
    /// Bytes received.
    received: u32,
    state: State,
}

#[derive(Clone, Copy, Debug)]
enum State {
    Idle,
    Quarantine,
    /// Everything is done; it only has to be told.
    Finished(u32),
    /// The initiate of a download was sent.
    Download {
        expedited: bool,
    },
    /// A segment was sent; with it the first `sent` bytes are.
    DownloadSegment {
        sent: u32,
        toggle: bool,
    },
    /// The initiate of an upload was sent.
    Upload,
    /// A segment was requested.
    UploadSegment {
        toggle: bool,
    },
    /// The initiate of a block download was sent.
    BlockDownload,
    /// Segments are being sent, or await their acknowledgement.
    BlockDownloadSegments(Sender),
    /// The end of a block download was sent.
    BlockDownloadEnd,
    /// The initiate of a block upload was sent.
    BlockUpload,
    /// Segments, or the end, are awaited.
    BlockUploadSegments(Receiver),
}

/// What a step of a transfer comes to.
enum Step {
    /// Wait on.
    Wait,
    /// Not an answer to what was asked: wait on, the timeout keeps running.
    Ignore,
    Send(Command),
    Done(u32),
    /// The server refused.
    Refused(AbortCode),
    /// The server broke the protocol.
    Violation(AbortCode),
    /// The caller's payload refused, or the sizes do not match.
    Failed(SdoError),
}

impl Channel {
    /// A channel to the default server of `node` that waits `timeout` for each
    /// answer.
    pub const fn new(node: NodeId, timeout: Duration) -> Channel {
        Channel {
            node,
            timeout,
            quarantine: timeout,
            block: true,
            deadline: Instant::ZERO,
            at: Address::new(0, 0),
            size: None,
            received: 0,
            state: State::Idle,
        }
    }

    /// The same with another quarantine.
    pub const fn with_quarantine(self, quarantine: Duration) -> Channel {
        Channel { quarantine, ..self }
    }

    /// The node at the other end.
    pub const fn node(&self) -> NodeId {
        self.node
    }

    /// The identifier that answers arrive on.
    pub const fn response_id(&self) -> CobId {
        CobId::of(FunctionCode::SdoResponse, self.node)
    }

    /// Whether a transfer could be started at `now`.
    pub fn is_ready(&self, now: Instant) -> bool {
        match self.state {
            State::Idle => true,
            State::Quarantine => now >= self.deadline,
            _ => false,
        }
    }

    /// Writes `size` bytes. Returns the frame to send.
    ///
    /// # Errors
    /// If the channel is not free.
    pub fn download(
        &mut self,
        at: Address,
        size: u32,
        protocol: Protocol,
        payload: &mut dyn Payload,
        now: Instant,
    ) -> Result<Frame, StartError> {
        self.start(at, Some(size), now)?;
        let request = if protocol == Protocol::Block && self.block {
            self.begin_block_download(size)
        } else {
            self.begin_download(size, payload)
        };
        Ok(self.send(request, now))
    }

    /// Reads an entry. Returns the frame to send.
    ///
    /// # Errors
    /// If the channel is not free.
    pub fn upload(
        &mut self,
        at: Address,
        protocol: Protocol,
        now: Instant,
    ) -> Result<Frame, StartError> {
        self.start(at, None, now)?;
        let request = if protocol == Protocol::Block && self.block {
            self.begin_block_upload()
        } else {
            self.begin_upload()
        };
        Ok(self.send(request, now))
    }

    /// Ends the transfer under way, if there is one, with an abort to the
    /// server.
    pub fn cancel(&mut self, code: AbortCode, now: Instant) -> Progress<Transfer> {
        match self.is_active() {
            true => self.close(SdoError::Cancelled { at: self.at, code }, now),
            false => Progress::Nothing,
        }
    }

    /// Forgets everything without a word: the node was reset.
    pub fn reset(&mut self) {
        self.state = State::Idle;
        self.block = true;
    }

    /// When [`poll`](Channel::poll) has something to do. In the middle of a
    /// block download that is at once, as soon as there is room for a frame.
    pub const fn next_deadline(&self) -> Option<Instant> {
        match self.state {
            State::Idle => None,
            _ => Some(self.deadline),
        }
    }

    /// Lets time pass: sends the segments of a block download one by one,
    /// notices the timeout and the end of the quarantine. To be called until it
    /// returns [`Progress::Nothing`], or until there is no room for another
    /// frame.
    pub fn poll(&mut self, now: Instant, payload: &mut dyn Payload) -> Progress<Transfer> {
        if now < self.deadline {
            return Progress::Nothing;
        }
        match self.state {
            State::Idle => Progress::Nothing,
            State::Quarantine => {
                self.state = State::Idle;
                Progress::Nothing
            }
            State::Finished(len) => self.progress(Step::Done(len), now),
            _ => match self.block_poll(payload) {
                Ok(Some(command)) => self.progress(Step::Send(command), now),
                Ok(None) => {
                    let error = SdoError::Timeout {
                        at: self.at,
                        waited: self.timeout,
                    };
                    self.close(error, now)
                }
                Err(code) => self.progress(Step::Violation(code), now),
            },
        }
    }

    /// Takes in a frame. Frames of others, frames without eight bytes and what
    /// does not fit the request are ignored.
    pub fn on_frame(
        &mut self,
        frame: &Frame,
        now: Instant,
        payload: &mut dyn Payload,
    ) -> Progress<Transfer> {
        if frame.id() != self.response_id()
            || frame.data().len() != size_of::<Bytes>()
            || !self.is_active()
        {
            return Progress::Nothing;
        }
        let command = Command(frame.padded());
        let step = match self.block_segment(command, payload) {
            Some(step) => step,
            None => match command.answer() {
                // What names an entry answers a request for that entry.
                Some(answer) if !answer.is_addressed() || command.address() == self.at => {
                    self.step(answer, command, payload)
                }
                _ => Step::Ignore,
            },
        };
        self.progress(step, now)
    }

    fn step(&mut self, answer: Answer, command: Command, payload: &mut dyn Payload) -> Step {
        match (self.state, answer) {
            (State::BlockDownload | State::BlockUpload, Answer::Abort)
                if command.abort_code() == AbortCode::COMMAND =>
            {
                self.fall_back(payload)
            }
            (_, Answer::Abort) => Step::Refused(command.abort_code()),
            (State::Download { expedited }, Answer::Download) => {
                self.download_begun(expedited, payload)
            }
            (State::DownloadSegment { sent, toggle }, Answer::DownloadSegment) => {
                self.segment_taken(sent, toggle, command.toggle(), payload)
            }
            (State::Upload | State::BlockUpload, Answer::Upload) => {
                self.upload_begun(command, payload)
            }
            (State::UploadSegment { toggle }, Answer::UploadSegment) => {
                self.segment_given(toggle, command, payload)
            }
            (_, answer) => self.block_step(answer, command, payload),
        }
    }

    fn progress(&mut self, step: Step, now: Instant) -> Progress<Transfer> {
        let at = self.at;
        match step {
            Step::Ignore => Progress::Nothing,
            Step::Wait => {
                self.deadline = now + self.patience();
                Progress::Nothing
            }
            Step::Send(command) => Progress::Send(self.send(command, now)),
            Step::Done(len) => {
                self.state = State::Idle;
                Progress::Done(Transfer { at, len })
            }
            Step::Refused(code) => {
                self.state = State::Idle;
                Progress::Failed(SdoError::Aborted { at, code }, None)
            }
            Step::Violation(code) => self.close(SdoError::Protocol { at, code }, now),
            Step::Failed(error) => self.close(error, now),
        }
    }

    /// The payload refused to take what came.
    fn refused(&self, code: AbortCode, size: u32) -> Step {
        let at = self.at;
        Step::Failed(match code {
            AbortCode::OUT_OF_MEMORY => SdoError::NoRoom { at, size },
            code => SdoError::Cancelled { at, code },
        })
    }

    /// Hands received bytes on, keeping to the size that was announced.
    fn take(&mut self, data: &[u8], last: bool, payload: &mut dyn Payload) -> Result<(), Step> {
        let len = data.len() as u32;
        let Some(received) = self.received.checked_add(len) else {
            return Err(Step::Violation(AbortCode::TOO_LONG));
        };
        let lies = |size: &u32| received > *size || last && received < *size;
        if let Some(announced) = self.size.filter(lies) {
            return Err(Step::Failed(SdoError::Size {
                at: self.at,
                announced,
                received,
            }));
        }
        let offset = core::mem::replace(&mut self.received, received);
        payload
            .write(offset, data)
            .map_err(|code| self.refused(code, received))
    }

    fn start(&mut self, at: Address, size: Option<u32>, now: Instant) -> Result<(), StartError> {
        match self.state {
            _ if self.is_ready(now) => {
                self.at = at;
                self.size = size;
                self.received = 0;
                Ok(())
            }
            State::Quarantine => Err(StartError::Quarantine {
                until: self.deadline,
            }),
            _ => Err(StartError::Busy),
        }
    }

    fn send(&mut self, command: Command, now: Instant) -> Frame {
        self.deadline = now + self.patience();
        self.frame(command)
    }

    /// Fails the transfer, tells the server, and keeps the channel closed.
    fn close(&mut self, error: SdoError, now: Instant) -> Progress<Transfer> {
        self.state = State::Quarantine;
        self.deadline = now + self.quarantine;
        let abort = Command::abort(error.address(), error.code());
        Progress::Failed(error, Some(self.frame(abort)))
    }

    /// How long to wait in the present state.
    const fn patience(&self) -> Duration {
        match &self.state {
            State::Finished(_) => Duration::ZERO,
            State::BlockDownloadSegments(sender) if sender.is_sending() => Duration::ZERO,
            State::BlockUploadSegments(receiver) if !receiver.is_complete() => self.timeout.half(),
            _ => self.timeout,
        }
    }

    const fn is_active(&self) -> bool {
        !matches!(
            self.state,
            State::Idle | State::Quarantine | State::Finished(_)
        )
    }

    fn frame(&self, command: Command) -> Frame {
        Frame::full(CobId::of(FunctionCode::SdoRequest, self.node), command.0)
    }
}

/// Segments per block that a client takes.
const BLOCK_SIZE: u8 = BLOCK_MAX;

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
use super::command::{Answer, BLOCK_MAX, Bytes, Command, Request};
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

/// What an upload has to send.
struct Nothing;

impl Payload for Nothing {
    fn read(&mut self, _: u32, _: &mut [u8]) {}

    fn begin(&mut self, _: Option<u32>) -> Result<(), AbortCode> {
        Ok(())
    }

    fn write(&mut self, _: u32, _: &[u8]) -> Result<(), AbortCode> {
        Ok(())
    }
}

/// Segments per block that a client takes.
const BLOCK_SIZE: u8 = BLOCK_MAX;

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
// In this order, so that what is used most is near: it takes shorter instructions.
#[repr(C)]
pub struct Channel {
    state: State,
    /// The toggle bit of the segment, or of the request for one, that is to be
    /// confirmed.
    toggle: bool,
    /// The server is not known to refuse block transfers.
    block: bool,
    /// Of the error that is under way.
    fault: Fault,
    node: NodeId,
    /// The entry of the transfer under way.
    at: Address,
    /// Bytes of the transfer under way: to be sent, or announced by the
    /// server.
    size: Option<u32>,
    /// How many of them have been sent or received in order.
    done: u32,
    /// What the server is to be asked or told next.
    request: Command,
    timeout: Duration,
    quarantine: Duration,
    /// End of the wait or of the quarantine.
    deadline: Instant,
    /// This end of a block download.
    sender: Sender,
    /// This end of a block upload.
    receiver: Receiver,
}

/// What is awaited.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Idle,
    Quarantine,
    /// Everything is done; it only has to be told.
    Finished,
    /// The answer to a download with all its data.
    ExpeditedDownload,
    /// The answer to the initiate of a download.
    Download,
    /// The confirmation of a segment.
    DownloadSegment,
    /// The answer to the initiate of an upload.
    Upload,
    /// A segment.
    UploadSegment,
    /// The answer to the initiate of a block download.
    BlockDownload,
    /// Segments to be sent, or their acknowledgement.
    BlockDownloadSegments,
    /// The confirmation of the end of a block download.
    BlockDownloadEnd,
    /// The answer to the initiate of a block upload.
    BlockUpload,
    /// Segments, or the end.
    BlockUploadSegments,
}

/// What an answer comes to. As wide as an abort code, so that either comes back in
/// registers.
#[derive(Clone, Copy)]
#[repr(u32)]
enum Step {
    /// Wait on.
    Wait,
    /// Not an answer to what was asked: wait on, the timeout keeps running.
    Ignore,
    /// Send the request.
    Send,
    Done,
}

/// Whose fault it is that the transfer fails.
#[derive(Clone, Copy, Debug)]
enum Fault {
    /// The server broke the protocol, unless told otherwise.
    Violation,
    /// The server refused.
    Refusal,
    /// The server has sent more or fewer bytes than it announced.
    Size,
    /// The caller's payload refused what came.
    Payload,
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
            done: 0,
            state: State::Idle,
            toggle: false,
            sender: Sender::new(BLOCK_MAX, false),
            receiver: Receiver::new(BLOCK_MAX, false),
            request: Command([0; 8]),
            fault: Fault::Violation,
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

    /// # Errors
    /// If no transfer could be started at `now`.
    pub(super) fn ready(&self, now: Instant) -> Result<(), StartError> {
        match self.state {
            _ if self.is_ready(now) => Ok(()),
            State::Quarantine => Err(StartError::Quarantine {
                until: self.deadline,
            }),
            _ => Err(StartError::Busy),
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
        self.start(at, Some(size), protocol, payload, now)
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
        self.start(at, None, protocol, &mut Nothing, now)
    }

    /// Writes `size` bytes, or reads what there is if there is no size. Returns
    /// the frame to send.
    ///
    /// # Errors
    /// If the channel is not free.
    pub(super) fn start(
        &mut self,
        at: Address,
        size: Option<u32>,
        protocol: Protocol,
        payload: &mut dyn Payload,
        now: Instant,
    ) -> Result<Frame, StartError> {
        self.ready(now)?;
        self.at = at;
        self.size = size;
        self.done = 0;
        self.begin(protocol == Protocol::Block && self.block, payload);
        Ok(self.send(now))
    }

    /// Prepares the initiate of a transfer (CiA 301, 7.2.4.3.3, 7.2.4.3.6,
    /// 7.2.4.3.9, 7.2.4.3.13).
    fn begin(&mut self, block: bool, payload: &mut dyn Payload) {
        let (at, size) = (self.at, self.size);
        (self.state, self.request) = match (size, block) {
            (Some(_), true) => (
                State::BlockDownload,
                Command::block_of(Request::BlockDownload.code(), at, size),
            ),
            (Some(size), false) => self.download_initiate(size, payload),
            (None, true) => (
                State::BlockUpload,
                Command::block_for(Request::BlockUpload.code(), at, BLOCK_SIZE),
            ),
            (None, false) => (
                State::Upload,
                Command::addressed(Request::Upload.code(), at, [0; 4]),
            ),
        };
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
            State::Finished => self.progress(Ok(Step::Done), now),
            _ => {
                let step = self.block_poll(payload);
                if let Ok(Step::Ignore) = step {
                    let (at, waited) = (self.at, self.timeout);
                    return self.close(SdoError::Timeout { at, waited }, now);
                }
                self.progress(step, now)
            }
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
        let step = match self.is_block_segment(&command) {
            true => self.block_segment(&command, payload),
            false => self.answer(&command, payload),
        };
        self.progress(step, now)
    }

    /// Its own function, so that the command stays in memory: in registers its
    /// fields would be shifted out again and again, for 120 bytes more of flash.
    #[inline(never)]
    fn answer(&mut self, command: &Command, payload: &mut dyn Payload) -> Result<Step, AbortCode> {
        let Some(answer) = command.answer() else {
            return Ok(Step::Ignore);
        };
        // What names an entry answers a request for that entry.
        if answer.is_addressed() && command.address() != self.at {
            return Ok(Step::Ignore);
        }
        match (self.state, answer) {
            (State::BlockDownload | State::BlockUpload, Answer::Abort)
                if command.abort_code() == AbortCode::COMMAND =>
            {
                // The server does not know block transfers.
                self.block = false;
                self.begin(false, payload);
                Ok(Step::Send)
            }
            (_, Answer::Abort) => {
                self.fault = Fault::Refusal;
                Err(command.abort_code())
            }
            (State::ExpeditedDownload, Answer::Download)
            | (State::BlockDownloadEnd, Answer::BlockDownloadEnd) => {
                self.done = self.size.unwrap_or(0);
                Ok(Step::Done)
            }
            (State::Download, Answer::Download) => Ok(self.next_segment(payload)),
            (State::DownloadSegment, Answer::DownloadSegment) => {
                self.segment_taken(command, payload)
            }
            (State::Upload | State::BlockUpload, Answer::Upload) => {
                self.upload_begun(command, payload)
            }
            (State::UploadSegment, Answer::UploadSegment) => self.segment_given(command, payload),
            (State::BlockDownload, Answer::BlockDownload) => self.block_download_begun(command),
            (State::BlockDownloadSegments, Answer::BlockDownloadAcknowledge) => {
                self.block_acknowledged(command)
            }
            (State::BlockUpload, Answer::BlockUpload) => self.block_upload_begun(command, payload),
            (State::BlockUploadSegments, Answer::BlockUploadEnd) => {
                self.block_upload_end(command, payload)
            }
            _ => Ok(Step::Ignore),
        }
    }

    fn progress(&mut self, step: Result<Step, AbortCode>, now: Instant) -> Progress<Transfer> {
        let at = self.at;
        let code = match step {
            Ok(Step::Ignore) => return Progress::Nothing,
            Ok(Step::Wait) => {
                self.deadline = now + self.patience();
                return Progress::Nothing;
            }
            Ok(Step::Send) => return Progress::Send(self.send(now)),
            Ok(Step::Done) => {
                self.state = State::Idle;
                let len = self.done;
                return Progress::Done(Transfer { at, len });
            }
            Err(code) => code,
        };
        let error = match core::mem::replace(&mut self.fault, Fault::Violation) {
            Fault::Refusal => {
                self.state = State::Idle;
                return Progress::Failed(SdoError::Aborted { at, code }, None);
            }
            Fault::Violation => SdoError::Protocol { at, code },
            Fault::Size => SdoError::Size {
                at,
                announced: self.size.unwrap_or(0),
                received: self.done,
            },
            Fault::Payload if code == AbortCode::OUT_OF_MEMORY => SdoError::NoRoom {
                at,
                size: self.size.unwrap_or(self.done),
            },
            Fault::Payload => SdoError::Cancelled { at, code },
        };
        self.close(error, now)
    }

    /// An upload begins, of as many bytes as the server tells.
    fn announced(&mut self, size: Option<u32>, payload: &mut dyn Payload) -> Result<(), AbortCode> {
        self.size = size;
        let begun = payload.begin(size);
        self.judge(begun)
    }

    /// Hands received bytes on, keeping to the size that was announced.
    fn take(
        &mut self,
        data: &[u8],
        last: bool,
        payload: &mut dyn Payload,
    ) -> Result<(), AbortCode> {
        let offset = self.done;
        let received = offset.checked_add(data.len() as u32);
        let received = received.ok_or(AbortCode::TOO_LONG)?;
        self.done = received;
        let lies = |size: u32| received > size || last && received < size;
        if self.size.is_some_and(lies) {
            self.fault = Fault::Size;
            return Err(AbortCode::LENGTH_MISMATCH);
        }
        let written = payload.write(offset, data);
        self.judge(written)
    }

    /// What the payload says.
    fn judge(&mut self, result: Result<(), AbortCode>) -> Result<(), AbortCode> {
        if result.is_err() {
            self.fault = Fault::Payload;
        }
        result
    }

    fn send(&mut self, now: Instant) -> Frame {
        self.deadline = now + self.patience();
        self.frame()
    }

    /// Fails the transfer, tells the server, and keeps the channel closed.
    fn close(&mut self, error: SdoError, now: Instant) -> Progress<Transfer> {
        self.state = State::Quarantine;
        self.deadline = now + self.quarantine;
        self.request = Command::abort(self.at, error.code());
        Progress::Failed(error, Some(self.frame()))
    }

    /// How long to wait in the present state.
    const fn patience(&self) -> Duration {
        match self.state {
            State::Finished => Duration::ZERO,
            State::BlockDownloadSegments if self.sender.is_sending() => Duration::ZERO,
            State::BlockUploadSegments if !self.receiver.is_complete() => self.timeout.half(),
            _ => self.timeout,
        }
    }

    const fn is_active(&self) -> bool {
        !matches!(
            self.state,
            State::Idle | State::Quarantine | State::Finished
        )
    }

    fn frame(&self) -> Frame {
        Frame::full(
            CobId::of(FunctionCode::SdoRequest, self.node),
            self.request.0,
        )
    }
}

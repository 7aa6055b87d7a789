//! A client for small objects: a [`Channel`] with a buffer of its own.

use super::abort::AbortCode;
use super::channel::{Channel, Payload, Protocol, Transfer};
use super::progress::{Progress, StartError};
use super::response::{RESPONSE_MAX, Response};
use crate::frame::Frame;
use crate::id::{Address, CobId, NodeId};
use crate::time::{Duration, Instant};

/// An SDO client with a channel to one node, for objects of up to
/// [`RESPONSE_MAX`](super::RESPONSE_MAX) bytes; see [`Channel`] for its rules.
#[derive(Clone, Debug)]
pub struct Client {
    channel: Channel,
    buffer: Response,
}

impl Payload for Response {
    fn read(&mut self, offset: u32, buf: &mut [u8]) {
        crate::od::read_bytes(self.data(), offset, buf);
    }

    fn begin(&mut self, size: Option<u32>) -> Result<(), AbortCode> {
        if size.is_some_and(|size| size as usize > RESPONSE_MAX) {
            return Err(AbortCode::OUT_OF_MEMORY);
        }
        Ok(())
    }

    fn write(&mut self, _: u32, data: &[u8]) -> Result<(), AbortCode> {
        if self.append(data) {
            Ok(())
        } else {
            Err(AbortCode::OUT_OF_MEMORY)
        }
    }
}

impl Client {
    /// A channel to the default server of `node` that waits `timeout` for each
    /// answer.
    pub const fn new(node: NodeId, timeout: Duration) -> Client {
        Client {
            channel: Channel::new(node, timeout),
            buffer: Response::empty(Address::new(0, 0)),
        }
    }

    /// The same with another quarantine.
    pub const fn with_quarantine(self, quarantine: Duration) -> Client {
        Client {
            channel: self.channel.with_quarantine(quarantine),
            buffer: self.buffer,
        }
    }

    /// The node at the other end.
    pub const fn node(&self) -> NodeId {
        self.channel.node()
    }

    /// The identifier that answers arrive on.
    pub const fn response_id(&self) -> CobId {
        self.channel.response_id()
    }

    /// Whether a request could be started at `now`.
    pub fn is_ready(&self, now: Instant) -> bool {
        self.channel.is_ready(now)
    }

    /// Writes `data`, 1..=[`RESPONSE_MAX`](super::RESPONSE_MAX) bytes: expedited
    /// up to four bytes, else in segments. Returns the frame to send.
    ///
    /// # Errors
    /// If the channel is not free or the length is wrong.
    pub fn download(
        &mut self,
        at: Address,
        data: &[u8],
        now: Instant,
    ) -> Result<Frame, StartError> {
        if data.is_empty() {
            return Err(StartError::Length(0));
        }
        self.start(at, Some(data), now)
    }

    /// Reads an entry. Returns the frame to send.
    ///
    /// # Errors
    /// If the channel is not free.
    pub fn upload(&mut self, at: Address, now: Instant) -> Result<Frame, StartError> {
        self.start(at, None, now)
    }

    fn start(
        &mut self,
        at: Address,
        data: Option<&[u8]>,
        now: Instant,
    ) -> Result<Frame, StartError> {
        if let Some(data) = data
            && data.len() > RESPONSE_MAX
        {
            return Err(StartError::Length(data.len()));
        }
        self.channel.ready(now)?;
        self.buffer = Response::empty(at);
        if let Some(data) = data {
            self.buffer.append(data);
        }
        let size = data.map(|data| data.len() as u32);
        self.channel
            .start(at, size, Protocol::Normal, &mut self.buffer, now)
    }

    /// Ends the request under way, if there is one, with an abort to the
    /// server.
    pub fn cancel(&mut self, code: AbortCode, now: Instant) -> Progress {
        let progress = self.channel.cancel(code, now);
        self.finish(progress)
    }

    /// Forgets everything without a word: the node was reset.
    pub fn reset(&mut self) {
        self.channel.reset();
    }

    /// When [`poll`](Client::poll) has something to do.
    pub const fn next_deadline(&self) -> Option<Instant> {
        self.channel.next_deadline()
    }

    /// Lets time pass: notices the timeout and the end of the quarantine.
    pub fn poll(&mut self, now: Instant) -> Progress {
        let progress = self.channel.poll(now, &mut self.buffer);
        self.finish(progress)
    }

    /// Takes in a frame. Frames of others, frames without eight bytes and what
    /// does not fit the request are ignored.
    pub fn on_frame(&mut self, frame: &Frame, now: Instant) -> Progress {
        let progress = self.channel.on_frame(frame, now, &mut self.buffer);
        self.finish(progress)
    }

    fn finish(&self, progress: Progress<Transfer>) -> Progress {
        match progress {
            Progress::Nothing => Progress::Nothing,
            Progress::Send(frame) => Progress::Send(frame),
            Progress::Failed(error, abort) => Progress::Failed(error, abort),
            Progress::Done(_) => Progress::Done(self.buffer),
        }
    }
}

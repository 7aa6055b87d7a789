//! The client for async code: reading or writing an entry is one `await`.
//!
//! Beneath it is a [`Channel`], with all its rules. What async code has besides
//! are a clock, a way to the bus, frames that come, and something to wait for: a
//! [`Link`].

use super::abort::AbortCode;
use super::channel::{Channel, Payload, Protocol, Transfer};
use super::error::SdoError;
use super::progress::Progress;
use super::response::Response;
use crate::frame::Frame;
use crate::id::Address;
use crate::time::Instant;
use core::pin::{Pin, pin};
use core::task::{Context, Poll};

/// The way to the bus and the clock.
pub trait Link {
    /// The present moment.
    fn now(&self) -> Instant;

    /// Hands a frame on to be sent; `false` if there is no room for it now.
    fn send(&mut self, frame: Frame) -> bool;

    /// The next frame that was received. Frames that are not the node's may be
    /// among them.
    fn receive(&mut self) -> Option<Frame>;

    /// Waits until a frame may have come, or until a moment. If that is past,
    /// until there may be room for a frame to be sent. The future may be dropped
    /// before its end and another be asked for.
    fn wait(&mut self, until: Instant) -> impl Future<Output = ()>;
}

/// An SDO client whose transfers are awaited (CiA 301, 7.2.4).
///
/// A transfer whose future is dropped before its end is under way still. The
/// next one aborts it with 08000000h and waits for the end of the quarantine.
pub struct AsyncClient<'a, L> {
    channel: &'a mut Channel,
    link: &'a mut L,
}

/// What is written.
struct Bytes<'a>(&'a [u8]);

impl Payload for Bytes<'_> {
    fn read(&mut self, offset: u32, buf: &mut [u8]) {
        crate::od::read_bytes(self.0, offset, buf);
    }

    fn begin(&mut self, _: Option<u32>) -> Result<(), AbortCode> {
        Err(AbortCode::GENERAL)
    }

    fn write(&mut self, _: u32, _: &[u8]) -> Result<(), AbortCode> {
        Err(AbortCode::GENERAL)
    }
}

impl<'a, L: Link> AsyncClient<'a, L> {
    /// A client on a channel.
    pub const fn new(channel: &'a mut Channel, link: &'a mut L) -> AsyncClient<'a, L> {
        AsyncClient { channel, link }
    }

    /// Reads a small entry.
    ///
    /// # Errors
    /// As of [`transfer`](Self::transfer); [`SdoError::NoRoom`] if it has more
    /// than [`RESPONSE_MAX`](super::RESPONSE_MAX) bytes.
    pub async fn read(&mut self, at: Address) -> Result<Response, SdoError> {
        let mut response = Response::empty(at);
        self.transfer(at, None, Protocol::Normal, &mut response)
            .await?;
        Ok(response)
    }

    /// Writes an entry: expedited up to four bytes, else in segments.
    ///
    /// # Errors
    /// As of [`transfer`](Self::transfer).
    pub async fn write(&mut self, at: Address, data: &[u8]) -> Result<(), SdoError> {
        let size = u32::try_from(data.len()).unwrap_or(u32::MAX);
        self.transfer(at, Some(size), Protocol::Normal, &mut Bytes(data))
            .await?;
        Ok(())
    }

    /// Transfers an entry of any size: writes `size` bytes, or reads what there
    /// is if there is no size.
    ///
    /// # Errors
    /// Why it failed, told when the channel is open again: after a timeout or a
    /// violation of the protocol, at the end of the quarantine.
    pub fn transfer<'b>(
        &'b mut self,
        at: Address,
        size: Option<u32>,
        protocol: Protocol,
        payload: &'b mut dyn Payload,
    ) -> Transferring<'b, L> {
        let cancelled = self.channel.cancel(AbortCode::GENERAL, self.link.now());
        Transferring {
            channel: self.channel,
            link: self.link,
            payload,
            at,
            size,
            protocol,
            unsent: match cancelled {
                Progress::Failed(_, abort) => abort,
                _ => None,
            },
            over: None,
        }
    }
}

/// A transfer under way: to be awaited.
///
/// Written by hand, since the state that the compiler makes of an async function
/// takes twice the code.
#[must_use = "nothing happens unless it is awaited"]
pub struct Transferring<'a, L> {
    channel: &'a mut Channel,
    link: &'a mut L,
    payload: &'a mut dyn Payload,
    at: Address,
    size: Option<u32>,
    protocol: Protocol,
    unsent: Option<Frame>,
    over: Option<Result<Transfer, SdoError>>,
}

impl<L: Link> Future for Transferring<'_, L> {
    type Output = Result<Transfer, SdoError>;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        let this = self.get_mut();
        loop {
            let until = match this.go_on() {
                Ok(over) => return Poll::Ready(over),
                Err(until) => until,
            };
            if pin!(this.link.wait(until)).poll(context).is_pending() {
                return Poll::Pending;
            }
        }
    }
}

impl<L: Link> Transferring<'_, L> {
    /// Does everything that can be done now. The end, or until when to wait.
    fn go_on(&mut self) -> Result<Result<Transfer, SdoError>, Instant> {
        loop {
            let now = self.link.now();
            if let Some(frame) = self.unsent {
                if !self.link.send(frame) {
                    return Err(now);
                }
                self.unsent = None;
            }
            let progress = if let Some(frame) = self.link.receive() {
                self.channel.on_frame(&frame, now, self.payload)
            } else if !self.channel.is_ready(now) {
                match self.channel.poll(now, self.payload) {
                    Progress::Nothing => return Err(self.channel.next_deadline().unwrap_or(now)),
                    progress => progress,
                }
            } else if let Some(over) = self.over.take() {
                return Ok(over);
            } else {
                let (at, protocol) = (self.at, self.protocol);
                let begun = match self.size {
                    Some(size) => self.channel.download(at, size, protocol, self.payload, now),
                    None => self.channel.upload(at, protocol, now),
                };
                begun.map_or(Progress::Nothing, Progress::Send)
            };
            match progress {
                Progress::Nothing => {}
                Progress::Send(frame) => self.unsent = Some(frame),
                Progress::Done(transfer) => self.over = Some(Ok(transfer)),
                Progress::Failed(error, abort) => {
                    self.unsent = abort;
                    self.over = Some(Err(error));
                }
            }
        }
    }
}

//! The client for async code: reading or writing an entry is one `await`.
//!
//! Beneath it is a [`Session`] on a [`Channel`], with all its rules. What async
//! code has besides a [`Link`] is something to wait for.

use super::abort::AbortCode;
use super::channel::{Channel, Payload, Protocol, Transfer};
use super::error::SdoError;
use super::progress::Progress;
use super::response::Response;
use super::session::{Course, Link, Session};
use crate::id::Address;
use crate::time::Instant;

/// A link that can be waited on.
pub trait AsyncLink: Link {
    /// Waits until a frame may have come, or until a moment. If that is past,
    /// until there may be room for a frame to be sent.
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

impl<'a, L: AsyncLink> AsyncClient<'a, L> {
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
    pub async fn transfer(
        &mut self,
        at: Address,
        size: Option<u32>,
        protocol: Protocol,
        payload: &mut dyn Payload,
    ) -> Result<Transfer, SdoError> {
        let abort = match self.channel.cancel(AbortCode::GENERAL, self.link.now()) {
            Progress::Failed(_, abort) => abort,
            _ => None,
        };
        let mut session = Session::new(at, size, protocol).after(abort);
        loop {
            match session.go_on(self.channel, self.link, payload) {
                Course::Over(over) => return over,
                Course::Until(until) => self.link.wait(until).await,
            }
        }
    }
}

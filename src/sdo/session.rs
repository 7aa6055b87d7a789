//! One transfer over a [`Channel`], from its first frame to its last.

use super::channel::{Channel, Payload, Protocol, Transfer};
use super::error::SdoError;
use super::progress::Progress;
use crate::frame::Frame;
use crate::id::Address;
use crate::time::Instant;

/// The way to the bus and the clock.
pub trait Link {
    /// The present moment.
    fn now(&self) -> Instant;

    /// Hands a frame on to be sent; `false` if there is no room for it now.
    fn send(&mut self, frame: Frame) -> bool;

    /// The next frame that was received. Frames that are not the node's may be
    /// among them.
    fn receive(&mut self) -> Option<Frame>;
}

/// How far a [`Session`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum Course {
    /// To be called again for a frame that comes, and at this moment; at once, as
    /// soon as there is room for a frame, if it is past.
    Until(Instant),
    /// The transfer is over and the channel is open again: after a timeout or a
    /// violation of the protocol, the quarantine is.
    Over(Result<Transfer, SdoError>),
}

/// One transfer: what has to be done, and what is to be sent next.
#[derive(Clone, Debug)]
pub struct Session {
    at: Address,
    size: Option<u32>,
    protocol: Protocol,
    unsent: Option<Frame>,
    over: Option<Result<Transfer, SdoError>>,
}

impl Session {
    /// Writes `size` bytes of an entry, or reads what there is if there is no
    /// size.
    pub const fn new(at: Address, size: Option<u32>, protocol: Protocol) -> Session {
        Session {
            at,
            size,
            protocol,
            unsent: None,
            over: None,
        }
    }

    /// The same, after a frame that is sent before.
    pub(super) const fn after(self, frame: Option<Frame>) -> Session {
        Session {
            unsent: frame,
            ..self
        }
    }

    /// Does everything that can be done now. A channel that is in quarantine is
    /// waited for; it must be in no other transfer.
    pub fn go_on(
        &mut self,
        channel: &mut Channel,
        link: &mut impl Link,
        payload: &mut dyn Payload,
    ) -> Course {
        let now = link.now();
        loop {
            if let Some(frame) = self.unsent {
                if !link.send(frame) {
                    return Course::Until(now);
                }
                self.unsent = None;
            }
            let progress = if let Some(frame) = link.receive() {
                channel.on_frame(&frame, now, payload)
            } else if !channel.is_ready(now) {
                match channel.poll(now, payload) {
                    Progress::Nothing => {
                        return Course::Until(channel.next_deadline().unwrap_or(now));
                    }
                    progress => progress,
                }
            } else if let Some(over) = self.over.take() {
                return Course::Over(over);
            } else {
                let begun = channel.start(self.at, self.size, self.protocol, payload, now);
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

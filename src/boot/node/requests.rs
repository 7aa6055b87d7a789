//! What is read from a node and written to it (CiA 302-2, "Boot slave", steps 2
//! to 6 and 8).

use super::super::event::{Action, Event};
use super::super::failure::{Cause, Status};
use super::super::settings::Assignment;
use super::state::{Configure, Identify, Restore, Retry, State, Verify};
use super::{ATTEMPT, NodeBoot, Step};
use crate::frame::Frame;
use crate::id::Address;
use crate::network::{self, ConfigWrite};
use crate::objects;
use crate::sdo::{Progress, SdoError};

/// Configuration writes between two progress reports.
const REPORT_EVERY: u16 = 16;
/// What 1011h wants to be told: "load" (CiA 301, 7.5.2.14).
const LOAD: u32 = u32::from_le_bytes(*b"load");
/// Where the node says when it was configured (CiA 301, 7.5.2.23).
const SIGNATURE: [Address; 2] = [objects::CONFIGURATION_DATE, objects::CONFIGURATION_TIME];

/// What is read before anything else, and what it is called when it is not what
/// it must be.
const IDENTITY: [(Address, Status); 5] = [
    (objects::DEVICE_TYPE, Status::C),
    (objects::VENDOR_ID, Status::D),
    (objects::PRODUCT_CODE, Status::M),
    (objects::REVISION_NUMBER, Status::N),
    (objects::SERIAL_NUMBER, Status::O),
];

impl NodeBoot {
    /// A frame from the node's SDO server.
    pub(in super::super) fn on_sdo(&mut self, frame: &Frame) {
        let progress = self.client.on_frame(frame, self.now);
        self.on_progress(progress);
    }

    /// Sends the request that the state wants, if the channel is free.
    pub(super) fn advance(&mut self) {
        while self.advance_once() {}
    }

    /// Whether the state changed to one that may have something to send.
    fn advance_once(&mut self) -> bool {
        if self.now >= self.until {
            self.expire();
            return matches!(self.state, State::Identify(_));
        }
        match self.state {
            State::Identify(Identify { item }) => match IDENTITY.get(usize::from(item)) {
                // 1000h is read even if it may be anything: it shows that the
                // node answers.
                Some(_) if item != 0 && self.expected(item).is_none() => {
                    self.identify(item + 1);
                    return true;
                }
                Some((at, _)) => self.read(*at),
                None => {
                    self.tell(Step::Identified);
                    if self.is(Assignment::KEEP_ALIVE) && !self.fresh {
                        self.await_state();
                    } else {
                        self.verify();
                        return true;
                    }
                }
            },
            State::Verify(Verify { item }) => match SIGNATURE.get(usize::from(item)) {
                Some(at) => self.read(*at),
                None => {
                    self.tell(Step::Configured);
                    self.await_error_control();
                }
            },
            State::Restore(Restore) => {
                let at = Address::new(objects::RESTORE_PARAMETERS, self.settings.restore);
                self.write(ConfigWrite::u32(at, LOAD));
            }
            State::Configure(Configure { done }) => match self.planned(done) {
                Some(write) => self.write(write),
                None => {
                    self.tell(Step::Configured);
                    self.await_error_control();
                }
            },
            _ => {}
        }
        false
    }

    /// Step 8, entered by a node that may be configured.
    pub(super) fn verify(&mut self) {
        if self.signature_len() == 0 {
            self.begin_configuration();
        } else {
            self.enter(State::Verify(Verify { item: 0 }));
        }
    }

    fn begin_configuration(&mut self) {
        let restores = self.is(Assignment::RESTORE) && self.settings.restore != 0;
        self.enter(match restores {
            true => State::Restore(Restore),
            false => State::Configure(Configure { done: 0 }),
        });
    }

    /// The write number `n` of the configuration. Date and time come last, so
    /// that they stand for all of it.
    fn planned(&self, n: u16) -> Option<ConfigWrite> {
        match n.checked_sub(self.planned) {
            None => network::planned(self.network, self.node, usize::from(n)),
            Some(item) if item >= self.signature_len() => None,
            Some(item) => {
                let item = usize::from(item);
                let at = SIGNATURE.get(item)?;
                let value = self.node.configured.get(item)?;
                Some(ConfigWrite::u32(*at, *value))
            }
        }
    }

    /// How many entries of 1020h are compared and written.
    fn signature_len(&self) -> u16 {
        match self.node.configured {
            [0, 0] => 0,
            _ => SIGNATURE.len() as u16,
        }
    }

    fn read(&mut self, at: Address) {
        let request = self.client.upload(at, self.now);
        self.send_request(request);
    }

    fn write(&mut self, write: ConfigWrite) {
        let bytes = write.bytes();
        let data = bytes.get(..write.len()).unwrap_or(&bytes);
        let request = self.client.download(write.at, data, self.now);
        self.send_request(request);
    }

    /// Busy is no error: the channel is in use or in quarantine, and the
    /// request is made again when it is free.
    fn send_request<E>(&mut self, request: Result<Frame, E>) {
        if let Ok(frame) = request {
            self.push(Action::Send(frame));
        }
    }

    pub(super) fn on_progress(&mut self, progress: Progress) {
        match progress {
            Progress::Nothing => {}
            Progress::Send(frame) => self.push(Action::Send(frame)),
            Progress::Done(response) => {
                self.tries = 0;
                self.on_response(response.data());
                // The next request follows at once, not at the next poll, so
                // that the node's latency is all that is waited for.
                self.advance();
            }
            Progress::Failed(error, abort) => {
                if let Some(abort) = abort {
                    self.push(Action::Send(abort));
                }
                self.on_sdo_error(error);
            }
        }
    }

    fn on_response(&mut self, data: &[u8]) {
        let found = <[u8; 4]>::try_from(data).map(u32::from_le_bytes);
        match self.state {
            State::Identify(Identify { item }) => {
                let Some(&(at, status)) = IDENTITY.get(usize::from(item)) else {
                    return;
                };
                let cause = match (found, self.expected(item)) {
                    (Ok(found), Some(expected)) if found != expected => Cause::Mismatch {
                        at,
                        expected,
                        found,
                    },
                    (Ok(_), _) => {
                        self.identify(item + 1);
                        return;
                    }
                    (Err(_), _) => Cause::Garbled { at },
                };
                self.fail(status, cause);
            }
            State::Verify(Verify { item }) => {
                if found.ok().as_ref() == self.node.configured.get(usize::from(item)) {
                    self.enter(State::Verify(Verify { item: item + 1 }));
                } else {
                    self.begin_configuration();
                }
            }
            State::Restore(_) => self.reset(true),
            State::Configure(Configure { done }) => {
                let done = done + 1;
                self.enter(State::Configure(Configure { done }));
                if done % REPORT_EVERY == 0 {
                    let node = self.node.id;
                    let total = self.planned + self.signature_len();
                    self.report(Event::Configuring { node, done, total });
                }
            }
            _ => {}
        }
    }

    fn on_sdo_error(&mut self, error: SdoError) {
        let cause = match error {
            SdoError::Aborted { at, code } => Cause::Refused { at, code },
            SdoError::Timeout { at, .. } => Cause::NoAnswer { at },
            other => Cause::Garbled {
                at: other.address(),
            },
        };
        let final_word = matches!(cause, Cause::Refused { .. });
        self.tries += 1;
        if !final_word && self.tries < self.network.master.sdo_tries {
            return;
        }
        self.tries = 0;
        match self.state {
            State::Identify(Identify { item: 0 }) if !final_word => self.unreached(cause),
            State::Identify(Identify { item }) => {
                let status = IDENTITY
                    .get(usize::from(item))
                    .map_or(Status::B, |(_, status)| *status);
                self.fail(status, cause);
            }
            // It does not tell when it was configured: it is configured.
            State::Verify(_) => self.begin_configuration(),
            State::Restore(_) | State::Configure(_) => self.fail(Status::J, cause),
            _ => {}
        }
    }

    /// No answer to 1000h. A mandatory node has the boot time, an optional one
    /// holds nobody up.
    fn unreached(&mut self, cause: Cause) {
        let mandatory = self.is(Assignment::MANDATORY);
        if mandatory && !self.has_given_up() && !self.boot_time_is_over() {
            let at = self.boot_deadline.min(self.now + ATTEMPT);
            self.enter_until(State::Retry(Retry), at);
        } else {
            self.fail(Status::B, cause);
        }
    }

    /// What an entry of [`IDENTITY`] must be.
    fn expected(&self, item: u8) -> Option<u32> {
        self.node.number(item)
    }
}

//! Boot-up of one node: CiA 302-2, "Boot slave".

use super::event::{Action, Event};
use super::failure::{Cause, Failure, Status};
use crate::frame::Frame;
use crate::id::Address;
use crate::network::{self, Network, Node};
use crate::nmt::{self, Command, NodeControl};
use crate::objects;
use crate::sdo::{Client, Progress, SdoError};
use crate::time::{Duration, Instant};
use heapless::Deque;

/// Actions that one stimulus can cause at most: an abort, the next request and
/// a report.
const OUTBOX: usize = 4;
/// Heartbeats of a node that may be missed before its first one is given up.
const HEARTBEATS_AWAITED: u32 = 3;
/// Configuration writes between two progress reports.
const REPORT_EVERY: u16 = 16;

/// Waiting for the boot-up frame, until the boot time (1F89h) is over
/// (CiA 302-2, "Boot slave", step 2).
#[derive(Debug)]
struct AwaitBootUp {
    deadline: Option<Instant>,
}

/// Reading 1000h and 1018h and comparing them with 1F84h .. 1F88h (CiA 302-2,
/// "Boot slave", steps 2 to 6).
#[derive(Debug)]
struct Identify {
    item: usize,
}

/// Writing the configuration (CiA 302-2, "Boot slave", step 8).
#[derive(Debug)]
struct Configure {
    done: u16,
}

/// Waiting for the first heartbeat, for which the boot-up frame does not count
/// (CiA 302-2, "Start error control service").
#[derive(Debug)]
struct AwaitHeartbeat {
    deadline: Instant,
}

#[derive(Debug)]
enum State {
    AwaitBootUp(AwaitBootUp),
    Identify(Identify),
    Configure(Configure),
    AwaitHeartbeat(AwaitHeartbeat),
    Ready,
    Failed,
}

/// The boot-up of one node, and the SDO channel to it.
#[derive(Debug)]
pub(super) struct NodeBoot {
    network: &'static Network,
    node: &'static Node,
    client: Client,
    state: State,
    tries: u8,
    restarts: u8,
    operational: bool,
    total: u16,
    outbox: Deque<Action, OUTBOX>,
}

impl NodeBoot {
    pub(super) fn new(network: &'static Network, node: &'static Node) -> NodeBoot {
        NodeBoot {
            network,
            node,
            client: Client::new(node.id, network.master.sdo_timeout),
            state: State::AwaitBootUp(AwaitBootUp { deadline: None }),
            tries: 0,
            restarts: 0,
            operational: false,
            total: u16::try_from(network::plan(network, node).count()).unwrap_or(u16::MAX),
            outbox: Deque::new(),
        }
    }

    pub(super) const fn node(&self) -> &'static Node {
        self.node
    }

    pub(super) const fn is_ready(&self) -> bool {
        matches!(self.state, State::Ready)
    }

    pub(super) const fn is_failed(&self) -> bool {
        matches!(self.state, State::Failed)
    }

    pub(super) const fn is_operational(&self) -> bool {
        self.operational
    }

    /// The reset command is on its way: the boot time begins.
    pub(super) fn start(&mut self, now: Instant) {
        self.state = State::AwaitBootUp(AwaitBootUp {
            deadline: Some(now + self.network.master.boot_time),
        });
    }

    /// The node reported its NMT state: a boot-up frame or a heartbeat
    /// (CiA 301, 7.2.8.3.2.2).
    pub(super) fn on_error_control(&mut self, state: nmt::State) {
        if state == nmt::State::Initialising {
            return self.on_boot_up();
        }
        match &self.state {
            State::AwaitHeartbeat(_) => {
                self.state = State::Ready;
                self.report(Event::Ready(self.node.id));
            }
            State::Ready if state == nmt::State::Operational && !self.operational => {
                self.operational = true;
                self.report(Event::Operational(self.node.id));
            }
            _ => {}
        }
    }

    /// It booted, or booted again in the middle of everything: whatever was
    /// done is gone, so all starts over.
    fn on_boot_up(&mut self) {
        match self.state {
            State::AwaitBootUp(AwaitBootUp { deadline: None }) | State::Failed => return,
            State::AwaitBootUp(_) => {}
            _ => {
                self.restarts += 1;
                if self.restarts >= self.network.master.sdo_tries {
                    return self.fail(Status::B, Cause::Restarts);
                }
            }
        }
        self.client.reset();
        self.tries = 0;
        self.operational = false;
        self.push(Action::Report(Event::BootUp(self.node.id)));
        self.push(Action::Send(
            NodeControl::node(Command::EnterPreOperational, self.node.id).frame(),
        ));
        self.state = State::Identify(Identify { item: 0 });
    }

    /// A frame from the node's SDO server.
    pub(super) fn on_sdo(&mut self, frame: &Frame, now: Instant) {
        let progress = self.client.on_frame(frame, now);
        self.on_progress(progress, now);
    }

    /// The next thing to do, if there is one now.
    pub(super) fn poll(&mut self, now: Instant) -> Option<Action> {
        if let Some(action) = self.outbox.pop_front() {
            return Some(action);
        }
        let progress = self.client.poll(now);
        self.on_progress(progress, now);
        self.advance(now);
        self.outbox.pop_front()
    }

    /// When [`poll`](Self::poll) has to be called again at the latest.
    pub(super) fn next_deadline(&self) -> Option<Instant> {
        let of_state = match &self.state {
            State::AwaitBootUp(AwaitBootUp { deadline }) => *deadline,
            State::AwaitHeartbeat(AwaitHeartbeat { deadline }) => Some(*deadline),
            _ => None,
        };
        [of_state, self.client.next_deadline()]
            .into_iter()
            .flatten()
            .min()
    }

    /// Sends the request that the state wants, if the channel is free.
    fn advance(&mut self, now: Instant) {
        while self.advance_once(now) {}
    }

    /// Whether the state changed to one that may have something to send.
    fn advance_once(&mut self, now: Instant) -> bool {
        match &self.state {
            State::AwaitBootUp(AwaitBootUp {
                deadline: Some(deadline),
            }) if now >= *deadline => {
                self.fail(Status::B, Cause::NoBootUp);
            }
            State::AwaitHeartbeat(AwaitHeartbeat { deadline }) if now >= *deadline => {
                self.fail(Status::K, Cause::NoHeartbeat);
            }
            State::Identify(Identify { item }) => {
                let item = *item;
                match self.expectation(item) {
                    Some((at, Some(_), _)) => {
                        let request = self.client.upload(at, now);
                        self.send_request(request);
                    }
                    Some((_, None, _)) => {
                        self.state = State::Identify(Identify { item: item + 1 });
                        return true;
                    }
                    None => {
                        self.report(Event::Identified(self.node.id));
                        self.state = State::Configure(Configure { done: 0 });
                        return true;
                    }
                }
            }
            State::Configure(Configure { done }) => {
                let done = *done;
                match network::planned(self.network, self.node, usize::from(done)) {
                    Some(write) => {
                        let bytes = write.bytes();
                        let data = bytes.get(..write.len()).unwrap_or(&bytes);
                        let request = self.client.download(write.at, data, now);
                        self.send_request(request);
                    }
                    None => {
                        self.report(Event::Configured(self.node.id));
                        self.await_heartbeat(now);
                    }
                }
            }
            _ => {}
        }
        false
    }

    fn await_heartbeat(&mut self, now: Instant) {
        if self.node.heartbeat_ms == 0 {
            self.state = State::Ready;
            return self.report(Event::Ready(self.node.id));
        }
        let patience = u32::from(self.node.heartbeat_ms) * HEARTBEATS_AWAITED;
        self.state = State::AwaitHeartbeat(AwaitHeartbeat {
            deadline: now + Duration::from_millis(patience),
        });
    }

    /// Busy is no error: the channel is in use or in quarantine, and the
    /// request is made again when it is free.
    fn send_request<E>(&mut self, request: Result<Frame, E>) {
        if let Ok(frame) = request {
            self.push(Action::Send(frame));
        }
    }

    fn on_progress(&mut self, progress: Progress, now: Instant) {
        match progress {
            Progress::Nothing => {}
            Progress::Send(frame) => self.push(Action::Send(frame)),
            Progress::Done(response) => {
                self.tries = 0;
                self.on_response(response.data());
                // The next request follows at once, not at the next poll, so
                // that the node's latency is all that is waited for.
                self.advance(now);
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
        match &self.state {
            State::Identify(Identify { item }) => {
                let item = *item;
                let Some((at, Some(expected), status)) = self.expectation(item) else {
                    return;
                };
                let found = <[u8; 4]>::try_from(data).map(u32::from_le_bytes);
                match found {
                    Ok(found) if found == expected => {
                        self.state = State::Identify(Identify { item: item + 1 });
                    }
                    Ok(found) => self.fail(
                        status,
                        Cause::Mismatch {
                            at,
                            expected,
                            found,
                        },
                    ),
                    Err(_) => self.fail(status, Cause::Garbled { at }),
                }
            }
            State::Configure(Configure { done }) => {
                let done = done + 1;
                self.state = State::Configure(Configure { done });
                if done % REPORT_EVERY == 0 {
                    let (node, total) = (self.node.id, self.total);
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
        let status = match (&self.state, cause) {
            (State::Configure(_), _) => Status::J,
            (State::Identify(Identify { item }), Cause::Refused { .. }) => self
                .expectation(*item)
                .map_or(Status::B, |(_, _, status)| status),
            _ => Status::B,
        };
        self.fail(status, cause);
    }

    /// What is read, what it must be, and what it is called when it is not.
    fn expectation(&self, item: usize) -> Option<(Address, Option<u32>, Status)> {
        let identity = &self.node.identity;
        [
            (objects::DEVICE_TYPE, identity.device_type, Status::C),
            (objects::VENDOR_ID, identity.vendor, Status::D),
            (objects::PRODUCT_CODE, identity.product, Status::M),
            (objects::REVISION_NUMBER, identity.revision, Status::N),
            (objects::SERIAL_NUMBER, identity.serial, Status::O),
        ]
        .get(item)
        .copied()
    }

    /// Sends an NMT command to this node alone.
    pub(super) fn send(&mut self, command: Command) {
        self.push(Action::Send(
            NodeControl::node(command, self.node.id).frame(),
        ));
    }

    /// It is to be operational and is not, after all the time that it had.
    pub(super) fn fail_to_start(&mut self) {
        self.fail(Status::K, Cause::NotOperational);
    }

    fn fail(&mut self, status: Status, cause: Cause) {
        let failure = Failure { status, cause };
        self.state = State::Failed;
        self.report(Event::Failed(self.node.id, failure));
    }

    fn report(&mut self, event: Event) {
        self.push(Action::Report(event));
    }

    fn push(&mut self, action: Action) {
        // The outbox holds what one stimulus can cause; it is emptied before
        // the next one.
        let _ = self.outbox.push_back(action);
    }
}

//! What error control tells of a node, and what follows (CiA 302-2, "Check node
//! state", "Start error control service", "Error handler").

use super::super::event::Action;
use super::super::failure::{BootResult, Cause, Failure, Status};
use super::super::settings::Assignment;
use super::state::{
    AwaitBootUp, AwaitErrorControl, AwaitReset, AwaitState, Configure, Lost, Operational, Ready,
    Starting, State,
};
use super::{ATTEMPT, NodeBoot, Step};
use crate::frame::Frame;
use crate::nmt::{self, Command, ErrorControl, Guard, Guardian};
use crate::time::{Duration, Instant};

/// Heartbeats of a node that may be missed before its first one is given up.
const HEARTBEATS_AWAITED: u32 = 3;
/// The time that a node is given to report operational, however short its
/// heartbeat.
const START_TIME: Duration = Duration::from_millis(100);

impl NodeBoot {
    /// The node reported its NMT state: a boot-up frame, a heartbeat or the
    /// answer to node guarding (CiA 301, 7.2.8.3.2).
    #[inline(never)]
    pub(in super::super) fn on_error_control(&mut self, frame: &Frame) {
        let Some(ErrorControl { state, .. }) = ErrorControl::decode(frame) else {
            return;
        };
        let counts = self.guardian.on_frame(frame, self.now).is_some();
        if state == nmt::State::Initialising {
            return self.on_boot_up();
        }
        // Of a node that was not reset nobody knows the toggle bit.
        if self.is_asked() && !counts && !matches!(self.state, State::AwaitState(_)) {
            return;
        }
        let operational = state == nmt::State::Operational;
        match self.state {
            State::AwaitState(_) if operational => {
                self.enter(State::Operational(Operational));
                if core::mem::take(&mut self.lost) {
                    self.tell(Step::Back);
                }
                self.done(BootResult::LeftRunning, Step::LeftRunning);
            }
            State::AwaitState(_) => self.reset(false),
            State::AwaitErrorControl(_) => self.ready(),
            State::Ready(_) | State::Starting(_) if operational && !self.held => self.operational(),
            State::Operational(_) if !operational => {
                self.lose(false);
            }
            State::GivenUp(_) => self.on_sign_of_life(),
            _ => {}
        }
    }

    /// It booted, or booted again in the middle of everything: whatever was
    /// done is gone, so all starts over.
    fn on_boot_up(&mut self) {
        if self.lose(true) {
            return;
        }
        match self.state {
            State::Idle(_) | State::Lost(_) => return,
            State::GivenUp(_) => self.restarts = 0,
            State::AwaitBootUp(_) | State::AwaitReset(_) => {}
            _ if !self.fresh || !self.is(Assignment::MAY_START) => {}
            _ => return self.restarted(),
        }
        self.booted();
    }

    /// It booted again too soon.
    fn restarted(&mut self) {
        self.restarts += 1;
        if self.restarts < self.network.master.sdo_tries {
            return self.booted();
        }
        self.client.reset();
        self.fail(Status::B, Cause::Restarts);
    }

    /// After the boot-up frame.
    fn booted(&mut self) {
        let before = self.state;
        self.client.reset();
        self.tries = 0;
        self.fresh = true;
        self.tell(Step::BootUp);
        if !self.is(Assignment::MAY_START) {
            return self.await_error_control();
        }
        self.send(Command::EnterPreOperational);
        match before {
            State::AwaitReset(AwaitReset { restored: true }) => {
                self.enter(State::Configure(Configure { done: 0 }));
            }
            State::AwaitReset(_) => self.verify(),
            _ => self.identify(0),
        }
    }

    /// A node that was given up because nothing was heard of it is there.
    fn on_sign_of_life(&mut self) {
        let unheard = matches!(
            self.result,
            BootResult::Failed(Failure {
                cause: Cause::NoBootUp | Cause::NoHeartbeat,
                ..
            })
        );
        if !self.is(Assignment::MAY_START) {
            self.ready();
        } else if unheard && self.is(Assignment::KEEP_ALIVE) {
            self.identify(0);
        } else if unheard {
            self.send(Command::ResetCommunication);
            self.enter_until(State::AwaitBootUp(AwaitBootUp), self.attempt_end());
        }
    }

    /// It was booted and is not any more. The network decides what follows.
    pub(in super::super) fn lose(&mut self, booted: bool) -> bool {
        if !self.is_up() {
            return false;
        }
        self.lost = true;
        self.result = BootResult::Pending;
        self.enter(State::Lost(Lost { booted }));
        self.tell(Step::Lost);
        true
    }

    /// A lost node is booted again (CiA 302-2, "Error handler").
    pub(in super::super) fn recover(&mut self) {
        let booted = match self.state {
            State::Lost(Lost { booted }) => booted,
            // It was put into the list meanwhile.
            State::Idle(_) if self.is(0) => false,
            _ => return,
        };
        let may_start = self.is(Assignment::MAY_START);
        if !booted || !may_start {
            return self.begin(may_start);
        }
        self.held = false;
        self.begin_boot_time();
        self.restarted();
    }

    /// Sends a reset that was requested, and boots the node again.
    pub(in super::super) fn reset_by_request(&mut self, command: Command) {
        let was_up = self.is_up();
        self.begin(false);
        if was_up {
            self.lost = true;
            self.tell(Step::Lost);
        }
        self.send(command);
    }

    /// Resets this node alone in the middle of its boot-up.
    pub(super) fn reset(&mut self, restored: bool) {
        // What was restored is in force after a reset of the node
        // (CiA 301, 7.5.2.14).
        self.send(if restored {
            Command::ResetNode
        } else {
            Command::ResetCommunication
        });
        let state = State::AwaitReset(AwaitReset { restored });
        self.enter_until(state, self.attempt_end());
    }

    #[inline(never)]
    fn attempt_end(&self) -> Instant {
        self.boot_end().max(self.now + ATTEMPT)
    }

    /// Step 7, entered with the identity checked.
    pub(super) fn await_state(&mut self) {
        match self.patience() {
            Duration::ZERO => self.reset(false),
            patience => {
                self.guard();
                self.enter_for(State::AwaitState(AwaitState), patience);
            }
        }
    }

    /// Step 9.
    pub(super) fn await_error_control(&mut self) {
        match self.patience() {
            Duration::ZERO => self.ready(),
            patience => {
                self.guard();
                self.enter_for(State::AwaitErrorControl(AwaitErrorControl), patience);
            }
        }
    }

    /// How long error control may stay away; zero if there is none.
    pub(super) fn patience(&self) -> Duration {
        let (period_ms, times) = match self.node.heartbeat_ms {
            0 => (
                self.settings.assignment.guard_time().as_millis(),
                u32::from(self.settings.assignment.guard_retries()) + 1,
            ),
            period => (u32::from(period), HEARTBEATS_AWAITED),
        };
        Duration::from_millis(period_ms.saturating_mul(times))
    }

    fn ready(&mut self) {
        self.enter(State::Ready(Ready));
        self.done(BootResult::Booted, Step::Ready);
    }

    fn done(&mut self, result: BootResult, step: Step) {
        self.gave_up = false;
        self.result = result;
        self.tell(step);
    }

    fn operational(&mut self) {
        self.enter(State::Operational(Operational));
        self.restarts = 0;
        let back = core::mem::take(&mut self.lost);
        self.tell(if back { Step::Back } else { Step::Operational });
    }

    /// NMT start goes, or went by broadcast, to the node.
    pub(in super::super) fn start(&mut self, alone: bool) {
        if alone {
            self.send(Command::Start);
        }
        match self.patience() {
            Duration::ZERO => self.operational(),
            patience => {
                // A guarded node is asked when its time comes, not at once.
                let asked = self.settings.assignment.guard_time();
                let time = patience.max(START_TIME) + asked;
                self.enter_for(State::Starting(Starting), time);
            }
        }
    }

    /// Somebody asked for another state than operational, or for operational
    /// after that.
    pub(in super::super) fn hold(&mut self, held: bool) {
        if self.is_up() {
            self.held = held;
            if held {
                self.enter(State::Ready(Ready));
            }
        }
    }

    /// Whether it tells its state by answers only.
    fn is_asked(&self) -> bool {
        self.node.heartbeat_ms == 0 && self.patience() != Duration::ZERO
    }

    /// Begins node guarding (CiA 301, 7.2.8.3.2.1), if the node has no heartbeat.
    pub(super) fn guard(&mut self) {
        let time = match self.is_asked() {
            true => self.settings.assignment.guard_time(),
            false => Duration::ZERO,
        };
        let retries = self.settings.assignment.guard_retries();
        self.guardian = Guardian::new(self.node.id, time, retries);
        self.guardian.start(self.now);
    }

    /// Asks a guarded node for its state when it is time, and loses it when it
    /// does not answer.
    pub(super) fn ask_for_state(&mut self) {
        if !self.state.is_guarded() {
            return;
        }
        match self.guardian.poll(self.now) {
            Some(Guard::Ask(frame)) => self.push(Action::Send(frame)),
            Some(Guard::Lost(_)) => {
                self.lose(false);
            }
            None => {}
        }
    }
}

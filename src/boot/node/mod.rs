//! Boot-up of one node: CiA 302-2, "Boot slave".

mod error_control;
mod requests;
mod state;

use super::event::{Action, Event};
use super::failure::{BootResult, Cause, Failure, Status};
use super::settings::{Assignment, NodeSettings};
use crate::network::{self, Network, Node};
use crate::nmt::{Command, Guardian, NodeControl};
use crate::objects;
use crate::sdo::Client;
use crate::time::{Duration, Instant};
use heapless::Deque;
use state::{AwaitBootUp, AwaitErrorControl, AwaitReset, GivenUp, Identify, Idle, Missing, State};

/// Actions that one stimulus can cause at most: an abort or a step that ends,
/// the next request and reports.
const OUTBOX: usize = 4;
/// How long a boot-up frame is awaited where no boot time is set, and the pause
/// between two attempts to reach a node.
const ATTEMPT: Duration = Duration::from_millis(1_000);

/// The boot-up of one node, and the SDO channel to it.
#[derive(Debug)]
#[repr(C)]
pub(super) struct NodeBoot {
    // In this order, small ones first: instructions that reach the first 32 bytes
    // are shorter.
    /// Tries of the request under way.
    tries: u8,
    /// Restarts in the middle of the boot-up.
    restarts: u8,
    /// It failed, and was not booted since.
    gave_up: bool,
    /// It booted since the boot-up began, so that nothing of old runs on.
    fresh: bool,
    /// It was lost and has not been operational since.
    lost: bool,
    /// Somebody asked for another state than operational.
    held: bool,
    /// If it does not boot, it may be looked for by its serial number.
    search: bool,
    /// Writes of the configuration without date and time.
    planned: u16,
    node: &'static Node,
    settings: NodeSettings,
    /// 1F89h; zero: for ever.
    boot_time: Duration,
    state: State,
    /// When time alone leads out of the state.
    until: Instant,
    /// The time of what is being done, as the network has told it.
    now: Instant,
    network: &'static Network,
    result: BootResult,
    /// End of the boot time 1F89h, which may be [`Instant::NEVER`].
    boot_deadline: Instant,
    client: Client,
    /// Asks the node for its state, if it has no heartbeat.
    guardian: Guardian,
    outbox: Deque<Action, OUTBOX>,
}

/// A step of which there is no more to tell than whose it is.
#[derive(Clone, Copy)]
enum Step {
    BootUp,
    Identified,
    Configured,
    Ready,
    LeftRunning,
    NotListed,
    Operational,
    Lost,
    Back,
}

/// What the network looks for in its nodes.
#[derive(Clone, Copy)]
pub(super) struct Trait(u16);

impl Trait {
    /// It did not boot and is to be looked for by its serial number.
    pub(super) const MISSING: Trait = Trait(1 << 0);
    /// NMT start was sent.
    pub(super) const STARTING: Trait = Trait(1 << 1);
    pub(super) const OPERATIONAL: Trait = Trait(1 << 2);
    pub(super) const KEPT_ALIVE: Trait = Trait(1 << 3);
    /// In the list, failed, and not booted since.
    pub(super) const GIVEN_UP: Trait = Trait(1 << 4);
    /// In the list, and neither booted nor given up.
    pub(super) const UNSETTLED: Trait = Trait(1 << 5);
    /// Not waiting to be started, or not allowed to be.
    pub(super) const NOT_STARTABLE: Trait = Trait(1 << 6);
    /// Mandatory, and no longer what it should be.
    pub(super) const MANDATORY_LOST: Trait = Trait(1 << 7);
    /// Mandatory and given up.
    pub(super) const MANDATORY_FAILED: Trait = Trait(1 << 8);
    /// Mandatory and not booted.
    pub(super) const MANDATORY_DOWN: Trait = Trait(1 << 9);
    /// Mandatory and not all that the network wants of it.
    pub(super) const MANDATORY_INCOMPLETE: Trait = Trait(1 << 10);
}

impl NodeBoot {
    pub(super) fn new(
        network: &'static Network,
        node: &'static Node,
        settings: NodeSettings,
        boot_time: Duration,
    ) -> NodeBoot {
        // Before the rest is made, which then is made in place.
        let planned = network::plan(network, node).count() as u16;
        NodeBoot {
            network,
            node,
            settings,
            boot_time,
            client: Client::new(node.id, node.sdo_timeout),
            state: State::Idle(Idle),
            until: Instant::NEVER,
            now: Instant::ZERO,
            boot_deadline: Instant::NEVER,
            guardian: Guardian::new(node.id, Duration::ZERO, 0),
            tries: 0,
            restarts: 0,
            planned,
            result: BootResult::Pending,
            gave_up: false,
            fresh: false,
            lost: false,
            held: false,
            search: false,
            outbox: Deque::new(),
        }
    }

    pub(super) const fn set_settings(&mut self, settings: NodeSettings, boot_time: Duration) {
        self.settings = settings;
        self.boot_time = boot_time;
    }

    /// What follows is done at `now`.
    pub(super) const fn set_now(&mut self, now: Instant) {
        self.now = now;
    }

    pub(super) const fn node(&self) -> &'static Node {
        self.node
    }

    pub(super) const fn result(&self) -> BootResult {
        self.result
    }

    pub(super) const fn is(&self, bits: u32) -> bool {
        self.settings.assignment.has(Assignment::LISTED | bits)
    }

    /// Booted, whether started or not.
    pub(super) const fn is_up(&self) -> bool {
        matches!(
            self.state,
            State::Ready(_) | State::Starting(_) | State::Operational(_)
        )
    }

    pub(super) const fn has_given_up(&self) -> bool {
        self.gave_up
    }

    /// All that the network wants of it: operational, or booted if it is not to
    /// be started.
    const fn is_complete(&self) -> bool {
        match self.state {
            State::Operational(_) => true,
            State::Ready(_) => !self.is(Assignment::MAY_START),
            _ => false,
        }
    }

    /// Whether it has that trait. All are found out in one place: flash is scarcer
    /// than time.
    #[inline(never)]
    pub(super) const fn has(&self, one: Trait) -> bool {
        let (up, listed) = (self.is_up(), self.is(0));
        let startable =
            matches!(self.state, State::Ready(_)) && self.is(Assignment::MAY_START) && !self.held;
        let mut traits = match self.state {
            State::Missing(_) => Trait::MISSING.0,
            State::Starting(_) => Trait::STARTING.0,
            State::Operational(_) => Trait::OPERATIONAL.0,
            _ => 0,
        };
        if self.is(Assignment::KEEP_ALIVE) {
            traits |= Trait::KEPT_ALIVE.0;
        }
        if self.gave_up && listed {
            traits |= Trait::GIVEN_UP.0;
        }
        if !up && !self.gave_up && listed {
            traits |= Trait::UNSETTLED.0;
        }
        if !startable {
            traits |= Trait::NOT_STARTABLE.0;
        }
        if self.is(Assignment::MANDATORY) {
            if matches!(self.state, State::Lost(_)) {
                traits |= Trait::MANDATORY_LOST.0;
            }
            if self.gave_up {
                traits |= Trait::MANDATORY_FAILED.0;
            }
            if !up {
                traits |= Trait::MANDATORY_DOWN.0;
            }
            if !self.is_complete() {
                traits |= Trait::MANDATORY_INCOMPLETE.0;
            }
        }
        traits & one.0 != 0
    }

    /// If it does not boot, it is looked for before it is given up, should the
    /// network name its serial number.
    pub(super) const fn allow_search(&mut self, allowed: bool) {
        self.search = allowed && self.node.serial.is_some();
    }

    /// Nobody is looked for any more. Whether it is given up for that.
    pub(super) fn not_found(&mut self) -> bool {
        let missing = self.has(Trait::MISSING);
        if missing {
            self.fail(Status::B, Cause::NoBootUp);
        }
        missing
    }

    /// It was reset, or given its node-ID: it boots.
    #[inline(never)]
    pub(super) fn await_boot_up(&mut self) {
        self.begin_boot_time();
        self.enter_until(State::AwaitBootUp(AwaitBootUp), self.boot_end());
    }

    /// The boot-up begins. `reset`: the node is to be reset by itself, unless it
    /// is to be kept alive.
    pub(super) fn begin(&mut self, reset: bool) {
        self.halt();
        self.result = BootResult::Pending;
        self.gave_up = false;
        self.held = false;
        self.search = false;
        self.restarts = 0;
        if !self.is(0) {
            self.result = BootResult::Failed(Failure {
                status: Status::A,
                cause: Cause::NotListed,
            });
            return self.tell(Step::NotListed);
        }
        let keep_alive = self.is(Assignment::KEEP_ALIVE);
        if reset && !keep_alive {
            self.send(Command::ResetCommunication);
        }
        self.await_boot_up();
        if !self.is(Assignment::MAY_START) {
            self.guard();
            let end = self.boot_end() + self.patience();
            self.enter_until(State::AwaitErrorControl(AwaitErrorControl), end);
        } else if keep_alive {
            self.identify(0);
        }
    }

    /// Nothing more is done until [`begin`](Self::begin).
    pub(super) fn halt(&mut self) {
        self.client.reset();
        self.enter(State::Idle(Idle));
        self.tries = 0;
        self.fresh = false;
    }

    /// The next thing to do, if there is one now.
    pub(super) fn poll(&mut self) -> Option<Action> {
        if let Some(action) = self.outbox.pop_front() {
            return Some(action);
        }
        let progress = self.client.poll(self.now);
        self.on_progress(progress);
        self.advance();
        self.ask_for_state();
        self.outbox.pop_front()
    }

    /// When [`poll`](Self::poll) has to be called again at the latest.
    pub(super) fn next_deadline(&self) -> Instant {
        let client = Instant::of(self.client.next_deadline());
        let next = self.until.min(client);
        match self.state.is_guarded() {
            true => next.min(Instant::of(self.guardian.next_deadline())),
            false => next,
        }
    }

    /// The time of a state is over.
    pub(super) fn expire(&mut self) {
        let (status, cause) = match self.state {
            State::AwaitBootUp(_) if self.search => {
                return self.enter(State::Missing(Missing));
            }
            State::AwaitBootUp(_) if self.boot_time_is_over() => (Status::B, Cause::NoBootUp),
            State::Retry(_) if self.boot_time_is_over() => {
                let at = objects::DEVICE_TYPE;
                (Status::B, Cause::NoAnswer { at })
            }
            State::AwaitBootUp(_) | State::Retry(_) | State::GivenUp(_) => {
                return self.identify(0);
            }
            State::AwaitReset(AwaitReset { restored: true }) => (Status::J, Cause::NoBootUp),
            State::AwaitReset(_) => (Status::B, Cause::NoBootUp),
            State::AwaitState(_) => match self.node.heartbeat_ms {
                0 => (Status::F, Cause::NoState),
                _ => (Status::E, Cause::NoState),
            },
            State::AwaitErrorControl(_) => (Status::K, Cause::NoHeartbeat),
            State::Starting(_) => (Status::K, Cause::NotOperational),
            _ => return,
        };
        self.fail(status, cause);
    }

    /// The boot time begins; zero lasts for ever.
    fn begin_boot_time(&mut self) {
        self.boot_deadline = match self.boot_time {
            Duration::ZERO => Instant::NEVER,
            time => self.now + time,
        };
    }

    fn boot_time_is_over(&self) -> bool {
        self.now >= self.boot_deadline
    }

    /// How long it may take to boot.
    #[inline(never)]
    fn boot_end(&self) -> Instant {
        match self.boot_deadline {
            Instant::NEVER => self.now + ATTEMPT,
            deadline => deadline,
        }
    }

    /// A state that time alone does not lead out of.
    #[inline(never)]
    fn enter(&mut self, state: State) {
        self.enter_until(state, Instant::NEVER);
    }

    fn enter_for(&mut self, state: State, time: Duration) {
        self.enter_until(state, self.now + time);
    }

    fn enter_until(&mut self, state: State, until: Instant) {
        self.state = state;
        self.until = until;
    }

    fn identify(&mut self, item: u8) {
        self.enter(State::Identify(Identify { item }));
    }

    /// Sends an NMT command to this node alone.
    #[inline(never)]
    pub(super) fn send(&mut self, command: Command) {
        self.push(Action::Send(
            NodeControl::node(command, self.node.id).frame(),
        ));
    }

    #[inline(never)]
    fn fail(&mut self, status: Status, cause: Cause) {
        self.enter(State::GivenUp(GivenUp));
        if status == Status::B && !self.is(Assignment::MANDATORY) {
            self.until = self.now + ATTEMPT;
        }
        self.tries = 0;
        self.fresh = false;
        // What is tried for ever is told once.
        let told = self.gave_up && self.result.status() == Some(status);
        self.gave_up = true;
        let failure = Failure { status, cause };
        self.result = BootResult::Failed(failure);
        if !told {
            self.report(Event::Failed(self.node.id, failure));
        }
    }

    /// Tells of a step that is done.
    #[inline(never)]
    fn tell(&mut self, step: Step) {
        let node = self.node.id;
        self.report(match step {
            Step::BootUp => Event::BootUp(node),
            Step::Identified => Event::Identified(node),
            Step::Configured => Event::Configured(node),
            Step::Ready => Event::Ready(node),
            Step::LeftRunning => Event::LeftRunning(node),
            Step::NotListed => Event::NotListed(node),
            Step::Operational => Event::Operational(node),
            Step::Lost => Event::NodeLost(node),
            Step::Back => Event::NodeBack(node),
        });
    }

    #[inline(never)]
    fn report(&mut self, event: Event) {
        self.push(Action::Report(event));
    }

    /// Not inlined, here and elsewhere: it is called from everywhere, and flash is
    /// scarcer than time.
    #[inline(never)]
    fn push(&mut self, action: Action) {
        // The outbox holds what one stimulus can cause; it is emptied before
        // the next one.
        let _ = self.outbox.push_back(action);
    }
}

//! A simulated maxon EPOS4 with its motor and load, on a simulated CAN bus.
//!
//! The drive follows the EPOS4's documentation and CiA 301 / CiA 402, never the
//! master's decisions: every frame of every length in every state has the
//! reaction of the data sheet. It is passive: frames and the time go in through
//! [`Drive::on_event`] and [`Drive::advance`], frames come out through
//! [`Drive::offer`], and the result depends only on the configuration and the
//! events, not on how often it is asked.
//!
//! Where the documentation leaves something open the choice is written where it
//! is made.
//!
//! Not modelled: current control (torque is there at once), supply voltage and
//! its speed limit, digital outputs, a change of velocity units under way.

mod axis;
mod bit_rate;
pub mod cia402;
mod clock;
mod config;
mod controller;
mod dictionary;
pub mod errors;
mod exchange;
mod faults;
mod guarding;
mod layer;
mod life;
mod mangle;
pub mod modes;
mod network;
pub mod objects;
mod pdo;
pub mod plant;
mod position;
mod ramp;
mod random;
mod service;
pub mod servo;
mod status;
mod store;
mod supervision;
pub mod test_data;
#[cfg(test)]
mod tests;
pub mod travel;
mod warnings;

pub use config::{DriveConfig, DriveFault, Identity, Spread, Trouble};
pub use mangle::SdoWrong;
pub use plant::PlantState;
pub use status::{DriveStatus, Sample};

use crate::bus::{BitTiming, ErrorState, Event, EventKind, Offer};
use crate::frame::WireFrame;
use crate::time::Time;
use axis::Axis;
use canmaster::lss::LssSlave;
use canmaster::nmt::{Node, Service as NmtService};
use canmaster::{Frame, NodeId};
use clock::Clock;
use controller::{Controller, QueueFull};
use dictionary::Dictionary;
use exchange::Exchange;
use guarding::Guarding;
use life::Life;
use network::Watch;
use random::Random;
use service::SdoService;
use servo::Servo;
use test_data::TestData;
use warnings::Warnings;

/// Microseconds in a second.
const US_PER_S: f64 = 1e6;

/// Something that the drive does at a moment known before.
#[derive(Clone, Debug)]
enum Job {
    /// The supply comes on.
    PowerOn,
    /// The supply fails.
    PowerOff,
    /// The software has started: boot-up.
    Boot,
    /// An SDO request is ready to be served.
    Serve,
    /// The answer to a block of segments is ready.
    Answer(Frame),
    /// A TPDO is ready to be sent.
    Transmit(WireFrame),
    /// LSS switches the bit rate.
    SwitchBitRate,
    /// The silence around it is over.
    SpeakAgain,
    /// The pause after bus-off is over.
    BusOffOver,
    /// A controlword acts, late.
    Control(u16),
    /// The newest controlword acts, late.
    Hesitated,
    /// The mode stays from now on.
    StickMode,
    /// Another load on the shaft, per mille of rated torque.
    Load(i32),
    /// Something blocks the shaft, or lets it go.
    Block(bool),
    /// The power stage goes off in this state.
    DropOut(cia402::State),
    /// An error of the configuration occurs.
    Error { code: u16, lasting: bool },
    /// Its cause is gone.
    CauseGone(u16),
}

#[derive(Clone, Debug)]
struct Planned {
    at: Time,
    job: Job,
    /// Jobs planned before this life of the drive ended are void.
    life: Option<u32>,
}

/// A drive.
#[derive(Clone, Debug)]
pub struct Drive {
    config: DriveConfig,
    clock: Clock,
    cycle: Time,
    now: Time,
    next_cycle: Time,
    agenda: Vec<Planned>,
    random: Random,
    life: Life,
    lives: u32,
    nmt: Node,
    lss: LssSlave,
    guarding: Guarding,
    /// bit/s, in use.
    bit_rate: u32,
    control_delay: Option<Spread>,
    /// A controlword waits in a state that is left slowly.
    hesitates: bool,
    /// State of CiA 402 whose entering was seen.
    watched_state: cia402::State,
    bus_off: bool,
    controller: Controller,
    od: Dictionary,
    axis: Axis,
    service: SdoService,
    exchange: Exchange,
    watch: Watch,
    last_emcy: Option<u16>,
    moved_at: Option<Time>,
    samples: Option<Vec<Sample>>,
    warnings: Option<Warnings>,
}

impl Drive {
    /// A drive before its power-on.
    pub fn new(config: DriveConfig) -> Drive {
        let clock = Clock::new(config.power_on, config.clock_ppm);
        let servo = Servo::new(config.servo, config.plant, config.seed);
        let node = (!config.unconfigured).then_some(config.node);
        let mut od = Dictionary::new(node, config.identity, config.node_guarding);
        od.test_data = config.test_data;
        let mut random = Random::new(config.seed, random::LATENCY);
        // Control cycles of different drives are not in step.
        let phase = clock.span(random.integer(0, 400));
        let mut drive = Drive {
            clock,
            cycle: clock.cycle(),
            now: Time::ZERO,
            next_cycle: phase + clock.cycle(),
            agenda: Vec::new(),
            random,
            life: Life::Off,
            lives: 0,
            nmt: Node::new(config.node),
            lss: layer::slave(config.identity, node),
            guarding: Guarding::default(),
            bit_rate: config.bit_rate,
            control_delay: None,
            hesitates: false,
            watched_state: cia402::State::NotReadyToSwitchOn,
            bus_off: false,
            controller: Controller::default(),
            od,
            axis: Axis::new(servo),
            service: SdoService::new(config.node, config.sdo_block_size),
            exchange: Exchange::default(),
            watch: Watch::new(config.node),
            last_emcy: None,
            moved_at: None,
            samples: None,
            warnings: None,
            config,
        };
        drive.plan_life();
        drive
    }

    /// Its node-ID as configured: its place in the machine.
    pub fn node(&self) -> NodeId {
        self.config.node
    }

    /// How it was described.
    pub fn config(&self) -> &DriveConfig {
        &self.config
    }

    /// What came of the object for tests of a client, if it has one.
    pub fn test_data(&self) -> Option<&TestData> {
        self.od.test_data.as_ref()
    }

    /// Takes in an event of its port. Lets the time up to it pass first.
    pub fn on_event(&mut self, event: &Event) {
        self.advance(event.at);
        if self.timing().is_none() {
            return;
        }
        if let Some(state) = self.controller.on_event(&event.kind) {
            self.on_error_state(state);
        }
        if let EventKind::Rx { frame, .. } = event.kind
            && let Ok(frame) = Frame::try_from(frame)
        {
            self.on_frame(&frame);
        }
        // A frame that has left makes room for the next.
        self.advance(event.at);
    }

    /// What its controller would send next.
    pub fn offer(&self) -> Option<Offer> {
        self.timing()?;
        self.controller.offer()
    }

    /// Its bit timing; `None` while it takes no part in the bus.
    pub fn timing(&self) -> Option<BitTiming> {
        let off = matches!(self.life, Life::Off | Life::Starting) || self.bus_off;
        (!off).then(|| BitTiming::new(self.bit_rate, self.config.clock_ppm))
    }

    /// The next moment at which it may have something new to say.
    pub fn next_deadline(&self) -> Time {
        let planned = self.agenda.iter().map(|p| p.at).min();
        let timer = self.next_timer();
        let cycle = self.watched_cycle().then_some(self.next_cycle);
        [planned, timer, cycle]
            .into_iter()
            .flatten()
            .min()
            .unwrap_or(Time::MAX)
    }

    /// Lets time pass.
    pub fn advance(&mut self, to: Time) {
        loop {
            let job = self.next_job();
            let job_at = job.map_or(Time::MAX, |i| self.agenda[i].at);
            let timer = self.next_timer().unwrap_or(Time::MAX);
            let at = job_at.min(timer).min(self.next_cycle);
            if at > to {
                break;
            }
            self.now = self.now.max(at);
            if at == job_at
                && let Some(i) = job
            {
                let planned = self.agenda.remove(i);
                self.run(planned.job);
            } else if at == timer {
                self.on_timer();
            } else {
                self.next_cycle = at + self.cycle;
                self.control_cycle();
            }
        }
        self.now = self.now.max(to);
    }

    /// The earliest job, the one planned first among equals.
    fn next_job(&mut self) -> Option<usize> {
        let lives = self.lives;
        self.agenda.retain(|p| p.life.is_none_or(|l| l == lives));
        // A heap would be no faster for this handful.
        (0..self.agenda.len()).min_by_key(|&i| self.agenda[i].at)
    }

    /// Plans a job of the present life.
    fn plan(&mut self, at: Time, job: Job) {
        let life = Some(self.lives);
        self.agenda.push(Planned { at, job, life });
    }

    fn run(&mut self, job: Job) {
        match job {
            Job::PowerOn => self.power_on(),
            Job::PowerOff => self.power_off(),
            Job::Boot => self.boot(),
            Job::Serve => self.serve(),
            Job::Answer(frame) => self.transmit(frame),
            Job::Transmit(frame) => self.send_tpdo(frame),
            Job::SwitchBitRate => self.switch_bit_rate(),
            Job::SpeakAgain => self.speak_again(),
            Job::BusOffOver => self.bus_off_over(),
            Job::Control(word) => self.control(word),
            Job::Hesitated => self.hesitated(),
            Job::StickMode => self.axis.stick_mode(),
            Job::Load(permille) => self.axis.set_load(permille.into()),
            Job::Block(blocked) => self.axis.block(blocked),
            Job::DropOut(state) => self.drop_out(state),
            Job::Error { code, lasting } => self.raise(code, lasting),
            Job::CauseGone(code) => self.cause_gone(code),
        }
    }

    fn on_frame(&mut self, frame: &Frame) {
        self.on_layer_frame(frame);
        if self.life != Life::Running {
            return;
        }
        self.on_guard_request(frame);
        self.on_network_frame(frame);
        self.on_process_frame(frame);
        self.on_service_frame(frame);
    }

    /// One control cycle ends now.
    fn control_cycle(&mut self) {
        let (own_s, true_s) = self.clock.cycle_seconds();
        match self.life {
            Life::Off | Life::Starting => self.axis.coast(own_s, true_s),
            _ => {
                let now_s = self.own_seconds();
                let error = self.axis.cycle(&mut self.od, own_s, true_s, now_s);
                if let Some(code) = error {
                    self.raise(code, false);
                }
                self.send_events();
                self.finish_reset();
            }
        }
        self.watch_state();
        self.observe();
    }

    /// Whether a control cycle can make the drive say something by itself.
    fn watched_cycle(&self) -> bool {
        matches!(self.life, Life::Resetting)
            || self.axis.may_fail(&self.od)
            || self.has_troubles()
            || (self.nmt.allows(NmtService::Pdo) && self.exchange.has_events())
    }

    /// The drive's own clock in seconds.
    fn own_seconds(&self) -> f64 {
        self.clock.own(self.now).as_micros() as f64 / US_PER_S
    }

    fn transmit(&mut self, frame: impl Into<WireFrame>) {
        let sent = self.controller.send(frame.into(), self.now);
        self.on_queue(sent);
    }

    fn transmit_latest(&mut self, frame: WireFrame) {
        let sent = self.controller.send_latest(frame, self.now);
        self.on_queue(sent);
    }

    fn on_queue(&mut self, sent: Result<(), QueueFull>) {
        if sent.is_err() {
            self.raise(errors::TRANSMIT_QUEUE, false);
        }
    }

    fn on_error_state(&mut self, state: ErrorState) {
        match state {
            ErrorState::Active | ErrorState::Warning => {}
            ErrorState::Passive => self.connection_lost(errors::ERROR_PASSIVE),
            ErrorState::BusOff => {
                self.controller.clear();
                self.bus_off = true;
                self.connection_lost(errors::BUS_OFF);
                let pause = self.config.bus_off_pause.draw(&mut self.random);
                self.plan(self.now + self.clock.span(pause), Job::BusOffOver);
            }
        }
    }

    fn bus_off_over(&mut self) {
        self.bus_off = false;
    }
}

//! Board, bus and drives together in virtual time, with the person who presses
//! the button.

mod image;
mod operator;
mod program;
mod record;
mod scenario;
mod stimulus;
pub mod trials;
mod watch;

pub use image::{Image, ImageError};
pub use program::{assignment, network, round_trip, traffic};
pub use record::{AxisRecord, Record};
pub use scenario::{Ailment, Scenario};
pub use stimulus::Stimulus;
pub use watch::Startup;

use canmaster::{NodeId, nmt};

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::board::{Board, BoardError, BoardOptions, Stop};
use crate::bus::{BitTiming, Bus, Event, PortId, WireRecord};
use crate::drive::{Drive, DriveConfig, DriveFault, DriveStatus, PlantState, cia402};
use crate::judge::Assignment;
use crate::log::{LogDecoder, LogLine};
use crate::time::Time;
use operator::{Operator, View};
use record::Seen;
use stimulus::Agenda;
use watch::{AxisTruth, Watch};

/// How often the machine is looked at: truth of the plant, log, operator.
const LOOK: Time = Time::from_us(200);
/// The board's only CAN controller in use.
const FDCAN1: usize = 0;
/// After a complaint of the firmware and standstill, how long it may go on to
/// say why.
const LAST_WORDS: Time = Time::from_ms(200);

/// Keeps the board's random numbers apart from everybody else's.
const BOARD_STREAM: u64 = 0x0B0A_4D00;
/// Largest errors of the board's oscillators: of any node's crystal, and what
/// the microcontroller's data sheet gives over its temperature range.
const CRYSTAL_PPM: f64 = 100.0;
const HSI_PERCENT: f64 = 1.0;
const LSI_PERCENT: f64 = 6.0;

/// Told what happens while it happens.
pub trait Observer {
    /// The firmware logged a line.
    fn log(&mut self, at: Time, line: &LogLine);
    /// Called at every look, some thousand times a simulated second.
    fn look(&mut self, world: &World<'_>);
}

/// Nobody looks.
impl Observer for () {
    fn log(&mut self, _: Time, _: &LogLine) {}
    fn look(&mut self, _: &World<'_>) {}
}

/// A drive with its place on the bus.
struct Station {
    drive: Drive,
    port: PortId,
    timing: Option<BitTiming>,
}

/// The machine.
pub struct World<'i> {
    scenario: Scenario,
    assignment: Assignment,
    now: Time,
    next_look: Time,
    board: Board,
    board_port: PortId,
    board_timing: Option<BitTiming>,
    bus: Bus,
    /// In the order of the network; `None`: not on the bus.
    stations: Vec<Option<Station>>,
    ports: Vec<String>,
    agenda: Agenda,
    operator: Operator,
    watch: Watch,
    decoder: LogDecoder<'i>,
    log: Vec<(Time, LogLine)>,
    complained: Option<Time>,
    halted: Option<String>,
    in_motion: Vec<Stimulus>,
    wire: Vec<WireRecord>,
    events: Vec<Event>,
    rtt: Vec<u8>,
    lines: Vec<LogLine>,
}

impl<'i> World<'i> {
    /// Puts the machine together and switches it on.
    pub fn new(image: &'i Image, scenario: Scenario) -> Result<World<'i>, BoardError> {
        let mut bus = Bus::new(scenario.seed);
        let mut ports = vec!["board".to_string()];
        let board_port = bus.attach(&ports[0]);
        let board = Board::new(image.elf(), board_options(scenario.seed))?;
        let mut stations = Vec::new();
        for node in network().nodes {
            let present = !scenario.without.contains(&node.id);
            stations.push(present.then(|| {
                let faults = scenario.faults.get(&node.id).into_iter().flatten().copied();
                let config = DriveConfig::new(node.id, scenario.seed);
                let drive = Drive::new(faults.fold(config, DriveConfig::with));
                ports.push(format!("node {}", node.id.get()));
                let port = bus.attach(&ports[ports.len() - 1]);
                Station {
                    drive,
                    port,
                    timing: None,
                }
            }));
        }
        let assignment = assignment();
        let moves = (0..stations.len())
            .map(|axis| assignment.of_axis(axis).count())
            .collect();
        let mut agenda = Agenda::default();
        for (at, stimulus) in &scenario.stimuli {
            agenda.add(*at, stimulus.clone());
        }
        let operator = if scenario.operated {
            Operator::new(scenario.seed)
        } else {
            Operator::absent()
        };
        Ok(World {
            in_motion: scenario.in_motion.clone(),
            scenario,
            assignment,
            now: Time::ZERO,
            next_look: Time::ZERO,
            board,
            board_port,
            board_timing: None,
            bus,
            stations,
            ports,
            agenda,
            operator,
            watch: Watch::new(moves),
            decoder: image.log_table().decoder(),
            log: Vec::new(),
            complained: None,
            halted: None,
            wire: Vec::new(),
            events: Vec::new(),
            rtt: Vec::new(),
            lines: Vec::new(),
        })
    }

    /// Runs to the end of the scenario, or until the firmware has given up and
    /// everything stands, and judges what was seen.
    pub fn run(mut self, observer: &mut dyn Observer) -> Record {
        while self.now < self.scenario.end && !self.over() {
            self.step(self.scenario.end, observer);
        }
        self.finish()
    }

    /// Runs until `at`.
    pub fn run_until(&mut self, at: Time) {
        while self.now < at {
            self.step(at, &mut ());
        }
    }

    /// Runs until `condition` holds, at most until `limit`. Whether it holds.
    pub fn run_to(&mut self, limit: Time, condition: impl Fn(&Self) -> bool) -> bool {
        while !condition(self) {
            if self.now >= limit {
                return false;
            }
            self.step(limit, &mut ());
        }
        true
    }

    /// Does something to the machine now.
    pub fn apply(&mut self, stimulus: Stimulus) {
        match stimulus {
            Stimulus::Button(pressed) => self.board.set_button(pressed),
            Stimulus::Reset(true) => {
                self.watch.revoke();
                self.decoder.restart();
                self.board.hold_in_reset();
            }
            Stimulus::Reset(false) => self.board.release_reset(),
            Stimulus::BlockIrq { irq, blocked } => self.board.block_irq(irq, blocked),
            Stimulus::DelayIrq { irq, max_cycles } => {
                self.board.delay_irq(irq, max_cycles, self.scenario.seed);
            }
            Stimulus::Silence { node } => self.silence(node),
            Stimulus::Bus(fault) => self.bus.inject(fault),
        }
    }

    /// Does something to the machine later.
    pub fn schedule(&mut self, at: Time, stimulus: Stimulus) {
        self.agenda.add(at, stimulus);
    }

    /// Presses the button with bouncing contacts and lets it go again. In
    /// standby that is a release, in motion a stop.
    pub fn press(&mut self) {
        if self.watch.ready() {
            self.watch.release(self.now);
        } else {
            self.watch.revoke();
        }
        let mut presses = Vec::new();
        self.operator.press(self.now, &mut presses);
        for (at, stimulus) in presses {
            self.agenda.add(at, stimulus);
        }
    }

    /// The present moment.
    pub fn now(&self) -> Time {
        self.now
    }

    /// When the scenario ends.
    pub fn end(&self) -> Time {
        self.scenario.end
    }

    /// All drives are enabled and at rest: a press of the button releases
    /// motion.
    pub fn ready(&self) -> bool {
        self.watch.ready()
    }

    /// No axis moves.
    pub fn at_rest(&self) -> bool {
        self.watch.at_rest()
    }

    /// All axes turn.
    pub fn in_full_motion(&self) -> bool {
        self.truths()
            .flatten()
            .all(|truth| watch::is_full_motion(truth.velocity_rpm))
    }

    /// What is true of each axis; `None`: not on the bus.
    pub fn truths(&self) -> impl Iterator<Item = Option<PlantState>> + '_ {
        self.stations
            .iter()
            .map(|station| station.as_ref().map(|station| station.drive.truth()))
    }

    /// What each drive is in; `None`: not on the bus.
    pub fn statuses(&self) -> impl Iterator<Item = Option<DriveStatus>> + '_ {
        self.stations
            .iter()
            .map(|station| station.as_ref().map(|station| station.drive.status()))
    }

    /// Round trips that were finished, and whether one is going on.
    pub fn round_trips(&self) -> (usize, bool) {
        let done = self
            .watch
            .releases
            .iter()
            .filter(|release| release.done.is_some())
            .count();
        let going_on = self
            .watch
            .releases
            .last()
            .is_some_and(|release| release.done.is_none() && !release.revoked);
        (done, going_on)
    }

    /// What was on the wire so far.
    pub fn wire(&self) -> &[WireRecord] {
        &self.wire
    }

    /// The firmware's log so far.
    pub fn log(&self) -> &[(Time, LogLine)] {
        &self.log
    }

    /// The emulated board.
    pub fn board(&self) -> &Board {
        &self.board
    }

    /// One step of the event loop, at most until `limit`.
    fn step(&mut self, limit: Time, observer: &mut dyn Observer) {
        while let Some(stimulus) = self.agenda.due(self.now) {
            self.apply(stimulus);
        }
        let until = self.next_moment().min(limit).max(self.now);
        let reached = match self.board.run_until(until) {
            Stop::Reached => until,
            // What the board would send has changed: the bus has to know
            // before it goes on.
            Stop::CanChanged => self.board.now().clamp(self.now, until),
            Stop::Fault(report) => {
                self.complained.get_or_insert(self.now);
                self.halted
                    .get_or_insert_with(|| format!("the firmware crashed: {report}"));
                until
            }
        };
        self.now = reached;
        self.offer_board();
        self.advance_bus();
        self.advance_drives();
        if self.now >= self.next_look {
            self.next_look = self.now + LOOK;
            self.look(observer);
        }
    }

    /// When something happens next that is not the board's doing.
    fn next_moment(&self) -> Time {
        let deadlines = self
            .stations
            .iter()
            .flatten()
            .map(|station| station.drive.next_deadline());
        [
            self.bus.next_event(),
            self.agenda.next(),
            Some(self.next_look),
        ]
        .into_iter()
        .flatten()
        .chain(deadlines)
        .min()
        .unwrap_or(self.next_look)
    }

    fn offer_board(&mut self) {
        let timing = self.board.can_timing(FDCAN1);
        if timing != self.board_timing {
            self.board_timing = timing;
            self.bus.set_timing(self.board_port, timing, self.now);
        }
        self.bus
            .offer(self.board_port, self.board.can_offer(FDCAN1));
    }

    fn advance_bus(&mut self) {
        let mut events = std::mem::take(&mut self.events);
        self.bus.advance(self.now, &mut events);
        for event in &events {
            if event.port == self.board_port {
                self.board.can_event(FDCAN1, event);
            } else if let Some(station) = self
                .stations
                .iter_mut()
                .flatten()
                .find(|station| station.port == event.port)
            {
                station.drive.on_event(event);
            }
        }
        if !events.is_empty() {
            self.offer_board();
        }
        events.clear();
        self.events = events;
    }

    fn advance_drives(&mut self) {
        for station in self.stations.iter_mut().flatten() {
            if station.drive.next_deadline() <= self.now {
                station.drive.advance(self.now);
            }
            let timing = station.drive.timing();
            if timing != station.timing {
                station.timing = timing;
                self.bus.set_timing(station.port, timing, self.now);
            }
            self.bus.offer(station.port, station.drive.offer());
        }
    }

    fn look(&mut self, observer: &mut dyn Observer) {
        self.wire.extend(self.bus.take_records());
        self.read_log(observer);
        for station in self.stations.iter_mut().flatten() {
            // Control cycles that nobody waits for have not been worked out yet.
            station.drive.advance(self.now);
        }
        let truth: Vec<Option<AxisTruth>> = self
            .stations
            .iter()
            .map(|station| station.as_ref().map(|station| axis_truth(&station.drive)))
            .collect();
        if self.watch.sample(self.now, &truth) {
            self.operator.trip_done();
        }
        if self.watch.full_motion() {
            for stimulus in std::mem::take(&mut self.in_motion) {
                self.apply(stimulus);
            }
        }
        self.operate();
        observer.look(self);
    }

    fn read_log(&mut self, observer: &mut dyn Observer) {
        self.rtt.clear();
        self.board.drain_rtt(&mut self.rtt);
        self.decoder.decode(&self.rtt, &mut self.lines);
        for line in self.lines.drain(..) {
            observer.log(self.now, &line);
            if line.level == Some(crate::log::Level::Error) && self.complained.is_none() {
                self.complained = Some(self.now);
                self.watch.revoke();
            }
            self.log.push((self.now, line));
        }
    }

    fn operate(&mut self) {
        let view = View {
            now: self.now,
            ready: self.watch.ready(),
            round_trip: self.watch.round_trip().or_else(round_trip),
            end: self.scenario.end,
        };
        let mut presses = Vec::new();
        if self.operator.look(view, &mut presses) {
            self.watch.release(self.now);
        }
        for (at, stimulus) in presses {
            self.agenda.add(at, stimulus);
        }
    }

    fn silence(&mut self, node: NodeId) {
        let at = self.now;
        let station = network()
            .find(node)
            .and_then(|(axis, _)| self.stations[axis].as_mut());
        if let Some(station) = station {
            station.drive.inject(DriveFault::HeartbeatLost { at });
            station.drive.inject(DriveFault::TpdosLost { at });
            station.drive.inject(DriveFault::SdoDead { at });
        }
    }

    /// Nothing more is to be expected.
    fn over(&self) -> bool {
        self.complained
            .is_some_and(|since| self.now >= since + LAST_WORDS)
            && self.watch.at_rest()
    }

    /// Ends the run and judges it.
    pub fn finish(mut self) -> Record {
        self.wire.extend(self.bus.take_records());
        let unfinished = self.unfinished();
        let complaints = self
            .halted
            .iter()
            .cloned()
            .chain(self.board.diagnostics().iter().map(ToString::to_string))
            .collect();
        let axes = network()
            .nodes
            .iter()
            .zip(self.stations.iter().zip(self.watch.axes))
            .map(|(node, (station, motion))| AxisRecord {
                node: node.id,
                status: station.as_ref().map(|station| station.drive.status()),
                motion,
            })
            .collect();
        Seen {
            seed: self.scenario.seed,
            simulated: self.now,
            ports: self.ports,
            wire: self.wire,
            log: self.log,
            axes,
            releases: self.watch.releases,
            startup: self.watch.startup,
            board: self.board.stats(),
            complaints,
            unfinished,
        }
        .judge(&self.assignment, &traffic())
    }

    /// Why there was no (further) round trip, for a person.
    fn unfinished(&self) -> String {
        let simulated = self.now;
        match (self.watch.startup.enabled, self.watch.releases.is_empty()) {
            (None, _) => format!("not all drives were enabled by {simulated} s"),
            (Some(enabled), true) => format!(
                "no whole round trip fits: all drives were enabled at {enabled} s, a round trip \
                 takes {} s, and the run ended at {simulated} s; give it more with --seconds",
                round_trip().unwrap_or(Time::ZERO)
            ),
            (Some(_), false) => format!("a round trip was still going on at {simulated} s"),
        }
    }
}

/// The board that `seed` describes: its oscillators are a little off.
fn board_options(seed: u64) -> BoardOptions {
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ BOARD_STREAM);
    BoardOptions {
        clock_error_ppm: random.random_range(-CRYSTAL_PPM..=CRYSTAL_PPM),
        hsi_error_percent: random.random_range(-HSI_PERCENT..=HSI_PERCENT),
        lsi_error_percent: random.random_range(-LSI_PERCENT..=LSI_PERCENT),
        ..BoardOptions::default()
    }
}

/// The drive has sent its boot-up.
pub fn booted(status: &DriveStatus) -> bool {
    status.nmt != nmt::State::Initialising
}

/// The drive is in NMT operational.
pub fn operational(status: &DriveStatus) -> bool {
    status.nmt == nmt::State::Operational
}

/// The drive is in operation enabled.
pub fn enabled(status: &DriveStatus) -> bool {
    status.state == cia402::State::OperationEnabled
}

fn axis_truth(drive: &Drive) -> AxisTruth {
    let truth = drive.truth();
    let status = drive.status();
    AxisTruth {
        position: truth.position_inc,
        velocity: truth.velocity_rpm,
        operational: operational(&status),
        enabled: enabled(&status),
    }
}

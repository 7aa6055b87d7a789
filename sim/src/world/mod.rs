//! Board, bus and drives together in virtual time, with the person who presses
//! the button.

mod bench;
mod client;
mod guest;
mod image;
pub mod library;
mod line;
mod machine;
mod operator;
mod orders;
mod record;
mod scenario;
mod station;
mod steps;
mod stimulus;
pub mod strike;
mod tool;
pub mod trials;
mod watch;

pub use client::Client;
pub use image::{Image, ImageError};
pub use machine::{Machine, MachineError, Segment, sample};
pub use record::{AxisRecord, BusRecord, Record};
pub use scenario::{Ailment, Scenario};
pub use stimulus::Stimulus;
pub use watch::{AxisState, Startup};

use canmaster::nmt;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::board::{Board, BoardError, BoardOptions, ResetCause};
use crate::bridge::Bridge;
use crate::bus::Event;
use crate::drive::{DriveConfig, DriveStatus, cia402};
use crate::judge::Assignment;
use crate::log::{LogDecoder, LogLine};
use crate::time::Time;
use line::{Line, Who};
use operator::Operator;
use orders::Orders;
use record::Seen;
use station::Station;
use stimulus::Agenda;
use watch::Watch;

/// The bus that is meant where none is named.
const FIRST: usize = 0;
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
    /// Whether the run is to end now.
    fn stop(&self) -> bool {
        false
    }
}

/// Nobody looks.
impl Observer for () {
    fn log(&mut self, _: Time, _: &LogLine) {}
    fn look(&mut self, _: &World<'_>) {}
}

/// The machine.
pub struct World<'i> {
    scenario: Scenario,
    machine: &'i Machine,
    assignment: Assignment,
    now: Time,
    next_look: Time,
    board: Board,
    /// In the order of the machine's buses.
    lines: Vec<Line>,
    /// In the order of the network; `None`: not on the bus.
    stations: Vec<Option<Station>>,
    /// Drives that the network does not name.
    strangers: Vec<Station>,
    bridge: Option<Bridge>,
    guest: Option<guest::Guest>,
    agenda: Agenda,
    operator: Operator,
    orders: Orders,
    watch: Watch,
    decoder: LogDecoder<'i>,
    log: Vec<(Time, LogLine)>,
    complained: Option<Time>,
    halted: Option<String>,
    in_motion: Vec<Stimulus>,
    /// What was done to the machine, for a picture.
    marks: Vec<(Time, String)>,
    events: Vec<Event>,
    rtt: Vec<u8>,
    told: Vec<LogLine>,
}

impl<'i> World<'i> {
    /// Puts the machine together and switches it on.
    pub fn new(image: &'i Image, scenario: Scenario) -> Result<World<'i>, BoardError> {
        let board = Board::new(image.elf(), board_options(&scenario))?;
        let machine = image.machine();
        let segments = machine.segments().iter().enumerate();
        let mut lines: Vec<Line> = segments
            .map(|(number, segment)| Line::new(segment, number, scenario.seed))
            .collect();
        let mut connect = |config: DriveConfig, line: usize, who: Who| {
            let name = format!("node {}", config.node.get());
            let port = lines[line].attach(name, who);
            Station::new(config, line, port)
        };
        let mut stations = Vec::new();
        for (axis, config) in station::machine(machine, &scenario).into_iter().enumerate() {
            let line = machine.segment_of(axis);
            stations.push(config.map(|config| connect(config, line, Who::Axis(axis))));
        }
        let mut strangers = Vec::new();
        for (number, config) in scenario.strangers.iter().cloned().enumerate() {
            let bit_rate = machine.segments()[FIRST].bit_rate;
            let config = DriveConfig { bit_rate, ..config };
            strangers.push(connect(config, FIRST, Who::Stranger(number)));
        }
        let assignment = machine.assignment();
        let moves = (0..stations.len())
            .map(|axis| assignment.of_axis(axis).collect())
            .collect();
        let watch = Watch::new(moves).at_least(assignment.least);
        let watch = watch.with_torque(assignment.torque);
        let mut agenda = Agenda::default();
        for (at, stimulus) in &scenario.stimuli {
            agenda.add(*at, stimulus.clone());
        }
        let operator = match (scenario.operated, scenario.restless) {
            (false, _) => Operator::absent(),
            (true, false) => Operator::new(scenario.seed),
            (true, true) => Operator::restless(scenario.seed),
        };
        Ok(World {
            in_motion: scenario.in_motion.clone(),
            scenario,
            machine,
            assignment,
            now: Time::ZERO,
            next_look: Time::ZERO,
            board,
            lines,
            stations,
            strangers,
            bridge: None,
            guest: None,
            agenda,
            operator,
            orders: Orders::new(machine.network().master.node),
            watch,
            decoder: image.log_table().decoder(),
            log: Vec::new(),
            complained: None,
            halted: None,
            marks: Vec::new(),
            events: Vec::new(),
            rtt: Vec::new(),
            told: Vec::new(),
        })
    }

    /// The same with a bridge for other tools on the first bus. Such a run does
    /// not end before its time when the firmware gives up.
    pub fn with_bridge(mut self, mut bridge: Bridge) -> World<'i> {
        let line = &mut self.lines[FIRST];
        for name in bridge.attach(&mut line.bus) {
            line.note(name, Who::Tool);
        }
        self.bridge = Some(bridge);
        self
    }

    /// Runs to the end of the scenario, until the observer stops it, or until
    /// the firmware has given up and everything stands, and judges what was
    /// seen.
    pub fn run(mut self, observer: &mut dyn Observer) -> Record {
        while self.now < self.scenario.end && !self.over() && !observer.stop() {
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

    /// Ends the run and judges it.
    pub fn finish(mut self) -> Record {
        self.lines.iter_mut().for_each(Line::read);
        let unfinished = self.unfinished();
        let complaints = self.complaints();
        let axes = self
            .machine
            .network()
            .nodes
            .iter()
            .zip(self.stations.iter().zip(self.watch.axes))
            .zip(self.watch.states)
            .map(|((node, (station, motion)), states)| AxisRecord {
                node: node.id,
                status: station.as_ref().map(|station| station.drive.status()),
                motion,
                states,
            })
            .collect();
        Seen {
            seed: self.scenario.seed,
            simulated: self.now,
            machine: self.machine.clone(),
            lines: self.lines,
            log: self.log,
            axes,
            releases: self.watch.releases,
            startup: self.watch.startup,
            marks: self.marks,
            board: self.board.stats(),
            complaints,
            unfinished,
        }
        .judge(&self.assignment)
    }

    /// What the board has noticed: crashes, resets that nobody ordered, wrong
    /// use of its registers.
    fn complaints(&self) -> Vec<String> {
        let resets = self.board.stats().resets;
        let ordered = [ResetCause::PowerOn, ResetCause::Pin];
        let resets = resets
            .iter()
            .filter(|reset| !ordered.contains(&reset.cause))
            .map(|reset| {
                let cause = match reset.cause {
                    ResetCause::Watchdog => "the watchdog: a task hung, or the program crashed",
                    _ => "the program itself",
                };
                format!("the board was reset at {} s by {cause}", reset.at)
            });
        let diagnostics = self.board.diagnostics().iter().map(ToString::to_string);
        self.halted
            .iter()
            .cloned()
            .chain(resets)
            .chain(diagnostics)
            .collect()
    }

    /// Why there was no (further) round trip, for a person.
    fn unfinished(&self) -> String {
        let simulated = self.now;
        match (self.watch.startup.enabled, self.watch.releases.is_empty()) {
            (None, _) => format!("not all drives were enabled by {simulated} s"),
            (Some(enabled), true) => format!(
                "no whole round trip fits: all drives were enabled at {enabled} s, a round trip \
                 takes {} s, and the run ended at {simulated} s; give it more with --seconds",
                self.machine.round_trip().unwrap_or(Time::ZERO)
            ),
            (Some(_), false) => format!("a round trip was still going on at {simulated} s"),
        }
    }
}

/// The board that the seed describes: its oscillators are a little off.
fn board_options(scenario: &Scenario) -> BoardOptions {
    let mut random = Pcg64Mcg::seed_from_u64(scenario.seed ^ BOARD_STREAM);
    BoardOptions {
        clock_error_ppm: random.random_range(-CRYSTAL_PPM..=CRYSTAL_PPM),
        hsi_error_percent: random.random_range(-HSI_PERCENT..=HSI_PERCENT),
        lsi_error_percent: random.random_range(-LSI_PERCENT..=LSI_PERCENT),
        flash: scenario.flash.clone(),
        ..BoardOptions::default()
    }
}

/// The drive has a node-ID and has booted with it.
pub fn has_node_id(status: &DriveStatus) -> bool {
    status.node_id.is_some()
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

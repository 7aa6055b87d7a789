//! The scenarios, what must hold in each, and how the drives are.

use std::path::PathBuf;

use canmaster_sim::drive::{DriveConfig, DriveFault, Spread};
use canmaster_sim::time::Time;
use canmaster_sim::world::{Machine, Scenario};

use crate::cargo;

/// Where the descriptions are.
const FOLDER: &str = "networks";
/// From SYNC to the TPDOs, microseconds.
const TPDO_DELAY: Spread = Spread::new(50, 250);
/// From an SDO request to its answer.
const ANSWER_2MS: Spread = Spread::new(200, 1_000);
const ANSWER_1MS: Spread = Spread::new(200, 500);
/// That of one drive of the disturbed scenario.
const SLOW_ANSWER: Spread = Spread::fixed(15_000);
/// From a SYNC to a warning, and from the next to its end.
const WARNING_DELAY: Spread = Spread::new(0, 1_900);

/// The longest frame of eight bytes, and what else a SYNC may be late, in
/// microseconds at 1 Mbit/s.
const ONE_FRAME_LATE_US: f64 = 135.0 + JITTER_US;
const JITTER_US: f64 = 2.0;
const SKEW_US: f64 = 2.0;
/// From the timer's event to the transmit request of a SYNC, and where there are three
/// buses to the last of them.
const REQUEST_CYCLES: u64 = 170;
const LAST_OF_THREE_CYCLES: u64 = 260;
/// Beyond the interframe space.
const BURST_GAP_BITS: f64 = 3.0;
/// One exchange in ten cycles of 2 ms, one in twenty of 1 ms and bus.
const EXCHANGES_PER_S: f64 = 50.0;
const LOAD: f64 = 0.9;

/// What must hold. `None`: nothing is asked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limits {
    pub(super) load: Option<f64>,
    pub(super) jitter_us: f64,
    pub(super) skew_us: f64,
    pub(super) cpu_load: Option<f64>,
    pub(super) first_request_cycles: u64,
    pub(super) last_request_cycles: u64,
    pub(super) burst_gap_bits: f64,
    pub(super) exchanges_per_s: Option<f64>,
}

const QUIET: Limits = Limits {
    load: None,
    jitter_us: JITTER_US,
    skew_us: SKEW_US,
    cpu_load: Some(0.15),
    first_request_cycles: REQUEST_CYCLES,
    last_request_cycles: REQUEST_CYCLES,
    burst_gap_bits: BURST_GAP_BITS,
    exchanges_per_s: Some(EXCHANGES_PER_S),
};

/// One scenario.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Case {
    /// Its name, and that of its description.
    pub(crate) name: &'static str,
    tuned: fn(DriveConfig) -> DriveConfig,
    /// Warnings, a slow drive, and somebody who reads the board's dictionary.
    pub(super) disturbed: bool,
    /// The board is asked what it measures of itself: by frames that have no place in
    /// the layout of a cycle, so that it must have some room to spare.
    pub(super) asked: bool,
    pub(super) limits: Limits,
}

/// All of them.
pub(crate) const CASES: [Case; 4] = [
    Case {
        name: "one_bus_2ms",
        tuned: |config| answering(config, ANSWER_2MS),
        disturbed: false,
        asked: true,
        limits: Limits {
            load: Some(LOAD),
            cpu_load: Some(0.05),
            ..QUIET
        },
    },
    Case {
        name: "two_bus_1ms",
        tuned: |config| answering(config, ANSWER_1MS),
        disturbed: false,
        asked: true,
        limits: QUIET,
    },
    Case {
        name: "three_bus_1ms_full",
        tuned: |config| answering(config, ANSWER_1MS),
        disturbed: false,
        asked: true,
        limits: Limits {
            last_request_cycles: LAST_OF_THREE_CYCLES,
            ..QUIET
        },
    },
    Case {
        name: "one_bus_2ms_disturbed",
        tuned: |config| answering(config, ANSWER_2MS),
        disturbed: true,
        asked: true,
        limits: Limits {
            jitter_us: ONE_FRAME_LATE_US,
            cpu_load: None,
            exchanges_per_s: None,
            ..QUIET
        },
    },
];

/// What the search for the smallest cycle asks: load and SDO are no matter.
pub(crate) const SEARCHED: Case = Case {
    name: "search",
    tuned: |config| answering(config, ANSWER_1MS),
    disturbed: false,
    asked: false,
    limits: Limits {
        cpu_load: None,
        exchanges_per_s: None,
        ..QUIET
    },
};

fn answering(config: DriveConfig, sdo_latency: Spread) -> DriveConfig {
    DriveConfig {
        sdo_latency,
        tpdo_delay: TPDO_DELAY,
        ..config
    }
}

impl Case {
    /// Its description.
    pub(in crate::bench) fn path(&self) -> PathBuf {
        let file = format!("{}.toml", self.name);
        cargo::workspace().join(FOLDER).join(file)
    }

    /// What is simulated: motion all the time.
    pub(in crate::bench) fn scenario(&self, machine: &Machine, seed: u64) -> Scenario {
        let scenario = Scenario::new(seed, Time::MAX);
        let scenario = scenario.restless().tuned(self.tuned);
        if !self.disturbed {
            return scenario;
        }
        let nodes = machine.network().nodes;
        let every = nodes.len() as u32;
        // In each cycle one drive warns, and the one before takes it back.
        let warned = nodes
            .iter()
            .zip(0..)
            .fold(scenario, |scenario, (node, turn)| {
                let delay = WARNING_DELAY;
                scenario.fault(node.id, DriveFault::Warnings { every, turn, delay })
            });
        match nodes.last() {
            Some(slow) => warned.fault(slow.id, DriveFault::SdoLatency(SLOW_ANSWER)),
            None => warned,
        }
    }
}

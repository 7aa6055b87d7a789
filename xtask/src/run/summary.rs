//! A run in figures: the table, and the JSON object that says the same.

use std::time::Duration;

use canmaster_sim::board::irqs;
use canmaster_sim::drive::cia402::State;
use canmaster_sim::judge::BusFigures;
use canmaster_sim::time::Time;
use canmaster_sim::world::{AxisRecord, BusRecord, Record};
use serde::Serialize;

use crate::image::ImageSize;
use crate::table;

/// See the module. The names are the JSON object's.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Summary {
    pub(crate) result: String,
    pub(crate) reason: String,
    pub(crate) seed: u64,
    pub(crate) simulated_s: f64,
    pub(crate) wall_s: f64,
    pub(crate) sync: Sync,
    pub(crate) bus: Bus,
    /// Each bus, where there are several.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    buses: Vec<OneBus>,
    pub(crate) cpu: Cpu,
    image: Image,
    pub(crate) startup: Startup,
    drives: Vec<Drive>,
    pub(crate) arrivals: Vec<Arrival>,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Sync {
    period_us: f64,
    count: usize,
    pub(crate) jitter_pp_us: f64,
    pub(crate) missed: usize,
    /// Between the buses, where there are several.
    #[serde(skip_serializing_if = "Option::is_none")]
    skew_us: Option<f64>,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Bus {
    bitrate: u32,
    load_mean: f64,
    pub(crate) load_max: f64,
    frames: usize,
    pub(crate) error_frames: usize,
}

/// A bus among several.
#[derive(Clone, Debug, Serialize)]
struct OneBus {
    name: String,
    sync: Sync,
    #[serde(flatten)]
    bus: Bus,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Cpu {
    pub(crate) load_mean: f64,
    pub(crate) sync_isr_worst_cycles: u64,
    pub(crate) irq_off_max_cycles: u64,
    pub(crate) stack_high_water_bytes: u32,
}

#[derive(Clone, Debug, Serialize)]
struct Image {
    flash_bytes: u64,
    ram_bytes: u64,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Startup {
    boot_to_operational_ms: Option<f64>,
    pub(crate) boot_to_enabled_ms: Option<f64>,
    /// The search for drives without node-ID, if there was one.
    lss: Option<Lss>,
}

#[derive(Clone, Debug, Serialize)]
struct Lss {
    from_ms: f64,
    to_ms: f64,
    requests: usize,
    answers: usize,
    node_ids: usize,
}

#[derive(Clone, Debug, Serialize)]
struct Drive {
    node: u8,
    state: String,
    target: Option<i32>,
    position: Option<i64>,
    /// The worst of all its arrivals.
    error: Option<i64>,
    stopped_at_us: Option<u64>,
    /// The last error code that the drive sent; 0 = none.
    emcy: u16,
    travelled: u64,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Arrival {
    node: u8,
    target: i32,
    pub(crate) error: i64,
    stopped_at_us: u64,
}

impl Summary {
    pub(crate) fn new(record: &Record, image: &ImageSize, wall: Duration) -> Summary {
        let ms = |at: Option<Time>| at.map(|at| rounded(at.as_us_f64() / 1000.0, 3));
        Summary {
            result: record.verdict.outcome.to_string(),
            reason: record.verdict.reason.clone(),
            seed: record.seed,
            simulated_s: rounded(record.simulated.as_secs_f64(), 6),
            wall_s: rounded(wall.as_secs_f64(), 3),
            sync: Sync {
                skew_us: (record.buses.len() > 1).then(|| rounded(record.skew_us, 3)),
                ..Sync::of(&record.bus)
            },
            bus: Bus::of(&record.bus, record.machine.network().bit_rate),
            buses: buses(record),
            cpu: cpu(record),
            image: Image {
                flash_bytes: image.flash_bytes,
                ram_bytes: image.ram_bytes,
            },
            startup: Startup {
                boot_to_operational_ms: ms(record.startup.operational),
                boot_to_enabled_ms: ms(record.startup.enabled),
                lss: record.lss.map(|lss| Lss {
                    from_ms: rounded(lss.from.as_us_f64() / 1000.0, 3),
                    to_ms: rounded(lss.to.as_us_f64() / 1000.0, 3),
                    requests: lss.requests,
                    answers: lss.answers,
                    node_ids: lss.node_ids,
                }),
            },
            drives: record
                .axes
                .iter()
                .enumerate()
                .map(|(axis, of_axis)| drive(record, axis, of_axis))
                .collect(),
            arrivals: record
                .arrivals
                .iter()
                .map(|arrival| Arrival {
                    node: arrival.node.get(),
                    target: arrival.target,
                    error: arrival.error,
                    stopped_at_us: arrival.stopped.as_us(),
                })
                .collect(),
        }
    }

    /// What stands over the columns of [`drive_rows`](Self::drive_rows).
    pub(crate) const DRIVE_HEADING: [&str; 8] = [
        "node",
        "state",
        "target",
        "position",
        "error",
        "stopped [s]",
        "travelled",
        "EMCY",
    ];

    /// A row for each drive.
    pub(crate) fn drive_rows(&self) -> Vec<Vec<String>> {
        fn or_dash<T: ToString>(value: Option<T>) -> String {
            value.map_or_else(|| "-".into(), |value| value.to_string())
        }
        self.drives
            .iter()
            .map(|drive| {
                vec![
                    drive.node.to_string(),
                    drive.state.clone(),
                    or_dash(drive.target),
                    or_dash(drive.position),
                    or_dash(drive.error),
                    or_dash(drive.stopped_at_us.map(Time::from_us)),
                    drive.travelled.to_string(),
                    if drive.emcy == 0 {
                        "none".into()
                    } else {
                        format!("{:04X}h", drive.emcy)
                    },
                ]
            })
            .collect()
    }

    /// The figures of the machine as a whole.
    pub(crate) fn facts(&self) -> Vec<(&'static str, String)> {
        let ms =
            |value: Option<f64>| value.map_or_else(|| "never".into(), |ms| format!("{ms:.1} ms"));
        let mut facts = vec![
            (
                "result",
                format!("{} {}", self.result, self.reason)
                    .trim()
                    .to_string(),
            ),
            ("seed", self.seed.to_string()),
            ("simulated", self.speed()),
            ("SYNC", self.sync.words()),
            ("bus", self.bus.words()),
            ("CPU", self.cpu.words()),
            (
                "image",
                format!(
                    "{} bytes of flash, {} bytes of RAM",
                    self.image.flash_bytes, self.image.ram_bytes
                ),
            ),
            (
                "from power-on",
                format!(
                    "all operational after {}, all enabled after {}",
                    ms(self.startup.boot_to_operational_ms),
                    ms(self.startup.boot_to_enabled_ms)
                ),
            ),
        ];
        for one in &self.buses {
            let words = format!("{}: {}; {}", one.name, one.sync.words(), one.bus.words());
            facts.push(("bus", words));
        }
        if let Some(lss) = &self.startup.lss {
            facts.push(("LSS", lss.words()));
        }
        facts
    }

    fn speed(&self) -> String {
        let times = self.simulated_s / self.wall_s.max(f64::MIN_POSITIVE);
        format!(
            "{:.2} s in {:.2} s: {times:.1} times real time",
            self.simulated_s, self.wall_s
        )
    }

    /// For a terminal.
    pub(crate) fn as_table(&self) -> String {
        let mut drives = table::new(&Summary::DRIVE_HEADING);
        table::align_right(&mut drives, &[0, 2, 3, 4, 5, 6]);
        for row in self.drive_rows() {
            drives.add_row(row);
        }
        format!("{drives}\n{}", table::facts(&self.facts()))
    }
}

impl Lss {
    fn words(&self) -> String {
        format!(
            "{} node-IDs given, from {:.1} ms to {:.1} ms: {} requests, {} answers",
            self.node_ids, self.from_ms, self.to_ms, self.requests, self.answers
        )
    }
}

impl Sync {
    fn of(bus: &BusFigures) -> Sync {
        Sync {
            period_us: rounded(bus.sync_period_us, 3),
            count: bus.sync_count,
            jitter_pp_us: rounded(bus.jitter_pp_us, 3),
            missed: bus.missed,
            skew_us: None,
        }
    }

    fn words(&self) -> String {
        let skew = self.skew_us.map(|us| format!(", skew {us:.2} us"));
        format!(
            "{} frames, period {:.3} us, jitter {:.2} us peak to peak{}, {} missed",
            self.count,
            self.period_us,
            self.jitter_pp_us,
            skew.unwrap_or_default(),
            self.missed
        )
    }
}

/// Each bus; none where there is only one, which is the whole.
fn buses(record: &Record) -> Vec<OneBus> {
    if record.buses.len() == 1 {
        return Vec::new();
    }
    let one = |bus: &BusRecord| OneBus {
        name: bus.name.clone(),
        sync: Sync::of(&bus.figures),
        bus: Bus::of(&bus.figures, bus.bit_rate),
    };
    record.buses.iter().map(one).collect()
}

impl Bus {
    fn of(bus: &BusFigures, bitrate: u32) -> Bus {
        Bus {
            bitrate,
            load_mean: rounded(bus.load_mean, 5),
            load_max: rounded(bus.load_max, 5),
            frames: bus.frames,
            error_frames: bus.error_frames,
        }
    }

    fn words(&self) -> String {
        format!(
            "{} bit/s, load {} mean, {} worst cycle; {} frames, {} error frames",
            self.bitrate,
            percent(self.load_mean),
            percent(self.load_max),
            self.frames,
            self.error_frames
        )
    }
}

impl Cpu {
    fn words(&self) -> String {
        format!(
            "load {}; worst sync_tick {} cycles; interrupts off for {} cycles at most; stack {} \
             bytes deep",
            percent(self.load_mean),
            self.sync_isr_worst_cycles,
            self.irq_off_max_cycles,
            self.stack_high_water_bytes
        )
    }
}

fn cpu(record: &Record) -> Cpu {
    let board = &record.board;
    Cpu {
        load_mean: rounded(board.cpu_load(), 5),
        sync_isr_worst_cycles: board.irq(irqs::TIM2).map_or(0, |irq| irq.worst_cycles),
        irq_off_max_cycles: board.irq_off_max_cycles,
        stack_high_water_bytes: board.stack_high_water_bytes,
    }
}

fn drive(record: &Record, axis: usize, of_axis: &AxisRecord) -> Drive {
    let arrivals = || {
        record
            .arrivals
            .iter()
            .filter(|arrival| arrival.axis == axis)
    };
    Drive {
        node: of_axis.node.get(),
        state: of_axis
            .status
            .as_ref()
            .map_or("missing", |status| words(status.state))
            .into(),
        target: arrivals().next_back().map(|arrival| arrival.target),
        position: of_axis
            .motion
            .last()
            .map(|point| point.position.round() as i64),
        error: arrivals().map(|arrival| arrival.error).max(),
        stopped_at_us: of_axis.motion.stopped().map(Time::as_us),
        emcy: of_axis
            .status
            .as_ref()
            .and_then(|status| status.last_emcy)
            .unwrap_or(0),
        travelled: of_axis.motion.travelled().round() as u64,
    }
}

/// The state as CiA 402 spells it.
fn words(state: State) -> &'static str {
    match state {
        State::NotReadyToSwitchOn => "not ready to switch on",
        State::SwitchOnDisabled => "switch on disabled",
        State::ReadyToSwitchOn => "ready to switch on",
        State::SwitchedOn => "switched on",
        State::OperationEnabled => "operation enabled",
        State::QuickStopActive => "quick stop active",
        State::FaultReactionActive => "fault reaction active",
        State::Fault => "fault",
    }
}

fn percent(share: f64) -> String {
    format!("{:.2} %", share * 100.0)
}

fn rounded(value: f64, digits: i32) -> f64 {
    let scale = 10_f64.powi(digits);
    (value * scale).round() / scale
}

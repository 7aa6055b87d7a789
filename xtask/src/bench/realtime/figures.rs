//! The figures of a scenario, and whether they reach its limits.

use canmaster_sim::board::BoardStats;
use canmaster_sim::bus::WireRecord;
use canmaster_sim::judge::bus::{judge_running, syncs};
use canmaster_sim::judge::skew::skew_us;
use canmaster_sim::judge::{BusFigures, Outcome, RealTime, realtime};
use canmaster_sim::time::Time;
use canmaster_sim::world::{BusRecord, Record};
use serde::Serialize;

use super::case::{Case, Limits};
use super::own::Own;
use super::session::Span;

/// The board's crystal is no farther from its frequency, and the SYNCs no farther from
/// their cycle but for what one of them may be late.
const DRIFT_PPM: f64 = 101.0;
/// While a frame is handed to a controller.
const HELD_CYCLES: f64 = 40.0;

/// The names are the JSON object's.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Figures {
    pub(crate) name: &'static str,
    cycle_us: u32,
    missed: usize,
    overruns: u64,
    pub(crate) jitter_pp_us: f64,
    /// How many SYNCs were so late, by whole microseconds.
    jitter_histogram: Vec<usize>,
    /// SYNCs that were late without a frame in their way, or came twice.
    late_unexplained: usize,
    /// Late ones one behind the other, each by a frame of its own.
    late_in_a_row: usize,
    /// Of the SYNCs' grid from the cycle.
    drift_ppm: f64,
    skew_us: f64,
    pub(crate) load_max: f64,
    pub(crate) cpu_load: f64,
    sync_isr_worst_cycles: u64,
    /// To the first transmit request, where there are several buses.
    sync_isr_first_cycles: u64,
    irq_off_max_cycles: u64,
    /// How long a transmit request holds SYNC back: put index read, buffer filled,
    /// requested.
    sync_held_max_cycles: u64,
    burst_gap_max_bits: f64,
    /// On the bus that had the fewest.
    sdo_exchanges_per_s: f64,
    /// SYNC and the PDOs of every cycle at worst, on the fullest bus.
    wire_bound_us: u32,
    pub(crate) stack_high_water_bytes: u32,
    /// Before that time.
    #[serde(skip)]
    pub(crate) missed_before: usize,
    /// What the board says of itself, if it was asked.
    own: Option<Own>,
    seeds: u64,
    simulated_s: f64,
    wall_s: f64,
    /// Simulated over wall.
    speed: f64,
    /// Objects of the board that somebody else has read meanwhile.
    outside_transfers: usize,
    /// What went wrong, apart from limits that were missed.
    failures: Vec<String>,
}

/// What a run leaves behind, and since when it is looked at.
pub(super) struct Measured {
    pub(super) record: Record,
    pub(super) span: Span,
    /// Of the board, in that span.
    pub(super) stats: BoardStats,
    pub(super) own: Option<Own>,
    /// See [`Figures`].
    pub(super) wire_bound_us: u32,
    pub(super) wall_s: f64,
    pub(super) outside_transfers: usize,
    /// Refused transfers of the outside client.
    pub(super) refused: Vec<String>,
}

/// What began between two moments.
pub(in crate::bench) fn between(wire: &[WireRecord], from: Time, to: Time) -> &[WireRecord] {
    let place = |at: Time| wire.partition_point(|record| record.sof < at);
    wire.get(place(from)..place(to)).unwrap_or_default()
}

/// One bus between two moments.
fn of_bus(bus: &BusRecord, measured: &Measured, index: usize) -> (BusFigures, RealTime) {
    let Span { from, to, .. } = measured.span;
    let records = between(&bus.wire, from, to);
    let machine = &measured.record.machine;
    let segment = &machine.segments()[index];
    let traffic = machine.traffic(segment);
    (
        judge_running(records, &traffic, to),
        realtime::judge(records, &traffic, &segment.bursts, bus.board),
    )
}

/// How far the SYNCs of one cycle are apart in the time that is looked at: while the
/// nodes boot, their heartbeats may be in the way of one bus's.
fn skew(measured: &Measured) -> f64 {
    let seen = measured.span.from..measured.span.to;
    let of_bus = |bus: &BusRecord| -> Vec<Time> {
        let all = syncs(&bus.wire).into_iter();
        all.filter(|at| seen.contains(at)).collect()
    };
    let buses: Vec<_> = measured.record.buses.iter().map(of_bus).collect();
    skew_us(&buses, measured.record.machine.assignment().cycle)
}

impl Figures {
    pub(super) fn new(case: &Case, measured: &Measured) -> Figures {
        let (record, board) = (&measured.record, &measured.stats);
        let buses = record.buses.iter().enumerate();
        let buses: Vec<_> = buses
            .map(|(index, bus)| of_bus(bus, measured, index))
            .collect();
        let all = BusFigures::together(buses.iter().map(|(figures, _)| figures));
        let worst = |value: fn(&RealTime) -> f64| {
            buses.iter().map(|(_, bus)| value(bus)).fold(0.0, f64::max)
        };
        let Span { from, to, .. } = measured.span;
        let span = (to - from).as_secs_f64();
        let answers = buses.iter().map(|(_, bus)| bus.sdo_answers).min();
        let in_a_row = buses.iter().map(|(_, bus)| bus.late_in_a_row);
        let mut histogram = Vec::new();
        for (_, bus) in &buses {
            add(&mut histogram, &bus.histogram);
        }
        let mut failures = measured.refused.clone();
        // In a cycle that is full to the brim a drive's heartbeat has no place, and it
        // has one until the drive is operational: the search looks at motion only.
        let before = !case.asked && all.missed == 0 && record.bus.missed > 0;
        if record.verdict.outcome == Outcome::Failed && !before {
            failures.push(record.verdict.reason.clone());
        }
        failures.extend(record.complaints.iter().cloned());
        let network = record.machine.network();
        let all_answers = buses.iter().map(|(_, bus)| bus.sdo_answers).sum();
        let own = measured.own.clone().map(|own| {
            own.beside(
                &record.buses,
                &measured.span,
                Time::from(network.cycle),
                network.bit_rate,
                board,
                all_answers,
            )
        });
        failures.extend(own.iter().flat_map(Own::complaints));
        Figures {
            name: case.name,
            cycle_us: network.cycle.as_micros(),
            missed: all.missed,
            overruns: board.rx_overruns.iter().sum(),
            jitter_pp_us: worst(|bus| bus.jitter_pp_us),
            jitter_histogram: histogram,
            late_unexplained: buses.iter().map(|(_, bus)| bus.unexplained).sum(),
            late_in_a_row: in_a_row.max().unwrap_or(0),
            drift_ppm: worst(|bus| bus.drift_ppm),
            skew_us: skew(measured),
            load_max: all.load_max,
            cpu_load: board.cpu_load(),
            sync_isr_worst_cycles: board.sync.worst_last_cycles,
            sync_isr_first_cycles: board.sync.worst_first_cycles,
            irq_off_max_cycles: board.irq_off_max_cycles,
            sync_held_max_cycles: board.sync_masked_max_cycles,
            burst_gap_max_bits: worst(|bus| bus.burst_gap_bits),
            sdo_exchanges_per_s: answers.unwrap_or(0) as f64 / span,
            wire_bound_us: measured.wire_bound_us,
            stack_high_water_bytes: board.stack_high_water_bytes,
            missed_before: record.bus.missed.saturating_sub(all.missed),
            own,
            seeds: 1,
            simulated_s: span,
            wall_s: measured.wall_s,
            speed: speed(span, measured.wall_s),
            outside_transfers: measured.outside_transfers,
            failures,
        }
    }

    /// The worst of both.
    pub(crate) fn and(mut self, other: Figures) -> Figures {
        self.missed += other.missed;
        self.overruns += other.overruns;
        self.jitter_pp_us = self.jitter_pp_us.max(other.jitter_pp_us);
        add(&mut self.jitter_histogram, &other.jitter_histogram);
        self.late_unexplained += other.late_unexplained;
        self.late_in_a_row = self.late_in_a_row.max(other.late_in_a_row);
        self.drift_ppm = self.drift_ppm.max(other.drift_ppm);
        self.skew_us = self.skew_us.max(other.skew_us);
        self.load_max = self.load_max.max(other.load_max);
        self.cpu_load = self.cpu_load.max(other.cpu_load);
        let cycles = &mut self.sync_isr_worst_cycles;
        *cycles = other.sync_isr_worst_cycles.max(*cycles);
        let cycles = &mut self.sync_isr_first_cycles;
        *cycles = other.sync_isr_first_cycles.max(*cycles);
        self.irq_off_max_cycles = self.irq_off_max_cycles.max(other.irq_off_max_cycles);
        let cycles = &mut self.sync_held_max_cycles;
        *cycles = other.sync_held_max_cycles.max(*cycles);
        self.burst_gap_max_bits = self.burst_gap_max_bits.max(other.burst_gap_max_bits);
        self.sdo_exchanges_per_s = self.sdo_exchanges_per_s.min(other.sdo_exchanges_per_s);
        let stack = &mut self.stack_high_water_bytes;
        *stack = other.stack_high_water_bytes.max(*stack);
        self.missed_before += other.missed_before;
        self.own = self.own.zip(other.own).map(|(all, own)| all.and(own));
        self.seeds += other.seeds;
        self.simulated_s += other.simulated_s;
        self.wall_s += other.wall_s;
        self.speed = speed(self.simulated_s, self.wall_s);
        self.outside_transfers += other.outside_transfers;
        self.failures.extend(other.failures);
        self
    }

    /// How much faster than the clock on the wall it was.
    pub(super) fn times_real_time(&self) -> f64 {
        self.speed
    }

    /// The limits that were missed, in words.
    pub(crate) fn missed_limits(&self, case: &Case) -> Vec<String> {
        let Limits {
            load,
            jitter_us,
            skew_us,
            cpu_load,
            first_request_cycles,
            last_request_cycles,
            burst_gap_bits,
            exchanges_per_s,
        } = case.limits;
        let mut words: Vec<String> = self.failures.clone();
        let mut at_most = |what: &str, value: f64, limit: f64| {
            if value > limit {
                words.push(format!("{what}: {value:.3}, at most {limit} are allowed"));
            }
        };
        at_most("missed cycles", self.missed as f64, 0.0);
        at_most("overruns", self.overruns as f64, 0.0);
        at_most("SYNC jitter [us]", self.jitter_pp_us, jitter_us);
        let late = self.late_unexplained as f64;
        at_most("SYNCs late without a frame in their way", late, 0.0);
        at_most("drift of the SYNCs [ppm]", self.drift_ppm, DRIFT_PPM);
        at_most("skew between buses [us]", self.skew_us, skew_us);
        if let Some(limit) = load {
            at_most("load of the worst cycle", self.load_max, limit);
        }
        if let Some(limit) = cpu_load {
            at_most("CPU load", self.cpu_load, limit);
        }
        let first = self.sync_isr_first_cycles as f64;
        let last = self.sync_isr_worst_cycles as f64;
        let (first_limit, last_limit) = (first_request_cycles as f64, last_request_cycles as f64);
        at_most("cycles to the first request of a SYNC", first, first_limit);
        at_most("cycles to the last request of a SYNC", last, last_limit);
        let held = self.sync_held_max_cycles as f64;
        at_most(
            "cycles in which a transmit request holds SYNC back",
            held,
            HELD_CYCLES,
        );
        let gap = self.burst_gap_max_bits;
        at_most("silence within a burst [bits]", gap, burst_gap_bits);
        let stack = f64::from(self.stack_high_water_bytes);
        if case.asked {
            at_most("bytes of stack", stack, STACK_BYTES);
        }
        if let Some(limit) = exchanges_per_s.filter(|limit| self.sdo_exchanges_per_s < *limit) {
            let rate = self.sdo_exchanges_per_s;
            words.push(format!(
                "SDO exchanges in a second: {rate:.1}, at least {limit} are wanted"
            ));
        }
        if case.disturbed && self.outside_transfers == 0 {
            words.push("nobody could read the board's dictionary meanwhile".to_string());
        }
        let name = case.name;
        words
            .iter()
            .map(|words| format!("{name}: {words}"))
            .collect()
    }

    /// What stands over the columns of [`cells`](Self::cells).
    pub(super) const HEADING: [&str; 15] = [
        "scenario",
        "cycle [us]",
        "missed",
        "overruns",
        "jitter [us]",
        "own [us]",
        "skew [us]",
        "load",
        "CPU",
        "sync_tick",
        "irq off",
        "gap [bits]",
        "SDO/s",
        "bound [us]",
        "speed",
    ];

    /// For the table.
    pub(super) fn cells(&self) -> Vec<String> {
        let percent = |share: f64| format!("{:.1} %", share * 100.0);
        vec![
            self.name.to_string(),
            self.cycle_us.to_string(),
            self.missed.to_string(),
            self.overruns.to_string(),
            format!("{:.2}", self.jitter_pp_us),
            match &self.own {
                Some(own) => format!("{:.0}", own.jitter_pp_us),
                None => "-".to_string(),
            },
            format!("{:.2}", self.skew_us),
            percent(self.load_max),
            percent(self.cpu_load),
            self.sync_isr_worst_cycles.to_string(),
            self.irq_off_max_cycles.to_string(),
            format!("{:.1}", self.burst_gap_max_bits),
            format!("{:.0}", self.sdo_exchanges_per_s),
            self.wire_bound_us.to_string(),
            format!("{:.2}", self.times_real_time()),
        ]
    }
}

fn speed(simulated_s: f64, wall_s: f64) -> f64 {
    simulated_s / wall_s.max(f64::MIN_POSITIVE)
}

/// The stack may be so deep.
const STACK_BYTES: f64 = 4096.0;

/// Adds a histogram to another.
fn add(all: &mut Vec<usize>, more: &[usize]) {
    if more.len() > all.len() {
        all.resize(more.len(), 0);
    }
    for (sum, count) in all.iter_mut().zip(more) {
        *sum += count;
    }
}

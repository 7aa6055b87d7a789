//! What was really on the wire.

use canmaster::NodeId;

use super::grid::{Grid, peak_to_peak};
use crate::bus::{RecordKind, WireRecord};
use crate::frame::{WireFrame, WireId};
use crate::time::Time;

/// Function codes of the predefined connection set (CiA 301, 7.3.5) that are
/// looked at: the part of a COB-ID above the node-ID.
const NMT: u16 = 0x000;
const SYNC: u16 = 0x080;
const TPDO1: u16 = 0x180;
const RPDO1: u16 = 0x200;
/// In its place where the mode wants another target.
const RPDO3: u16 = 0x400;
const RPDO4: u16 = 0x500;
const ERROR_CONTROL: u16 = 0x700;

/// NMT commands (CiA 301, 7.3.2.2.1).
const START: u8 = 0x01;
const RESET_COMMUNICATION: u8 = 0x82;
/// Heartbeat: operational (CiA 301, 7.2.8.3.2.2).
const OPERATIONAL: u8 = 0x05;
/// The node number that means all.
const ALL: u8 = 0;

/// What should be on the bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Traffic {
    /// Bits per second.
    pub bit_rate: u32,
    /// SYNC period.
    pub cycle: Time,
    /// Nodes with an RPDO1 and a TPDO1 in every cycle.
    pub nodes: Vec<NodeId>,
}

/// Figures of the bus.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BusFigures {
    /// SYNC frames.
    pub sync_count: usize,
    /// Slope of the grid that fits them best, microseconds.
    pub sync_period_us: f64,
    /// Greatest peak to peak distance of the SYNCs' starts of frame from their
    /// best-fit grid. A new grid begins with each NMT reset communication.
    pub jitter_pp_us: f64,
    /// Distance of each SYNC from its grid, in the order of the frames.
    pub sync_residuals_us: Vec<f64>,
    /// SYNCs that did not come (or came twice), and intervals in operational in
    /// which an RPDO1 or TPDO1 is absent.
    pub missed: usize,
    /// Bits between two SYNC starts over the bits of a cycle: mean.
    pub load_mean: f64,
    /// The same: worst.
    pub load_max: f64,
    /// Frames that were sent without error.
    pub frames: usize,
    /// Frames that ended in an error frame.
    pub error_frames: usize,
    /// Start of the cycle whose load was worst, and its end.
    pub worst_cycle: Option<(Time, Time)>,
}

impl BusFigures {
    /// Those of several buses together: what is counted is added up, except the
    /// SYNCs, which leave on all of them; of the rest the worst holds, and the
    /// first bus where there is no worst.
    pub fn together<'f>(mut buses: impl Iterator<Item = &'f BusFigures>) -> BusFigures {
        let add = |mut all: BusFigures, bus: &BusFigures| {
            all.missed += bus.missed;
            all.frames += bus.frames;
            all.error_frames += bus.error_frames;
            all.jitter_pp_us = all.jitter_pp_us.max(bus.jitter_pp_us);
            all.sync_residuals_us.extend(&bus.sync_residuals_us);
            all.load_mean = all.load_mean.max(bus.load_mean);
            if bus.load_max > all.load_max {
                all.load_max = bus.load_max;
                all.worst_cycle = bus.worst_cycle;
            }
            all
        };
        let first = buses.next().cloned().unwrap_or_default();
        buses.fold(first, add)
    }
}

/// Starts of frame of all SYNCs.
pub fn syncs(records: &[WireRecord]) -> Vec<Time> {
    let syncs = records.iter().filter(|record| is_sync(record));
    syncs.map(|record| record.sof).collect()
}

/// Whether it is a SYNC that was sent without error.
pub(super) fn is_sync(record: &WireRecord) -> bool {
    let sync = |frame: &WireFrame| frame.id == WireId::Standard(SYNC) && !frame.rtr;
    matches!(&record.kind, RecordKind::Frame(frame) if sync(frame))
}

/// What was seen of one node between two SYNCs.
#[derive(Clone, Copy, Default)]
struct Seen {
    operational: bool,
    left: bool,
    rpdo1: bool,
    tpdo1: bool,
}

impl Seen {
    /// The node was started, or says so, or the opposite.
    fn state(&mut self, operational: bool) {
        if !operational {
            self.left = true;
        } else if self.left || !self.operational {
            // Counts from the next SYNC on.
            *self = Seen {
                operational: true,
                left: false,
                rpdo1: true,
                tpdo1: true,
            };
        }
    }
}

/// Judges what was on the wire until `end` against what should have been.
pub fn judge(records: &[WireRecord], traffic: &Traffic, end: Time) -> BusFigures {
    let mut judge = Judge::new(traffic);
    for record in records {
        judge.record(record);
    }
    judge.finish(end)
}

/// The same of records that begin when all nodes were operational already.
pub fn judge_running(records: &[WireRecord], traffic: &Traffic, end: Time) -> BusFigures {
    let mut judge = Judge::new(traffic);
    judge.nodes.iter_mut().for_each(|seen| seen.state(true));
    for record in records {
        judge.record(record);
    }
    judge.finish(end)
}

struct Judge<'t> {
    traffic: &'t Traffic,
    cycle_us: f64,
    figures: BusFigures,
    /// SYNCs of the grid that is going on: place in it, microseconds.
    grid: Vec<(u64, f64)>,
    longest_grid: usize,
    interval_start: Option<Time>,
    interval_bits: u64,
    /// Bits and cycles of all whole intervals.
    bits: u64,
    cycles: u64,
    nodes: Vec<Seen>,
}

impl<'t> Judge<'t> {
    fn new(traffic: &'t Traffic) -> Judge<'t> {
        Judge {
            traffic,
            cycle_us: traffic.cycle.as_us_f64(),
            figures: BusFigures::default(),
            grid: Vec::new(),
            longest_grid: 0,
            interval_start: None,
            interval_bits: 0,
            bits: 0,
            cycles: 0,
            nodes: vec![Seen::default(); traffic.nodes.len()],
        }
    }

    fn record(&mut self, record: &WireRecord) {
        match &record.kind {
            RecordKind::Frame(frame) => {
                self.figures.frames += 1;
                self.frame(record.sof, frame);
            }
            RecordKind::ErrorFrame { .. } => self.figures.error_frames += 1,
        }
        // A SYNC opens the interval that its own bits belong to.
        self.interval_bits += u64::from(record.bits);
    }

    fn frame(&mut self, sof: Time, frame: &WireFrame) {
        let WireId::Standard(id) = frame.id else {
            return;
        };
        if frame.rtr {
            return;
        }
        let first = frame.data[0];
        match id {
            SYNC => self.sync(sof),
            NMT => self.nmt(first, frame.data[1]),
            _ => {
                let nodes = self.traffic.nodes.iter().zip(&mut self.nodes);
                for (node, seen) in nodes {
                    let node = u16::from(node.get());
                    if [RPDO1, RPDO3, RPDO4].contains(&id.wrapping_sub(node)) {
                        seen.rpdo1 = true;
                    } else if id == TPDO1 + node {
                        seen.tpdo1 = true;
                    } else if id == ERROR_CONTROL + node {
                        seen.state(first == OPERATIONAL);
                    }
                }
            }
        }
    }

    fn nmt(&mut self, command: u8, to: u8) {
        for (node, seen) in self.traffic.nodes.iter().zip(&mut self.nodes) {
            if to != ALL && to != node.get() {
                continue;
            }
            seen.state(command == START);
        }
        if command == RESET_COMMUNICATION && to == ALL {
            self.end_grid();
            self.interval_start = None;
        }
    }

    fn sync(&mut self, sof: Time) {
        self.figures.sync_count += 1;
        let us = sof.as_us_f64();
        let steps = match self.grid.last() {
            None => 0,
            Some(&(_, last)) => ((us - last) / self.cycle_us).round().max(0.0) as u64,
        };
        if let Some(start) = self.interval_start {
            self.end_interval(start, sof, steps);
        }
        let place = self.grid.last().map_or(0, |&(n, _)| n + steps);
        self.grid.push((place, us));
        self.interval_start = Some(sof);
        self.interval_bits = 0;
        for seen in &mut self.nodes {
            *seen = Seen {
                operational: seen.operational && !seen.left,
                ..Seen::default()
            };
        }
    }

    fn end_interval(&mut self, start: Time, end: Time, steps: u64) {
        self.figures.missed += steps.abs_diff(1) as usize;
        if self
            .nodes
            .iter()
            .any(|seen| seen.operational && !seen.left && !(seen.rpdo1 && seen.tpdo1))
        {
            self.figures.missed += 1;
        }
        let cycles = steps.max(1);
        self.bits += self.interval_bits;
        self.cycles += cycles;
        let load = self.load(self.interval_bits, cycles);
        if load > self.figures.load_max {
            self.figures.load_max = load;
            self.figures.worst_cycle = Some((start, end));
        }
    }

    fn load(&self, bits: u64, cycles: u64) -> f64 {
        let cycle_bits = self.cycle_us * 1e-6 * f64::from(self.traffic.bit_rate);
        if cycles == 0 {
            0.0
        } else {
            bits as f64 / (cycles as f64 * cycle_bits)
        }
    }

    fn end_grid(&mut self) {
        let points = std::mem::take(&mut self.grid);
        let Some(grid) = Grid::fit(&points) else {
            return;
        };
        let residuals = grid.residuals(&points);
        self.figures.jitter_pp_us = self.figures.jitter_pp_us.max(peak_to_peak(&residuals));
        self.figures.sync_residuals_us.extend(residuals);
        if points.len() > self.longest_grid {
            self.longest_grid = points.len();
            self.figures.sync_period_us = grid.period;
        }
    }

    fn finish(mut self, end: Time) -> BusFigures {
        if let Some(last) = self.interval_start {
            // The SYNCs that did not come any more; half a cycle late is not yet
            // missing.
            let overdue = end.since(last).as_us_f64() / self.cycle_us - 0.5;
            self.figures.missed += overdue.max(0.0) as usize;
        }
        self.end_grid();
        self.figures.load_mean = self.load(self.bits, self.cycles);
        self.figures
    }
}

#[cfg(test)]
#[path = "bus_tests.rs"]
mod tests;

//! Everything that a run leaves behind.

use canmaster::NodeId;

use super::Machine;
use super::line::Line;
use super::watch::{AxisState, Startup};
use crate::board::BoardStats;
use crate::bus::{PortId, WireRecord};
use crate::drive::DriveStatus;
use crate::judge::{
    Arrival, Assignment, AxisMonitor, BusFigures, Evidence, LssFigures, Release, Span, Verdict,
    arrivals, bus, coordination, lss, skew::skew_us, verdict,
};
use crate::log::LogLine;
use crate::time::Time;

/// One axis at the end of a run.
#[derive(Clone, Debug)]
pub struct AxisRecord {
    /// Its drive.
    pub node: NodeId,
    /// What the drive is in; `None` if it is not on the bus.
    pub status: Option<DriveStatus>,
    /// What it did.
    pub motion: AxisMonitor,
    /// What its drive was in, from change to change.
    pub states: Vec<AxisState>,
}

/// One bus at the end of a run.
#[derive(Clone, Debug)]
pub struct BusRecord {
    /// Its name.
    pub name: String,
    /// bit/s
    pub bit_rate: u32,
    /// Names of its ports, by number.
    pub ports: Vec<String>,
    /// The board's port.
    pub board: PortId,
    /// Everything that was on the wire.
    pub wire: Vec<WireRecord>,
    /// What came of it.
    pub figures: BusFigures,
}

/// What was seen, before it is judged.
pub(super) struct Seen {
    pub(super) seed: u64,
    pub(super) simulated: Time,
    pub(super) machine: Machine,
    pub(super) lines: Vec<Line>,
    pub(super) log: Vec<(Time, LogLine)>,
    pub(super) axes: Vec<AxisRecord>,
    pub(super) releases: Vec<Release>,
    pub(super) startup: Startup,
    pub(super) marks: Vec<(Time, String)>,
    pub(super) board: BoardStats,
    pub(super) complaints: Vec<String>,
    pub(super) unfinished: String,
}

/// A run, judged.
#[derive(Clone, Debug)]
pub struct Record {
    /// Seed of everything that was drawn at random.
    pub seed: u64,
    /// Virtual time from power-on to the end.
    pub simulated: Time,
    /// The machine that moved.
    pub machine: Machine,
    /// The buses, in the order of the machine's.
    pub buses: Vec<BusRecord>,
    /// The firmware's log, and when each line reached the host.
    pub log: Vec<(Time, LogLine)>,
    /// The axes, in the order of the network.
    pub axes: Vec<AxisRecord>,
    /// What the operator gave.
    pub releases: Vec<Release>,
    /// Who arrived where.
    pub arrivals: Vec<Arrival>,
    /// When the machine got ready.
    pub startup: Startup,
    /// What was done to the machine, and when: faults, resets.
    pub marks: Vec<(Time, String)>,
    /// In which SYNC each axis was told to start, and to move for the last time.
    pub spans: Vec<Span>,
    /// The search for drives without node-ID, if there was one.
    pub lss: Option<LssFigures>,
    /// Figures of all buses together.
    pub bus: BusFigures,
    /// How far the SYNCs of one cycle are apart on different buses, at worst,
    /// microseconds.
    pub skew_us: f64,
    /// Figures of the emulated board.
    pub board: BoardStats,
    /// Wrong use of the hardware that the emulated board noticed.
    pub complaints: Vec<String>,
    /// How it ended.
    pub verdict: Verdict,
}

impl Seen {
    /// Judges what was seen.
    pub(super) fn judge(self, assignment: &Assignment) -> Record {
        let nodes: Vec<NodeId> = self.axes.iter().map(|axis| axis.node).collect();
        let motion: Vec<AxisMonitor> = self.axes.iter().map(|axis| axis.motion.clone()).collect();
        let buses: Vec<BusRecord> = self
            .machine
            .segments()
            .iter()
            .zip(self.lines)
            .map(|(segment, line)| {
                let traffic = self.machine.traffic(segment);
                BusRecord {
                    name: segment.name.clone(),
                    bit_rate: segment.bit_rate,
                    ports: line.names,
                    board: line.board,
                    figures: bus::judge(&line.wire, &traffic, self.simulated),
                    wire: line.wire,
                }
            })
            .collect();
        let figures = BusFigures::together(buses.iter().map(|bus| &bus.figures));
        let syncs: Vec<_> = buses.iter().map(|bus| bus::syncs(&bus.wire)).collect();
        let spans = coordination::spans(
            buses.iter().map(|bus| &bus.wire[..]),
            self.machine.network(),
        );
        let arrived = arrivals(&nodes, &motion, assignment, &self.releases);
        let error_line = first_error(&self.log).map(|line| line.message.as_str());
        let verdict = verdict(&Evidence {
            nodes: &nodes,
            axes: &motion,
            assignment,
            releases: &self.releases,
            arrivals: &arrived,
            bus: &figures,
            irq_off_cycles: self.board.irq_off_max_cycles,
            error_line,
            board_complaint: self.complaints.first().map(String::as_str),
            unfinished: &self.unfinished,
        });
        Record {
            lss: buses.iter().find_map(|bus| lss::judge(&bus.wire)),
            skew_us: skew_us(&syncs, assignment.cycle),
            spans,
            seed: self.seed,
            simulated: self.simulated,
            machine: self.machine,
            buses,
            log: self.log,
            axes: self.axes,
            releases: self.releases,
            arrivals: arrived,
            startup: self.startup,
            marks: self.marks,
            bus: figures,
            board: self.board,
            complaints: self.complaints,
            verdict,
        }
    }
}

/// The firmware's first complaint.
pub(super) fn first_error(log: &[(Time, LogLine)]) -> Option<&LogLine> {
    log.iter()
        .map(|(_, line)| line)
        .find(|line| line.level == Some(crate::log::Level::Error))
}

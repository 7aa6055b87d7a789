//! Everything that a run leaves behind.

use canmaster::NodeId;

use super::Machine;
use super::watch::Startup;
use crate::board::BoardStats;
use crate::bus::WireRecord;
use crate::drive::DriveStatus;
use crate::judge::{
    Arrival, Assignment, AxisMonitor, BusFigures, Evidence, LssFigures, Release, Traffic, Verdict,
    arrivals, bus, lss, verdict,
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
}

/// What was seen, before it is judged.
pub(super) struct Seen {
    pub(super) seed: u64,
    pub(super) simulated: Time,
    pub(super) machine: Machine,
    pub(super) ports: Vec<String>,
    pub(super) wire: Vec<WireRecord>,
    pub(super) log: Vec<(Time, LogLine)>,
    pub(super) axes: Vec<AxisRecord>,
    pub(super) releases: Vec<Release>,
    pub(super) startup: Startup,
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
    /// Names of the bus's ports, by number.
    pub ports: Vec<String>,
    /// Everything that was on the wire.
    pub wire: Vec<WireRecord>,
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
    /// The search for drives without node-ID, if there was one.
    pub lss: Option<LssFigures>,
    /// Figures of the bus.
    pub bus: BusFigures,
    /// Figures of the emulated board.
    pub board: BoardStats,
    /// Wrong use of the hardware that the emulated board noticed.
    pub complaints: Vec<String>,
    /// How it ended.
    pub verdict: Verdict,
}

impl Seen {
    /// Judges what was seen.
    pub(super) fn judge(self, assignment: &Assignment, traffic: &Traffic) -> Record {
        let nodes: Vec<NodeId> = self.axes.iter().map(|axis| axis.node).collect();
        let motion: Vec<AxisMonitor> = self.axes.iter().map(|axis| axis.motion.clone()).collect();
        let figures = bus::judge(&self.wire, traffic, self.simulated);
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
            lss: lss::judge(&self.wire),
            seed: self.seed,
            simulated: self.simulated,
            machine: self.machine,
            ports: self.ports,
            wire: self.wire,
            log: self.log,
            axes: self.axes,
            releases: self.releases,
            arrivals: arrived,
            startup: self.startup,
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

//! What is shown while a run is going on: which step, which node, how far; and
//! the firmware's log. All of it on standard error.

use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use canmaster::{CobId, network};
use canmaster_sim::bridge::Pace;
use canmaster_sim::bus::RecordKind;
use canmaster_sim::drive::DriveStatus;
use canmaster_sim::frame::WireId;
use canmaster_sim::log::LogLine;
use canmaster_sim::time::Time;
use canmaster_sim::world::{self, Machine, Observer, World};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::cli::{LogLevel, RunOptions};

/// SDO answers, server to client (CiA 301, 7.3.5).
const SDO_ANSWER: u16 = 0x580;
/// How often the step is worked out anew, in virtual time.
const REFRESH: Time = Time::from_ms(20);
/// How often the bar is drawn, in times a second.
const DRAW_HZ: u8 = 15;

/// Shows a run on standard error.
pub(super) struct Progress {
    bar: ProgressBar,
    /// Without a terminal each new step is a line of its own.
    plain: bool,
    log: LogLevel,
    /// Paced by the clock since then.
    pace: Option<(Pace, Instant)>,
    /// The user has had enough.
    stop: Arc<AtomicBool>,
    next: Time,
    step: &'static str,
    answers: Vec<usize>,
    /// The master has sent its first NMT command: the silent phase is over.
    commanded: bool,
    /// The master looks for drives without node-ID.
    search: bool,
    /// By bus.
    records_seen: Vec<usize>,
}

impl Progress {
    pub(super) fn new(options: &RunOptions, machine: &Machine, end: Time) -> Progress {
        let target = ProgressDrawTarget::stderr_with_hz(DRAW_HZ);
        let bar = ProgressBar::with_draw_target(Some(end.as_ms()), target);
        let style = ProgressStyle::with_template("{bar:24} {prefix} {wide_msg}")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        bar.set_style(style);
        let paced = options.realtime || options.bridge.is_some();
        Progress {
            bar,
            plain: !std::io::stderr().is_terminal(),
            log: options.log,
            pace: paced.then(|| (Pace::default(), Instant::now())),
            stop: Arc::default(),
            next: Time::ZERO,
            step: "",
            answers: vec![0; machine.network().nodes.len()],
            commanded: false,
            search: false,
            records_seen: vec![0; machine.segments().len()],
        }
    }

    /// Ends the run when `stop` is set.
    pub(super) fn stop_on(&mut self, stop: Arc<AtomicBool>) {
        self.stop = stop;
    }

    pub(super) fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn say(&self, line: &str) {
        if self.plain {
            eprintln!("{line}");
        } else {
            self.bar.println(line);
        }
    }

    fn show(&mut self, world: &World<'_>) {
        let (step, detail) = self.describe(world);
        let (now, end) = (world.now().as_secs_f64(), world.end().as_secs_f64());
        self.bar.set_position(world.now().as_ms());
        self.bar.set_prefix(format!("{now:.1} of {end:.1} s"));
        self.bar.set_message(format!("{step}: {detail}"));
        if step != self.step {
            self.step = step;
            if self.plain {
                eprintln!("[{now:6.2} of {end:.1} s] {step}");
            }
        }
    }

    /// The step that the machine is in, and how far it has come.
    fn describe(&mut self, world: &World<'_>) -> (&'static str, String) {
        self.read(world);
        let (done, going_on) = world.round_trips();
        if going_on {
            return (
                "moving",
                format!("round trip {}, positions {}", done + 1, positions(world)),
            );
        }
        if !self.commanded {
            let silence = world.machine().network().master.silence.as_millis();
            return (
                "silent, so that drives left running come to rest",
                format!("{silence} ms in all"),
            );
        }
        if self.search
            && let Some(nodes) = still_to_come(world, world::has_node_id)
        {
            return ("giving the drives their node-IDs", nodes);
        }
        if let Some(nodes) = still_to_come(world, world::booted) {
            return ("waiting for the drives to boot", nodes);
        }
        if let Some(nodes) = still_to_come(world, world::operational) {
            let (answers, all) = self.configured(world);
            if answers < all {
                return (
                    "configuring the drives",
                    format!("{answers} of {all} SDO transfers; {nodes}"),
                );
            }
            return ("starting the drives", nodes);
        }
        if let Some(nodes) = still_to_come(world, world::enabled) {
            return ("enabling the drives", nodes);
        }
        ("standby", format!("{done} round trips made"))
    }

    /// Takes in what was on the wire since the last time: answers of the SDO
    /// servers, and LSS.
    fn read(&mut self, world: &World<'_>) {
        let network = world.machine().network();
        let seen = &mut self.records_seen;
        let new = seen.iter_mut().enumerate().flat_map(|(bus, seen)| {
            let wire = world.wire_of(bus);
            let from = std::mem::replace(seen, wire.len());
            wire.get(from..).unwrap_or_default()
        });
        for record in new {
            let RecordKind::Frame(frame) = &record.kind else {
                continue;
            };
            let WireId::Standard(id) = frame.id else {
                continue;
            };
            self.commanded |= id == CobId::NMT.get();
            self.search |= id == CobId::LSS_MASTER.get();
            let answers = |node: &network::Node| id == SDO_ANSWER + u16::from(node.id.get());
            let axis = network.nodes.iter().position(answers);
            if let Some(count) = axis.and_then(|axis| self.answers.get_mut(axis)) {
                *count += 1;
            }
        }
    }

    /// How much of their configuration the nodes have answered, and all of it.
    fn configured(&self, world: &World<'_>) -> (usize, usize) {
        let network = world.machine().network();
        let answers: usize = self.answers.iter().sum();
        let all: usize = network
            .nodes
            .iter()
            .map(|node| network::plan(network, node).count() + reads(node))
            .sum();
        (answers.min(all), all)
    }
}

/// Identity entries that are read of a node before anything is written.
fn reads(node: &network::Node) -> usize {
    let identity = &node.identity;
    [
        identity.device_type,
        identity.vendor,
        identity.product,
        identity.revision,
        node.serial,
    ]
    .iter()
    .flatten()
    .count()
}

/// The nodes that are not yet there.
fn still_to_come(world: &World<'_>, there: impl Fn(&DriveStatus) -> bool) -> Option<String> {
    let nodes: Vec<String> = world
        .machine()
        .network()
        .nodes
        .iter()
        .zip(world.statuses())
        .filter(|(_, status)| !status.as_ref().is_some_and(&there))
        .map(|(node, _)| node.id.get().to_string())
        .collect();
    (!nodes.is_empty()).then(|| format!("still to come: node {}", nodes.join(", ")))
}

fn positions(world: &World<'_>) -> String {
    let positions: Vec<String> = world
        .truths()
        .flatten()
        .map(|truth| format!("{:.0}", truth.position_inc))
        .collect();
    positions.join(" ")
}

impl Observer for Progress {
    fn log(&mut self, _: Time, line: &LogLine) {
        if self.log.shows(line.level) {
            self.say(&line.to_string());
        }
    }

    fn look(&mut self, world: &World<'_>) {
        if world.now() >= self.next {
            self.next = world.now() + REFRESH;
            self.show(world);
        }
        if let Some((pace, started)) = &mut self.pace {
            let early = pace.wait(world.now(), started.elapsed());
            if !early.is_zero() {
                std::thread::sleep(early);
            }
        }
    }

    fn stop(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

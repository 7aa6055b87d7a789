//! What a description may choose, beside each other: RPDOs after the TPDOs or after
//! SYNC, and whether a missing TPDO or a missing heartbeat tells that a drive is lost.
//! All is measured on the wire.

use std::fs;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Result};
use canmaster_sim::board::BoardStats;
use canmaster_sim::drive::DriveFault;
use canmaster_sim::judge::bus::judge_running;
use canmaster_sim::judge::reaction::{Reaction, reaction};
use canmaster_sim::judge::realtime::{self, RealTime};
use canmaster_sim::time::Time;
use canmaster_sim::world::trials::moving;
use canmaster_sim::world::{Image, Stimulus, World};
use serde::Serialize;

use super::{Outcome, Report};
use crate::machine::{Checked, DESCRIPTION, Description};
use crate::{cargo, new, table};

/// What all of them are like.
const LIKE: &str = "networks/one_bus_2ms.toml";
/// How much motion is looked at for load and jitter.
const LOOKED_AT: Time = Time::from_ms(1000);
/// A drive is lost at several moments of a cycle and of its heartbeat.
const LOSSES: u64 = 8;
/// The moments are so far apart, microseconds: no part of a cycle or a heartbeat.
const APART_US: u64 = 13_370;
/// The drive that is lost, or fails: its place in the network.
const STRUCK: usize = 3;
/// Overcurrent: the drive leaves operation enabled at once, and says so.
const FAILURE: u16 = 0x2310;
/// Everything that is looked for has happened by then.
const KNOWN_BY: Time = Time::from_ms(500);
/// The dead time may differ from the layout's by the clock errors.
const DEAD_TIME_US: f64 = 2.0;

/// A description that differs from [`LIKE`] in some lines.
struct Choice {
    name: &'static str,
    order: &'static str,
    lost_by: &'static str,
    /// By their keys; no text: the line is left out.
    lines: &'static [(&'static str, &'static str)],
}

const CHOICES: [Choice; 3] = [
    Choice {
        name: "choice-1",
        order: "after TPDOs",
        lost_by: "TPDO",
        lines: &[("rpdos", r#"rpdos = "after TPDOs""#)],
    },
    Choice {
        name: "choice-2",
        order: "after SYNC",
        lost_by: "TPDO",
        lines: &[
            ("sdo_frames", "sdo_frames = 1"),
            ("rpdos", r#"rpdos = "after SYNC""#),
        ],
    },
    Choice {
        name: "choice-3",
        order: "after SYNC",
        lost_by: "heartbeat",
        lines: &[
            ("sdo_frames", "sdo_frames = 1"),
            ("rpdos", r#"rpdos = "after SYNC""#),
            ("heartbeats_wait", "heartbeats_wait = true"),
            ("heartbeat_in_operational", ""),
            ("by", r#"by = "heartbeat""#),
        ],
    },
];

/// What was measured of one.
#[derive(Clone, Debug, Serialize)]
struct Row {
    rpdos: &'static str,
    lost_by: &'static str,
    /// From the SYNC at which a TPDO's values are taken to the SYNC at which the RPDO acts
    /// that answers to them.
    dead_time_us: f64,
    layout_dead_time_us: u32,
    /// From the loss of a drive to the SYNC at which the stop of the others acts.
    detection_ms: f64,
    detection_max_ms: f64,
    load_mean: f64,
    load_max: f64,
    jitter_pp_us: f64,
    cpu_load: f64,
}

#[derive(Serialize)]
struct Figures {
    losses: u64,
    choices: Vec<Row>,
}

pub(super) fn run(seed: u64) -> Result<Outcome> {
    let started = Instant::now();
    let mut choices = Vec::new();
    for choice in &CHOICES {
        eprintln!("RPDOs {}, lost by {}", choice.order, choice.lost_by);
        choices.push(choice.measure(seed).context(choice.order)?);
    }
    let missed: Vec<String> = choices.iter().filter_map(Row::missed).collect();
    let table = as_table(&choices);
    let losses = LOSSES;
    let figures = Figures { losses, choices };
    let report = Report::new(figures, seed, started.elapsed().as_secs_f64(), &missed);
    Ok(Outcome {
        json: report.json()?,
        table,
        missed,
    })
}

impl Choice {
    fn measure(&self, seed: u64) -> Result<Row> {
        let path = self.write()?;
        let layout = Description::check(Some(&path))?.machine;
        let image = Checked::read(Some(&path))?.built()?;
        let (load_mean, load_max, even, stats) = undisturbed(&image, seed)?;
        let failed = struck(&image, seed, 0, |at| DriveFault::Error {
            at,
            code: FAILURE,
            until: None,
        })?;
        let sampled = failed
            .1
            .sampled
            .context("the drive did not say that it failed")?;
        let mut detected = Vec::new();
        for turn in 0..LOSSES {
            let (at, reaction) = struck(&image, seed, turn, |at| DriveFault::PowerLoss { at })?;
            detected.push((reaction.acts - at).as_us_f64() / 1000.0);
        }
        let dead_times = layout.buses.iter().map(|bus| bus.layout.dead_time_us());
        Ok(Row {
            rpdos: self.order,
            lost_by: self.lost_by,
            dead_time_us: (failed.1.acts - sampled).as_us_f64(),
            layout_dead_time_us: dead_times.max().unwrap_or(0),
            detection_ms: detected.iter().sum::<f64>() / detected.len() as f64,
            detection_max_ms: detected.iter().copied().fold(0.0, f64::max),
            load_mean,
            load_max,
            jitter_pp_us: even.jitter_pp_us,
            cpu_load: stats.cpu_load(),
        })
    }

    /// Puts the description into a folder of its own and says where it is.
    fn write(&self) -> Result<PathBuf> {
        let networks = cargo::workspace().join("target").join("networks");
        let dir = networks.join(self.name);
        new::copy(&dir)?;
        let like = fs::read_to_string(cargo::workspace().join(LIKE)).context(LIKE)?;
        let path = dir.join(DESCRIPTION);
        fs::write(&path, self.describe(&like)).with_context(|| path.display().to_string())?;
        Ok(path)
    }

    fn describe(&self, like: &str) -> String {
        let mut left: Vec<_> = self.lines.to_vec();
        let mut text = String::new();
        let mut add = |line: &str| {
            if !line.is_empty() {
                text.push_str(line);
            }
            text.push('\n');
        };
        for line in like.lines() {
            let key = line.split('=').next().unwrap_or_default().trim();
            // The last key of the bus: those that it does not have yet follow.
            if key == "load_limit" {
                add("load_limit = 100");
                for (_, line) in left.extract_if(.., |(key, _)| NEW.contains(key)) {
                    add(line);
                }
                continue;
            }
            match left.iter().position(|(other, _)| *other == key) {
                Some(place) => add(left.remove(place).1),
                None => add(&line.replace("../eds/", "eds/")),
            }
        }
        text
    }
}

/// Keys of a bus that [`LIKE`] does not have.
const NEW: [&str; 2] = ["rpdos", "heartbeats_wait"];

/// Load of the bus, mean and worst; evenness of the SYNC; what it costs.
fn undisturbed(image: &Image, seed: u64) -> Result<(f64, f64, RealTime, BoardStats)> {
    let mut world = moving(image, seed)?;
    world.clear_stats();
    let from = world.now();
    let to = from + LOOKED_AT;
    world.run_until(to);
    let stats = world.board().stats();
    let machine = world.machine();
    let segment = &machine.segments()[0];
    let traffic = machine.traffic(segment);
    let wire = super::realtime::between(world.wire(), from, to);
    let bus = judge_running(wire, &traffic, to);
    let even = realtime::judge(wire, &traffic, &segment.bursts, world.board_port());
    Ok((bus.load_mean, bus.load_max, even, stats))
}

/// Something befalls a drive in motion: when, and what the wire shows of it.
fn struck(
    image: &Image,
    seed: u64,
    turn: u64,
    fault: fn(Time) -> DriveFault,
) -> Result<(Time, Reaction)> {
    let mut world: World<'_> = moving(image, seed)?;
    world.run_until(world.now() + Time::from_us(APART_US * turn));
    let at = world.now();
    let network = world.machine().network();
    let node = network.nodes[STRUCK].id;
    world.apply(Stimulus::Drive {
        node,
        fault: fault(at),
    });
    world.run_until(at + KNOWN_BY);
    let found = reaction(world.wire(), network, STRUCK, at);
    Ok((at, found.context("the other axes were not stopped")?))
}

impl Row {
    fn missed(&self) -> Option<String> {
        let layout = f64::from(self.layout_dead_time_us);
        let differs = (self.dead_time_us - layout).abs() > DEAD_TIME_US;
        differs.then(|| {
            format!(
                "RPDOs {}: a dead time of {:.0} us, and the layout says {layout:.0} us",
                self.rpdos, self.dead_time_us
            )
        })
    }
}

const HEADING: [&str; 8] = [
    "RPDOs",
    "lost by",
    "dead time [us]",
    "detection [ms]",
    "at worst [ms]",
    "load mean",
    "load worst",
    "SYNC jitter [us]",
];

fn as_table(rows: &[Row]) -> comfy_table::Table {
    let mut table = table::new(&HEADING);
    table::align_right(&mut table, &[2, 3, 4, 5, 6, 7]);
    for row in rows {
        table.add_row([
            row.rpdos.to_string(),
            row.lost_by.to_string(),
            format!("{:.0}", row.dead_time_us),
            format!("{:.1}", row.detection_ms),
            format!("{:.1}", row.detection_max_ms),
            format!("{:.1} %", row.load_mean * 100.0),
            format!("{:.1} %", row.load_max * 100.0),
            format!("{:.1}", row.jitter_pp_us),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use canmaster_network::{Source, read_for_firmware};

    #[test]
    fn every_choice_is_accepted() {
        let workspace = cargo::workspace();
        let like = fs::read_to_string(workspace.join(LIKE)).unwrap();
        for choice in &CHOICES {
            let text = choice.describe(&like);
            for (_, line) in choice.lines {
                assert!(text.contains(line), "{line}\n{text}");
            }
            let name = workspace.join(DESCRIPTION).display().to_string();
            let source = Source::new(name, text.as_bytes());
            let outcome = read_for_firmware(&source, &mut |file| fs::read(file));
            assert!(outcome.machine.is_some(), "{:?}", outcome.problems);
        }
    }

    #[test]
    fn another_dead_time_than_the_layouts_is_told() {
        let row = |dead_time_us| Row {
            rpdos: "after TPDOs",
            lost_by: "TPDO",
            dead_time_us,
            layout_dead_time_us: 2000,
            detection_ms: 8.0,
            detection_max_ms: 9.0,
            load_mean: 0.6,
            load_max: 0.8,
            jitter_pp_us: 1.0,
            cpu_load: 0.05,
        };
        assert_eq!(row(1999.8).missed(), None);
        assert!(row(3999.7).missed().unwrap().contains("4000 us"));
    }
}

//! A random fault at a random moment with each seed: the contract for faults, on
//! the emulated board.

use std::process::ExitCode;
use std::time::Instant;

use anyhow::Result;
use canmaster_sim::judge::Cause;
use canmaster_sim::time::Time;
use canmaster_sim::world::Image;
use canmaster_sim::world::strike::{Strike, Struck};
use serde::Serialize;

use super::pool;
use crate::table;

/// The JSON object.
#[derive(Serialize)]
struct Report {
    result: &'static str,
    seeds: u64,
    wall_s: f64,
    runs: Vec<Row>,
}

/// One seed.
#[derive(Clone, Debug, Serialize)]
struct Row {
    seed: u64,
    ok: bool,
    reason: String,
    cause: &'static str,
    node: u8,
    phase: String,
    wall_s: f64,
    #[serde(flatten)]
    figures: Option<Figures>,
    #[serde(skip)]
    kind: Option<Cause>,
}

/// What was measured, in the plant.
#[derive(Clone, Copy, Debug, Serialize)]
struct Figures {
    at_s: f64,
    /// From the fault until the axes stood that still had torque.
    stood_ms: Option<f64>,
    allowed_ms: f64,
    /// The same of the axis that its own drive had disabled.
    coasted_ms: Option<f64>,
    /// How far apart the axes came to rest that the master stopped.
    apart_ms: Option<f64>,
    recovered: bool,
}

/// What is struck.
pub(super) struct Images {
    pub(super) sample: Image,
    /// For what only a missing heartbeat shows.
    pub(super) with_heartbeats: Image,
}

impl Images {
    fn of(&self, strike: &Strike) -> &Image {
        match strike.wants_heartbeats() {
            true => &self.with_heartbeats,
            false => &self.sample,
        }
    }
}

/// Runs all seeds and tells what came of them.
pub(super) fn command(images: &Images, seeds: u64, workers: usize, json: bool) -> Result<ExitCode> {
    let started = Instant::now();
    let all: Vec<u64> = (1..=seeds).collect();
    let bar = super::progress(all.len());
    let runs = pool::run(
        &all,
        workers,
        |seed| Row::new(images, *seed),
        |row: &Row| {
            bar.inc(1);
            if !row.ok {
                bar.suspend(|| {
                    let Row {
                        seed,
                        cause,
                        node,
                        phase,
                        reason,
                        ..
                    } = row;
                    eprintln!("seed {seed}, {cause}, node {node}, {phase}: {reason}");
                });
            }
        },
    );
    bar.finish_and_clear();
    let wall_s = started.elapsed().as_secs_f64();
    let ok = runs.iter().filter(|row| row.ok).count();
    let all_ok = ok == runs.len();
    if json {
        let result = if all_ok { "ok" } else { "failed" };
        let report = Report {
            result,
            seeds,
            wall_s,
            runs,
        };
        println!("{}", serde_json::to_string(&report)?);
    } else {
        println!("{}", as_table(&runs));
        println!("{ok} of {} runs ok, in {wall_s:.0} s", runs.len());
    }
    Ok(if all_ok {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

impl Row {
    fn new(images: &Images, seed: u64) -> Row {
        let started = Instant::now();
        let nodes = images.sample.machine().network().nodes;
        let strike = Strike::random(seed, nodes.len());
        let outcome = strike.run(images.of(&strike), seed);
        Row {
            seed,
            ok: outcome.is_ok(),
            figures: outcome.as_ref().ok().map(Figures::of),
            reason: outcome.err().map(|e| e.to_string()).unwrap_or_default(),
            cause: strike.cause.words(),
            node: nodes[strike.axis].id.get(),
            phase: strike.phase.to_string(),
            wall_s: started.elapsed().as_secs_f64(),
            kind: Some(strike.cause),
        }
    }
}

impl Figures {
    fn of(struck: &Struck) -> Figures {
        Figures {
            at_s: struck.at.as_secs_f64(),
            stood_ms: struck.stood_after.map(ms),
            allowed_ms: ms(struck.allowed),
            coasted_ms: struck.coasted.map(ms),
            apart_ms: struck.apart.map(ms),
            recovered: struck.recovered,
        }
    }
}

fn ms(time: Time) -> f64 {
    time.as_us_f64() / 1000.0
}

/// The worst of each cause.
fn as_table(runs: &[Row]) -> comfy_table::Table {
    let mut table = table::new(&[
        "cause",
        "runs",
        "ok",
        "stood [ms]",
        "allowed [ms]",
        "coasted [ms]",
        "apart [ms]",
        "standby again",
    ]);
    table::align_right(&mut table, &[1, 2, 3, 4, 5, 6, 7]);
    for cause in Cause::ALL {
        let of_cause: Vec<&Row> = runs.iter().filter(|row| row.kind == Some(cause)).collect();
        if of_cause.is_empty() {
            continue;
        }
        let figures = || of_cause.iter().filter_map(|row| row.figures);
        let worst = |value: fn(Figures) -> Option<f64>| {
            let worst = figures().filter_map(value).max_by(f64::total_cmp);
            worst.map_or_else(|| "-".into(), |ms| format!("{ms:.0}"))
        };
        let count = |test: fn(&Row) -> bool| of_cause.iter().filter(|row| test(row)).count();
        table.add_row([
            cause.words().to_string(),
            of_cause.len().to_string(),
            count(|row| row.ok).to_string(),
            worst(|f| f.stood_ms),
            worst(|f| Some(f.allowed_ms)),
            worst(|f| f.coasted_ms),
            worst(|f| f.apart_ms),
            count(|row| row.figures.is_some_and(|f| f.recovered)).to_string(),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_hundred_seeds_have_every_cause_in_motion_and_every_phase() {
        let strikes: Vec<Strike> = (1..=200).map(|seed| Strike::random(seed, 6)).collect();
        for cause in Cause::ALL {
            let in_motion =
                |strike: &&Strike| strike.cause == cause && strike.phase.to_string() == "motion";
            assert!(strikes.iter().filter(in_motion).count() >= 3, "{cause:?}");
        }
        for phase in ["start", "standby", "release", "motion", "stop"] {
            let there = strikes
                .iter()
                .any(|strike| strike.phase.to_string() == phase);
            assert!(there, "{phase}");
        }
        for axis in 0..6 {
            assert!(strikes.iter().any(|strike| strike.axis == axis));
        }
    }

    #[test]
    fn the_table_has_a_row_for_each_cause_that_came() {
        let row = |cause: Cause, ok| Row {
            seed: 1,
            ok,
            reason: String::new(),
            cause: cause.words(),
            node: 1,
            phase: "motion".into(),
            wall_s: 1.0,
            figures: ok.then_some(Figures {
                at_s: 3.0,
                stood_ms: Some(432.1),
                allowed_ms: 865.0,
                coasted_ms: None,
                apart_ms: Some(4.0),
                recovered: false,
            }),
            kind: Some(cause),
        };
        let runs = [row(Cause::Sto, true), row(Cause::Sto, false)];
        let text = as_table(&runs).to_string();
        let line = text.lines().find(|line| line.contains("safe torque off"));
        let cells: Vec<&str> = line.unwrap().split_whitespace().skip(3).collect();
        assert_eq!(cells, ["2", "1", "432", "865", "-", "4", "0"]);
        assert!(!text.contains("heartbeat"));
    }
}

//! A random fault at a random moment with each seed: the contract for faults, on
//! the emulated board.

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::Result;
use canmaster::motion::GroupState;
use canmaster_sim::judge::Cause;
use canmaster_sim::time::Time;
use canmaster_sim::world::Image;
use canmaster_sim::world::strike::{MODES, Strike, Struck};
use serde::Serialize;

use super::pool;
use crate::table;

/// The JSON object.
#[derive(Serialize)]
struct Report {
    result: &'static str,
    seeds: u64,
    wall_s: f64,
    /// How many strikes came in each state of the group and mode of the drives.
    struck: Vec<Count>,
    runs: Vec<Row>,
}

/// How many strikes came in a state, in each mode.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
struct Count {
    state: String,
    strikes: usize,
    modes: BTreeMap<&'static str, usize>,
}

/// One seed.
#[derive(Clone, Debug, Serialize)]
struct Row {
    seed: u64,
    ok: bool,
    reason: String,
    cause: &'static str,
    node: u8,
    /// Who led the group to the moment, and what was ordered or done last.
    led_by: String,
    phase: String,
    /// At the moment of the fault.
    at_s: Option<f64>,
    state: Option<String>,
    mode: Option<&'static str>,
    wall_s: f64,
    #[serde(flatten)]
    figures: Option<Figures>,
    #[serde(skip)]
    kind: Option<Cause>,
}

/// What was measured, in the plant.
#[derive(Clone, Copy, Debug, Serialize)]
struct Figures {
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
                        led_by,
                        phase,
                        state,
                        reason,
                        ..
                    } = row;
                    let state = state.as_deref().unwrap_or("not led there");
                    eprintln!(
                        "seed {seed}, {cause}, node {node}, {led_by}, {phase} ({state}): {reason}"
                    );
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
            struck: counts(&runs),
            runs,
        };
        println!("{}", serde_json::to_string(&report)?);
    } else {
        println!("{}", as_table(&runs));
        println!("{}", states_table(&counts(&runs)));
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
        let (moment, outcome) = strike.run(images.of(&strike), seed);
        Row {
            seed,
            ok: outcome.is_ok(),
            figures: outcome.as_ref().ok().map(Figures::of),
            reason: outcome.err().map(|e| e.to_string()).unwrap_or_default(),
            cause: strike.cause.words(),
            node: nodes[strike.axis].id.get(),
            led_by: strike.leader.to_string(),
            phase: strike.phase.to_string(),
            at_s: moment.as_ref().map(|moment| moment.at.as_secs_f64()),
            state: moment.as_ref().map(|moment| moment.state.to_string()),
            mode: moment.as_ref().map(|moment| moment.mode),
            wall_s: started.elapsed().as_secs_f64(),
            kind: Some(strike.cause),
        }
    }
}

impl Figures {
    fn of(struck: &Struck) -> Figures {
        Figures {
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

/// How many strikes came in which state and mode: all states, so that a hole is seen.
fn counts(runs: &[Row]) -> Vec<Count> {
    let of = |state: GroupState| {
        let state = state.to_string();
        let there = runs.iter().filter(|row| row.state.as_ref() == Some(&state));
        let mut modes = BTreeMap::new();
        for mode in there.filter_map(|row| row.mode) {
            *modes.entry(mode).or_default() += 1;
        }
        Count {
            state,
            strikes: modes.values().sum(),
            modes,
        }
    };
    GroupState::ALL.into_iter().map(of).collect()
}

fn states_table(counts: &[Count]) -> comfy_table::Table {
    let mut heading = vec!["state of the group", "strikes"];
    heading.extend(MODES);
    let mut table = table::new(&heading);
    let columns: Vec<usize> = (1..heading.len()).collect();
    table::align_right(&mut table, &columns);
    for Count {
        state,
        strikes,
        modes,
    } in counts
    {
        let in_mode = |mode| modes.get(mode).map_or("-".into(), usize::to_string);
        let mut cells = vec![state.clone(), strikes.to_string()];
        cells.extend(MODES.map(in_mode));
        table.add_row(cells);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_hundred_seeds_have_every_cause_in_motion_every_phase_and_every_leader() {
        let strikes: Vec<Strike> = (1..=200).map(|seed| Strike::random(seed, 6)).collect();
        for cause in Cause::ALL {
            let moves = |strike: &Strike| {
                let phase = strike.phase.to_string();
                let moving = ["release", "motion", "homing", "stop", "halt", "quick stop"];
                moving.contains(&phase.as_str())
            };
            let in_motion = |strike: &&Strike| strike.cause == cause && moves(strike);
            assert!(strikes.iter().filter(in_motion).count() >= 3, "{cause:?}");
        }
        for phase in [
            "start",
            "standby",
            "release",
            "motion",
            "stop",
            "homing",
            "mode change",
            "halt",
            "quick stop",
            "disable",
            "enable",
        ] {
            let there = strikes
                .iter()
                .any(|strike| strike.phase.to_string() == phase);
            assert!(there, "{phase}");
        }
        let led_by = |words: &str| {
            let led = |strike: &&Strike| strike.leader.to_string().contains(words);
            strikes.iter().filter(led).count()
        };
        assert!(led_by("button") >= 40 && led_by("client") >= 90 && led_by("program") >= 30);
        for mode in ["position", "velocity", "torque", "homing", "mixed", "tour"] {
            assert!(led_by(mode) >= 5, "{mode}");
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
            led_by: "button".into(),
            phase: "motion".into(),
            at_s: Some(3.0),
            state: Some("moving".into()),
            mode: Some("profile velocity"),
            wall_s: 1.0,
            figures: ok.then_some(Figures {
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
        let struck = counts(&runs);
        assert_eq!(struck.len(), GroupState::ALL.len());
        let moving = struck.iter().find(|count| count.state == "moving").unwrap();
        assert_eq!((moving.strikes, moving.modes["profile velocity"]), (2, 2));
        let text = states_table(&struck).to_string();
        let hole = text
            .lines()
            .find(|line| line.contains("homing ") && !line.contains("state"));
        assert!(hole.unwrap().contains(" 0 "));
    }
}

//! `cargo xtask bench`: figures that the release image has to reach on the
//! emulated board, judged on the bus; and instructions of the library's hot
//! functions.

mod choices;
pub(crate) mod cycle;
pub(crate) mod instructions;
mod motion;
pub(crate) mod realtime;
mod sdo;
pub(crate) mod self_measurement;
mod startup;

use std::process::ExitCode;

use anyhow::Result;
use canmaster_sim::time::Time;
use canmaster_sim::world::Image;
use serde::Serialize;

use crate::cli::{self, Bench, BenchOptions};
use crate::machine::Checked;
use realtime::{CASES, Order};

pub(crate) fn command(options: &BenchOptions) -> Result<ExitCode> {
    let outcome = match options.bench {
        Bench::Startup => startup::run(&image()?, options.seed)?,
        Bench::Sdo => sdo::run(&image()?, options.seed)?,
        Bench::Motion => motion::run(&image()?, options.seed)?,
        Bench::Instructions => instructions::run(options.accept)?,
        Bench::Cycle => {
            let span = Time::from_secs_f64(options.seconds.unwrap_or(CYCLE_S));
            cycle::run(options.seed, span, options.document)?
        }
        Bench::Realtime => realtime::run(&order(options))?,
        Bench::Choices => choices::run(options.seed)?,
        Bench::SelfMeasurement => {
            let span = Time::from_secs_f64(options.seconds.unwrap_or(CYCLE_S));
            self_measurement::run(options.seed, span)?
        }
    };
    if options.json {
        println!("{}", outcome.json);
    } else {
        println!("{}", outcome.table);
    }
    if outcome.missed.is_empty() {
        return Ok(ExitCode::SUCCESS);
    }
    for words in &outcome.missed {
        eprintln!("missed: {words}");
    }
    Ok(ExitCode::FAILURE)
}

/// Simulated seconds of motion that are looked at, where nobody says how many.
const REALTIME_S: f64 = 30.0;
const CYCLE_S: f64 = 3.0;

/// The image for the machine of the project.
fn image() -> Result<Image> {
    Checked::read(None)?.built()
}

fn order(options: &BenchOptions) -> Order {
    let scenario = options.scenario.clone();
    if let Some(name) = &scenario
        && CASES.iter().all(|case| case.name != name)
    {
        let names = CASES.map(|case| case.name).join(", ");
        cli::refuse(&format!("--scenario {name}: there are {names}"));
    }
    let last = options.seed.saturating_add(options.seeds - 1);
    Order {
        scenario,
        seeds: options.seed..=last,
        span: Time::from_secs_f64(options.seconds.unwrap_or(REALTIME_S)),
    }
}

/// What a bench comes to.
struct Outcome {
    json: String,
    table: comfy_table::Table,
    /// The limits that were missed, in words.
    missed: Vec<String>,
}

/// The JSON object of a bench: its figures, and whether they reach the limits.
#[derive(Serialize)]
struct Report<F> {
    result: &'static str,
    reason: String,
    seed: u64,
    wall_s: f64,
    #[serde(flatten)]
    figures: F,
}

impl<F: Serialize> Report<F> {
    fn new(figures: F, seed: u64, wall_s: f64, missed: &[String]) -> Report<F> {
        Report {
            result: if missed.is_empty() { "ok" } else { "failed" },
            reason: missed.join("; "),
            seed,
            wall_s,
            figures,
        }
    }

    fn json(&self) -> Result<String> {
        Ok(serde_json::to_string(self)?)
    }
}

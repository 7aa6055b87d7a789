//! `cargo xtask run`: the image on the emulated board, six drives, one table.

pub(crate) mod fault;
mod output;
mod progress;
pub(crate) mod summary;

use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result};
use canmaster_sim::judge::Outcome;
use canmaster_sim::time::Time;
use canmaster_sim::world::{self, Image, Scenario, World};

use crate::cli::RunOptions;
use crate::image::ImageSize;
use crate::{firmware, report};
use progress::Progress;
use summary::Summary;

/// Time for booting, configuring and enabling, and the operator's patience, of
/// a run whose length is not given.
const START: Time = Time::from_ms(3500);
/// What such a run shows after the round trip.
const MARGIN: Time = Time::from_ms(1000);

pub(crate) fn command(options: &RunOptions) -> Result<ExitCode> {
    eprintln!("Building the firmware.");
    let elf = firmware::build()?;
    let size = ImageSize::read(&elf)?;
    let image = Image::read(&elf).context("the firmware image cannot be run")?;
    let started = Instant::now();
    let scenario = scenario(options);
    let mut progress = Progress::new(options, scenario.end);
    let record = World::new(&image, scenario)
        .context("the emulated board cannot boot this image")?
        .run(&mut progress);
    progress.finish();
    for complaint in &record.complaints {
        eprintln!("board: {complaint}");
    }
    let summary = Summary::new(&record, &size, started.elapsed());
    let mut files = output::write(&record, &summary)?;
    if let Some(path) = &options.picture {
        files.push(output::save(path, report::picture(&record)?.as_bytes())?);
    }
    if options.json {
        println!("{}", serde_json::to_string(&summary)?);
    } else {
        println!("{}", summary.as_table());
        for file in files {
            println!("{file}");
        }
    }
    match record.verdict.outcome {
        Outcome::Ok => Ok(ExitCode::SUCCESS),
        outcome => {
            eprintln!("{outcome}: {}", record.verdict.reason);
            Ok(ExitCode::FAILURE)
        }
    }
}

fn scenario(options: &RunOptions) -> Scenario {
    let end = options
        .seconds
        .map_or_else(default_end, Time::from_secs_f64);
    let sound = Scenario::new(options.seed, end);
    let complete = options
        .without
        .iter()
        .fold(sound, |scenario, &node| scenario.without(node));
    options
        .fault
        .iter()
        .fold(complete, |scenario, fault| fault.apply(scenario))
}

/// Enough for one round trip.
fn default_end() -> Time {
    START + world::round_trip().unwrap_or(Time::ZERO) + MARGIN
}

//! `cargo xtask run`: the image on the emulated board, six drives, one table.

mod ctrl_c;
pub(crate) mod fault;
mod output;
mod progress;
pub(crate) mod summary;

use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result};
use canmaster_sim::bridge::Bridge;
use canmaster_sim::judge::Outcome;
use canmaster_sim::time::Time;
use canmaster_sim::world::{self, Image, Scenario, World};

use crate::cli::{self, RunOptions};
use crate::image::ImageSize;
use crate::{firmware, report};
use progress::Progress;
use summary::Summary;

/// Time for booting, configuring and enabling, and the operator's patience, of
/// a run whose length is not given.
const START: Time = Time::from_ms(3500);
/// What it takes longer when the drives have no node-ID: their boot time that
/// passes in vain, the search, and a second boot.
const FACTORY: Time = Time::from_ms(4500);
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
    let mut world =
        World::new(&image, scenario).context("the emulated board cannot boot this image")?;
    if let Some(port) = options.bridge {
        world = world.with_bridge(bridge(port)?);
        progress.stop_on(ctrl_c::handle()?);
    }
    let record = world.run(&mut progress);
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
    let end = match options.seconds {
        Some(seconds) => Time::from_secs_f64(seconds),
        None if options.bridge.is_some() => Time::from_secs_f64(cli::LONGEST_RUN_S),
        None if options.factory => default_end() + FACTORY,
        None => default_end(),
    };
    let mut sound = Scenario::new(options.seed, end);
    sound.factory = options.factory;
    if options.stranger {
        sound = sound.with_stranger();
    }
    let complete = options
        .without
        .iter()
        .fold(sound, |scenario, &node| scenario.without(node));
    options
        .fault
        .iter()
        .fold(complete, |scenario, fault| fault.apply(scenario))
}

/// A bridge, and how to use it.
fn bridge(port: u16) -> Result<Bridge> {
    let bridge = Bridge::listen(port, world::network().bit_rate).with_context(|| {
        format!("cannot listen on port {port} of this computer; --bridge 0 takes one that is free")
    })?;
    eprintln!(
        "The bus is open to other tools: interface slcan, channel socket://{}; Ctrl-C ends the run.",
        bridge.address()
    );
    Ok(bridge)
}

/// Enough for one round trip.
fn default_end() -> Time {
    START + world::round_trip().unwrap_or(Time::ZERO) + MARGIN
}

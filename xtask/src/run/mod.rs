//! `cargo xtask run`: the image on the emulated board, six drives, one table.

mod ctrl_c;
mod download;
pub(crate) mod fault;
mod output;
mod progress;
pub(crate) mod summary;

use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result};
use canmaster::network::{self, Network};
use canmaster_sim::bridge::Bridge;
use canmaster_sim::judge::Outcome;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Machine, Scenario, World};

use crate::cli::{self, RunOptions};
use crate::image::ImageSize;
use crate::machine::Checked;
use crate::report;
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
    let file = options.machine.network.as_deref();
    let (checked, program) = match &options.program {
        Some(program) => {
            let (checked, program) = Checked::with_program(file, program)?;
            (checked, Some(program))
        }
        None => (Checked::read(file)?, None),
    };
    known(options, checked.machine.network());
    eprintln!("Building the firmware.");
    let elf = checked.build()?;
    let size = ImageSize::read(&elf)?;
    let image = checked.image(&elf)?;
    let started = Instant::now();
    let mut scenario = scenario(options, &checked.machine);
    if program.is_some() || options.unattended {
        // Nobody presses the button before the program is there, or at all.
        scenario = scenario.unattended();
    }
    let mut progress = Progress::new(options, &checked.machine, scenario.end);
    let mut world =
        World::new(&image, scenario).context("the emulated board cannot boot this image")?;
    if let Some(port) = options.bridge {
        world = world.with_bridge(bridge(port, checked.machine.network())?);
        progress.stop_on(ctrl_c::handle()?);
    }
    if let Some(program) = &program {
        world = download::before_the_release(world, program)?;
    }
    let record = world.run(&mut progress);
    progress.finish();
    for complaint in &record.complaints {
        eprintln!("board: {complaint}");
    }
    let summary = Summary::new(&record, &size, started.elapsed());
    let mut files = output::write(&record, &summary, &checked.buses)?;
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

/// Nodes that the network does not name end the program, and faults that they
/// cannot have.
fn known(options: &RunOptions, network: &'static Network) {
    let ids = || {
        let ids: Vec<String> = network
            .nodes
            .iter()
            .map(|n| n.id.get().to_string())
            .collect();
        ids.join(", ")
    };
    for &node in &options.without {
        if network.find(node).is_none() {
            let (node, ids) = (node.get(), ids());
            cli::refuse(&format!(
                "--without {node}: the network has the nodes {ids}"
            ));
        }
    }
    for fault in &options.fault {
        if let Err(words) = fault.check(network) {
            cli::refuse(&format!("--fault: {words}"));
        }
    }
}

fn scenario(options: &RunOptions, machine: &Machine) -> Scenario {
    let end = match options.seconds {
        Some(seconds) => Time::from_secs_f64(seconds),
        None if options.bridge.is_some() => Time::from_secs_f64(cli::LONGEST_RUN_S),
        None if options.factory => default_end(machine) + FACTORY,
        None => default_end(machine),
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
fn bridge(port: u16, network: &Network) -> Result<Bridge> {
    let bridge = Bridge::listen(port, network.bit_rate).with_context(|| {
        format!("cannot listen on port {port} of this computer; --bridge 0 takes one that is free")
    })?;
    eprintln!(
        "The bus is open to other tools: interface slcan, channel socket://{}; Ctrl-C ends the run.",
        bridge.address()
    );
    Ok(bridge)
}

/// Enough for one round trip: what the sample needs, and what a slower bus takes
/// longer to configure its drives and to enable them.
pub(crate) fn default_end(machine: &Machine) -> Time {
    let network = machine.network();
    let writes = |node| network::plan(network, node).count() as u64;
    let transfers: u64 = network.nodes.iter().map(writes).sum();
    let configuring =
        Time::from_us(transfers * TRANSFER_BITS * US_PER_S / u64::from(network.bit_rate));
    let enabling = Time::from_us(ENABLING_CYCLES * u64::from(network.cycle.as_micros()));
    START + configuring + enabling + machine.round_trip().unwrap_or(Time::ZERO) + MARGIN
}

/// A request and its answer, with room for retries.
const TRANSFER_BITS: u64 = 400;
/// Until all drives are enabled.
const ENABLING_CYCLES: u64 = 50;
const US_PER_S: u64 = 1_000_000;

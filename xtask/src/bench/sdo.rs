//! How fast the image moves 100 kB to and from one drive by SDO.
//!
//! A tool on the bus describes the transfer in 2F12h of the board, starts it and
//! is silent until it is over. The board makes the data that it sends and checks
//! what it gets, the drive does so by itself, and the time is taken on the wire.

use std::time::Instant;

use anyhow::{Context, Result, anyhow, bail, ensure};
use canmaster::NodeId;
use canmaster::id::Address;
use canmaster_sim::drive::test_data::{self, TestData};
use canmaster_sim::drive::{DriveConfig, Spread};
use canmaster_sim::judge::sdo::{conversation, other_frames};
use canmaster_sim::time::Time;
use canmaster_sim::world::{Image, Scenario, World};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use super::{Outcome, Report};
use crate::table;

const MASTER: NodeId = NodeId::MAX;
/// No node of the network, so that nobody but the test speaks to it.
const DRIVE: NodeId = NodeId::constant::<10>();
const BYTES: u32 = 100_000;
const LATENCY_US: u64 = 250;
/// Segments per block.
const BLOCK_SIZE: u8 = 127;
/// The network's own drives are missing; the board has noticed by then, and has
/// nothing more to say.
const QUIET: Time = Time::from_ms(3000);
/// After so long a silence a transfer is over.
const SILENCE: Time = Time::from_ms(300);
/// The longest transfer that makes sense.
const PATIENCE: Time = Time::from_ms(30_000);
const END: Time = Time::from_ms(200_000);
/// How often the machine is looked at.
const LOOK: Time = Time::from_ms(20);

/// Bytes of data in a frame.
const SEGMENT: u64 = 7;

/// Limits of 1000 bytes in a second.
const BLOCK_LIMIT: f64 = 55.0;
const SEGMENTED_LIMIT: f64 = 13.0;

/// The record in the board: what each sub-index is.
const TEST: u16 = 0x2F12;
const TARGET: u8 = 1;
const SIZE: u8 = 2;
const SEED: u8 = 3;
const COMMAND: u8 = 4;
const MOVED: u8 = 5;
const RESULT: u8 = 7;
const HEARTBEAT: Address = Address::new(0x1017, 0);

/// One transfer: its name, the command that starts it, its limit.
struct Way {
    name: &'static str,
    command: u32,
    download: bool,
    limit: f64,
}

const fn way(name: &'static str, command: u32, download: bool, limit: f64) -> Way {
    Way {
        name,
        command,
        download,
        limit,
    }
}

const WAYS: [Way; 4] = [
    way("block download", 3, true, BLOCK_LIMIT),
    way("block upload", 4, false, BLOCK_LIMIT),
    way("segmented download", 1, true, SEGMENTED_LIMIT),
    way("segmented upload", 2, false, SEGMENTED_LIMIT),
];

#[derive(Serialize)]
struct Figures {
    #[serde(rename = "block_download_kB_s")]
    block_download: f64,
    #[serde(rename = "block_upload_kB_s")]
    block_upload: f64,
    #[serde(rename = "segmented_download_kB_s")]
    segmented_download: f64,
    #[serde(rename = "segmented_upload_kB_s")]
    segmented_upload: f64,
    bytes: u32,
    latency_us: u64,
    /// Frames on the bus during the transfers that were none of theirs.
    other_frames: usize,
}

/// What one transfer came to.
struct Moved {
    rate: f64,
    other_frames: usize,
}

pub(super) fn run(image: &Image, seed: u64) -> Result<Outcome> {
    let started = Instant::now();
    let mut world = World::new(image, scenario(seed))
        .context("the emulated board cannot boot this image")?
        .with_guest();
    eprintln!("Booting the board beside one drive.");
    world.run_until(QUIET);
    // The board falls silent but for the transfer.
    write(&mut world, HEARTBEAT, &0_u16.to_le_bytes())?;
    let target = u32::from(test_data::INDEX) << 16 | u32::from(DRIVE.get());
    for (sub, value) in [(TARGET, target), (SIZE, BYTES), (SEED, data_seed(seed))] {
        write(&mut world, Address::new(TEST, sub), &value.to_le_bytes())?;
    }
    let mut moved = Vec::new();
    for way in &WAYS {
        moved.push(transfer(&mut world, way).with_context(|| way.name)?);
    }
    let missed = missed(&moved);
    let figures = Figures {
        block_download: moved[0].rate,
        block_upload: moved[1].rate,
        segmented_download: moved[2].rate,
        segmented_upload: moved[3].rate,
        bytes: BYTES,
        latency_us: LATENCY_US,
        other_frames: moved.iter().map(|moved| moved.other_frames).sum(),
    };
    let report = Report::new(figures, seed, started.elapsed().as_secs_f64(), &missed);
    Ok(Outcome {
        json: report.json()?,
        table: as_table(&moved),
        missed,
    })
}

/// The limits that were missed, in words.
fn missed(moved: &[Moved]) -> Vec<String> {
    WAYS.iter()
        .zip(moved)
        .filter(|(way, moved)| moved.rate < way.limit)
        .map(|(way, moved)| {
            let (name, rate, limit) = (way.name, moved.rate, way.limit);
            format!("{name}: {rate:.1} kB/s, at least {limit} are wanted")
        })
        .collect()
}

fn scenario(seed: u64) -> Scenario {
    let drive = DriveConfig {
        sdo_latency: Spread::fixed(LATENCY_US),
        sdo_block_size: BLOCK_SIZE,
        test_data: Some(TestData::new(data_seed(seed), BYTES)),
        ..DriveConfig::new(DRIVE, seed)
    };
    let scenario = Scenario::new(seed, END).unattended().without_drives();
    scenario.stranger(drive)
}

/// The seed of the data, 32 bits.
fn data_seed(seed: u64) -> u32 {
    seed as u32 ^ (seed >> 32) as u32
}

fn write(world: &mut World<'_>, at: Address, data: &[u8]) -> Result<()> {
    world
        .sdo_write(MASTER, at, data)
        .map_err(|error| anyhow!("node {MASTER}, {error}"))
}

fn read(world: &mut World<'_>, sub: u8) -> Result<u32> {
    let response = world
        .sdo_read(MASTER, Address::new(TEST, sub))
        .map_err(|error| anyhow!("node {MASTER}, {error}"))?;
    response.as_u32().context("not a number")
}

fn transfer(world: &mut World<'_>, way: &Way) -> Result<Moved> {
    write(
        world,
        Address::new(TEST, COMMAND),
        &way.command.to_le_bytes(),
    )?;
    let begin = await_end(world, way)?;
    let result = read(world, RESULT)?;
    ensure!(
        result == 0,
        "ended with {}",
        canmaster::sdo::AbortCode(result)
    );
    let bytes = read(world, MOVED)?;
    ensure!(bytes == BYTES, "{bytes} bytes instead of {BYTES}");
    let data = world.stranger_of(DRIVE).and_then(|drive| drive.test_data());
    if way.download && !data.is_some_and(TestData::is_sound) {
        bail!("the drive got other data than was sent: {data:?}");
    }
    let wire = &world.wire()[begin.0..begin.1];
    let talk = conversation(wire, DRIVE).context("nothing on the wire")?;
    Ok(Moved {
        rate: f64::from(BYTES) / 1000.0 / (talk.last - talk.first).as_secs_f64(),
        other_frames: other_frames(wire, DRIVE),
    })
}

/// Waits for the end of the transfer; the records on the wire from its first
/// frame to its last.
fn await_end(world: &mut World<'_>, way: &Way) -> Result<(usize, usize)> {
    let style = ProgressStyle::with_template("{bar:24} {pos} of {len} bytes, {msg}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(u64::from(BYTES)).with_style(style);
    bar.set_message(way.name);
    let started = world.now();
    let mut wire = world.wire().len();
    // The tool's own talk with the board ends before.
    let from = wire;
    let mut last = started;
    while world.now() < last + SILENCE {
        ensure!(
            world.now() < started + PATIENCE,
            "still going on after {PATIENCE} s"
        );
        world.run_until(world.now() + LOOK);
        if world.wire().len() != wire {
            wire = world.wire().len();
            last = world.now();
        }
        let segments = conversation(&world.wire()[from..], DRIVE).map_or(0, |talk| {
            if way.download {
                talk.requests
            } else {
                talk.answers
            }
        });
        bar.set_position((segments * SEGMENT).min(u64::from(BYTES)));
    }
    bar.finish_and_clear();
    eprintln!("[{:6.2} s] {} done", last.as_secs_f64(), way.name);
    Ok((from, wire))
}

fn as_table(moved: &[Moved]) -> comfy_table::Table {
    let mut table = table::new(&["transfer", "kB/s", "at least"]);
    table::align_right(&mut table, &[1, 2]);
    for (way, moved) in WAYS.iter().zip(moved) {
        let (rate, limit) = (format!("{:.1}", moved.rate), way.limit.to_string());
        table.add_row([way.name, &rate, &limit]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_figures_have_the_documented_names() {
        let figures = Figures {
            block_download: 56.0,
            block_upload: 57.0,
            segmented_download: 13.5,
            segmented_upload: 14.0,
            bytes: BYTES,
            latency_us: LATENCY_US,
            other_frames: 0,
        };
        let json = Report::new(figures, 3, 1.5, &[]).json().unwrap();
        let object: serde_json::Value = serde_json::from_str(&json).unwrap();
        for (name, value) in [
            ("block_download_kB_s", 56.0),
            ("block_upload_kB_s", 57.0),
            ("segmented_download_kB_s", 13.5),
            ("segmented_upload_kB_s", 14.0),
        ] {
            assert_eq!(object[name], value, "{json}");
        }
        assert_eq!(object["result"], "ok");
        assert_eq!(object["seed"], 3);
    }

    #[test]
    fn a_slow_transfer_is_told() {
        let moved = [55.0, 54.9, 13.0, 12.9].map(|rate| Moved {
            rate,
            other_frames: 0,
        });
        let words = missed(&moved);
        let expected = [
            "block upload: 54.9 kB/s, at least 55 are wanted",
            "segmented upload: 12.9 kB/s, at least 13 are wanted",
        ];
        assert_eq!(words, expected);
    }
}

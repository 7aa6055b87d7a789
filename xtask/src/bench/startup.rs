//! How long the configuration of all drives takes, against what the bus allows.

use std::time::Instant;

use anyhow::{Context, Result, ensure};
use canmaster_sim::drive::{DriveConfig, Spread};
use canmaster_sim::judge::sdo::{Configuration, configuration};
use canmaster_sim::time::Time;
use canmaster_sim::world::{self, Image, Scenario, World};
use serde::Serialize;

use super::{Outcome, Report};
use crate::table;

/// How long a drive takes to answer an SDO request.
const LATENCY_US: u64 = 1000;
/// From reset to boot-up frame: the same for all drives, so that the
/// configuration does not wait for the boot time of one.
const BOOT_US: u64 = 300_000;
/// All drives are operational by then.
const LIMIT: Time = Time::from_ms(10_000);
/// The most that the configuration may take, in terms of its bound.
const RATIO_LIMIT: f64 = 1.3;

#[derive(Serialize)]
struct Figures {
    configure_ms: f64,
    wire_bound_ms: f64,
    ratio: f64,
    sequential_ms: f64,
    exchanges: u64,
    nodes: usize,
    latency_us: u64,
}

pub(super) fn run(image: &Image, seed: u64) -> Result<Outcome> {
    let started = Instant::now();
    let network = image.machine().network();
    let nodes: Vec<_> = network.nodes.iter().map(|node| node.id).collect();
    let scenario = Scenario::new(seed, LIMIT).unattended().tuned(tune);
    eprintln!("Booting the board and {} drives.", nodes.len());
    let mut world =
        World::new(image, scenario).context("the emulated board cannot boot this image")?;
    let operational = |world: &World<'_>| {
        let mut drives = world.statuses().flatten();
        drives.all(|status| world::operational(&status))
    };
    ensure!(
        world.run_to(LIMIT, operational),
        "not all drives were operational after {LIMIT} s; see `cargo xtask run`"
    );
    eprintln!(
        "[{:6.2} s] all drives are operational",
        world.now().as_secs_f64()
    );
    let bit_rate = network.bit_rate;
    let latency = Time::from_us(LATENCY_US);
    let judged = configuration(world.wire(), &nodes, latency, bit_rate)
        .context("a drive was not configured")?;
    let figures = Figures::new(&judged, nodes.len());
    let missed = figures.missed();
    let table = figures.as_table();
    let report = Report::new(figures, seed, started.elapsed().as_secs_f64(), &missed);
    Ok(Outcome {
        json: report.json()?,
        table,
        missed,
    })
}

fn tune(config: DriveConfig) -> DriveConfig {
    DriveConfig {
        boot: Spread::fixed(BOOT_US),
        sdo_latency: Spread::fixed(LATENCY_US),
        ..config
    }
}

impl Figures {
    fn new(judged: &Configuration, nodes: usize) -> Figures {
        let ms = |time: Time| time.as_us_f64() / 1000.0;
        Figures {
            configure_ms: ms(judged.took),
            wire_bound_ms: ms(judged.wire_bound),
            ratio: ms(judged.took) / ms(judged.wire_bound),
            sequential_ms: ms(judged.sequential),
            exchanges: judged.exchanges,
            nodes,
            latency_us: LATENCY_US,
        }
    }

    fn missed(&self) -> Vec<String> {
        if self.ratio <= RATIO_LIMIT {
            return Vec::new();
        }
        vec![format!(
            "configuration took {:.1} ms, {:.2} times its bound of {:.1} ms; at most \
             {RATIO_LIMIT} times are allowed",
            self.configure_ms, self.ratio, self.wire_bound_ms
        )]
    }

    fn as_table(&self) -> comfy_table::Table {
        table::facts(&[
            ("configuration", format!("{:.1} ms", self.configure_ms)),
            ("bound by the bus", format!("{:.1} ms", self.wire_bound_ms)),
            (
                "ratio",
                format!("{:.2} (at most {RATIO_LIMIT})", self.ratio),
            ),
            (
                "one node after the other",
                format!("{:.1} ms", self.sequential_ms),
            ),
            (
                "SDO exchanges",
                format!("{} with {} nodes", self.exchanges, self.nodes),
            ),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_configuration_is_told() {
        let judged = |took_ms| Configuration {
            took: Time::from_ms(took_ms),
            wire_bound: Time::from_ms(100),
            sequential: Time::from_ms(500),
            exchanges: 300,
        };
        assert!(Figures::new(&judged(130), 6).missed().is_empty());
        let missed = Figures::new(&judged(131), 6).missed();
        assert!(missed[0].contains("131.0 ms") && missed[0].contains("1.31"));
        let report = Report::new(Figures::new(&judged(131), 6), 1, 0.5, &missed);
        let object: serde_json::Value = serde_json::from_str(&report.json().unwrap()).unwrap();
        assert_eq!(object["result"], "failed");
        assert_eq!(object["configure_ms"], 131.0);
        assert_eq!(object["reason"], missed[0]);
    }
}

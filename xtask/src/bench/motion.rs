//! How many cycles of the core the steps of the axes take, in each mode that the
//! image has.

use std::time::Instant;

use anyhow::{Context, Result, ensure};
use canmaster_sim::board::irqs;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Image, Scenario, World};
use serde::Serialize;

use super::{Outcome, Report};
use crate::table;

/// The most that a step of all axes may take, cycles.
const WORST: u64 = 10_000;
/// All drives are enabled by then.
const READY_BY: Time = Time::from_ms(8000);
/// What a round trip may take beyond the program's own time.
const MARGIN: Time = Time::from_ms(1500);

/// A mode, and how it is measured.
struct Case {
    mode: &'static str,
    /// From standby until the axes stand again.
    moves: fn(&mut World<'_>) -> Result<()>,
}

/// The modes that the image has.
const CASES: [Case; 1] = [Case {
    mode: "profile velocity",
    moves: round_trip,
}];

/// What was measured in one mode.
#[derive(Serialize)]
struct Mode {
    mode: &'static str,
    mean: f64,
    worst: u64,
}

#[derive(Serialize)]
struct Figures {
    axes: usize,
    worst_allowed: u64,
    modes: Vec<Mode>,
}

pub(super) fn run(image: &Image, seed: u64) -> Result<Outcome> {
    let started = Instant::now();
    let mut modes = Vec::new();
    for case in CASES {
        eprintln!("{}", case.mode);
        modes.push(case.measure(image, seed)?);
    }
    let figures = Figures {
        axes: image.machine().network().nodes.len(),
        worst_allowed: WORST,
        modes,
    };
    let missed = figures.missed();
    let table = figures.as_table();
    let report = Report::new(figures, seed, started.elapsed().as_secs_f64(), &missed);
    Ok(Outcome {
        json: report.json()?,
        table,
        missed,
    })
}

impl Case {
    fn measure(&self, image: &Image, seed: u64) -> Result<Mode> {
        let scenario = Scenario::new(seed, Time::MAX).unattended();
        let mut world =
            World::new(image, scenario).context("the emulated board cannot boot this image")?;
        ensure!(
            world.run_to(READY_BY, World::ready),
            "not all drives were enabled after {READY_BY} s; see `cargo xtask run`"
        );
        world.clear_stats();
        (self.moves)(&mut world)?;
        let stats = world.board().stats();
        let steps = stats.irq(irqs::TIM3).context("the axes were not stepped")?;
        Ok(Mode {
            mode: self.mode,
            mean: steps.total_cycles as f64 / steps.count.max(1) as f64,
            worst: steps.worst_cycles,
        })
    }
}

/// The program, released by the button.
fn round_trip(world: &mut World<'_>) -> Result<()> {
    world.press();
    let limit = world.now() + world.machine().round_trip().unwrap_or(Time::ZERO) + MARGIN;
    let done = world.run_to(limit, |world| world.round_trips() == (1, false));
    ensure!(done, "the round trip did not end; see `cargo xtask run`");
    Ok(())
}

impl Figures {
    fn missed(&self) -> Vec<String> {
        let slow = self.modes.iter().filter(|mode| mode.worst > WORST);
        slow.map(|mode| {
            format!(
                "{}: {} cycles at worst, at most {WORST} are allowed",
                mode.mode, mode.worst
            )
        })
        .collect()
    }

    fn as_table(&self) -> comfy_table::Table {
        let mut table = table::new(&["mode", "mean [cycles]", "worst [cycles]", "allowed"]);
        table::align_right(&mut table, &[1, 2, 3]);
        for mode in &self.modes {
            table.add_row([
                mode.mode.to_string(),
                format!("{:.0}", mode.mean),
                mode.worst.to_string(),
                WORST.to_string(),
            ]);
        }
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_mode_is_told() {
        let figures = |worst| Figures {
            axes: 6,
            worst_allowed: WORST,
            modes: vec![Mode {
                mode: "profile velocity",
                mean: 5000.5,
                worst,
            }],
        };
        assert!(figures(WORST).missed().is_empty());
        let missed = figures(WORST + 1).missed();
        assert!(missed[0].contains("profile velocity: 10001 cycles"));
        let report = Report::new(figures(WORST + 1), 1, 0.5, &missed);
        let object: serde_json::Value = serde_json::from_str(&report.json().unwrap()).unwrap();
        assert_eq!(object["result"], "failed");
        assert_eq!(object["axes"], 6);
        assert_eq!(object["modes"][0]["mode"], "profile velocity");
        assert_eq!(object["modes"][0]["worst"], 10_001);
        assert_eq!(object["modes"][0]["mean"], 5000.5);
    }
}

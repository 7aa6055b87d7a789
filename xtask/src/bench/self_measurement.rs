//! What the firmware's measuring of itself costs: each image of `bench realtime` beside
//! one that is built without it.

use std::time::Instant;

use anyhow::{Context, Result};
use canmaster_sim::time::Time;
use canmaster_sim::world::{Image, World};
use serde::Serialize;

use super::realtime::{CASES, Case};
use super::{Outcome, Report};
use crate::machine::Checked;
use crate::table;

/// Of the CPU.
const LIMIT: f64 = 0.01;
/// All axes turn by then.
const MOVING_BY: Time = Time::from_ms(10_000);

/// The names are the JSON object's.
#[derive(Clone, Debug, Serialize)]
struct Row {
    name: &'static str,
    /// CPU load with it and without.
    with: f64,
    without: f64,
}

#[derive(Serialize)]
struct Figures {
    simulated_s: f64,
    limit: f64,
    scenarios: Vec<Row>,
}

/// The limits that are missed, in words.
pub(crate) fn sampled(seed: u64, span: Time) -> Result<Vec<String>> {
    let of = |case| measure(case, seed, span).context(case.name);
    let rows: Vec<Row> = CASES.iter().map(of).collect::<Result<_>>()?;
    Ok(rows.iter().filter_map(Row::missed).collect())
}

pub(super) fn run(seed: u64, span: Time) -> Result<Outcome> {
    let started = Instant::now();
    let mut scenarios = Vec::new();
    for case in &CASES {
        eprintln!("{}", case.name);
        scenarios.push(measure(case, seed, span).context(case.name)?);
    }
    let missed: Vec<String> = scenarios.iter().filter_map(Row::missed).collect();
    let table = as_table(&scenarios);
    let figures = Figures {
        simulated_s: span.as_secs_f64(),
        limit: LIMIT,
        scenarios,
    };
    let report = Report::new(figures, seed, started.elapsed().as_secs_f64(), &missed);
    Ok(Outcome {
        json: report.json()?,
        table,
        missed,
    })
}

fn measure(case: &Case, seed: u64, span: Time) -> Result<Row> {
    let checked = Checked::read(Some(&case.path()))?;
    let load = |image: &Image| cpu_load(case, image, seed, span);
    Ok(Row {
        name: case.name,
        with: load(&checked.built()?)?,
        without: load(&checked.built_unmeasured()?)?,
    })
}

/// The load of the CPU while the axes move.
fn cpu_load(case: &Case, image: &Image, seed: u64, span: Time) -> Result<f64> {
    let scenario = case.scenario(image.machine(), seed);
    let mut world =
        World::new(image, scenario).context("the emulated board cannot boot this image")?;
    anyhow::ensure!(
        world.run_to(MOVING_BY, World::in_full_motion),
        "the axes do not turn"
    );
    world.clear_stats();
    world.run_until(world.now() + span);
    Ok(world.board().stats().cpu_load())
}

impl Row {
    fn cost(&self) -> f64 {
        self.with - self.without
    }

    fn missed(&self) -> Option<String> {
        (self.cost() > LIMIT).then(|| {
            format!(
                "{}: measuring itself takes {:.2} % of the CPU, at most {:.0} % are allowed",
                self.name,
                self.cost() * 100.0,
                LIMIT * 100.0
            )
        })
    }
}

fn as_table(rows: &[Row]) -> comfy_table::Table {
    let mut table = table::new(&["scenario", "CPU", "without", "cost"]);
    table::align_right(&mut table, &[1, 2, 3]);
    let percent = |share: f64| format!("{:.2} %", share * 100.0);
    for row in rows {
        table.add_row([
            row.name.to_string(),
            percent(row.with),
            percent(row.without),
            percent(row.cost()),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cost_above_the_limit_is_told() {
        let row = |with| Row {
            name: "one_bus_2ms",
            with,
            without: 0.045,
        };
        assert_eq!(row(0.054).missed(), None);
        assert!(row(0.056).missed().unwrap().contains("1.10 %"));
    }
}

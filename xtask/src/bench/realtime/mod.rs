//! Real time: whether the image holds its cycle in the scenarios of `networks`,
//! how even its SYNC is, and what it costs. Judged on the wires and by the
//! emulated board; what the firmware reports about itself stands beside it.

mod case;
mod figures;
mod own;
pub(super) mod session;

use std::time::Instant;

use anyhow::{Context, Result};
use canmaster_sim::time::Time;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use super::{Outcome, Report};
use crate::table;
pub(super) use case::SEARCHED;
pub(crate) use case::{CASES, Case};
pub(crate) use figures::Figures;
pub(super) use figures::between;
pub(crate) use session::Built;

/// What is asked for.
#[derive(Clone, Debug)]
pub(crate) struct Order {
    /// One of [`CASES`]; all of them without.
    pub(crate) scenario: Option<String>,
    /// The seeds.
    pub(crate) seeds: std::ops::RangeInclusive<u64>,
    /// How much of each is looked at.
    pub(crate) span: Time,
}

#[derive(Serialize)]
struct Scenarios {
    scenarios: Vec<Figures>,
}

pub(super) fn run(order: &Order) -> Result<Outcome> {
    let started = Instant::now();
    let wanted = |case: &&Case| {
        order
            .scenario
            .as_deref()
            .is_none_or(|name| name == case.name)
    };
    let mut scenarios = Vec::new();
    let mut missed = Vec::new();
    for case in CASES.iter().filter(wanted) {
        let figures = measure(case, order).with_context(|| case.name)?;
        missed.extend(figures.missed_limits(case));
        eprintln!(
            "{}: {} missed, jitter {:.2} us, {:.2} times real time",
            case.name,
            figures.cells()[2],
            figures.jitter_pp_us,
            figures.times_real_time()
        );
        scenarios.push(figures);
    }
    let mut table = table::new(&Figures::HEADING);
    table::align_right(&mut table, &std::array::from_fn::<_, 14, _>(|k| k + 1));
    for figures in &scenarios {
        table.add_row(figures.cells());
    }
    let wall_s = started.elapsed().as_secs_f64();
    let seed = *order.seeds.start();
    let report = Report::new(Scenarios { scenarios }, seed, wall_s, &missed);
    Ok(Outcome {
        json: report.json()?,
        table,
        missed,
    })
}

/// Builds the image of a scenario.
pub(crate) fn built(case: &Case) -> Result<Built> {
    eprintln!("{}", case.name);
    Built::new(&case.path())
}

/// One run of a scenario.
pub(crate) fn measure_one(case: &Case, built: &Built, seed: u64, span: Time) -> Result<Figures> {
    session::run(case, built, seed, span, &ProgressBar::hidden())
}

/// Builds the image of a scenario and runs it with every seed.
fn measure(case: &Case, order: &Order) -> Result<Figures> {
    let built = built(case)?;
    let bar = bar();
    let mut all: Option<Figures> = None;
    for seed in order.seeds.clone() {
        let figures = session::run(case, &built, seed, order.span, &bar)?;
        all = Some(match all {
            Some(all) => all.and(figures),
            None => figures,
        });
    }
    bar.finish_and_clear();
    all.context("there is no seed")
}

fn bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:24} {pos} of {len} ms, {msg}, {eta} to go")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(0).with_style(style)
}

#[cfg(test)]
mod tests;

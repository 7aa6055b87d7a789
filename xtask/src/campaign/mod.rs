//! `cargo xtask campaign`: the long figures, of which `test` takes samples.

mod faults;
mod job;
mod pool;

use std::process::ExitCode;
use std::time::Instant;

use anyhow::Result;
use canmaster_sim::time::Time;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::bench::realtime::{self, CASES};
use crate::bench::{cycle, self_measurement};
use crate::cargo;
use crate::cli::CampaignOptions;
use crate::machine::Checked;
use crate::networks::{self, Variant};
use crate::table;
use faults::Images;
use job::{Job, Row};

/// Seeds, where none are given.
const SEEDS: u64 = 20;
/// The same with a fault each.
const FAULTS: u64 = 200;
/// Seeds of each scenario of `bench realtime`, and how much of each is looked at.
const REALTIME_SEEDS: u64 = 5;
const REALTIME_SPAN: Time = Time::from_ms(30_000);
/// How much of each is looked at where a bench is sampled.
const SAMPLE_SPAN: Time = Time::from_ms(1_000);

/// The JSON object.
#[derive(Serialize)]
struct Report {
    result: &'static str,
    seeds: u64,
    seconds: f64,
    wall_s: f64,
    runs: Vec<Row>,
}

pub(crate) fn command(options: &CampaignOptions) -> Result<ExitCode> {
    let image = Checked::read(None)?.built()?;
    let workers = options.jobs.map_or_else(pool::cores, |jobs| jobs as usize);
    if options.faults {
        let seeds = options.seeds.unwrap_or(FAULTS);
        let unhurried = cargo::workspace().join(networks::UNHURRIED);
        let images = Images {
            sample: image,
            with_heartbeats: Checked::read(Some(&unhurried))?.built()?,
        };
        return faults::command(&images, seeds, workers, options.json);
    }
    let seeds = options.seeds.unwrap_or(SEEDS);
    let end = Time::from_secs_f64(options.seconds);
    let jobs: Vec<Job> = (1..=seeds).flat_map(|seed| Job::all(seed, end)).collect();
    let started = Instant::now();
    let bar = progress(jobs.len());
    let runs = pool::run(
        &jobs,
        workers,
        |job| job.run(&image),
        |row: &Row| {
            bar.inc(1);
            if !row.ok {
                bar.suspend(|| eprintln!("seed {}, {}: {}", row.seed, row.kind, row.reason));
            }
        },
    );
    bar.finish_and_clear();
    let runs: Vec<Row> = runs
        .into_iter()
        .chain(networks::all().map(network))
        .chain(real_time(workers))
        .chain([
            sampled("bench cycle", cycle::sampled),
            sampled("bench self-measurement", self_measurement::sampled),
        ])
        .collect();
    let wall_s = started.elapsed().as_secs_f64();
    let ok = runs.iter().filter(|row| row.ok).count();
    let all_ok = ok == runs.len();
    if options.json {
        let result = if all_ok { "ok" } else { "failed" };
        let seconds = options.seconds;
        println!(
            "{}",
            serde_json::to_string(&Report {
                result,
                seeds,
                seconds,
                wall_s,
                runs
            })?
        );
    } else {
        println!("{}", as_table(&runs));
        println!("{ok} of {} runs ok, in {wall_s:.0} s", runs.len());
    }
    Ok(if all_ok {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// Builds and runs another machine than the sample.
fn network(variant: Variant) -> Row {
    eprintln!("{}", variant.name());
    let row = Row::of(variant);
    if !row.ok {
        eprintln!("{}: {}", row.kind, row.reason);
    }
    row
}

/// Some of what a bench measures, for a short time.
fn sampled(name: &str, limits: fn(u64, Time) -> Result<Vec<String>>) -> Row {
    const SEED: u64 = 1;
    eprintln!("{name}");
    let started = Instant::now();
    let missed = limits(SEED, SAMPLE_SPAN).unwrap_or_else(|error| vec![format!("{error:#}")]);
    let row = Row::of_bench(name, SEED, &missed, started.elapsed().as_secs_f64());
    if !row.ok {
        eprintln!("{}: {}", row.kind, row.reason);
    }
    row
}

/// The scenarios of `bench realtime`, long and with several seeds.
fn real_time(workers: usize) -> Vec<Row> {
    let started = Instant::now();
    let images: Vec<_> = CASES.iter().map(realtime::built).collect();
    let jobs: Vec<(usize, u64)> = (1..=REALTIME_SEEDS)
        .flat_map(|seed| (0..CASES.len()).map(move |case| (case, seed)))
        .collect();
    let bar = progress(jobs.len());
    let runs = pool::run(
        &jobs,
        workers,
        |&(case, seed)| {
            let built = images[case].as_ref().map_err(|e| format!("{e:#}"))?;
            realtime::measure_one(&CASES[case], built, seed, REALTIME_SPAN)
                .map_err(|e| format!("seed {seed}: {e:#}"))
        },
        |_| bar.inc(1),
    );
    bar.finish_and_clear();
    let wall_s = started.elapsed().as_secs_f64();
    let mut of_case: Vec<Vec<_>> = CASES.iter().map(|_| Vec::new()).collect();
    for ((case, _), run) in jobs.iter().zip(runs) {
        of_case[*case].push(run);
    }
    let rows = CASES.iter().zip(of_case);
    rows.map(|(case, runs)| Row::real_time(case, REALTIME_SEEDS, runs, wall_s))
        .collect()
}

fn progress(jobs: usize) -> ProgressBar {
    let bar = ProgressBar::new(jobs as u64);
    let style =
        ProgressStyle::with_template("{bar:24} {pos} of {len} runs, {elapsed}, {eta} to go")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.with_style(style)
}

fn as_table(runs: &[Row]) -> comfy_table::Table {
    let mut table = table::new(&Row::HEADING);
    table::align_right(&mut table, &[0, 3, 4, 5, 6, 7, 8, 9]);
    for row in runs {
        table.add_row(row.cells());
    }
    table
}

//! The smallest cycle that holds, for one axis to twelve on one bus, beside what
//! the layout computes and what the wire allows.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use canmaster_network::{Source, read_for_firmware};
use canmaster_sim::time::Time;
use indicatif::ProgressBar;
use serde::Serialize;

use super::realtime::{Built, SEARCHED, session};
use super::{Outcome, Report};
use crate::report::plot;
use crate::{cargo, cli, new, table};

/// What all of them are like but for the number of nodes and the cycle.
const LIKE: &str = "networks/one_bus_2ms.toml";
const DESCRIPTION: &str = "network.toml";
const NODES: &str = "[[node]]";
const AXES: std::ops::RangeInclusive<u32> = 1..=12;
/// From the last TPDO to the first RPDO: as [`LIKE`] has it, and what the check asks for
/// each axis.
const COMPUTE_US: u32 = 120;
const COMPUTE_AXIS_US: u32 = 20;
/// What a campaign looks at.
const SAMPLES: [u32; 3] = [1, 6, 12];
/// With as many axes as the sample has the stack may be so deep.
const STACK_AXES: u32 = 6;
const STACK_BYTES: u32 = 4096;
/// Cycles are looked for in steps of this, not below the first.
const STEP_US: usize = 50;
const SHORTEST_US: u32 = 500;
/// Far above what twelve axes need.
const LONGEST_US: u32 = 10_000;
/// What holds may be so many percent longer than what the layout computes.
const PERCENT_LIMIT: u32 = 5;
/// Where the table and the plot go.
const DOCUMENT: &str = "docs/performance.md";
const PICTURE: &str = "docs/cycle.svg";
/// Between these lines of the document.
const BEGIN: &str = "<!-- begin: cargo xtask bench cycle --document -->\n";
const END: &str = "<!-- end -->";

/// One number of axes.
#[derive(Clone, Copy, Debug, Serialize)]
struct Row {
    axes: u32,
    /// SYNC and the PDOs of every cycle at worst, one behind the other.
    wire_bound_us: u32,
    /// The smallest that the check lets through.
    layout_bound_us: u32,
    /// The smallest that held.
    held_us: u32,
    load_max: f64,
    cpu_load: f64,
    jitter_pp_us: f64,
    stack_high_water_bytes: u32,
    /// Cycles without a PDO before all drives were operational, when they still sent
    /// heartbeats, for which such a cycle has no place.
    missed_before: usize,
}

#[derive(Serialize)]
struct Figures {
    simulated_s: f64,
    rows: Vec<Row>,
}

pub(super) fn run(seed: u64, span: Time, document: bool) -> Result<Outcome> {
    let started = Instant::now();
    let mut rows = Vec::new();
    for axes in AXES {
        let row = search(axes, seed, span).with_context(|| format!("{axes} axes"))?;
        eprintln!(
            "{axes} axes: {} us, {} bytes of stack, {} cycles missed before motion",
            row.held_us, row.stack_high_water_bytes, row.missed_before
        );
        rows.push(row);
    }
    let missed = missed(&rows);
    let table = as_table(&rows);
    let picture = picture(&rows)?;
    if document {
        save(&cargo::workspace().join(PICTURE), &picture)?;
        let path = cargo::workspace().join(DOCUMENT);
        let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        save(&path, &replaced(&text, &markdown(&rows))?)?;
    } else {
        let folder = cli::results_dir();
        fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
        save(&folder.join("cycle.svg"), &picture)?;
    }
    let figures = Figures {
        simulated_s: span.as_secs_f64(),
        rows,
    };
    let report = Report::new(figures, seed, started.elapsed().as_secs_f64(), &missed);
    Ok(Outcome {
        json: report.json()?,
        table,
        missed,
    })
}

fn save(path: &Path, text: &str) -> Result<()> {
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))?;
    eprintln!("{}", path.display());
    Ok(())
}

/// The smallest cycle from the layout's bound on that holds.
fn search(axes: u32, seed: u64, span: Time) -> Result<Row> {
    let dir = folder(axes)?;
    let like = fs::read_to_string(cargo::workspace().join(LIKE)).context(LIKE)?;
    let bound = bound(&like, axes, &dir).context("no cycle is long enough")?;
    let bar = ProgressBar::hidden();
    for cycle_us in (bound..=LONGEST_US).step_by(STEP_US) {
        let path = dir.join(DESCRIPTION);
        fs::write(&path, describe(&like, axes, cycle_us))
            .with_context(|| path.display().to_string())?;
        let built = Built::new(&path)?;
        eprintln!("{axes} axes at {cycle_us} us");
        let figures = match session::run(&SEARCHED, &built, seed, span, &bar) {
            Ok(figures) => figures,
            Err(error) => {
                eprintln!("does not hold: {error:#}");
                continue;
            }
        };
        let missed = figures.missed_limits(&SEARCHED);
        if missed.is_empty() {
            return Ok(Row {
                axes,
                wire_bound_us: built.wire_bound_us,
                layout_bound_us: bound,
                held_us: cycle_us,
                load_max: figures.load_max,
                cpu_load: figures.cpu_load,
                jitter_pp_us: figures.jitter_pp_us,
                stack_high_water_bytes: figures.stack_high_water_bytes,
                missed_before: figures.missed_before,
            });
        }
        eprintln!("does not hold: {}", missed.join("; "));
    }
    anyhow::bail!("no cycle up to {LONGEST_US} us holds")
}

/// The limits that are missed with a few numbers of axes, in words.
pub(crate) fn sampled(seed: u64, span: Time) -> Result<Vec<String>> {
    let of = |axes| search(axes, seed, span).with_context(|| format!("{axes} axes"));
    let rows: Vec<Row> = SAMPLES.into_iter().map(of).collect::<Result<_>>()?;
    Ok(missed(&rows))
}

/// A folder with what a description names.
fn folder(axes: u32) -> Result<PathBuf> {
    let name = format!("cycle-{axes}");
    let networks = cargo::workspace().join("target").join("networks");
    let dir = networks.join(name);
    new::copy(&dir)?;
    Ok(dir)
}

/// The smallest cycle that the check lets through.
fn bound(like: &str, axes: u32, dir: &Path) -> Option<u32> {
    let name = dir.join(DESCRIPTION).display().to_string();
    let accepted = |cycle_us: &u32| {
        let text = describe(like, axes, *cycle_us);
        let source = Source::new(&name, text.as_bytes());
        let outcome = read_for_firmware(&source, &mut |file| fs::read(file));
        outcome.machine.is_some()
    };
    (SHORTEST_US..=LONGEST_US).step_by(STEP_US).find(accepted)
}

/// The description with another number of nodes, another cycle, a capacity limit of
/// 100 %, and drives that answer SDO as at 1 ms.
fn describe(like: &str, axes: u32, cycle_us: u32) -> String {
    let common = like.split(NODES).next().unwrap_or_default();
    let mut text = String::new();
    for line in common.lines() {
        let key = line.split('=').next().unwrap_or_default().trim();
        let _ = match key {
            "cycle_us" => writeln!(text, "cycle_us = {cycle_us}"),
            "compute_us" => writeln!(
                text,
                "compute_us = {}",
                COMPUTE_US.max(COMPUTE_AXIS_US * axes)
            ),
            "load_limit" => writeln!(text, "load_limit = 100"),
            // An answer may come in the next cycle.
            "sdo_frames" => writeln!(text, "sdo_frames = 1"),
            "sdo_latency_us" => writeln!(text, "sdo_latency_us = [200, 500]"),
            "eds" => writeln!(text, "{}", line.replace("../eds/", "eds/")),
            _ => writeln!(text, "{line}"),
        };
    }
    for axis in 1..=axes {
        let _ = writeln!(
            text,
            "{NODES}\nid = {axis}\nname = \"axis {axis}\"\ndevice = \"epos4\"\n"
        );
    }
    text
}

/// How much longer than the layout's bound it is, percent, rounded up.
fn above_bound(row: &Row) -> u32 {
    const PERCENT: u32 = 100;
    let longer = row.held_us.saturating_sub(row.layout_bound_us);
    (longer * PERCENT).div_ceil(row.layout_bound_us.max(1))
}

fn missed(rows: &[Row]) -> Vec<String> {
    let far = rows.iter().filter(|row| above_bound(row) > PERCENT_LIMIT);
    let far = far.map(|row| {
        format!(
            "{} axes: {} us hold, {} % above the layout's bound of {} us; at most \
             {PERCENT_LIMIT} % are allowed",
            row.axes,
            row.held_us,
            above_bound(row),
            row.layout_bound_us
        )
    });
    let deep = |row: &&Row| row.axes <= STACK_AXES && row.stack_high_water_bytes > STACK_BYTES;
    let deep = rows.iter().filter(deep).map(|row| {
        format!(
            "{} axes: {} bytes of stack, at most {STACK_BYTES} are allowed",
            row.axes, row.stack_high_water_bytes
        )
    });
    far.chain(deep).collect()
}

const HEADING: [&str; 7] = [
    "axes",
    "wire bound [us]",
    "layout [us]",
    "holds [us]",
    "load",
    "CPU",
    "jitter [us]",
];

fn cells(row: &Row) -> [String; HEADING.len()] {
    let percent = |share: f64| format!("{:.1} %", share * 100.0);
    [
        row.axes.to_string(),
        row.wire_bound_us.to_string(),
        row.layout_bound_us.to_string(),
        row.held_us.to_string(),
        percent(row.load_max),
        percent(row.cpu_load),
        format!("{:.2}", row.jitter_pp_us),
    ]
}

fn as_table(rows: &[Row]) -> comfy_table::Table {
    let mut table = table::new(&HEADING);
    table::align_right(&mut table, &std::array::from_fn::<_, 7, _>(|column| column));
    for row in rows {
        table.add_row(cells(row));
    }
    table
}

fn markdown(rows: &[Row]) -> String {
    let mut text = format!("| {} |\n", HEADING.join(" | "));
    text.push_str(&"|---:".repeat(HEADING.len()));
    text.push_str("|\n");
    for row in rows {
        let _ = writeln!(text, "| {} |", cells(row).join(" | "));
    }
    text
}

/// The document with another table between the marks.
fn replaced(text: &str, table: &str) -> Result<String> {
    let missing = || format!("{DOCUMENT} has no place for the table: {BEGIN} .. {END}");
    let (before, rest) = text.split_once(BEGIN).with_context(missing)?;
    let (_, after) = rest.split_once(END).with_context(missing)?;
    Ok(format!("{before}{BEGIN}\n{table}\n{END}{after}"))
}

fn picture(rows: &[Row]) -> Result<String> {
    let curve = |name: &str, value: fn(&Row) -> u32| plot::Curve {
        name: name.to_string(),
        points: rows
            .iter()
            .map(|row| (f64::from(row.axes), f64::from(value(row))))
            .collect(),
    };
    let curves = [
        curve("holds", |row| row.held_us),
        curve("layout", |row| row.layout_bound_us),
        curve("wire", |row| row.wire_bound_us),
    ];
    plot::lines("axes on one bus at 1 Mbit/s", "cycle [us]", &curves)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_grows_with_the_axes() {
        let workspace = cargo::workspace();
        let like = fs::read_to_string(workspace.join(LIKE)).unwrap();
        let bounds = [1, 3, 6, 12].map(|axes| bound(&like, axes, &workspace).unwrap());
        assert!(bounds.is_sorted(), "{bounds:?}");
        assert!(bounds[2] <= 2000, "{bounds:?}");
    }

    #[test]
    fn the_document_keeps_what_is_around_the_table() {
        let text = format!("before\n{BEGIN}old{END}\nafter\n");
        let new = replaced(&text, "| new |").unwrap();
        assert!(
            new.starts_with("before\n") && new.ends_with("\nafter\n"),
            "{new}"
        );
        assert!(new.contains("| new |") && !new.contains("old"), "{new}");
        assert_eq!(replaced(&new, "| new |").unwrap(), new);
        assert!(replaced("no marks", "").is_err());
    }

    #[test]
    fn a_cycle_far_above_the_bound_is_told() {
        let row = |held_us| Row {
            axes: 6,
            wire_bound_us: 1435,
            layout_bound_us: 2000,
            held_us,
            load_max: 0.85,
            cpu_load: 0.04,
            jitter_pp_us: 1.0,
            stack_high_water_bytes: 4096,
            missed_before: 2,
        };
        assert!(missed(&[row(2000), row(2100)]).is_empty());
        assert_eq!(missed(&[row(2150)]).len(), 1);
        let deep = |axes| Row {
            axes,
            stack_high_water_bytes: 4100,
            ..row(2000)
        };
        assert_eq!(missed(&[deep(6), deep(9)]).len(), 1);
        let table = markdown(&[row(2000)]);
        assert_eq!(table.lines().count(), 3);
        assert!(table.ends_with("| 6 | 1435 | 2000 | 2000 | 85.0 % | 4.0 % | 1.00 |\n"));
    }
}

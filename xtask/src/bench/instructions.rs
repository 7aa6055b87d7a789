//! `cargo xtask bench instructions`: what one call of each hot function of the
//! library takes, in instructions of this computer, counted by Valgrind. The counts
//! repeat exactly; `instructions-budget.toml` limits them.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};

use super::Outcome;
use crate::{cargo, table};

/// The program that calls them.
const PACKAGE: &str = "canmaster-instructions";
const VALGRIND: &str = "valgrind";
/// Limits, in the workspace.
const BUDGET: &str = "instructions-budget.toml";
/// Limits are for the code of one processor and one system.
const BUDGET_IS_FOR: bool = cfg!(all(target_arch = "x86_64", target_os = "linux"));
/// Where Valgrind says how much it counted.
const COLLECTED: &str = "Collected :";
/// A limit that is accepted has room for another compiler: a tenth.
const ROOM_PERCENT: u64 = 110;
const PERCENT: u64 = 100;

/// What is not counted because Valgrind is missing, in words.
pub(crate) const MISSING: &str =
    "valgrind is not in PATH (Debian: apt install valgrind): instructions are not counted";

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Budget {
    /// Instructions of one call.
    limits: BTreeMap<String, u64>,
}

/// One function.
#[derive(Debug, Serialize)]
struct Row {
    name: String,
    instructions: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    limit: Option<u64>,
}

#[derive(Serialize)]
struct Report {
    result: &'static str,
    reason: String,
    rows: Vec<Row>,
}

/// What the program says of a case.
struct Case {
    name: String,
    few: u32,
    many: u32,
}

/// Whether there is something to count with.
pub(crate) fn is_possible() -> bool {
    Command::new(VALGRIND)
        .arg("--version")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Counts; `accept` writes the limits anew.
pub(super) fn run(accept: bool) -> Result<Outcome> {
    if !is_possible() {
        bail!("{MISSING}");
    }
    eprintln!("Building the hot functions.");
    let program = build()?;
    let budget_file = cargo::workspace().join(BUDGET);
    let cases = cases(&program)?;
    let mut counted = Vec::new();
    for case in &cases {
        counted.push((case.name.clone(), count(&program, case)?));
    }
    if accept {
        fs::write(&budget_file, accepted(&counted))
            .with_context(|| budget_file.display().to_string())?;
    }
    let budget = read(&budget_file)?;
    let (rows, missed) = judge(counted, &budget.limits);
    let mut shown = table::new(&["function", "instructions", "limit"]);
    for row in &rows {
        let limit = row.limit.map_or(String::new(), |limit| limit.to_string());
        shown.add_row([row.name.clone(), row.instructions.to_string(), limit]);
    }
    table::align_right(&mut shown, &[1, 2]);
    let report = Report {
        result: if missed.is_empty() { "ok" } else { "failed" },
        reason: missed.join("; "),
        rows,
    };
    Ok(Outcome {
        json: serde_json::to_string(&report)?,
        table: shown,
        missed,
    })
}

/// Builds the program as small as the image, and says where it is.
fn build() -> Result<PathBuf> {
    let mut command = cargo::cargo();
    command
        .args(["build", "--release", "--locked", "--package", PACKAGE])
        .args(["--message-format", "json-render-diagnostics"])
        .stdin(Stdio::null())
        .stderr(Stdio::inherit());
    let output = command.output().context("cannot start cargo")?;
    if !output.status.success() {
        bail!("`{}` ended with {}", cargo::line(&command), output.status);
    }
    String::from_utf8_lossy(&output.stdout)
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .find_map(|message| {
            let ours = message["target"]["name"] == PACKAGE;
            let program = message["executable"].as_str().filter(|_| ours);
            program.map(PathBuf::from)
        })
        .context("cargo built no such program")
}

fn cases(program: &Path) -> Result<Vec<Case>> {
    let output = Command::new(program)
        .stdin(Stdio::null())
        .output()
        .with_context(|| program.display().to_string())?;
    let text = String::from_utf8(output.stdout).context("its names are text")?;
    let case = |line: &str| {
        let mut parts = line.split('\t');
        Some(Case {
            name: parts.next()?.to_string(),
            few: parts.next()?.parse().ok()?,
            many: parts.next()?.parse().ok()?,
        })
    };
    let cases: Option<Vec<Case>> = text.lines().map(case).collect();
    cases.with_context(|| format!("it lists no cases: {text}"))
}

/// Instructions of one call, rounded.
fn count(program: &Path, case: &Case) -> Result<u64> {
    let few = collected(program, &case.name, case.few)?;
    let many = collected(program, &case.name, case.many)?;
    let calls = u64::from(case.many - case.few);
    Ok((many.saturating_sub(few) + calls / 2) / calls)
}

/// Instructions of the whole program.
fn collected(program: &Path, name: &str, times: u32) -> Result<u64> {
    let output = Command::new(VALGRIND)
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(program)
        .args([name, &times.to_string()])
        .env_clear()
        .stdin(Stdio::null())
        .output()
        .context(MISSING)?;
    let words = String::from_utf8_lossy(&output.stderr);
    if !output.status.success() {
        bail!(
            "`{name}` {times} times ended with {}: {words}",
            output.status
        );
    }
    let number = words
        .lines()
        .find_map(|line| line.split_once(COLLECTED))
        .and_then(|(_, number)| number.trim().parse().ok());
    number.with_context(|| format!("Valgrind counted nothing: {words}"))
}

fn read(file: &Path) -> Result<Budget> {
    let text = fs::read_to_string(file).with_context(|| file.display().to_string())?;
    toml::from_str(&text).with_context(|| file.display().to_string())
}

/// The file for these counts.
fn accepted(counted: &[(String, u64)]) -> String {
    let mut text = String::from(
        "# What one call of each hot function may take, in instructions on x86-64 Linux.\n\
         # `cargo xtask bench instructions` counts them, `--accept` writes this file with a\n\
         # tenth of room, and `cargo xtask ci` fails above.\n\n[limits]\n",
    );
    for (name, count) in counted {
        let limit = (count * ROOM_PERCENT).div_ceil(PERCENT);
        text.push_str(&format!("\"{name}\" = {limit}\n"));
    }
    text
}

/// Rows of the table, and what is too much.
fn judge(counted: Vec<(String, u64)>, limits: &BTreeMap<String, u64>) -> (Vec<Row>, Vec<String>) {
    let mut missed: Vec<String> = limits
        .keys()
        .filter(|name| counted.iter().all(|(counted, _)| counted != *name))
        .map(|name| format!("{BUDGET} limits \"{name}\", which is not counted"))
        .collect();
    let mut rows = Vec::new();
    for (name, instructions) in counted {
        let limit = limits.get(&name).copied().filter(|_| BUDGET_IS_FOR);
        match limit {
            Some(limit) if instructions > limit => missed.push(format!(
                "{name}: {instructions} instructions, more than {limit} ({BUDGET})"
            )),
            None if BUDGET_IS_FOR => missed.push(format!("{BUDGET} has no limit for \"{name}\"")),
            _ => {}
        }
        rows.push(Row {
            name,
            instructions,
            limit,
        });
    }
    (rows, missed)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits(of: &[(&str, u64)]) -> BTreeMap<String, u64> {
        of.iter().map(|(name, n)| (name.to_string(), *n)).collect()
    }

    #[test]
    fn what_takes_more_than_its_limit_is_named() {
        let counted = vec![("put".to_string(), 101), ("next".to_string(), 50)];
        let (rows, missed) = judge(counted, &limits(&[("put", 100), ("next", 50), ("gone", 1)]));
        assert_eq!(rows.len(), 2);
        let expected = if BUDGET_IS_FOR { 2 } else { 1 };
        assert_eq!(missed.len(), expected, "{missed:?}");
        assert!(missed[0].contains("\"gone\""));
    }

    #[test]
    fn accepted_limits_are_read_again_with_a_tenth_of_room() {
        let text = accepted(&[("a b".to_string(), 100), ("c".to_string(), 1)]);
        let budget: Budget = toml::from_str(&text).unwrap();
        assert_eq!(budget.limits, limits(&[("a b", 110), ("c", 2)]));
    }

    #[test]
    fn the_file_of_the_project_can_be_read() {
        let budget = read(&cargo::workspace().join(BUDGET)).unwrap();
        assert!(budget.limits.len() >= 20);
    }
}

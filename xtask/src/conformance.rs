//! `docs/conformance.md` names modules and tests: this finds out whether they
//! exist, so that the table cannot drift away from the code.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::cargo;

const TABLE: &str = "docs/conformance.md";
/// Where modules and tests are.
const SOURCES: [&str; 9] = [
    "src",
    "tests",
    "sim/src",
    "sim/tests",
    "network/src",
    "network/tests",
    "xtask/src",
    "xtask/tests",
    "boards",
];
/// What the paths in the table are relative to.
const ROOTS: [&str; 4] = ["src", "sim/src", "network/src", ""];

/// Every module and every test of the table exists.
pub(crate) fn check() -> Result<()> {
    let root = cargo::workspace();
    let table = fs::read_to_string(root.join(TABLE)).with_context(|| format!("reading {TABLE}"))?;
    let mut files = Vec::new();
    for folder in SOURCES {
        collect(&root.join(folder), &mut files)?;
    }
    let mut tests = BTreeSet::new();
    for file in &files {
        let text = fs::read_to_string(file).with_context(|| file.display().to_string())?;
        tests.extend(test_names(&text).map(String::from));
    }
    let exists = |path: &str| {
        ROOTS.iter().any(|base| root.join(base).join(path).exists())
            || files.iter().any(|file| file.ends_with(path))
    };
    let missing: Vec<String> = rows(&table)
        .flat_map(|(line, named)| named.into_iter().map(move |name| (line, name)))
        .filter(|(_, name)| {
            let is_path = name.contains('/') || name.contains('.');
            !(if is_path {
                exists(name)
            } else {
                tests.contains(*name)
            })
        })
        .map(|(line, name)| format!("{TABLE}:{line}: `{name}` does not exist"))
        .collect();
    if !missing.is_empty() {
        bail!("{}", missing.join("\n"));
    }
    Ok(())
}

/// What the last two cells of each row name in backquotes, with the number of
/// the line.
fn rows(table: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    (1..).zip(table.lines()).filter_map(|(number, line)| {
        let cells: Vec<&str> = line
            .strip_prefix('|')?
            .strip_suffix('|')?
            .split('|')
            .collect();
        let named = cells.iter().rev().take(2);
        Some((
            number,
            named
                .flat_map(|cell| cell.split('`').skip(1).step_by(2))
                .collect(),
        ))
    })
}

/// The functions that are tests: `#[test]` stands before them, with nothing but
/// other attributes and comments between.
fn test_names(source: &str) -> impl Iterator<Item = &str> {
    let mut is_test = false;
    source.lines().filter_map(move |line| {
        is_test |= line.trim_start().starts_with("#[test]");
        let name = line.split_once("fn ")?.1;
        std::mem::take(&mut is_test).then_some(())?;
        name.split(|c: char| !c.is_alphanumeric() && c != '_')
            .next()
    })
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    let entries = fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    for entry in entries {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stand_in_the_last_two_cells() {
        let table = "text\n| `clause` | what | `a.rs`, `b/` | `x`, `y` |\n|---|---|---|---|\n";
        let found: Vec<_> = rows(table).collect();
        assert_eq!(found, [(2, vec!["x", "y", "a.rs", "b/"]), (3, vec![])]);
    }

    #[test]
    fn tests_are_found_by_their_names() {
        let source = "#[test]\n/// Words.\n    fn one() {\nfn two<T>(x: T) {\n  #[test]\n  fn three(x in 0..2) {";
        assert_eq!(test_names(source).collect::<Vec<_>>(), ["one", "three"]);
    }

    #[test]
    fn the_table_of_this_project_is_right() {
        check().unwrap();
    }
}

//! The files that a run leaves in `target/run`.

use std::path::Path;

use anyhow::{Context, Result};
use canmaster_sim::bus::log::write_candump;
use canmaster_sim::world::Record;

use super::summary::Summary;
use crate::{cli, report};

/// What the bus is called in the log.
const INTERFACE: &str = "can0";

/// Writes them and says where they are.
pub(super) fn write(record: &Record, summary: &Summary) -> Result<Vec<String>> {
    let directory = cli::results_dir();
    std::fs::create_dir_all(&directory)
        .with_context(|| format!("cannot create {}", directory.display()))?;
    let mut log = Vec::new();
    write_candump(&mut log, INTERFACE, &record.wire)?;
    let page = report::html(record, summary)?.into_bytes();
    [("bus.log", log), ("report.html", page)]
        .into_iter()
        .map(|(name, content)| save(&directory.join(name), &content))
        .collect()
}

/// Writes one file and says where it is.
pub(super) fn save(path: &Path, content: &[u8]) -> Result<String> {
    std::fs::write(path, content).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(path.display().to_string())
}

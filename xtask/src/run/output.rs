//! The files that a run leaves in `target/run`.

use std::path::Path;

use anyhow::{Context, Result};
use canmaster_network::model::Bus;
use canmaster_sim::bus::WireRecord;
use canmaster_sim::bus::log::write_candump;
use canmaster_sim::world::Record;

use super::summary::Summary;
use crate::{cli, report};

/// What the buses are called in the log, with their number after it.
const INTERFACE: &str = "can";

/// Writes them and says where they are.
pub(super) fn write(record: &Record, summary: &Summary, laid_out: &[Bus]) -> Result<Vec<String>> {
    let directory = cli::results_dir();
    std::fs::create_dir_all(&directory)
        .with_context(|| format!("cannot create {}", directory.display()))?;
    let log = bus_log(record)?;
    let page = report::html(record, summary, laid_out)?.into_bytes();
    [("bus.log", log), ("report.html", page)]
        .into_iter()
        .map(|(name, content)| save(&directory.join(name), &content))
        .collect()
}

/// Everything that was on the buses, in the order of time.
fn bus_log(record: &Record) -> Result<Vec<u8>> {
    let mut all: Vec<(usize, &WireRecord)> = Vec::new();
    for (number, bus) in record.buses.iter().enumerate() {
        all.extend(bus.wire.iter().map(|wire| (number, wire)));
    }
    all.sort_by_key(|(_, wire)| wire.sof);
    let mut log = Vec::new();
    for (number, wire) in all {
        write_candump(&mut log, &format!("{INTERFACE}{number}"), [wire])?;
    }
    Ok(log)
}

/// Writes one file and says where it is.
pub(super) fn save(path: &Path, content: &[u8]) -> Result<String> {
    std::fs::write(path, content).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(path.display().to_string())
}

//! `cargo xtask capacity`: how many nodes can be updated in 0.1 s.

mod bench;
mod measure;

use std::process::ExitCode;

use anyhow::{Context, Result};
use canmaster_network::s1::{BIT_RATES, NODES_MAX, Row};
use measure::Measured;
use serde::Serialize;

use crate::cli::CapacityOptions;
use crate::table;

/// The JSON object.
#[derive(Serialize)]
struct Report {
    rows: Vec<JsonRow>,
}

#[derive(Serialize)]
struct JsonRow {
    bitrate: u32,
    sdo_paper: u32,
    pdo_paper: u32,
    pdo_paper_uncapped: u32,
    sdo_exact: u32,
    pdo_exact: u32,
    pdo_exact_uncapped: u32,
    #[serde(flatten)]
    measured: Option<JsonMeasured>,
}

/// What `--measure` adds.
#[derive(Serialize)]
struct JsonMeasured {
    sdo_counted: u32,
    pdo_counted: u32,
    pdo_counted_uncapped: u32,
    sdo_measured: u32,
    pdo_measured: u32,
    pdo_measured_uncapped: u32,
}

impl From<Row> for JsonRow {
    fn from(row: Row) -> JsonRow {
        JsonRow {
            bitrate: row.bit_rate,
            sdo_paper: row.sdo_paper,
            pdo_paper: row.pdo_paper(),
            pdo_paper_uncapped: row.pdo_paper_uncapped,
            sdo_exact: row.sdo_exact,
            pdo_exact: row.pdo_exact(),
            pdo_exact_uncapped: row.pdo_exact_uncapped,
            measured: None,
        }
    }
}

impl From<Measured> for JsonMeasured {
    fn from(measured: Measured) -> JsonMeasured {
        JsonMeasured {
            sdo_counted: measured.sdo_counted,
            pdo_counted: measured.pdo_counted_uncapped.min(NODES_MAX),
            pdo_counted_uncapped: measured.pdo_counted_uncapped,
            sdo_measured: measured.sdo,
            pdo_measured: measured.pdo_uncapped.min(NODES_MAX),
            pdo_measured_uncapped: measured.pdo_uncapped,
        }
    }
}

/// `cargo xtask capacity`.
pub(crate) fn command(options: &CapacityOptions) -> Result<ExitCode> {
    let mut rows = Vec::new();
    for bit_rate in BIT_RATES {
        let row = Row::new(bit_rate);
        let measured = match options.measure {
            true => Some(Measured::at(&row).with_context(|| format!("{bit_rate} bit/s"))?),
            false => None,
        };
        rows.push(JsonRow {
            measured: measured.map(JsonMeasured::from),
            ..JsonRow::from(row)
        });
    }
    if options.json {
        println!("{}", serde_json::to_string_pretty(&Report { rows })?);
        return Ok(ExitCode::SUCCESS);
    }
    println!(
        "Nodes that get controlword, target velocity, acceleration and deceleration every \
         0.1 s,\nwith the most stuff bits in every frame:\n"
    );
    let mut heading = vec!["bit/s", "SDO, paper", "CiA 301"];
    let measured = ["counted", "measured"];
    heading.extend(measured.iter().filter(|_| options.measure));
    heading.extend(["PDO, paper", "CiA 301"]);
    heading.extend(measured.iter().filter(|_| options.measure));
    let mut table = table::new(&heading);
    for row in &rows {
        let measured = row.measured.as_ref();
        let mut cells = [row.bitrate, row.sdo_paper, row.sdo_exact]
            .iter()
            .map(u32::to_string)
            .collect::<Vec<_>>();
        cells.extend(
            measured
                .iter()
                .flat_map(|m| [m.sdo_counted.to_string(), m.sdo_measured.to_string()]),
        );
        cells.push(capped(row.pdo_paper_uncapped));
        cells.push(capped(row.pdo_exact_uncapped));
        cells.extend(measured.iter().flat_map(|m| {
            [
                capped(m.pdo_counted_uncapped),
                capped(m.pdo_measured_uncapped),
            ]
        }));
        table.add_row(cells);
    }
    let columns: Vec<usize> = (0..heading.len()).collect();
    table::align_right(&mut table, &columns);
    println!(
        "{table}\n\nSDO: four requests with their answers, and 8 ms that the drive asks for. \
         The paper counts\nframes as long as what they carry, CiA 301 has eight bytes in each. \
         PDO: 8 and 6 bytes for\neach node, one SYNC for all. A network has at most {NODES_MAX} \
         nodes; in brackets what the bus\nalone would allow."
    );
    if options.measure {
        println!(
            "\nMeasured: this library as master of simulated drives on a bus simulated to the bit, \
             random\nvalues; above {NODES_MAX} nodes, node-IDs are used again. Counted: the formula \
             with the mean lengths\nof the frames in that run."
        );
    }
    Ok(ExitCode::SUCCESS)
}

/// With what the bus alone would allow, if that is more nodes than there can be.
fn capped(nodes: u32) -> String {
    if nodes <= NODES_MAX {
        nodes.to_string()
    } else {
        format!("{NODES_MAX} ({nodes})")
    }
}

//! `cargo xtask capacity`: how many nodes can be updated in 0.1 s.

use std::process::ExitCode;

use anyhow::Result;
use canmaster_network::s1::{BIT_RATES, NODES_MAX, Row};
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
        }
    }
}

/// `cargo xtask capacity`.
pub(crate) fn command(options: &CapacityOptions) -> Result<ExitCode> {
    let rows: Vec<JsonRow> = BIT_RATES.map(Row::new).map(JsonRow::from).into();
    if options.json {
        println!("{}", serde_json::to_string_pretty(&Report { rows })?);
        return Ok(ExitCode::SUCCESS);
    }
    println!(
        "Nodes that get controlword, target velocity, acceleration and deceleration every \
         0.1 s,\nwith the most stuff bits in every frame:\n"
    );
    let mut table = table::new(&[
        "bit/s",
        "SDO, paper",
        "SDO, CiA 301",
        "PDO, paper",
        "PDO, CiA 301",
    ]);
    for row in &rows {
        let capped = |nodes: u32, uncapped: u32| match nodes == uncapped {
            true => nodes.to_string(),
            false => format!("{nodes} ({uncapped})"),
        };
        table.add_row([
            row.bitrate.to_string(),
            row.sdo_paper.to_string(),
            row.sdo_exact.to_string(),
            capped(row.pdo_paper, row.pdo_paper_uncapped),
            capped(row.pdo_exact, row.pdo_exact_uncapped),
        ]);
    }
    table::align_right(&mut table, &[0, 1, 2, 3, 4]);
    println!(
        "{table}\n\nSDO: four requests with their answers, and 8 ms that the drive asks for. \
         The paper counts\nframes as long as what they carry, CiA 301 has eight bytes in each. \
         PDO: 8 and 6 bytes for\neach node, one SYNC for all. A network has at most {NODES_MAX} \
         nodes; in brackets what the bus\nalone would allow."
    );
    Ok(ExitCode::SUCCESS)
}

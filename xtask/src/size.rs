//! `cargo xtask size`.

use std::process::ExitCode;

use anyhow::Result;
use serde::Serialize;

use crate::cli::SizeOptions;
use crate::image::{Budget, ImageSize};
use crate::machine::Checked;
use crate::table;

#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    size: &'a ImageSize,
    budget: Budget,
    within_budget: bool,
}

pub(crate) fn command(options: &SizeOptions) -> Result<ExitCode> {
    let checked = Checked::read(options.machine.network.as_deref())?;
    let size = ImageSize::read(&checked.build()?)?;
    let budget = Budget::read()?.of(checked.axes());
    let exceeded = budget.exceeded_by(&size);
    if options.json {
        let report = Report {
            size: &size,
            budget,
            within_budget: exceeded.is_empty(),
        };
        println!("{}", serde_json::to_string(&report)?);
    } else {
        println!("{}", as_table(&size, budget));
    }
    for line in &exceeded {
        eprintln!("error: {line} ({})", Budget::FILE);
    }
    Ok(if exceeded.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// The sections and their sums against the budget.
pub(crate) fn as_table(size: &ImageSize, budget: Budget) -> comfy_table::Table {
    let mut table = table::new(&["section", "address", "flash", "RAM"]);
    table::align_right(&mut table, &[1, 2, 3]);
    let bytes = |n: u64| if n == 0 { String::new() } else { n.to_string() };
    for section in &size.sections {
        table.add_row([
            section.name.clone(),
            format!("{:#010x}", section.address),
            bytes(section.flash_bytes),
            bytes(section.ram_bytes),
        ]);
    }
    table.add_row([
        "sum".into(),
        String::new(),
        size.flash_bytes.to_string(),
        size.ram_bytes.to_string(),
    ]);
    table.add_row([
        "budget".into(),
        String::new(),
        budget.flash_bytes.to_string(),
        budget.ram_bytes.to_string(),
    ]);
    table
}

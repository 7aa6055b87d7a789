//! `cargo xtask check`: whether a machine can work, and what follows from it.

mod json;

use std::fs;
use std::ops::RangeInclusive;
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result};
use canmaster_network::derive::{concise_dcf, dbc, picture};
use canmaster_network::layout::{Layout, SlotKind};
use canmaster_network::model::{Bus, Machine};
use canmaster_sim::world::library;

use crate::cli::CheckOptions;
use crate::machine::{Description, counted};
use crate::{board_eds, cargo, report, table};

/// Letters of the picture of a cycle.
const WIDTH: usize = 72;
const NS_PER_US: u64 = 1000;
const PER_MILLE_TO_PERCENT: u32 = 10;

/// Rows of the table of a cycle.
const ROWS: [(SlotKind, &str); 8] = [
    (SlotKind::Sync, "SYNC"),
    (SlotKind::Latency, "drives answer"),
    (SlotKind::Tpdo, "TPDOs"),
    (SlotKind::Planned, "planned"),
    (SlotKind::Other, "heartbeats, EMCY, SDO"),
    (SlotKind::Compute, "master computes"),
    (SlotKind::Rpdo, "RPDOs"),
    (SlotKind::Guard, "guard"),
];

/// `cargo xtask check`.
pub(crate) fn command(options: &CheckOptions) -> Result<ExitCode> {
    let checked = Description::check(options.file.as_deref())?;
    let machine = &checked.machine;
    let folder = cargo::workspace().join("target").join("network");
    derived(machine, &folder)?;
    if options.json {
        let report = json::Report::new(machine, checked.warnings);
        println!("{}", serde_json::to_string(&report)?);
        return Ok(ExitCode::SUCCESS);
    }
    for bus in &machine.buses {
        show(bus, machine.cycles());
    }
    println!(
        "{}: {}, {}; derived files are in {}",
        checked.path.display(),
        counted(machine.nodes.len(), "node"),
        counted(checked.warnings, "warning"),
        folder.display()
    );
    Ok(ExitCode::SUCCESS)
}

/// `cycles`: those that all buses pass their check with.
fn show(bus: &Bus, cycles: RangeInclusive<u32>) {
    let layout = &bus.layout;
    println!(
        "bus \"{}\": FDCAN{}, {} bit/s, sample point {}.{} %, cycle {} us",
        bus.name,
        bus.peripheral,
        bus.bit_rate,
        bus.timing.sample_point() / PER_MILLE_TO_PERCENT,
        bus.timing.sample_point() % PER_MILLE_TO_PERCENT,
        bus.cycle_us
    );
    let mut cycle = table::new(&[
        "slot",
        "frames",
        "bits at worst",
        "us at worst",
        "ends at us",
    ]);
    for (kind, name) in ROWS {
        let slots: Vec<_> = layout
            .slots
            .iter()
            .filter(|slot| slot.kind == kind)
            .collect();
        let frames = slots.iter().filter(|slot| slot.bits > 0).count();
        let bits: u32 = slots.iter().map(|slot| slot.bits).sum();
        let us = slots
            .iter()
            .map(|slot| slot.length_ns)
            .sum::<u64>()
            .div_ceil(NS_PER_US);
        cycle.add_row([
            name.to_string(),
            frames.to_string(),
            bits.to_string(),
            us.to_string(),
            layout.end_us(kind).to_string(),
        ]);
    }
    table::align_right(&mut cycle, &[1, 2, 3, 4]);
    println!("{cycle}\n{}", picture(layout, WIDTH));
    println!("{}", summary(layout));
    println!("{}", plan(layout));
    let (shortest, longest) = cycles.into_inner();
    println!("1006h may be written {shortest} .. {longest} us\n");
}

fn summary(layout: &Layout) -> String {
    let percent = |per_mille: u32| {
        let (whole, tenth) = (
            per_mille / PER_MILLE_TO_PERCENT,
            per_mille % PER_MILLE_TO_PERCENT,
        );
        format!("{whole}.{tenth} %")
    };
    let smallest = match layout.demand.smallest_cycle() {
        Some(us) => format!("the smallest cycle that fits is {us} us"),
        None => "no cycle fits".to_string(),
    };
    format!(
        "load at worst {} of the cycle (limit {}); {smallest}",
        percent(layout.load()),
        percent(layout.demand.load_limit)
    )
}

/// When RPDOs and SDO requests go.
fn plan(layout: &Layout) -> String {
    let demand = &layout.demand;
    let mut words = format!(
        "RPDOs {}: {} us from the values of a TPDO to the RPDO that acts; SYNC and PDOs alone take \
         {} us",
        json::order(demand.order),
        layout.dead_time_us(),
        demand.wire_bound_us()
    );
    if let Some(window) = layout.sdo_window()
        && demand.is_planned()
    {
        let answer = if window.next_cycle {
            "answers in the next cycle"
        } else {
            "answers in the same cycle"
        };
        words.push_str(&format!(
            "\nSDO requests {} .. {} us after SYNC, {answer}",
            window.from_us, window.until_us
        ));
    }
    words
}

/// Writes what follows from the machine.
fn derived(machine: &Machine, folder: &Path) -> Result<()> {
    let write = |name: String, bytes: &[u8]| {
        let path = folder.join(name);
        fs::write(&path, bytes).with_context(|| path.display().to_string())
    };
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    for (place, bus) in machine.buses.iter().enumerate() {
        write(format!("{}.dbc", bus.name), dbc(machine, place).as_bytes())?;
        let network = library::network_of_bus(machine, place)?;
        let eds = board_eds::eds(machine, place, network);
        write(format!("{}-master.eds", bus.name), eds.write().as_bytes())?;
    }
    let cycle = report::layout::picture(&machine.buses)?;
    write("cycle.svg".to_string(), cycle.as_bytes())?;
    for node in &machine.nodes {
        let bytes = concise_dcf(&machine.master, node);
        write(format!("node-{}.dcf.bin", node.id), &bytes)?;
    }
    Ok(())
}

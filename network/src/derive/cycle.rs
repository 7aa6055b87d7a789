//! The constants of the cycle's layout, as Rust.

use std::fmt::{Debug, Write};

use crate::layout::{RpdoOrder, Window};
use crate::model::{Bus, Machine, Node, Send};

/// What the firmware keeps to in each cycle: when it may hand over what.
pub(super) fn cycle(machine: &Machine, out: &mut String) -> std::fmt::Result {
    let buses = &machine.buses;
    let nodes = &machine.nodes;
    writeln!(out, "/// Buses, in the order of their names.")?;
    writeln!(out, "pub const BUSES: usize = {};", buses.len())?;
    per_bus(
        buses,
        "The controller of each: 1 for FDCAN1.",
        ("BUS_PERIPHERALS", "u8"),
        |bus| bus.peripheral,
        out,
    )?;
    per_bus(
        buses,
        "Prescaler, segment 1 and segment 2 of the bit timing of each.",
        ("BUS_BIT_TIMINGS", "(u16, u16, u16)"),
        |bus| (bus.timing.prescaler, bus.timing.seg1, bus.timing.seg2),
        out,
    )?;
    per_node(
        nodes,
        "The bus of each axis.",
        ("AXIS_BUSES", "u8"),
        |node| node.bus,
        out,
    )?;
    let order = buses.first().map(|bus| bus.layout.demand.order);
    writeln!(
        out,
        "/// RPDOs that answer to TPDOs are handed over at the next SYNC, not when they are\n\
         /// computed."
    )?;
    writeln!(
        out,
        "pub const RPDOS_AFTER_SYNC: bool = {};",
        order == Some(RpdoOrder::AfterSync)
    )?;
    let guard = buses.iter().map(|bus| bus.layout.demand.guard_us).max();
    writeln!(
        out,
        "/// So long before SYNC nothing of the master is on the wire, us."
    )?;
    writeln!(out, "pub const GUARD_US: u16 = {};", guard.unwrap_or(0))?;
    per_bus(
        buses,
        "Until then a frame that is handed over goes ahead of all TPDOs, us after SYNC.",
        ("AFTER_SYNC_US", "u16"),
        |bus| bus.layout.demand.after_sync_us().min(bus.cycle_us),
        out,
    )?;
    let window = |bus: &Bus| {
        bus.layout.sdo_window().unwrap_or(Window {
            from_us: 0,
            until_us: 0,
            next_cycle: false,
        })
    };
    per_bus(
        buses,
        "One slot in a cycle serves SDO frames, the master's heartbeat and RPDOs on change.",
        ("ONE_PLANNED", "bool"),
        |bus| bus.layout.demand.is_planned(),
        out,
    )?;
    per_bus(
        buses,
        "SDO requests in operational are handed over from then on, us after SYNC,",
        ("SDO_FROM_US", "u16"),
        |bus| window(bus).from_us,
        out,
    )?;
    per_bus(
        buses,
        "and until then; 0: none is.",
        ("SDO_UNTIL_US", "u16"),
        |bus| window(bus).until_us,
        out,
    )?;
    per_bus(
        buses,
        "The answer comes in the cycle after that of the request, and has its planned slot.",
        ("SDO_NEXT_CYCLE", "bool"),
        |bus| window(bus).next_cycle,
        out,
    )?;
    per_bus(
        buses,
        "A drive is asked by SDO every so many cycles; 0: never.",
        ("SDO_EVERY", "u16"),
        |bus| bus.layout.demand.sdo_every,
        out,
    )?;
    per_node(
        nodes,
        "The ramps of each axis are sent on change, to one axis of a bus in a cycle.",
        ("RAMPS_ON_CHANGE", "bool"),
        |node| node.rpdos.iter().any(|pdo| pdo.send == Send::OnChange),
        out,
    )?;
    per_node(
        nodes,
        "Whether each node sends its heartbeat in operational, too.",
        ("HEARTBEATS_IN_OPERATIONAL", "bool"),
        |node| node.heartbeat_in_operational,
        out,
    )
}

fn per_bus<T: Debug>(
    buses: &[Bus],
    what: &str,
    (name, kind): (&str, &str),
    value: impl Fn(&Bus) -> T,
    out: &mut String,
) -> std::fmt::Result {
    let values: Vec<T> = buses.iter().map(value).collect();
    writeln!(out, "/// {what}")?;
    writeln!(out, "pub const {name}: [{kind}; BUSES] = {values:?};")
}

fn per_node<T: Debug>(
    nodes: &[Node],
    what: &str,
    (name, kind): (&str, &str),
    value: impl Fn(&Node) -> T,
    out: &mut String,
) -> std::fmt::Result {
    let values: Vec<T> = nodes.iter().map(value).collect();
    writeln!(out, "/// {what}")?;
    writeln!(out, "pub const {name}: [{kind}; AXES] = {values:?};")
}

//! What `cargo xtask check --json` says of the cycle.

use canmaster_network::layout::{RpdoOrder, SlotKind};
use canmaster_network::model::{Bus, Machine};
use serde::Serialize;

const PER_MILLE: f64 = 1000.0;
const NS_PER_US: f64 = 1000.0;

/// The JSON object.
#[derive(Serialize)]
pub(crate) struct Report {
    result: &'static str,
    nodes: usize,
    warnings: usize,
    /// 1006h may become that.
    shortest_cycle_us: u32,
    longest_cycle_us: u32,
    buses: Vec<JsonBus>,
}

#[derive(Serialize)]
struct JsonBus {
    name: String,
    peripheral: u8,
    bit_rate: u32,
    cycle_us: u32,
    rpdos: &'static str,
    dead_time_us: u32,
    load_max: f64,
    load_limit: f64,
    bits: u32,
    wire_bound_us: u32,
    smallest_cycle_us: Option<u32>,
    tpdos_us: u32,
    tpdo_deadline_us: u32,
    guard_us: u32,
    sdo: Option<JsonSdo>,
    slots: Vec<JsonSlot>,
}

#[derive(Serialize)]
struct JsonSdo {
    from_us: u32,
    until_us: u32,
    answer_in_next_cycle: bool,
    every_cycles: u32,
}

#[derive(Serialize)]
struct JsonSlot {
    kind: &'static str,
    what: String,
    start_us: f64,
    end_us: f64,
    bits: u32,
}

impl Report {
    pub(crate) fn new(machine: &Machine, warnings: usize) -> Report {
        let (shortest, longest) = machine.cycles().into_inner();
        Report {
            result: "ok",
            nodes: machine.nodes.len(),
            warnings,
            shortest_cycle_us: shortest,
            longest_cycle_us: longest,
            buses: machine.buses.iter().map(JsonBus::new).collect(),
        }
    }
}

impl JsonBus {
    fn new(bus: &Bus) -> JsonBus {
        let layout = &bus.layout;
        let demand = &layout.demand;
        let sdo = layout.sdo_window().filter(|_| demand.is_planned());
        JsonBus {
            name: bus.name.clone(),
            peripheral: bus.peripheral,
            bit_rate: bus.bit_rate,
            cycle_us: bus.cycle_us,
            rpdos: order(demand.order),
            dead_time_us: layout.dead_time_us(),
            load_max: f64::from(layout.load()) / PER_MILLE,
            load_limit: f64::from(demand.load_limit) / PER_MILLE,
            bits: layout.bits(),
            wire_bound_us: demand.wire_bound_us(),
            smallest_cycle_us: demand.smallest_cycle(),
            tpdos_us: layout.tpdos_us(),
            tpdo_deadline_us: bus.tpdo_deadline_us,
            guard_us: demand.guard_us,
            sdo: sdo.map(|window| JsonSdo {
                from_us: window.from_us,
                until_us: window.until_us,
                answer_in_next_cycle: window.next_cycle,
                every_cycles: demand.sdo_every,
            }),
            slots: layout
                .slots
                .iter()
                .map(|slot| JsonSlot {
                    kind: kind(slot.kind),
                    what: slot.what.clone(),
                    start_us: slot.start_ns as f64 / NS_PER_US,
                    end_us: slot.end_ns() as f64 / NS_PER_US,
                    bits: slot.bits,
                })
                .collect(),
        }
    }
}

/// As the description writes it.
pub(crate) fn order(order: RpdoOrder) -> &'static str {
    match order {
        RpdoOrder::AfterTpdos => "after TPDOs",
        RpdoOrder::AfterSync => "after SYNC",
    }
}

fn kind(kind: SlotKind) -> &'static str {
    match kind {
        SlotKind::Sync => "sync",
        SlotKind::Latency => "latency",
        SlotKind::Tpdo => "tpdo",
        SlotKind::Planned => "planned",
        SlotKind::Other => "other",
        SlotKind::Compute => "compute",
        SlotKind::Rpdo => "rpdo",
        SlotKind::Guard => "guard",
    }
}

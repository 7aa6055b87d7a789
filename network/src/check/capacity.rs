//! Whether the frames of a cycle fit into it.

use crate::description::Description;
use crate::layout::{Demand, Layout, SlotKind};
use crate::model::{Bus, Master, Node};
use crate::resolve::Context;

/// The buses with their cycles laid out.
pub(crate) fn capacity(
    description: &Description,
    buses: Vec<Bus>,
    master: &Master,
    nodes: &[Node],
    context: &mut Context<'_>,
) -> Vec<Bus> {
    let described = description.bus.values();
    let buses = buses.into_iter().enumerate().zip(described);
    buses
        .map(|((place, bus), described)| {
            let nodes = nodes.iter().filter(|node| node.bus == place);
            let fixed = &bus.layout.demand;
            let demand = Demand {
                load_limit: fixed.load_limit,
                compute_us: fixed.compute_us,
                guard_us: fixed.guard_us,
                sdo_frames: fixed.sdo_frames,
                ..Demand::of(nodes, master.heartbeat_ms, bus.bit_rate)
            };
            let layout = demand.layout(bus.cycle_us);
            if !layout.fits() {
                let cycle = &described.get_ref().cycle_us;
                let at = context.at(cycle);
                context.problems.error(
                    &at,
                    cycle.get_ref(),
                    too_much(&bus.name, &layout),
                    change(&layout),
                );
            }
            let explicit = described.get_ref().tpdo_deadline_us.as_ref();
            if let Some(deadline) = explicit {
                let at = context.at(deadline);
                let us = bus.tpdo_deadline_us;
                let latest = bus.cycle_us.saturating_sub(layout.after_tpdos_us());
                if us < layout.tpdos_us() {
                    context.problems.error(
                        &at,
                        us,
                        format!("the last TPDO may come {} us after SYNC", layout.tpdos_us()),
                        format!("write {} ..= {latest}", layout.tpdos_us()),
                    );
                } else if us > latest {
                    context.problems.error(
                        &at,
                        us,
                        format!(
                            "computation, RPDOs and guard take {} us, and the cycle is {} us",
                            layout.after_tpdos_us(),
                            bus.cycle_us
                        ),
                        format!("write {} ..= {latest}", layout.tpdos_us()),
                    );
                }
            }
            let tpdo_deadline_us = match explicit {
                Some(_) => bus.tpdo_deadline_us,
                None => layout.tpdos_us(),
            };
            Bus {
                layout,
                tpdo_deadline_us,
                ..bus
            }
        })
        .collect()
}

const PERCENT: u32 = 10;

fn too_much(bus: &str, layout: &Layout) -> String {
    let end = layout.end_us(SlotKind::Guard);
    let load = layout.load();
    let limit = layout.demand.load_limit;
    format!(
        "bus \"{bus}\" does not fit into its cycle: at worst {} bits, {}.{} % of the cycle (limit \
         {}.{} %), and {end} us with latencies and guard",
        layout.bits(),
        load / PERCENT,
        load % PERCENT,
        limit / PERCENT,
        limit % PERCENT,
    )
}

fn change(layout: &Layout) -> String {
    let what = match layout.largest() {
        SlotKind::Tpdo => "map fewer TPDOs",
        SlotKind::Rpdo => "map fewer RPDOs",
        SlotKind::Other => "make heartbeats rarer and sdo_frames fewer",
        SlotKind::Latency => "use drives that answer SYNC sooner",
        SlotKind::Compute => "lower compute_us",
        SlotKind::Sync | SlotKind::Guard => "lower guard_us",
    };
    match layout.demand.smallest_cycle() {
        Some(cycle) => format!("the smallest cycle that fits is {cycle} us; or {what}"),
        None => format!("no cycle up to a second fits; {what}, or take a higher bit rate"),
    }
}

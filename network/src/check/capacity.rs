//! Whether the frames of a cycle fit into it.

use toml::Spanned;

use crate::description::{self, Description};
use crate::layout::{Demand, Layout, RpdoOrder, SlotKind};
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
    let described: Vec<&description::Bus> =
        description.bus.values().map(|bus| bus.get_ref()).collect();
    same_cycle(&described, &buses, context);
    same_order(&described, context);
    let demands: Vec<Demand> = buses
        .iter()
        .enumerate()
        .map(|(place, bus)| {
            let nodes = nodes.iter().filter(|node| node.bus == place);
            let fixed = &bus.layout.demand;
            Demand {
                load_limit: fixed.load_limit,
                compute_us: fixed.compute_us,
                guard_us: fixed.guard_us,
                order: fixed.order,
                sdo_frames: fixed.sdo_frames,
                sdo_every: fixed.sdo_every,
                emcy_frames: fixed.emcy_frames,
                heartbeats_wait: fixed.heartbeats_wait,
                ..Demand::of(nodes, master.heartbeat_ms, bus.bit_rate)
            }
        })
        .collect();
    let layouts = in_order(&described, &buses, &demands);
    let any_order = described.iter().all(|bus| bus.rpdos.is_none());
    let tries = layouts.iter().zip(&buses).zip(&described);
    for ((layout, bus), described) in tries {
        if layout.lacks_only_sdo() {
            sdo(described, layout, context);
        } else if !layout.fits() {
            let cycle = &described.cycle_us;
            let at = context.at(cycle);
            context.problems.error(
                &at,
                cycle.get_ref(),
                too_much(&bus.name, layout),
                change(layout, any_order),
            );
        }
    }
    let last = layouts.iter().map(Layout::tpdos_us).max().unwrap_or(0);
    let mut tpdo_deadline_us = last;
    for ((bus, layout), described) in buses.iter().zip(&layouts).zip(&described) {
        if let Some(at) = &described.tpdo_deadline_us {
            deadline(bus, layout, at, context);
            tpdo_deadline_us = tpdo_deadline_us.max(bus.tpdo_deadline_us);
        }
    }
    let all = buses.into_iter().zip(layouts);
    all.map(|(bus, layout)| Bus {
        layout,
        tpdo_deadline_us,
        ..bus
    })
    .collect()
}

/// One timer makes the SYNCs of all buses.
fn same_cycle(described: &[&description::Bus], buses: &[Bus], context: &mut Context<'_>) {
    let Some((first, others)) = buses.split_first() else {
        return;
    };
    for (bus, described) in others.iter().zip(described.iter().skip(1)) {
        if bus.cycle_us != first.cycle_us {
            let at = context.at(&described.cycle_us);
            context.problems.error(
                &at,
                described.cycle_us.get_ref(),
                format!(
                    "the SYNCs of all buses leave together, and bus \"{}\" has a cycle of {} us",
                    first.name, first.cycle_us
                ),
                "give all buses the same cycle_us",
            );
        }
    }
}

/// The axes of all buses are stepped together, and their RPDOs go in one order.
fn same_order(described: &[&description::Bus], context: &mut Context<'_>) {
    let mut orders = described.iter().filter_map(|bus| bus.rpdos.as_ref());
    let Some(first) = orders.next() else {
        return;
    };
    if let Some(other) = orders.find(|other| other.get_ref() != first.get_ref()) {
        let at = context.at(other);
        context.problems.error(
            &at,
            other.get_ref(),
            format!(
                "the axes of all buses are stepped together, and another bus has rpdos = \"{}\"",
                first.get_ref()
            ),
            "give all buses the same rpdos, or leave it out",
        );
    }
}

/// SDO frames cannot be kept out of the guard.
fn sdo(described: &description::Bus, layout: &Layout, context: &mut Context<'_>) {
    let demand = &layout.demand;
    let (soonest, slowest) = demand.sdo_latency_us.unwrap_or_default();
    if !demand.sdo_can_be_planned() {
        // It is not the default.
        let at = described.sdo_frames.as_ref().unwrap_or(&described.cycle_us);
        let place = context.at(at);
        context.problems.error(
            &place,
            at.get_ref(),
            format!(
                "with one SDO frame in a cycle, a request at its end must not be answered before \
                 the next SYNC, and the soonest answer, {soonest} us, is sooner than a frame and \
                 guard_us"
            ),
            "write sdo_frames = 2, for the answer in the same cycle, or lower guard_us",
        );
        return;
    }
    let at = &described.cycle_us;
    let place = context.at(at);
    context.problems.error(
        &place,
        at.get_ref(),
        format!(
            "an SDO exchange takes up to {} us of a cycle with the slowest answer, {slowest} us",
            demand.least_for_sdo_us()
        ),
        "take a longer cycle; or write sdo_frames = 0, for no SDO in operational; or leave \
         sdo_latency_us out, so that answers may be in the way of a SYNC",
    );
}

/// The layouts of all buses with RPDOs after the TPDOs; if they do not fit, and
/// nobody wants that, after SYNC. The axes are stepped together: when all TPDOs of
/// all buses are there.
fn in_order(described: &[&description::Bus], buses: &[Bus], demands: &[Demand]) -> Vec<Layout> {
    let with = |order: Option<RpdoOrder>| -> Vec<Layout> {
        let layouts = |elsewhere_us: u32| -> Vec<Layout> {
            let all = demands.iter().zip(buses);
            all.map(|(demand, bus)| {
                let order = order.unwrap_or(demand.order);
                let demand = Demand {
                    order,
                    elsewhere_us,
                    ..demand.clone()
                };
                demand.layout(bus.cycle_us)
            })
            .collect()
        };
        let last = layouts(0).iter().map(Layout::tpdos_us).max();
        layouts(last.unwrap_or(0))
    };
    let asked = described.iter().find_map(|bus| bus.rpdos.as_ref());
    if let Some(place) = asked.and_then(|asked| {
        described
            .iter()
            .position(|bus| bus.rpdos.as_ref().map(Spanned::span) == Some(asked.span()))
    }) {
        // One of them speaks for all.
        return with(demands.get(place).map(|demand| demand.order));
    }
    let first = with(Some(RpdoOrder::AfterTpdos));
    if first.iter().all(Layout::fits) {
        return first;
    }
    let second = with(Some(RpdoOrder::AfterSync));
    match second.iter().all(Layout::fits) {
        true => second,
        false => first,
    }
}

fn deadline(bus: &Bus, layout: &Layout, at: &Spanned<i64>, context: &mut Context<'_>) {
    let place = context.at(at);
    let us = bus.tpdo_deadline_us;
    let soonest = layout.tpdos_us().max(layout.demand.elsewhere_us);
    let latest = bus.cycle_us.saturating_sub(layout.after_tpdos_us());
    if us < soonest {
        context.problems.error(
            &place,
            us,
            format!("the last TPDO may come {soonest} us after SYNC"),
            format!("write {soonest} ..= {latest}"),
        );
    } else if us > latest {
        context.problems.error(
            &place,
            us,
            format!(
                "computation, RPDOs and guard take {} us, and the cycle is {} us",
                layout.after_tpdos_us(),
                bus.cycle_us
            ),
            format!("write {soonest} ..= {latest}"),
        );
    }
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

/// `any_order`: no bus says in which order its RPDOs go.
fn change(layout: &Layout, any_order: bool) -> String {
    let what = match layout.largest() {
        SlotKind::Tpdo => "map fewer TPDOs",
        SlotKind::Rpdo => "map fewer RPDOs, or send = \"on change\"",
        SlotKind::Other => "make heartbeats rarer and sdo_frames fewer",
        SlotKind::Planned => "make sdo_frames fewer",
        SlotKind::Latency => "use drives that answer SYNC sooner",
        SlotKind::Compute => "lower compute_us",
        SlotKind::Sync | SlotKind::Guard => "lower guard_us",
    };
    let smallest = |order| {
        let demand = Demand {
            order,
            ..layout.demand.clone()
        };
        demand.smallest_cycle()
    };
    let orders = [
        (RpdoOrder::AfterTpdos, "after the TPDOs"),
        (RpdoOrder::AfterSync, "after SYNC"),
    ];
    let best = orders
        .iter()
        .filter_map(|(order, words)| Some((smallest(*order)?, words)));
    let best = best.min_by_key(|(cycle, _)| *cycle);
    let here = smallest(layout.demand.order);
    match (here, best) {
        (_, Some((cycle, _))) if any_order => {
            format!("the smallest cycle that fits is {cycle} us; or {what}")
        }
        (_, Some((cycle, words))) if cycle <= layout.cycle_us => {
            format!("leave rpdos out: {words}, {cycle} us fit; or {what}")
        }
        (Some(cycle), _) => format!("the smallest cycle that fits is {cycle} us; or {what}"),
        (None, _) => {
            format!("no cycle up to a second fits; {what}, or take a higher bit rate")
        }
    }
}

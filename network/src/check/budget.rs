//! What a cycle is promised to: the planned slot, answers to SDO, and the firmware's own
//! time.

use toml::Spanned;

use crate::description::{self, Description};
use crate::layout::{Demand, PARTS};
use crate::model::{Bus, Node};
use crate::resolve::{Context, least_compute_us};

/// The least of the guard, in microseconds: a frame is handed over within 2 us of the
/// look at the timer, which counts whole microseconds, and the controller begins within
/// a bit; clocks differ by 2 us.
const GUARD_US: u32 = 5;

const NS_PER_US: u64 = 1000;

/// Checks the buses as they are laid out.
pub(crate) fn budget(
    description: &Description,
    buses: &[Bus],
    nodes: &[Node],
    context: &mut Context<'_>,
) {
    let all = nodes.len();
    for (place, ((name, described), bus)) in description.bus.iter().zip(buses).enumerate() {
        let described = described.get_ref();
        if nodes.iter().all(|node| node.bus != place) {
            empty(name, context);
            continue;
        }
        own_time(described, bus, all, context);
        let demand = &bus.layout.demand;
        if demand.sdo_every != 0 && demand.sdo_frames == 0 {
            nothing_to_ask_in(described, context);
        } else {
            planned(description, described, bus, context);
        }
    }
    for (described, node) in description.node.iter().zip(nodes) {
        if let Some(bus) = buses.get(node.bus) {
            answers_in_time(description, described.get_ref(), node, bus, context);
        }
    }
}

fn empty(name: &Spanned<String>, context: &mut Context<'_>) {
    let place = context.at(name);
    context.problems.error(
        &place,
        name.get_ref(),
        "there is no node on this bus, and a SYNC that nobody acknowledges is never over",
        format!(
            "put nodes on it with bus = \"{}\", or remove it",
            name.get_ref()
        ),
    );
}

/// What the firmware needs for itself.
fn own_time(described: &description::Bus, bus: &Bus, axes: usize, context: &mut Context<'_>) {
    let demand = &bus.layout.demand;
    let bit_us = demand.bit_ns().div_ceil(NS_PER_US) as u32;
    for (key, value, least, rule) in [
        (
            &described.compute_us,
            demand.compute_us,
            least_compute_us(axes),
            format!("the firmware cannot step {axes} axes in so short a time"),
        ),
        (
            &described.guard_us,
            demand.guard_us,
            GUARD_US + bit_us,
            "a frame that the master hands over just before the guard may begin later than \
             that"
                .to_string(),
        ),
    ] {
        let at = key.as_ref().unwrap_or(&described.cycle_us);
        if value < least {
            let place = context.at(at);
            let help = format!("write at least {least}");
            context.problems.error(&place, value, rule, help);
        }
    }
}

fn nothing_to_ask_in(described: &description::Bus, context: &mut Context<'_>) {
    if let Some(every) = &described.sdo_every {
        let place = context.at(every);
        context.problems.error(
            &place,
            every.get_ref(),
            "with sdo_frames = 0 no cycle has room for an SDO frame, and nobody is asked",
            "write sdo_frames = 1 or 2; or sdo_every = 0",
        );
    }
}

/// One frame in a cycle is what the planned slot holds, and less must be wanted of it.
fn planned(
    description: &Description,
    described: &description::Bus,
    bus: &Bus,
    context: &mut Context<'_>,
) {
    let demand = &bus.layout.demand;
    let Some(wanted) = demand.wanted(bus.cycle_us) else {
        return;
    };
    if wanted.all() < PARTS {
        return;
    }
    let beat = &description.master.get_ref().heartbeat_ms;
    // What can be changed, and what that has to be.
    let every = described.sdo_every.as_ref().filter(|_| wanted.sdo > 0);
    let rarer = (1..=crate::resolve::SDO_EVERY_MAX as u32).find(|every| {
        let with = Demand {
            sdo_every: *every,
            ..demand.clone()
        };
        with.wanted(bus.cycle_us)
            .is_some_and(|all| all.all() < PARTS)
    });
    let (at, help) = match (every, rarer) {
        (Some(every), Some(rarer)) => (every, format!("write sdo_every = {rarer}, or more")),
        _ => {
            let ms = bus
                .cycle_us
                .saturating_mul(2)
                .div_ceil(crate::layout::US_PER_MS);
            (
                beat,
                format!("write heartbeat_ms = {ms}, or more; or take a shorter cycle"),
            )
        }
    };
    let place = context.at(at);
    let hundredths = |parts: u64| {
        let all = parts * 100 / PARTS;
        format!("{}.{:02}", all / 100, all % 100)
    };
    context.problems.error(
        &place,
        at.get_ref(),
        format!(
            "bus \"{}\" has one planned frame in a cycle, and {} are wanted: {} for the master's \
             heartbeat, {} for SDO, {} for RPDOs on change",
            bus.name,
            hundredths(wanted.all()),
            hundredths(wanted.heartbeat),
            hundredths(wanted.sdo),
            hundredths(wanted.on_change),
        ),
        help,
    );
}

/// A request waits for its window, and so may the answer for its slot.
fn answers_in_time(
    description: &Description,
    described: &description::Node,
    node: &Node,
    bus: &Bus,
    context: &mut Context<'_>,
) {
    let demand = &bus.layout.demand;
    let Some(device) = super::device(description, described) else {
        return;
    };
    let (Some((_, slowest)), Some(latency)) = (node.sdo_latency_us, &device.sdo_latency_us) else {
        return;
    };
    let longest_us = demand.exchange_us(slowest, bus.cycle_us);
    if node.sdo_timeout_ms.saturating_mul(crate::layout::US_PER_MS) > longest_us {
        return;
    }
    let place = match &device.sdo_timeout_ms {
        Some(timeout) => context.at(timeout),
        None => context.at(latency),
    };
    let least_ms = longest_us / crate::layout::US_PER_MS + 1;
    context.problems.error(
        &place,
        node.sdo_timeout_ms,
        format!(
            "an answer may take {longest_us} us: {slowest} us of the device (sdo_latency_us), \
             two frames, and two cycles of waiting"
        ),
        format!("write sdo_timeout_ms = {least_ms}, or more"),
    );
}

//! Buses: controller, bit rate, cycle. What depends on the nodes is checked
//! later.

use toml::Spanned;

use super::context::Context;
use crate::description::{self, Description};
use crate::layout::{Demand, RpdoOrder};
use crate::model::Bus;
use crate::problem::nearest;
use crate::timing::{BIT_RATES, BitTiming, CLOCK_HZ, SAMPLE_POINT, sample_point_limits};

/// Shortest cycle that the timers and the tasks of the firmware are made for.
pub(crate) const CYCLE_MIN_US: i64 = 500;
/// What the sixteen bits of the deadline's timer count.
pub(crate) const CYCLE_MAX_US: i64 = u16::MAX as i64;
/// Controllers that the firmware drives.
const PERIPHERALS: [(&str, u8); 3] = [("FDCAN1", 1), ("FDCAN2", 2), ("FDCAN3", 3)];
/// From the last TPDO to the first RPDO, as measured with room to spare.
const COMPUTE_US: u32 = 200;
/// What each axis takes of that at worst. For six axes `pdo_producer` takes up to 10 000
/// cycles of 170 MHz (docs/performance.md); `sync_tick` and `can_irq` preempt it, and
/// silicon has flash wait states, which the emulated core has not: as much again.
const COMPUTE_AXIS_US: u32 = 20;
/// A request and its answer.
const SDO_FRAMES: u32 = 2;
/// An answer to every request of every node and more.
const SDO_FRAMES_MAX: i64 = 256;
/// One of every node and more.
const EMCY_FRAMES_MAX: i64 = 256;
/// An exchange in a minute at the longest cycle.
pub(crate) const SDO_EVERY_MAX: i64 = 1000;
/// 90 % of the cycle.
const LOAD_LIMIT: u32 = 900;
const PERCENT_TO_PER_MILLE: f64 = 10.0;
/// Longest frame, bits.
const LONGEST_FRAME: u32 = 135;
const US_PER_S: u32 = 1_000_000;

/// What the key may say; without it, the first that fits.
const ORDERS: [(&str, RpdoOrder); 2] = [
    ("after TPDOs", RpdoOrder::AfterTpdos),
    ("after SYNC", RpdoOrder::AfterSync),
];

/// The least from the last TPDO to the first RPDO with which the firmware leads so many
/// axes, in microseconds.
pub(crate) fn least_compute_us(axes: usize) -> u32 {
    COMPUTE_AXIS_US.saturating_mul(u32::try_from(axes).unwrap_or(u32::MAX))
}

pub(super) fn bus(
    name: &Spanned<String>,
    bus: &description::Bus,
    axes: usize,
    context: &mut Context<'_>,
) -> Option<Bus> {
    let peripheral = peripheral(&bus.peripheral, context);
    let timing = timing(bus, context);
    let cycle_us = context.number(&bus.cycle_us, "cycle_us", CYCLE_MIN_US..=CYCLE_MAX_US);
    let time = |value: &Option<Spanned<i64>>, key, context: &mut Context<'_>| {
        let value = value.as_ref();
        value.map(|value| context.number::<u32>(value, key, 0..=CYCLE_MAX_US))
    };
    let deadline = time(&bus.tpdo_deadline_us, "tpdo_deadline_us", context);
    let compute_us = time(&bus.compute_us, "compute_us", context);
    let guard_us = time(&bus.guard_us, "guard_us", context);
    let sdo = bus.sdo_frames.as_ref();
    let sdo_frames = sdo.map(|n| context.number::<u32>(n, "sdo_frames", 0..=SDO_FRAMES_MAX));
    let every = bus.sdo_every.as_ref();
    let sdo_every = every.map(|n| context.number::<u32>(n, "sdo_every", 0..=SDO_EVERY_MAX));
    let emcy = bus.emcy_frames.as_ref();
    let emcy_frames = emcy.map(|n| context.number::<u32>(n, "emcy_frames", 0..=EMCY_FRAMES_MAX));
    let order = context.word(bus.rpdos.as_ref(), "rpdos", &ORDERS);
    let load_limit = match &bus.load_limit {
        Some(percent) => per_mille(percent, "load_limit", (1, 1000), context),
        None => Some(LOAD_LIMIT),
    };
    let (bit_rate, timing) = timing?;
    let cycle_us = cycle_us?;
    let demand = Demand {
        load_limit: load_limit?,
        compute_us: compute_us.unwrap_or(Some(COMPUTE_US.max(least_compute_us(axes))))?,
        // A frame that was started just before must be over.
        guard_us: match guard_us {
            Some(us) => us?,
            None => (LONGEST_FRAME * US_PER_S).div_ceil(bit_rate),
        },
        order: order?,
        sdo_frames: sdo_frames.unwrap_or(Some(SDO_FRAMES))?,
        sdo_every: sdo_every.unwrap_or(Some(0))?,
        emcy_frames: emcy_frames.unwrap_or(Some(0))?,
        heartbeats_wait: bus.heartbeats_wait.unwrap_or(false),
        ..Demand::of(std::iter::empty(), 0, bit_rate)
    };
    Some(Bus {
        name: name.get_ref().clone(),
        peripheral: peripheral?,
        bit_rate,
        timing,
        cycle_us,
        tpdo_deadline_us: deadline.unwrap_or(Some(0))?,
        layout: demand.layout(cycle_us),
    })
}

fn peripheral(name: &Spanned<String>, context: &mut Context<'_>) -> Option<u8> {
    let known = PERIPHERALS
        .iter()
        .find(|(known, _)| *known == name.get_ref().as_str());
    if known.is_none() {
        let names: Vec<&str> = PERIPHERALS.iter().map(|(name, _)| *name).collect();
        let place = context.at(name);
        context.problems.error(
            &place,
            name.get_ref(),
            "the firmware drives no such CAN controller",
            format!("use {}", names.join(", ")),
        );
    }
    known.map(|(_, number)| *number)
}

fn timing(bus: &description::Bus, context: &mut Context<'_>) -> Option<(u32, BitTiming)> {
    let place = context.at(&bus.bit_rate);
    let bit_rate = u32::try_from(*bus.bit_rate.get_ref()).ok();
    let known = bit_rate.filter(|rate| BIT_RATES.contains(rate));
    let Some(bit_rate) = known else {
        let rates: Vec<String> = BIT_RATES.iter().map(u32::to_string).collect();
        let rule = match bit_rate.and_then(|rate| BitTiming::find(rate, SAMPLE_POINT)) {
            Some(_) => "CiA 301, 5.1, has no such bit rate".to_string(),
            None => format!(
                "the controller's clock of {CLOCK_HZ} Hz cannot give this bit rate, and CiA 301, \
                 5.1, does not have it"
            ),
        };
        context.problems.error(
            &place,
            bus.bit_rate.get_ref(),
            rule,
            format!("use one of {}", rates.join(", ")),
        );
        return None;
    };
    let sample_point = match &bus.sample_point {
        Some(percent) => {
            let limits = sample_point_limits(bit_rate);
            per_mille(percent, "sample_point", limits, context)?
        }
        None => SAMPLE_POINT,
    };
    let timing = BitTiming::find(bit_rate, sample_point);
    if timing.is_none() {
        context.problems.error(
            &place,
            bit_rate,
            format!("the controller's clock of {CLOCK_HZ} Hz cannot give this sample point"),
            "leave sample_point out: 87.5 % is recommended",
        );
    }
    Some((bit_rate, timing?))
}

/// Percent in the file, per mille inside.
fn per_mille(
    percent: &Spanned<f64>,
    key: &str,
    (least, most): (u32, u32),
    context: &mut Context<'_>,
) -> Option<u32> {
    let value = *percent.get_ref();
    let rounded = (value * PERCENT_TO_PER_MILLE).round();
    if rounded >= f64::from(least) && rounded <= f64::from(most) {
        return Some(rounded as u32);
    }
    let (least, most) = (
        f64::from(least) / PERCENT_TO_PER_MILLE,
        f64::from(most) / PERCENT_TO_PER_MILLE,
    );
    let place = context.at(percent);
    context.problems.error(
        &place,
        value,
        format!("{key} must be {least} ..= {most} percent at this bit rate"),
        format!("write a number between {least} and {most}"),
    );
    None
}

/// The place of the bus of a node. Where there is only one, it need not be named.
pub(super) fn of_node(
    description: &Description,
    node: &description::Node,
    context: &mut Context<'_>,
) -> Option<usize> {
    let mut names = description.bus.keys().map(|name| name.get_ref().as_str());
    let Some(wanted) = &node.bus else {
        if description.bus.len() == 1 {
            return Some(0);
        }
        let place = context.at(&node.name);
        context.problems.error(
            &place,
            node.name.get_ref(),
            "there is not exactly one bus, and the node does not say on which it is",
            "add bus = \"NAME\" to the node",
        );
        return None;
    };
    if let Some(place) = names.clone().position(|name| name == wanted.get_ref()) {
        return Some(place);
    }
    let help = match nearest(wanted.get_ref(), names.clone()) {
        Some(name) => format!("did you mean \"{name}\"?"),
        None => match names.next() {
            Some(name) => format!("use \"{name}\", or add [bus.{}]", wanted.get_ref()),
            None => format!("add [bus.{}]", wanted.get_ref()),
        },
    };
    let place = context.at(wanted);
    context.problems.error(
        &place,
        wanted.get_ref(),
        "there is no bus of this name",
        help,
    );
    None
}

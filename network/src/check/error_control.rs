//! Heartbeats and the silence after a reset.

use toml::Spanned;

use crate::description::Description;
use crate::layout::US_PER_MS;
use crate::model::{Bus, Master, Node};
use crate::resolve::Context;

/// Milliseconds of a second.
const MS_PER_S: i64 = 1000;

pub(crate) fn error_control(
    description: &Description,
    master: &Master,
    buses: &[Bus],
    nodes: &[Node],
    context: &mut Context<'_>,
) {
    let described_master = description.master.get_ref();
    for (described, node) in description.node.iter().zip(nodes) {
        let Some(device) = super::device(description, described.get_ref()) else {
            continue;
        };
        let timeout = &device.master_timeout_ms;
        let place = context.at(timeout);
        let consumed = node.master_timeout_ms;
        let bus = buses.get(node.bus);
        let beat_us = bus.map_or(0, |bus| bus.layout.demand.master_beat_us(bus.cycle_us));
        let (produced, beat_ms) = (master.heartbeat_ms, beat_us.div_ceil(US_PER_MS));
        // One may be lost.
        let enough_ms = beat_ms + u32::from(produced);
        if consumed != 0 && u32::from(consumed) <= beat_ms {
            context.problems.error(
                &place,
                consumed,
                format!(
                    "1016h of the node must be longer than the master's heartbeat_ms, {produced}, \
                     and the cycles until there is room for it, {beat_ms} ms in all: it would \
                     lose the master at once"
                ),
                format!("write at least {enough_ms}"),
            );
        } else if consumed != 0 && u32::from(consumed) < enough_ms {
            context.problems.warning(
                &place,
                consumed,
                format!("one lost heartbeat of the master ({produced} ms) stops the node"),
                format!("write at least {enough_ms}"),
            );
        } else if consumed == 0 {
            context.problems.warning(
                &place,
                consumed,
                "the node does not notice that the master is gone, and runs on",
                format!("write at least {enough_ms}"),
            );
        }
        let own = |key: fn(&crate::description::Axis) -> &Option<Spanned<i64>>| {
            let key = key(&described.get_ref().axis)
                .as_ref()
                .or(key(&device.axis).as_ref());
            key.map(|value| *value.get_ref())
        };
        let ramp_ms = match (own(|axis| &axis.max_speed), own(|axis| &axis.quick_stop)) {
            (Some(speed), Some(ramp)) if ramp > 0 => speed.saturating_mul(MS_PER_S) / ramp,
            _ => 0,
        };
        let rest_ms = i64::from(consumed) + ramp_ms;
        if i64::from(master.silence_ms) < rest_ms {
            let place = context.at(&described_master.silence_ms);
            context.problems.error(
                &place,
                master.silence_ms,
                format!(
                    "after a reset of the master \"{}\" may turn for {consumed} ms (master_timeout_ms) \
                     and {ramp_ms} ms (quick stop from max_speed)",
                    node.name
                ),
                format!("write at least {rest_ms}"),
            );
        }
    }
}

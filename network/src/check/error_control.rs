//! Heartbeats and the silence after a reset.

use toml::Spanned;

use crate::description::Description;
use crate::model::{Master, Node};
use crate::resolve::Context;

/// Milliseconds of a second.
const MS_PER_S: i64 = 1000;

pub(crate) fn error_control(
    description: &Description,
    master: &Master,
    nodes: &[Node],
    context: &mut Context<'_>,
) {
    let described_master = description.master.get_ref();
    let produced = master.heartbeat_ms;
    for (described, node) in description.node.iter().zip(nodes) {
        let Some(device) = super::device(description, described.get_ref()) else {
            continue;
        };
        let timeout = &device.master_timeout_ms;
        let place = context.at(timeout);
        let consumed = node.master_timeout_ms;
        if consumed != 0 && consumed <= produced {
            context.problems.error(
                &place,
                consumed,
                format!(
                    "1016h of the node must be longer than the master's heartbeat_ms, {produced}: \
                     it would lose the master at once"
                ),
                format!("write at least {}", 2 * u32::from(produced)),
            );
        } else if consumed != 0 && u32::from(consumed) < 2 * u32::from(produced) {
            context.problems.warning(
                &place,
                consumed,
                format!("one lost heartbeat of the master ({produced} ms) stops the node"),
                format!("write at least {}", 2 * u32::from(produced)),
            );
        } else if consumed == 0 {
            context.problems.warning(
                &place,
                consumed,
                "the node does not notice that the master is gone, and runs on",
                format!("write at least {}", 2 * u32::from(produced)),
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

//! Whether somebody notices that a node is lost.

use crate::description::Description;
use crate::model::{Liveness, Node};
use crate::resolve::Context;

/// At every SYNC.
const EVERY_SYNC: u8 = 1;

pub(crate) fn liveness(
    description: &Description,
    by: Liveness,
    nodes: &[Node],
    context: &mut Context<'_>,
) {
    for (described, node) in description.node.iter().zip(nodes) {
        let Some(device) = super::device(description, described.get_ref()) else {
            continue;
        };
        let silent = node.heartbeat_ms == 0 || !node.heartbeat_in_operational;
        if !silent {
            continue;
        }
        let key = match &device.heartbeat_in_operational {
            Some(key) if node.heartbeat_ms != 0 => (context.at(key), key.get_ref().to_string()),
            _ => {
                let key = &device.heartbeat_ms;
                (context.at(key), key.get_ref().to_string())
            }
        };
        let (place, value) = key;
        let name = &node.name;
        if by == Liveness::Heartbeat {
            context.problems.error(
                &place,
                value,
                format!("[liveness] is by heartbeat, and \"{name}\" has none in operational"),
                "write by = \"TPDO\" in [liveness], or let the node send its heartbeat",
            );
        } else if !node.tpdos.iter().any(|pdo| pdo.transmission == EVERY_SYNC) {
            context.problems.error(
                &place,
                value,
                format!(
                    "\"{name}\" has neither a heartbeat in operational nor a TPDO at every SYNC: \
                     nobody notices when it is lost"
                ),
                "map a TPDO with transmission = 1, or let the node send its heartbeat",
            );
        }
    }
}

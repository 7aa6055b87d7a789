//! What the firmware writes to every node exists there and can be written.

use std::collections::BTreeMap;

use crate::description::Description;
use crate::eds::Eds;
use crate::model::{Master, Node};
use crate::plan::plan;
use crate::resolve::Context;

pub(crate) fn configuration(
    description: &Description,
    files: &BTreeMap<String, Eds>,
    master: &Master,
    nodes: &[Node],
    context: &mut Context<'_>,
) {
    for (described, node) in description.node.iter().zip(nodes) {
        let described = described.get_ref();
        let Some(eds) = files.get(described.device.get_ref()) else {
            continue;
        };
        let place = match super::device(description, described) {
            Some(device) => context.at(&device.eds),
            None => context.at(&described.device),
        };
        for write in plan(master, node) {
            let Some(entry) = eds.entry(write.at) else {
                context.problems.error(
                    &place,
                    &eds.file,
                    format!(
                        "the configuration writes {}, and the device does not have it",
                        write.at
                    ),
                    "this master needs four PDOs in each direction with changeable mapping, and \
                     heartbeat; use a device that has them, or its complete EDS",
                );
                continue;
            };
            let bits = entry.data_type.bits();
            let place = crate::problem::Place {
                source: place.source.clone(),
                line: place.line,
            };
            if !entry.access.is_writable() {
                context.problems.error(
                    &place,
                    write.at,
                    format!(
                        "the configuration writes it, and it is {} in {}:{}",
                        entry.access.word(),
                        eds.file,
                        entry.line
                    ),
                    "use a device whose PDOs and heartbeat can be configured",
                );
            } else if bits.map(|bits| bits.div_ceil(8)) != Some(write.bytes) {
                context.problems.error(
                    &place,
                    write.at,
                    format!(
                        "the standard has {} bits here, and {}:{} says {}",
                        u32::from(write.bytes) * u8::BITS,
                        eds.file,
                        entry.line,
                        entry.data_type
                    ),
                    "correct DataType in the EDS",
                );
            }
        }
    }
}

//! The concise DCF of a node, object 1F22h (CiA 302-3).

use crate::model::{Master, Node};
use crate::plan::plan;

/// Count, then for each entry index, sub-index, size and value, little-endian and
/// packed.
pub fn concise_dcf(master: &Master, node: &Node) -> Vec<u8> {
    let plan = plan(master, node);
    let mut bytes = (plan.len() as u32).to_le_bytes().to_vec();
    for write in plan {
        bytes.extend(write.at.index.to_le_bytes());
        bytes.push(write.at.sub);
        bytes.extend(u32::from(write.bytes).to_le_bytes());
        bytes.extend(&write.value.to_le_bytes()[..usize::from(write.bytes)]);
    }
    bytes
}

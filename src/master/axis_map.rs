//! From the node-ID in an identifier to the axis, without a search.

use crate::id::NodeId;
use crate::network::Network;

/// Node-IDs and the 0 that is none.
const NODES: usize = NodeId::MAX.get() as usize + 1;
const NO_AXIS: u8 = u8::MAX;

/// Which axis each node is: its place in the network's list.
#[derive(Debug)]
pub struct AxisMap([u8; NODES]);

impl AxisMap {
    /// The map of `network`.
    pub fn new(network: &Network) -> AxisMap {
        let mut map = [NO_AXIS; NODES];
        for (axis, node) in (0..NO_AXIS).zip(network.nodes) {
            if let Some(entry) = map.get_mut(usize::from(node.id.get())) {
                *entry = axis;
            }
        }
        AxisMap(map)
    }

    /// The axis of the node whose ID is in the low seven bits of `identifier`,
    /// as in every identifier of the predefined connection set.
    #[inline]
    pub fn axis(&self, identifier: u16) -> Option<usize> {
        let node = usize::from(identifier) % NODES;
        match self.0.get(node) {
            Some(&axis) if axis != NO_AXIS => Some(usize::from(axis)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::sample::SIX_EPOS4;

    #[test]
    fn only_the_nodes_of_the_network_are_axes() {
        let map = AxisMap::new(&SIX_EPOS4);
        for base in [0x180, 0x280, 0x700] {
            for node in 0..0x80 {
                let found = NodeId::new(node).and_then(|id| SIX_EPOS4.find(id));
                let expected = found.map(|(axis, _)| axis);
                assert_eq!(map.axis(base + u16::from(node)), expected);
            }
        }
    }
}

//! What is written to a node, in the order that CiA 301 asks for.

use super::{Network, Node, PDOS_PER_NODE, Pdo};
use crate::id::{Address, CobId, FunctionCode, NodeId};
use crate::objects;
use crate::pdo::{self, Direction, PdoCobId};

/// One write of a configuration: an entry of a concise DCF (CiA 302-3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConfigWrite {
    /// Where.
    pub at: Address,
    value: u32,
    len: u8,
}

impl ConfigWrite {
    /// An eight-bit value.
    pub const fn u8(at: Address, value: u8) -> ConfigWrite {
        ConfigWrite {
            at,
            value: value as u32,
            len: 1,
        }
    }

    /// A sixteen-bit value.
    pub const fn u16(at: Address, value: u16) -> ConfigWrite {
        ConfigWrite {
            at,
            value: value as u32,
            len: 2,
        }
    }

    /// A thirty-two-bit value.
    pub const fn u32(at: Address, value: u32) -> ConfigWrite {
        ConfigWrite { at, value, len: 4 }
    }

    /// The value; only the low bytes that the object has are meaningful.
    pub const fn value(&self) -> u32 {
        self.value
    }

    /// The four little-endian bytes, of which the first [`len`](Self::len)
    /// are written.
    pub const fn bytes(&self) -> [u8; 4] {
        self.value.to_le_bytes()
    }

    /// 1, 2 or 4.
    pub const fn len(&self) -> usize {
        self.len as usize
    }

    /// Never: every entry has a value.
    pub const fn is_empty(&self) -> bool {
        false
    }
}

/// Everything that is written to `node` before it is started, in order: every
/// PDO switched off and the used ones mapped anew, then the start values, then
/// error control, so that a node which got its heartbeat times got all else.
pub fn plan(network: &'static Network, node: &'static Node) -> impl Iterator<Item = ConfigWrite> {
    (0..).map_while(move |n| planned(network, node, n))
}

/// The write number `n` of [`plan`], counted from 0, without going through those
/// before it. `None` past the last.
pub fn planned(network: &Network, node: &Node, n: usize) -> Option<ConfigWrite> {
    let mut n = n;
    for place in 0..2 * PDOS_PER_NODE {
        let (direction, pdos) = match place / PDOS_PER_NODE {
            0 => (Direction::Receive, node.rpdos),
            _ => (Direction::Transmit, node.tpdos),
        };
        let number = place % PDOS_PER_NODE + 1;
        let steps = PdoSteps {
            node: node.id,
            direction,
            number,
            used: pdos.iter().find(|pdo| pdo.number == number),
        };
        let Some(after) = n.checked_sub(steps.len()) else {
            return steps.get(n);
        };
        n = after;
    }
    if let Some(write) = node.start_values.get(n) {
        return Some(*write);
    }
    let consumer = (u32::from(network.master.node.get()) << 16) | u32::from(node.consumer_ms);
    match n - node.start_values.len() {
        0 => Some(ConfigWrite::u32(objects::CONSUMER_HEARTBEAT, consumer)),
        1 => Some(ConfigWrite::u16(
            objects::PRODUCER_HEARTBEAT,
            node.heartbeat_ms,
        )),
        _ => None,
    }
}

/// The writes of one PDO. Remapping goes invalid, count 0, entries, count n,
/// type, inhibit time, valid (CiA 301, 7.5.2.36 and 7.5.2.38).
struct PdoSteps {
    node: NodeId,
    direction: Direction,
    number: u8,
    /// `None`: it is only switched off.
    used: Option<&'static Pdo>,
}

impl PdoSteps {
    /// Invalid and count 0.
    const BEFORE_ENTRIES: usize = 2;
    /// Count n, type, valid.
    const AFTER_ENTRIES: usize = 3;

    const fn has_inhibit_time(&self) -> bool {
        matches!(self.direction, Direction::Transmit)
    }

    fn len(&self) -> usize {
        self.used.map_or(1, |pdo| {
            Self::BEFORE_ENTRIES
                + pdo.mapping.len()
                + Self::AFTER_ENTRIES
                + usize::from(self.has_inhibit_time())
        })
    }

    fn get(&self, n: usize) -> Option<ConfigWrite> {
        let offset = u16::from(self.number) - 1;
        let cob_id = cob_id(self.node, self.direction, self.number);
        let (communication, mapping, cob_id) = match self.direction {
            Direction::Receive => (pdo::RPDO_COMMUNICATION, pdo::RPDO_MAPPING, cob_id),
            Direction::Transmit => (
                pdo::TPDO_COMMUNICATION,
                pdo::TPDO_MAPPING,
                cob_id.without_rtr(),
            ),
        };
        let parameter = |sub| Address::new(communication + offset, sub);
        let mapped = |sub| Address::new(mapping + offset, sub);
        if n == 0 {
            let off = cob_id.invalid().0;
            return Some(ConfigWrite::u32(parameter(objects::PDO_COB_ID), off));
        }
        let pdo = self.used?;
        if n == 1 {
            return Some(ConfigWrite::u8(mapped(0), 0));
        }
        if let Some(entry) = pdo.mapping.get(n - Self::BEFORE_ENTRIES) {
            let sub = n - Self::BEFORE_ENTRIES + 1;
            return Some(ConfigWrite::u32(mapped(sub as u8), entry.0));
        }
        match (
            n - Self::BEFORE_ENTRIES - pdo.mapping.len(),
            self.has_inhibit_time(),
        ) {
            (0, _) => Some(ConfigWrite::u8(mapped(0), pdo.mapping.len() as u8)),
            (1, _) => Some(ConfigWrite::u8(
                parameter(objects::PDO_TRANSMISSION_TYPE),
                pdo.transmission.code(),
            )),
            (2, true) => Some(ConfigWrite::u16(parameter(objects::PDO_INHIBIT_TIME), 0)),
            (2, false) | (3, true) => {
                Some(ConfigWrite::u32(parameter(objects::PDO_COB_ID), cob_id.0))
            }
            _ => None,
        }
    }
}

/// The identifier of the predefined connection set (CiA 301, 7.3.5).
pub(crate) const fn cob_id(node: NodeId, direction: Direction, number: u8) -> PdoCobId {
    let function = match (direction, number) {
        (Direction::Receive, 1) => FunctionCode::Rpdo1,
        (Direction::Receive, 2) => FunctionCode::Rpdo2,
        (Direction::Receive, 3) => FunctionCode::Rpdo3,
        (Direction::Receive, _) => FunctionCode::Rpdo4,
        (Direction::Transmit, 1) => FunctionCode::Tpdo1,
        (Direction::Transmit, 2) => FunctionCode::Tpdo2,
        (Direction::Transmit, 3) => FunctionCode::Tpdo3,
        (Direction::Transmit, _) => FunctionCode::Tpdo4,
    };
    PdoCobId::valid(CobId::of(function, node))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::sample::SIX_EPOS4;
    use std::vec::Vec;

    fn writes() -> Vec<ConfigWrite> {
        plan(&SIX_EPOS4, &SIX_EPOS4.nodes[2]).collect()
    }

    #[test]
    fn a_used_rpdo_is_switched_off_mapped_and_switched_on() {
        let expected = [
            ConfigWrite::u32(Address::new(0x1400, 1), 0x8000_0203),
            ConfigWrite::u8(Address::new(0x1600, 0), 0),
            ConfigWrite::u32(Address::new(0x1600, 1), 0x6040_0010),
            ConfigWrite::u32(Address::new(0x1600, 2), 0x60FF_0020),
            ConfigWrite::u8(Address::new(0x1600, 0), 2),
            ConfigWrite::u8(Address::new(0x1400, 2), 1),
            ConfigWrite::u32(Address::new(0x1400, 1), 0x0000_0203),
        ];
        assert_eq!(writes()[..expected.len()], expected);
    }

    #[test]
    fn an_unused_pdo_is_only_switched_off() {
        for (index, value) in [(0x1802, 0xC000_0383), (0x1803, 0xC000_0483)] {
            let of_it: Vec<_> = writes()
                .into_iter()
                .filter(|w| w.at.index.0 == index)
                .collect();
            assert_eq!(of_it, [ConfigWrite::u32(Address::new(index, 1), value)]);
        }
    }

    #[test]
    fn a_tpdo_forbids_remote_requests() {
        let of_it: Vec<_> = writes()
            .into_iter()
            .filter(|w| w.at.index.0 == 0x1800)
            .collect();
        assert_eq!(
            of_it,
            [
                ConfigWrite::u32(Address::new(0x1800, 1), 0xC000_0183),
                ConfigWrite::u8(Address::new(0x1800, 2), 1),
                ConfigWrite::u16(Address::new(0x1800, 3), 0),
                ConfigWrite::u32(Address::new(0x1800, 1), 0x4000_0183),
            ]
        );
    }

    #[test]
    fn error_control_comes_last() {
        let writes = writes();
        assert_eq!(
            writes[writes.len() - 2..],
            [
                ConfigWrite::u32(Address::new(0x1016, 1), 0x007F_00C8),
                ConfigWrite::u16(Address::new(0x1017, 0), 100),
            ]
        );
    }
}

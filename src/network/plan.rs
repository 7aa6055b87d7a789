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
    let rpdos = (1..=PDOS_PER_NODE)
        .flat_map(move |number| pdo_writes(node.id, Direction::Receive, number, node.rpdos));
    let tpdos = (1..=PDOS_PER_NODE)
        .flat_map(move |number| pdo_writes(node.id, Direction::Transmit, number, node.tpdos));
    let consumer = (u32::from(network.master.node.get()) << 16) | u32::from(node.consumer_ms);
    rpdos
        .chain(tpdos)
        .chain(node.start_values.iter().copied())
        .chain([
            ConfigWrite::u32(objects::CONSUMER_HEARTBEAT, consumer),
            ConfigWrite::u16(objects::PRODUCER_HEARTBEAT, node.heartbeat_ms),
        ])
}

/// The writes of one PDO. Remapping goes invalid, count 0, entries, count n,
/// type, valid (CiA 301, 7.5.2.36 and 7.5.2.38).
fn pdo_writes(
    node: NodeId,
    direction: Direction,
    number: u8,
    used: &'static [Pdo],
) -> impl Iterator<Item = ConfigWrite> {
    let offset = u16::from(number) - 1;
    let (communication, mapping) = match direction {
        Direction::Receive => (pdo::RPDO_COMMUNICATION, pdo::RPDO_MAPPING),
        Direction::Transmit => (pdo::TPDO_COMMUNICATION, pdo::TPDO_MAPPING),
    };
    let (communication, mapping) = (communication + offset, mapping + offset);
    let cob_id = match direction {
        Direction::Receive => cob_id(node, direction, number),
        Direction::Transmit => cob_id(node, direction, number).without_rtr(),
    };
    let at_cob_id = Address::new(communication, objects::PDO_COB_ID);
    let count = move |n: u8| ConfigWrite::u8(Address::new(mapping, 0), n);
    let off = ConfigWrite::u32(at_cob_id, cob_id.invalid().0);

    let remapped = used
        .iter()
        .find(|pdo| pdo.number == number)
        .map(move |pdo| {
            let entries = (1..)
                .zip(pdo.mapping)
                .map(move |(sub, entry)| ConfigWrite::u32(Address::new(mapping, sub), entry.0));
            let inhibit = matches!(direction, Direction::Transmit).then(|| {
                ConfigWrite::u16(Address::new(communication, objects::PDO_INHIBIT_TIME), 0)
            });
            core::iter::once(count(0))
                .chain(entries)
                .chain([
                    count(pdo.mapping.len() as u8),
                    ConfigWrite::u8(
                        Address::new(communication, objects::PDO_TRANSMISSION_TYPE),
                        pdo.transmission.code(),
                    ),
                ])
                .chain(inhibit)
                .chain([ConfigWrite::u32(at_cob_id, cob_id.0)])
        });
    core::iter::once(off).chain(remapped.into_iter().flatten())
}

/// The identifier of the predefined connection set (CiA 301, 7.3.5).
const fn cob_id(node: NodeId, direction: Direction, number: u8) -> PdoCobId {
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
        for (index, value) in [
            (0x1402, 0x8000_0403),
            (0x1403, 0x8000_0503),
            (0x1802, 0xC000_0383),
            (0x1803, 0xC000_0483),
        ] {
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

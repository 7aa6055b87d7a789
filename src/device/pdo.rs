//! 1400h ..= 1BFFh and 3000h + node-ID: the master's PDOs, which mirror those of
//! the nodes, and what they carry.
//!
//! The TPDOs of the nodes, in the order of the network, are the master's RPDOs,
//! and the other way round. They are mapped to the process image: record
//! 3000h + node-ID holds first the objects that the node sends, then those that
//! it receives.

use super::found::{Found, Item, Lookup, Process, variable};
use super::index;
use crate::id::NodeId;
use crate::network::{self, Network, Node, Pdo};
use crate::od::{Access, DataType};
use crate::pdo::{
    Direction, MappingEntry, RPDO_COMMUNICATION, RPDO_MAPPING, TPDO_COMMUNICATION, TPDO_MAPPING,
};
use crate::sdo::AbortCode;

/// Indices between the first object of one kind and the first of the next.
const BLOCK: u16 = 0x200;

pub(super) fn find(network: &'static Network, at: u16, sub: u8) -> Lookup {
    let block = at & !(BLOCK - 1);
    let number = usize::from(at % BLOCK);
    // What the master receives the node transmits.
    let direction = match block {
        RPDO_COMMUNICATION | RPDO_MAPPING => Direction::Transmit,
        TPDO_COMMUNICATION | TPDO_MAPPING => Direction::Receive,
        _ => return Err(AbortCode::NO_SUCH_OBJECT),
    };
    let (node, pdo) = network
        .nodes
        .iter()
        .flat_map(|node| pdos(node, direction).iter().map(move |pdo| (node, pdo)))
        .nth(number)
        .ok_or(AbortCode::NO_SUCH_OBJECT)?;
    match block {
        RPDO_COMMUNICATION | TPDO_COMMUNICATION => communication(sub, node, direction, pdo),
        _ => mapping(sub, node, direction, pdo),
    }
}

/// The record of a node in the process image.
pub(super) fn find_process(network: &'static Network, at: u16, sub: u8) -> Lookup {
    let node = NodeId::new((at - index::PROCESS) as u8).and_then(|id| network.find(id));
    let (_, node) = node.ok_or(AbortCode::NO_SUCH_OBJECT)?;
    let Some(n) = sub.checked_sub(1) else {
        return variable(sub, Found::highest(fields(node).count() as u8));
    };
    let process = fields(node)
        .nth(usize::from(n))
        .ok_or(AbortCode::NO_SUCH_SUB_INDEX)?;
    let data_type = match process.bits {
        0..=8 => DataType::Unsigned8,
        9..=16 => DataType::Unsigned16,
        17..=32 => DataType::Unsigned32,
        _ => DataType::Unsigned64,
    };
    let found = Found::with(data_type, Access::ReadOnly, Item::Process(process));
    Ok(Found {
        entry: found.entry.mappable(match process.direction {
            Direction::Transmit => crate::od::Mappable::Rpdo,
            Direction::Receive => crate::od::Mappable::Tpdo,
        }),
        ..found
    })
}

fn communication(sub: u8, node: &Node, direction: Direction, pdo: &Pdo) -> Lookup {
    const HIGHEST: u8 = 2;
    let cob_id = network::cob_id(node.id, direction, pdo.number);
    match sub {
        0 => Ok(Found::highest(HIGHEST)),
        1 => Ok(Found::number(
            DataType::Unsigned32,
            match direction {
                Direction::Transmit => cob_id.0,
                // The master's TPDO: not to be asked for by remote frames.
                Direction::Receive => cob_id.without_rtr().0,
            },
        )),
        HIGHEST => Ok(Found::number(
            DataType::Unsigned8,
            u32::from(pdo.transmission.code()),
        )),
        _ => Err(AbortCode::NO_SUCH_SUB_INDEX),
    }
}

fn mapping(sub: u8, node: &'static Node, direction: Direction, pdo: &Pdo) -> Lookup {
    let Some(n) = sub.checked_sub(1) else {
        return Ok(Found::highest(pdo.mapping.len() as u8));
    };
    let (field, process) = (1..)
        .zip(fields(node))
        .filter(|(_, field)| field.direction == direction && field.number == pdo.number)
        .nth(usize::from(n))
        .ok_or(AbortCode::NO_SUCH_SUB_INDEX)?;
    let entry = MappingEntry::new(
        index::PROCESS + u16::from(node.id.get()),
        field,
        process.bits,
    );
    Ok(Found::number(DataType::Unsigned32, entry.0))
}

/// Everything that a node sends and receives, in the order of the sub-indices.
fn fields(node: &'static Node) -> impl Iterator<Item = Process> {
    [Direction::Transmit, Direction::Receive]
        .into_iter()
        .flat_map(move |direction| {
            pdos(node, direction).iter().flat_map(move |pdo| {
                pdo.mapping.iter().scan(0_u8, move |bit, entry| {
                    let first_bit = *bit;
                    *bit = bit.saturating_add(entry.bits());
                    Some(Process {
                        node: node.id,
                        direction,
                        number: pdo.number,
                        first_bit,
                        bits: entry.bits(),
                    })
                })
            })
        })
}

const fn pdos(node: &Node, direction: Direction) -> &'static [Pdo] {
    match direction {
        Direction::Receive => node.rpdos,
        Direction::Transmit => node.tpdos,
    }
}

impl Process {
    /// The field out of the eight bytes of its PDO.
    pub(super) const fn extract(&self, pdo: [u8; 8]) -> u64 {
        let shifted = match u64::from_le_bytes(pdo).checked_shr(self.first_bit as u32) {
            Some(shifted) => shifted,
            None => 0,
        };
        if self.bits >= u64::BITS as u8 {
            shifted
        } else {
            shifted & ((1 << self.bits) - 1)
        }
    }
}

//! 1400h ..= 1BFFh and 3000h + node-ID: the master's PDOs, which mirror those of
//! the nodes, and what they carry.
//!
//! The TPDOs of the nodes, in the order of the network, are the master's RPDOs,
//! and the other way round. They are mapped to the process image: record
//! 3000h + node-ID holds first the objects that the node sends, then those that
//! it receives.

use super::index;
use crate::id::NodeId;
use crate::network::{self, Network, Node, Pdo};
use crate::od::DataType;
use crate::pdo::{Direction, MappingEntry};

/// Indices between the first object of one kind and the first of the next.
const BLOCK: u16 = 0x200;

/// A PDO of the master.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mirrored {
    node: &'static Node,
    /// As seen from the node.
    direction: Direction,
    pub(super) pdo: &'static Pdo,
}

impl Mirrored {
    /// The PDO whose parameter this object is.
    pub(super) fn find(network: &'static Network, at: u16) -> Option<Mirrored> {
        // What the master receives the node transmits.
        let direction = if at < index::TPDO {
            Direction::Transmit
        } else {
            Direction::Receive
        };
        let mut number = usize::from(at % BLOCK);
        for node in network.nodes {
            let pdos = pdos(node, direction);
            if let Some(pdo) = pdos.get(number) {
                return Some(Mirrored {
                    node,
                    direction,
                    pdo,
                });
            }
            number -= pdos.len();
        }
        None
    }

    pub(super) fn cob_id(&self) -> u32 {
        let cob_id = network::cob_id(self.node.id, self.direction, self.pdo.number);
        match self.direction {
            Direction::Transmit => cob_id.0,
            // The master's TPDO: not to be asked for by remote frames.
            Direction::Receive => cob_id.without_rtr().0,
        }
    }

    /// The entry `n` of the mapping, counted from 1.
    pub(super) fn mapped(&self, n: u8) -> Option<MappingEntry> {
        let mut left = n;
        let (field, process) = field(self.node, &mut |_, field| {
            if field.direction == self.direction && field.number == self.pdo.number {
                left = left.saturating_sub(1);
                return left == 0;
            }
            false
        })?;
        let at = index::PROCESS + u16::from(self.node.id.get());
        Some(MappingEntry::new(at, field, process.bits))
    }
}

/// A field of the process image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Process {
    pub(super) node: NodeId,
    /// As seen from the node.
    pub(super) direction: Direction,
    /// 1 ..= 4.
    pub(super) number: u8,
    /// The first bit of the field in the PDO.
    first_bit: u8,
    bits: u8,
}

impl Process {
    /// The field of a node with this number, counted from 1.
    pub(super) fn find(node: &'static Node, number: u8) -> Option<Process> {
        field(node, &mut |n, _| n == number).map(|(_, process)| process)
    }

    /// How many fields a node has.
    pub(super) fn count(node: &'static Node) -> u8 {
        let mut count = 0;
        field(node, &mut |n, _| {
            count = n;
            false
        });
        count
    }

    pub(super) const fn data_type(&self) -> DataType {
        match self.bits {
            0..=8 => DataType::Unsigned8,
            9..=16 => DataType::Unsigned16,
            17..=32 => DataType::Unsigned32,
            _ => DataType::Unsigned64,
        }
    }

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

/// Goes through everything that a node sends and receives, in the order of the
/// sub-indices, to the first field that is wanted.
fn field(
    node: &'static Node,
    wanted: &mut dyn FnMut(u8, &Process) -> bool,
) -> Option<(u8, Process)> {
    let mut n = 0_u8;
    for direction in [Direction::Transmit, Direction::Receive] {
        for pdo in pdos(node, direction) {
            let mut first_bit = 0_u8;
            for entry in pdo.mapping {
                let process = Process {
                    node: node.id,
                    direction,
                    number: pdo.number,
                    first_bit,
                    bits: entry.bits(),
                };
                n = n.saturating_add(1);
                if wanted(n, &process) {
                    return Some((n, process));
                }
                first_bit = first_bit.saturating_add(entry.bits());
            }
        }
    }
    None
}

const fn pdos(node: &Node, direction: Direction) -> &'static [Pdo] {
    match direction {
        Direction::Receive => node.rpdos,
        Direction::Transmit => node.tpdos,
    }
}

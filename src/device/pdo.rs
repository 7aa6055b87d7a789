//! 1400h ..= 1BFFh and 3000h + node-ID: the master's PDOs, which mirror those of
//! the nodes, and what they carry.
//!
//! The TPDOs of the nodes, in the order of the network, are the master's RPDOs,
//! and the other way round, behind the TPDOs of its own. They are mapped to the process image: record
//! 3000h + node-ID holds first the objects that the node sends, then those that
//! it receives.

use super::index;
use super::own_tpdo::OWN_TPDOS;
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
        let before = match direction {
            Direction::Transmit => 0,
            Direction::Receive => OWN_TPDOS,
        };
        let mut number = usize::from((at % BLOCK).checked_sub(before)?);
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
        let place = usize::from(n).checked_sub(1)?;
        let bits = self.pdo.mapping.get(place)?.bits();
        // The fields of the PDOs before this one.
        let mut before = match self.direction {
            Direction::Transmit => 0,
            Direction::Receive => fields(self.node.tpdos),
        };
        for pdo in pdos(self.node, self.direction) {
            if pdo.number == self.pdo.number {
                break;
            }
            before += pdo.mapping.len();
        }
        let at = index::PROCESS + u16::from(self.node.id.get());
        Some(MappingEntry::new(at, (before + usize::from(n)) as u8, bits))
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
    /// The field of a node with this number, counted from 1: first everything
    /// that the node sends, then what it receives.
    pub(super) fn find(node: &'static Node, number: u8) -> Option<Process> {
        let mut left = usize::from(number).checked_sub(1)?;
        for direction in [Direction::Transmit, Direction::Receive] {
            for pdo in pdos(node, direction) {
                if let Some((before, [entry, ..])) = pdo.mapping.split_at_checked(left) {
                    return Some(Process {
                        node: node.id,
                        direction,
                        number: pdo.number,
                        first_bit: before
                            .iter()
                            .fold(0, |bits, entry| entry.bits().saturating_add(bits)),
                        bits: entry.bits(),
                    });
                }
                left -= pdo.mapping.len();
            }
        }
        None
    }

    /// How many fields a node has.
    pub(super) fn count(node: &Node) -> u8 {
        (fields(node.tpdos) + fields(node.rpdos)) as u8
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

/// How many fields these PDOs have.
fn fields(pdos: &[Pdo]) -> usize {
    pdos.iter().map(|pdo| pdo.mapping.len()).sum()
}

const fn pdos(node: &Node, direction: Direction) -> &'static [Pdo] {
    match direction {
        Direction::Receive => node.kind.rpdos,
        Direction::Transmit => node.kind.tpdos,
    }
}

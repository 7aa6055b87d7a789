//! The identifiers of CANopen as types: a value that exists is a valid one.

use crate::words::in_words;
use core::num::NonZeroU8;
use embedded_can::StandardId;

/// A node-ID, 1..=127 (CiA 301, 7.2.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(NonZeroU8);

impl NodeId {
    /// The lowest node-ID.
    pub const MIN: NodeId = NodeId(NonZeroU8::MIN);
    /// The highest node-ID.
    pub const MAX: NodeId = NodeId::constant::<127>();

    /// `None` unless `id` is in 1..=127.
    pub const fn new(id: u8) -> Option<NodeId> {
        match NonZeroU8::new(id) {
            Some(number) if id <= 127 => Some(NodeId(number)),
            _ => None,
        }
    }

    /// For tables written down in the source: a wrong number does not compile.
    pub const fn constant<const ID: u8>() -> NodeId {
        const { assert!(ID >= 1 && ID <= 127, "a node-ID is 1..=127") }
        match NonZeroU8::new(ID) {
            Some(number) => NodeId(number),
            None => NodeId::MIN,
        }
    }

    /// The number, 1..=127.
    pub const fn get(self) -> u8 {
        self.0.get()
    }
}

in_words!(NodeId { id => ("{}", id.0), });

/// A communication object identifier: an 11-bit CAN identifier as CANopen uses
/// it (CiA 301, 7.3.5). Extended identifiers are not used by this master.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CobId(u16);

/// The largest 11-bit identifier.
const COB_ID_MAX: u16 = 0x7FF;
/// The low seven bits of an identifier of the predefined connection set.
const NODE_MASK: u16 = 0x07F;

impl CobId {
    /// NMT node control, broadcast (CiA 301, 7.2.8.3.1).
    pub const NMT: CobId = CobId(0x000);
    /// SYNC (CiA 301, 7.2.5).
    pub const SYNC: CobId = CobId(0x080);
    /// TIME (CiA 301, 7.2.6).
    pub const TIME: CobId = CobId(0x100);
    /// LSS, slave to master (CiA 305).
    pub const LSS_SLAVE: CobId = CobId(0x7E4);
    /// LSS, master to slave (CiA 305).
    pub const LSS_MASTER: CobId = CobId(0x7E5);

    /// `None` if `id` needs more than 11 bits.
    pub const fn new(id: u16) -> Option<CobId> {
        if id <= COB_ID_MAX {
            Some(CobId(id))
        } else {
            None
        }
    }

    /// The identifier that `function` has for `node` in the predefined
    /// connection set (CiA 301, 7.3.5).
    pub const fn of(function: FunctionCode, node: NodeId) -> CobId {
        CobId(function.base() | node.get() as u16)
    }

    /// Whether no object with a configurable identifier may use this one: PDO,
    /// SYNC, TIME, EMCY, further SDOs (CiA 301, 7.3.5, table 40).
    pub const fn is_restricted(self) -> bool {
        matches!(
            self.0,
            0x000..=0x07F
                | 0x101..=0x180
                | 0x581..=0x5FF
                | 0x601..=0x67F
                | 0x6E0..=0x6FF
                | 0x701..=0x7FF
        )
    }

    /// The 11-bit number.
    pub const fn get(self) -> u16 {
        self.0
    }

    /// Function code and node, if this identifier belongs to the predefined
    /// connection set.
    pub const fn split(self) -> Option<(FunctionCode, NodeId)> {
        let Some(node) = NodeId::new((self.0 & NODE_MASK) as u8) else {
            return None;
        };
        match FunctionCode::from_base(self.0 & !NODE_MASK) {
            Some(function) => Some((function, node)),
            None => None,
        }
    }
}

impl From<StandardId> for CobId {
    fn from(id: StandardId) -> CobId {
        CobId(id.as_raw())
    }
}

impl From<CobId> for StandardId {
    fn from(id: CobId) -> StandardId {
        // A CobId never exceeds 11 bits, so the fallback is never taken.
        StandardId::new(id.0).unwrap_or(StandardId::MAX)
    }
}

in_words!(CobId { id => ("{:03X}h", id.0), });

/// The function codes of the predefined connection set that carry a node-ID
/// (CiA 301, 7.3.5). RPDO and TPDO are seen from the node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[expect(missing_docs, reason = "the names are those of the standard")]
pub enum FunctionCode {
    Emcy,
    Tpdo1,
    Rpdo1,
    Tpdo2,
    Rpdo2,
    Tpdo3,
    Rpdo3,
    Tpdo4,
    Rpdo4,
    /// SDO, server to client.
    SdoResponse,
    /// SDO, client to server.
    SdoRequest,
    /// Boot-up, heartbeat and node guarding.
    ErrorControl,
}

impl FunctionCode {
    /// The identifier without the node-ID.
    pub const fn base(self) -> u16 {
        match self {
            FunctionCode::Emcy => 0x080,
            FunctionCode::Tpdo1 => 0x180,
            FunctionCode::Rpdo1 => 0x200,
            FunctionCode::Tpdo2 => 0x280,
            FunctionCode::Rpdo2 => 0x300,
            FunctionCode::Tpdo3 => 0x380,
            FunctionCode::Rpdo3 => 0x400,
            FunctionCode::Tpdo4 => 0x480,
            FunctionCode::Rpdo4 => 0x500,
            FunctionCode::SdoResponse => 0x580,
            FunctionCode::SdoRequest => 0x600,
            FunctionCode::ErrorControl => 0x700,
        }
    }

    /// The function code whose identifiers start at `base`.
    pub const fn from_base(base: u16) -> Option<FunctionCode> {
        Some(match base {
            0x080 => FunctionCode::Emcy,
            0x180 => FunctionCode::Tpdo1,
            0x200 => FunctionCode::Rpdo1,
            0x280 => FunctionCode::Tpdo2,
            0x300 => FunctionCode::Rpdo2,
            0x380 => FunctionCode::Tpdo3,
            0x400 => FunctionCode::Rpdo3,
            0x480 => FunctionCode::Tpdo4,
            0x500 => FunctionCode::Rpdo4,
            0x580 => FunctionCode::SdoResponse,
            0x600 => FunctionCode::SdoRequest,
            0x700 => FunctionCode::ErrorControl,
            _ => return None,
        })
    }
}

/// An index of the object dictionary (CiA 301, 7.4.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Index(pub u16);

in_words!(Index { index => ("{:04X}h", index.0), });

/// A sub-index of the object dictionary (CiA 301, 7.4.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SubIndex(pub u8);

in_words!(SubIndex { sub => ("{:02X}h", sub.0), });

/// Index and sub-index together: one entry of an object dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address {
    /// The object.
    pub index: Index,
    /// Its entry.
    pub sub: SubIndex,
}

impl Address {
    /// The entry `sub` of the object `index`.
    pub const fn new(index: u16, sub: u8) -> Address {
        Address {
            index: Index(index),
            sub: SubIndex(sub),
        }
    }
}

in_words!(Address { at => ("{:04X}h:{:02X}", at.index.0, at.sub.0), });

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_id_is_1_to_127() {
        for raw in 0..=u8::MAX {
            assert_eq!(NodeId::new(raw).is_some(), (1..=127).contains(&raw));
            if let Some(id) = NodeId::new(raw) {
                assert_eq!(id.get(), raw);
            }
        }
    }

    #[test]
    fn a_cob_id_has_11_bits() {
        for raw in 0..=u16::MAX {
            assert_eq!(CobId::new(raw).is_some(), raw < 0x800);
        }
    }

    #[test]
    fn the_predefined_connection_set_splits_and_joins() {
        let mut found = 0;
        for raw in 0..0x800 {
            let id = CobId::new(raw).unwrap();
            assert_eq!(StandardId::from(id).as_raw(), raw);
            if let Some((function, node)) = id.split() {
                assert_eq!(CobId::of(function, node), id);
                found += 1;
            }
        }
        assert_eq!(found, 12 * 127);
        assert_eq!(CobId::SYNC.split(), None);
        assert_eq!(CobId::TIME.split(), None);
    }
}

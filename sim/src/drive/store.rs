//! What the drive remembers without supply: 1010h, 1011h, and the values of the
//! factory (CiA 301, 7.5.2.13, 7.5.2.14).

use super::config::Identity;
use super::objects::{OBJECT_COUNT, PDOS, TABLE};
use super::pdo;
use canmaster::NodeId;
use canmaster::id::FunctionCode;
use canmaster::od::{Access, Values};
use canmaster::pdo::{Direction, PdoCobId, RPDO_COMMUNICATION, TPDO_COMMUNICATION};

/// Node-ID of an unconfigured device.
pub(super) const UNCONFIGURED: u8 = 255;
/// Node-ID and bit rate: 1011h leaves them alone, or the drive would be lost
/// to its master.
const LAYER: [u16; 2] = [0x2000, 0x2001];
/// Commands and set values: after power-on the drive must not act on what was
/// asked for before.
const NOT_SAVED: [u16; 11] = [
    0x1003, 0x1010, 0x1011, 0x6040, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60FE, 0x60FF,
];
/// The bits of an 11-bit identifier.
const IDENTIFIER: u32 = 0x7FF;

type Set = Values<OBJECT_COUNT>;

/// 1010h: the parameters go into the store.
pub(super) fn save(values: &Set, stored: &mut Set) {
    for object in TABLE.objects() {
        let (index, sub) = (object.at.index.0, object.at.sub.0);
        if object.entry.access == Access::ReadWrite && !NOT_SAVED.contains(&index) {
            stored.put(index, sub, values.number(index, sub));
        }
    }
}

/// 1011h: the factory's values for the next reset.
pub(super) fn restored(stored: &Set, identity: Identity) -> Set {
    let mut values = factory(None, identity);
    for index in LAYER {
        values.put(index, 0, stored.number(index, 0));
    }
    values
}

/// The values of a drive that was never configured. The identifiers of the
/// predefined connection set follow once a node-ID is in use.
pub(super) fn factory(node: Option<NodeId>, identity: Identity) -> Set {
    let mut values = Values::new(TABLE);
    let node = node.map_or(UNCONFIGURED, NodeId::get);
    put(&mut values, (0x2000, 0), node.into());
    for (at, function) in connections() {
        let mut raw = u32::from(function.base());
        if (TPDO_COMMUNICATION..TPDO_COMMUNICATION + PDOS).contains(&at.0) {
            let transmit = PdoCobId(raw).without_rtr();
            // Of the TPDOs only the first is on.
            let first = at.0 == TPDO_COMMUNICATION;
            raw = if first { transmit } else { transmit.invalid() }.0;
        }
        put(&mut values, at, raw.into());
    }
    put_identity(&mut values, identity);
    values
}

/// Puts `node` into every identifier that still is the one of the predefined
/// connection set, of whatever node.
pub(super) fn renumber(values: &mut Set, node: Option<NodeId>) {
    let node = node.map_or(0, |node| u32::from(node.get()));
    let nodes = u32::from(NodeId::MAX.get());
    for ((index, sub), function) in connections() {
        let raw = values.number(index, sub) as u32;
        let base = u32::from(function.base());
        if (raw & IDENTIFIER) & !nodes == base {
            let renumbered = raw & !nodes | node;
            put(values, (index, sub), renumbered.into());
        }
    }
}

/// The identity of the drive.
pub(super) fn put_identity(values: &mut Set, identity: Identity) {
    for (index, sub, number) in [
        (0x1000, 0, identity.device_type),
        (0x1018, 1, identity.vendor),
        (0x1018, 2, identity.product),
        (0x1018, 3, identity.revision),
        (0x1018, 4, identity.serial),
    ] {
        put(values, (index, sub), number.into());
    }
}

/// Entries that hold an identifier of the predefined connection set.
fn connections() -> impl Iterator<Item = ((u16, u8), FunctionCode)> {
    let pdos = |direction, first: u16| {
        (0..PDOS).map(move |n| ((first + n, 1), pdo::function(direction, n)))
    };
    [
        ((0x1014, 0), FunctionCode::Emcy),
        ((0x1200, 1), FunctionCode::SdoRequest),
        ((0x1200, 2), FunctionCode::SdoResponse),
    ]
    .into_iter()
    .chain(pdos(Direction::Receive, RPDO_COMMUNICATION))
    .chain(pdos(Direction::Transmit, TPDO_COMMUNICATION))
}

fn put(values: &mut Set, (index, sub): (u16, u8), number: i64) {
    let exists = values.put(index, sub, number);
    debug_assert!(exists, "{index:04X}h:{sub:02X} is in the table");
}

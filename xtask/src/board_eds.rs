//! The board's own EDS: its object dictionary, asked entry by entry, so that it
//! tells what the firmware has.

use std::collections::BTreeMap;

use canmaster::design;
use canmaster::device::{Board, Description, Device, Identity};
use canmaster::frame::{Frame, MAX_DATA};
use canmaster::id::{Address, CobId, FunctionCode, NodeId};
use canmaster::motion::panel;
use canmaster::network::Network;
use canmaster::nmt::{NodeControl, State};
use canmaster::objects::SERIAL_NUMBER;
use canmaster::od;
use canmaster::sdo::AbortCode;
use canmaster::sync::SyncLimits;
use canmaster::time::{Duration, Instant};
use canmaster_network::eds::{DeviceInfo, Eds, Entry, Number, Object, ObjectKind};
use canmaster_network::model::Machine;
use canmaster_network::object::{Access, DataType};

use crate::board_names;

/// Room for every node that a network can have.
const NODES: usize = NodeId::MAX.get() as usize;
/// Where objects begin and end.
const OBJECTS: std::ops::RangeInclusive<u16> = 0x1000..=0x9FFF;
/// The last sub-index of an entry: 255 is the structure of the object.
const LAST_SUB: u8 = 254;
/// Objects with more entries than this have one for each node-ID.
const PER_NODE: u8 = 64;
/// The entry that means all nodes.
const ALL_NODES: u8 = 0x80;
/// Where the process image begins: besides [`MAPPED`] the only objects that the
/// board's PDOs carry.
const PROCESS: u16 = 0x3000;
/// State, actual positions and program step of the group.
const MAPPED: [u16; 3] = [panel::STATE, panel::POSITION, panel::STEP];
const TIMEOUT: Duration = Duration::from_millis(500);
const BITS_PER_KILO: u32 = 1000;

/// A board that stores nothing and whose PDOs are empty.
struct Bench;

impl Board for Bench {
    fn save(&mut self, _: &[u8]) -> Result<(), AbortCode> {
        Err(AbortCode::HARDWARE)
    }

    fn can_save(&self) -> bool {
        true
    }

    fn may_request(&mut self, _: NodeControl) -> Result<(), AbortCode> {
        Err(AbortCode::DEVICE_STATE)
    }

    fn tpdo(&mut self, _: NodeId, _: u8) -> [u8; MAX_DATA] {
        [0; MAX_DATA]
    }

    fn rpdo(&mut self, _: NodeId, _: u8) -> [u8; MAX_DATA] {
        [0; MAX_DATA]
    }
}

/// The board as it is on one bus of a machine, which the library has as
/// `network`.
pub(crate) fn eds(machine: &Machine, bus: usize, network: &'static Network) -> Eds {
    let description = Description {
        device_type: 0,
        name: design::DEVICE_NAME,
        hardware: design::HARDWARE_VERSION,
        software: env!("CARGO_PKG_VERSION"),
        identity: Identity::default(),
        sync: SyncLimits::NONE,
        tpdo_every: 1,
    };
    let mut device: Device<NODES> = Device::new(description, network, TIMEOUT);
    device.set_state(State::PreOperational, &mut Bench, Instant::ZERO);
    let mut objects = BTreeMap::new();
    for index in OBJECTS {
        // Most objects have the entry 0, and those that do not have 1.
        if (0..=1).all(|sub| device.entry(Address::new(index, sub)).is_err()) {
            continue;
        }
        let object = object(index, machine, bus, network, &mut device);
        objects.insert(index, object);
    }
    let bit_rate = network.bit_rate / BITS_PER_KILO;
    Eds {
        file: "master.eds".to_string(),
        device: DeviceInfo {
            vendor_name: String::new(),
            vendor: Some(description.identity.vendor),
            product_name: format!("{} on {}", description.name, description.hardware),
            product: Some(description.identity.product),
            revision: Some(description.identity.revision),
            lss: false,
            bit_rates: BTreeMap::from([(bit_rate, true)]),
        },
        objects,
        ..Eds::default()
    }
}

fn object(
    index: u16,
    machine: &Machine,
    bus: usize,
    network: &Network,
    device: &mut Device<NODES>,
) -> Object {
    let exists = |sub: &u8| device.entry(Address::new(index, *sub)).is_ok();
    let subs: Vec<u8> = (0..=LAST_SUB).filter(exists).collect();
    let per_node = subs.last().is_some_and(|last| *last > PER_NODE);
    let named = |sub: &u8| {
        let node = NodeId::new(*sub).and_then(|id| network.find(id));
        !per_node || *sub == 0 || *sub == ALL_NODES || node.is_some()
    };
    let subs: Vec<u8> = subs.into_iter().filter(named).collect();
    let names = board_names::Names::new(index, machine, bus);
    let mut entries = BTreeMap::new();
    for sub in &subs {
        let at = Address::new(index, *sub);
        let Ok(entry) = device.entry(at) else {
            continue;
        };
        let (default, default_text) = default(network.master.node, at, &entry, device);
        let described = Entry {
            name: names.entry(*sub),
            data_type: DataType::from_code(entry.data_type.code()),
            access: match entry.access {
                od::Access::ReadOnly => Access::ReadOnly,
                od::Access::WriteOnly => Access::WriteOnly,
                od::Access::ReadWrite => Access::ReadWrite,
                od::Access::Constant => Access::Constant,
            },
            mappable: (index >= PROCESS && *sub > 0)
                || (MAPPED.contains(&index) && (*sub > 0 || subs.len() == 1)),
            low: None,
            high: None,
            default,
            default_text,
            parameter: None,
            line: 0,
        };
        entries.insert(*sub, described);
    }
    let kind = match subs.len() {
        1 => ObjectKind::Variable,
        _ => ObjectKind::Record,
    };
    Object {
        name: names.object(),
        kind,
        line: 0,
        entries,
    }
}

/// The value after a reset, as the SDO server gives it in one frame. What changes
/// by itself has none.
fn default(
    master: NodeId,
    at: Address,
    entry: &od::Entry,
    device: &mut Device<NODES>,
) -> (Option<Number>, String) {
    // Every board has its own serial number.
    let changes = matches!(entry.access, od::Access::ReadOnly | od::Access::WriteOnly);
    if changes || at == SERIAL_NUMBER {
        return (None, String::new());
    }
    const UPLOAD: u8 = 0x40;
    /// Expedited, with its size: 0x43, 0x47, 0x4B, 0x4F for 4 .. 1 bytes.
    const EXPEDITED: u8 = 0b0100_0011;
    const UNUSED_SHIFT: u8 = 2;
    const UNUSED: u8 = 0b11;
    let [low, high] = at.index.0.to_le_bytes();
    let request = Frame::full(
        CobId::of(FunctionCode::SdoRequest, master),
        [UPLOAD, low, high, at.sub.0, 0, 0, 0, 0],
    );
    let answer = device.on_frame(&request, Instant::ZERO, &mut Bench);
    let value = answer.and_then(|answer| {
        let [command, _, _, _, value @ ..] = <[u8; MAX_DATA]>::try_from(answer.data()).ok()?;
        let unused = command >> UNUSED_SHIFT & UNUSED;
        let bits = u8::BITS * (value.len() as u32 - u32::from(unused));
        let mask = u32::MAX >> (u32::BITS - bits);
        (command & !(UNUSED << UNUSED_SHIFT) == EXPEDITED).then(|| u32::from_le_bytes(value) & mask)
    });
    match value {
        Some(value) => (Some(Number::plain(value.into())), format!("0x{value:X}")),
        None => (None, String::new()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cargo;
    use crate::machine::DESCRIPTION;
    use canmaster_network::Source;
    use canmaster_network::object::Address as At;
    use canmaster_sim::world::library;

    fn sample() -> Eds {
        let outcome = canmaster_network::load(&cargo::workspace().join(DESCRIPTION));
        let machine = outcome.machine.unwrap();
        eds(&machine, 0, library::network_of_bus(&machine, 0).unwrap())
    }

    #[test]
    fn every_object_and_entry_has_a_name() {
        for (at, object, entry) in sample().entries() {
            assert_ne!(object.name, board_names::NAMELESS, "{at}");
            assert!(!entry.name.is_empty(), "{at}");
            // A variable by its name has no entries.
            assert!(at.sub == 0 || entry.name != object.name, "{at}");
        }
    }

    #[test]
    fn the_file_reads_without_a_complaint() {
        let written = sample();
        let source = Source::new("master.eds", written.write().as_bytes());
        let (read, problems) = Eds::read(&source);
        assert!(problems.is_empty(), "{problems:?}");
        assert_eq!(read.entries().count(), written.entries().count());
    }

    #[test]
    fn types_access_and_values_are_those_of_the_dictionary() {
        let eds = sample();
        let entry = |index, sub| eds.entry(At::new(index, sub)).unwrap();
        assert_eq!(entry(0x1006, 0).data_type, DataType::Unsigned(32));
        assert_eq!(entry(0x1006, 0).access, Access::ReadWrite);
        assert_eq!(entry(0x1006, 0).default.unwrap().value, 2_000);
        assert_eq!(entry(0x1017, 0).default.unwrap().value, 50);
        // The board's own TPDOs, then the mirrored ones.
        assert_eq!(entry(0x1A00, 1).default.unwrap().value, 0x2001_0008);
        assert_eq!(entry(0x1A03, 2).default.unwrap().value, 0x2009_0620);
        assert_eq!(entry(0x1800, 1).default.unwrap().value, 0xC000_01FF);
        assert_eq!(entry(0x1A04, 1).default.unwrap().value, 0x3001_0310);
        for (index, sub) in [(0x2001, 0), (0x2009, 6), (0x2010, 0), (0x3001, 1)] {
            assert!(entry(index, sub).mappable, "{index:X}");
        }
        for (index, sub) in [(0x2000, 0), (0x2009, 0), (0x3001, 0), (0x1018, 1)] {
            assert!(!entry(index, sub).mappable, "{index:X}");
        }
        assert_eq!(entry(0x2004, 6).data_type, DataType::Integer(32));
        assert_eq!(eds.entry(At::new(0x2004, 7)), None);
        assert_eq!(entry(0x2008, 1).data_type, DataType::Integer(8));
        assert_eq!(entry(0x200F, 0).data_type, DataType::Domain);
        assert_eq!(entry(0x3001, 1).name, "Statusword");
        assert_eq!(entry(0x3001, 3).name, "Controlword");
        assert_eq!(entry(0x1F22, 6).data_type, DataType::Domain);
        assert_eq!(entry(0x1F82, 0x80).access, Access::WriteOnly);
        assert_eq!(eds.entry(At::new(0x1F22, 7)), None);
    }
}

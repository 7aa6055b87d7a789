//! PDO parameters of the drive (CiA 301, 7.5.2.35 to 7.5.2.38, as the EPOS4
//! has them): what may be written, and the layout that follows from it.

use super::dictionary::Dictionary;
use super::objects::{
    MAPPING_ENTRIES, PDOS, RPDO_COMMUNICATION, RPDO_MAPPING, TPDO_COMMUNICATION, TPDO_MAPPING,
};
use canmaster::id::{Address, FunctionCode};
use canmaster::od::{Mappable, ObjectDictionary};
use canmaster::sdo::AbortCode;
use canmaster::{CobId, NodeId};

/// The PDO does not exist.
const INVALID: u32 = 1 << 31;
/// No remote request.
const NO_RTR: u32 = 1 << 30;
/// Extended identifier, or bits that have to be zero.
const RESERVED: u32 = 0x3FFF_F800;
const ID_MASK: u32 = 0x7FF;
const PDO_BITS: u32 = 64;

/// Transmission type: with every SYNC.
pub(super) const EVERY_SYNC: u8 = 1;
/// Transmission type: on remote request.
const ON_REQUEST: u8 = 253;
/// Transmission type: on change.
pub(super) const ON_CHANGE: u8 = 255;

/// Which way, seen from the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Direction {
    /// RPDO.
    Receive,
    /// TPDO.
    Transmit,
}

impl Direction {
    fn communication(self) -> u16 {
        match self {
            Direction::Receive => RPDO_COMMUNICATION,
            Direction::Transmit => TPDO_COMMUNICATION,
        }
    }

    fn mapping(self) -> u16 {
        match self {
            Direction::Receive => RPDO_MAPPING,
            Direction::Transmit => TPDO_MAPPING,
        }
    }

    /// Identifier of PDO `number` (from 0) in the predefined connection set.
    pub(super) fn default_id(self, number: u16, node: NodeId) -> u16 {
        use FunctionCode::*;
        let functions = match self {
            Direction::Receive => [Rpdo1, Rpdo2, Rpdo3, Rpdo4],
            Direction::Transmit => [Tpdo1, Tpdo2, Tpdo3, Tpdo4],
        };
        CobId::of(functions[usize::from(number % PDOS)], node).get()
    }

    fn maps(self, mappable: Mappable) -> bool {
        match self {
            Direction::Receive => matches!(mappable, Mappable::Rpdo | Mappable::Both),
            Direction::Transmit => matches!(mappable, Mappable::Tpdo | Mappable::Both),
        }
    }
}

/// A PDO that exists, ready to pack and unpack.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Pdo {
    /// Its identifier.
    pub id: u16,
    /// Its transmission type.
    pub transmission: u8,
    /// Whether a remote frame asks for it.
    pub on_request: bool,
    /// Inhibit time in units of 100 us.
    pub inhibit: u16,
    /// What it carries, and how many bytes each.
    pub entries: Vec<(Address, usize)>,
    /// Bytes together.
    pub len: usize,
}

impl Pdo {
    /// PDO `number` (from 0) as the dictionary describes it; `None` if it does
    /// not exist or carries nothing.
    pub(super) fn read(od: &Dictionary, direction: Direction, number: u16) -> Option<Pdo> {
        let communication = direction.communication() + number;
        let mapping = direction.mapping() + number;
        let cob_id = od.number(communication, 1) as u32;
        let count = od.number(mapping, 0) as u8;
        if cob_id & INVALID != 0 || count == 0 {
            return None;
        }
        let transmission = od.number(communication, 2) as u8;
        let inhibit = match direction {
            Direction::Receive => 0,
            Direction::Transmit => od.number(communication, 3) as u16,
        };
        let entries: Vec<_> = (1..=count)
            .map(|sub| {
                let entry = Mapped::from(od.number(mapping, sub) as u32);
                (entry.at, entry.bits as usize / 8)
            })
            .collect();
        Some(Pdo {
            id: (cob_id & ID_MASK) as u16,
            transmission,
            on_request: transmission == ON_REQUEST && cob_id & NO_RTR == 0,
            inhibit,
            len: entries.iter().map(|entry| entry.1).sum(),
            entries,
        })
    }

    /// The data of a TPDO as the dictionary stands now.
    pub(super) fn pack(&self, od: &mut Dictionary) -> Vec<u8> {
        let mut data = Vec::with_capacity(self.len);
        for &(at, len) in &self.entries {
            // Mapped entries exist: the mapping was checked when written.
            let value = od.get(at).ok();
            data.extend(value.iter().flat_map(|value| value.bytes()).take(len));
        }
        data
    }

    /// Takes over the data of an RPDO, which is at least as long as mapped.
    pub(super) fn unpack(&self, data: &[u8], od: &mut Dictionary) {
        let mut rest = data;
        for &(at, len) in &self.entries {
            let Some((value, tail)) = rest.split_at_checked(len) else {
                return;
            };
            od.receive(at, value);
            rest = tail;
        }
    }
}

/// An entry of a mapping (CiA 301, 7.5.2.36).
struct Mapped {
    at: Address,
    bits: u32,
}

impl From<u32> for Mapped {
    fn from(raw: u32) -> Mapped {
        Mapped {
            at: Address::new((raw >> 16) as u16, (raw >> 8) as u8),
            bits: raw & 0xFF,
        }
    }
}

/// Whether `number` may be written to `at`. Entries that are no PDO parameter
/// pass.
///
/// # Errors
/// The abort code of the drive.
pub(super) fn check(
    od: &Dictionary,
    node: NodeId,
    at: Address,
    number: u32,
) -> Result<(), AbortCode> {
    let index = at.index.0;
    for direction in [Direction::Receive, Direction::Transmit] {
        let communication = direction.communication();
        if (communication..communication + PDOS).contains(&index) {
            return match at.sub.0 {
                1 => check_cob_id(number, node),
                2 => check_transmission(direction, number),
                _ => Ok(()),
            };
        }
        let mapping = direction.mapping();
        if (mapping..mapping + PDOS).contains(&index) {
            if od.operational {
                return Err(AbortCode::DEVICE_STATE);
            }
            return match at.sub.0 {
                0 => check_count(od, index, number),
                _ => check_entry(od, direction, index, number),
            };
        }
    }
    Ok(())
}

fn check_cob_id(number: u32, node: NodeId) -> Result<(), AbortCode> {
    let raw = (number & ID_MASK) as u16;
    if number & RESERVED != 0 || restricted(raw) {
        return Err(AbortCode::VALUE_RANGE);
    }
    match CobId::new(raw).and_then(CobId::split) {
        // Seen in the field: the identifier of another node.
        Some((_, owner)) if owner != node => Err(AbortCode::NOT_MAPPABLE),
        _ => Ok(()),
    }
}

/// Identifiers that no PDO can have (CiA 301, 7.3.5, table 41), SYNC, EMCY and
/// TIME included.
fn restricted(id: u16) -> bool {
    matches!(
        id,
        0x000..=0x180 | 0x581..=0x5FF | 0x601..=0x67F | 0x6E0..=0x6FF | 0x701..=0x7FF
    )
}

fn check_transmission(direction: Direction, number: u32) -> Result<(), AbortCode> {
    let request = direction == Direction::Transmit && number == u32::from(ON_REQUEST);
    let known = number == u32::from(EVERY_SYNC) || number == u32::from(ON_CHANGE);
    if request || known {
        Ok(())
    } else {
        Err(AbortCode::VALUE_RANGE)
    }
}

fn check_count(od: &Dictionary, index: u16, number: u32) -> Result<(), AbortCode> {
    if number > u32::from(MAPPING_ENTRIES) {
        return Err(AbortCode::VALUE_RANGE);
    }
    let mut bits = 0;
    for sub in 1..=number as u8 {
        let raw = od.number(index, sub) as u32;
        if raw == 0 {
            return Err(AbortCode::NOT_MAPPABLE);
        }
        bits += Mapped::from(raw).bits;
    }
    if bits > PDO_BITS {
        return Err(AbortCode::PDO_LENGTH);
    }
    Ok(())
}

fn check_entry(
    od: &Dictionary,
    direction: Direction,
    index: u16,
    number: u32,
) -> Result<(), AbortCode> {
    if od.number(index, 0) != 0 {
        return Err(AbortCode::SUB0_NOT_ZERO);
    }
    if number == 0 {
        return Ok(());
    }
    let mapped = Mapped::from(number);
    let entry = od.entry(mapped.at)?;
    let bits = entry.data_type.size().map(|size| size as u32 * 8);
    if direction.maps(entry.mappable) && bits == Some(mapped.bits) {
        Ok(())
    } else {
        Err(AbortCode::NOT_MAPPABLE)
    }
}

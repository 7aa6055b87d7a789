//! PDO parameters of the drive (CiA 301, 7.5.2.35 to 7.5.2.38, as the EPOS4
//! has them): what may be written, and the PDO that follows from it.

use super::dictionary::{ByPdo, Dictionary};
use super::objects::{MAPPING_ENTRIES, PDOS};
use canmaster::id::{Address, FunctionCode};
use canmaster::od::ObjectDictionary;
use canmaster::pdo::{
    Direction, Mapping, MappingEntry, PDO_MAX, PdoCobId, RPDO_COMMUNICATION, RPDO_MAPPING,
    TPDO_COMMUNICATION, TPDO_MAPPING, Transmission,
};
use canmaster::sdo::AbortCode;
use canmaster::{CobId, NodeId};

/// With every SYNC.
pub(super) const EVERY_SYNC: Transmission = Transmission::Synchronous(1);
const PDO_BITS: u32 = PDO_MAX as u32 * 8;

const fn communication(direction: Direction) -> u16 {
    match direction {
        Direction::Receive => RPDO_COMMUNICATION,
        Direction::Transmit => TPDO_COMMUNICATION,
    }
}

const fn mapping(direction: Direction) -> u16 {
    match direction {
        Direction::Receive => RPDO_MAPPING,
        Direction::Transmit => TPDO_MAPPING,
    }
}

/// Function of PDO `number` (from 0) in the predefined connection set.
pub(super) fn function(direction: Direction, number: u16) -> FunctionCode {
    use FunctionCode::*;
    let functions = match direction {
        Direction::Receive => [Rpdo1, Rpdo2, Rpdo3, Rpdo4],
        Direction::Transmit => [Tpdo1, Tpdo2, Tpdo3, Tpdo4],
    };
    functions[usize::from(number % PDOS)]
}

/// A PDO that exists, ready to pack and unpack.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Pdo {
    /// Its identifier.
    pub(super) id: CobId,
    /// When it is sent or takes effect.
    pub(super) transmission: Transmission,
    /// Whether a remote frame asks for it.
    pub(super) on_request: bool,
    /// Inhibit time in units of 100 us.
    pub(super) inhibit: u16,
    /// What it carries.
    pub(super) mapping: Mapping,
}

impl Pdo {
    /// PDO `number` (from 0) as the dictionary describes it; `None` if it does
    /// not exist or carries nothing.
    pub(super) fn read(od: &Dictionary, direction: Direction, number: u16) -> Option<Pdo> {
        let parameter = communication(direction) + number;
        let map = mapping(direction) + number;
        let cob_id = PdoCobId(od.number(parameter, 1) as u32);
        let count = od.number(map, 0) as u8;
        if !cob_id.is_valid() || count == 0 {
            return None;
        }
        let transmission = Transmission::from_code(od.number(parameter, 2) as u8);
        let inhibit = match direction {
            Direction::Receive => 0,
            Direction::Transmit => od.number(parameter, 3) as u16,
        };
        let entries: Vec<_> = (1..=count)
            .map(|sub| MappingEntry(od.number(map, sub) as u32))
            .collect();
        Some(Pdo {
            id: cob_id.id()?,
            transmission,
            on_request: transmission == Transmission::Rtr && cob_id.allows_rtr(),
            inhibit,
            mapping: Mapping::new(&entries)?,
        })
    }

    /// The data of a TPDO as the dictionary stands now.
    pub(super) fn pack(&self, od: &mut Dictionary) -> Vec<u8> {
        // Mapped entries exist and can be read: checked when they were mapped.
        let (data, len) = self.mapping.pack(od).unwrap_or_default();
        data[..len].to_vec()
    }

    /// Takes over the data of an RPDO. An entry that does not accept its value
    /// keeps the old one, without a word.
    pub(super) fn unpack(&self, data: [u8; PDO_MAX], od: &mut Dictionary) {
        let _refused = self.mapping.unpack(data, &mut ByPdo(od));
    }
}

/// Whether `number` may be written to `at`. Entries that are no PDO parameter
/// pass.
///
/// # Errors
/// The abort code of the drive.
pub(super) fn check(
    od: &Dictionary,
    node: Option<NodeId>,
    at: Address,
    number: u32,
) -> Result<(), AbortCode> {
    let index = at.index.0;
    for direction in [Direction::Receive, Direction::Transmit] {
        let first = communication(direction);
        if (first..first + PDOS).contains(&index) {
            return match at.sub.0 {
                1 => {
                    let old = PdoCobId(od.number(index, 1) as u32);
                    check_cob_id(PdoCobId(number), old, node)
                }
                2 => check_transmission(direction, Transmission::from_code(number as u8)),
                _ => Ok(()),
            };
        }
        let first = mapping(direction);
        if (first..first + PDOS).contains(&index) {
            if od.operational {
                return Err(AbortCode::DEVICE_STATE);
            }
            return match at.sub.0 {
                0 => check_count(od, index, number),
                _ => check_entry(od, direction, index, MappingEntry(number)),
            };
        }
    }
    Ok(())
}

fn check_cob_id(new: PdoCobId, old: PdoCobId, node: Option<NodeId>) -> Result<(), AbortCode> {
    new.may_replace(old)?;
    match new.id().and_then(CobId::split) {
        // Seen in the field: the identifier of another node.
        Some((_, owner)) if Some(owner) != node => Err(AbortCode::NOT_MAPPABLE),
        _ => Ok(()),
    }
}

/// The drive has types 1 and 255, and 253 for TPDOs.
fn check_transmission(direction: Direction, new: Transmission) -> Result<(), AbortCode> {
    let known = matches!(
        new,
        EVERY_SYNC | Transmission::EventProfile | Transmission::Rtr
    );
    if known && new.exists(direction) {
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
        let entry = MappingEntry(od.number(index, sub) as u32);
        if entry == MappingEntry(0) {
            return Err(AbortCode::NOT_MAPPABLE);
        }
        bits += u32::from(entry.bits());
    }
    if bits > PDO_BITS {
        return Err(AbortCode::PDO_LENGTH);
    }
    Ok(())
}

/// The mapping can be written while bit 31 is still clear: real drives were
/// seen not to insist. Sub-index 0 has to be 0.
fn check_entry(
    od: &Dictionary,
    direction: Direction,
    index: u16,
    new: MappingEntry,
) -> Result<(), AbortCode> {
    if od.number(index, 0) != 0 {
        return Err(AbortCode::SUB0_NOT_ZERO);
    }
    if new == MappingEntry(0) {
        return Ok(());
    }
    new.check(&od.entry(new.at())?, direction)
}

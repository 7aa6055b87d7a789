//! The object table of the EPOS4: type, access, mappability, range and value
//! after a reset (EPOS4 Firmware Specification; firmware 0170h).
//!
//! Values that depend on the node-ID are put in by
//! `dictionary`.

use super::test_data;
use canmaster::od::DataType::{
    Domain, Integer8, Integer16, Integer32, Unsigned8, Unsigned16, Unsigned32,
};
use canmaster::od::{Mappable, Object, Table};
use canmaster::pdo::{RPDO_COMMUNICATION, RPDO_MAPPING, TPDO_COMMUNICATION, TPDO_MAPPING};

/// RPDOs and TPDOs of the drive, each.
pub const PDOS: u16 = 4;
/// Guard time in milliseconds: only where a drive is said to have it.
pub const GUARD_TIME: u16 = 0x100C;
/// Life time factor: guard times until the master counts as lost.
pub const LIFE_TIME_FACTOR: u16 = 0x100D;
/// Entries of one mapping.
pub const MAPPING_ENTRIES: u8 = 12;

const CONTROLWORD_ENTRY: i64 = 0x6040_0010;
const STATUSWORD_ENTRY: i64 = 0x6041_0010;
const U32_MAX: i64 = u32::MAX as i64;
/// Largest speed of 607Fh, 6080h and 6081h, rpm.
const SPEED_MAX: i64 = 50_000;

/// Mappable into RPDOs and TPDOs, writable.
const fn rww(object: Object) -> Object {
    object.mappable(Mappable::Both)
}

const fn rpdo_communication(pdo: u16) -> [Object; 3] {
    let index = RPDO_COMMUNICATION + pdo;
    [
        Object::constant(index, 0, Unsigned8, 2),
        Object::rw(index, 1, Unsigned32, 0),
        Object::rw(index, 2, Unsigned8, 255),
    ]
}

const fn tpdo_communication(pdo: u16) -> [Object; 4] {
    let index = TPDO_COMMUNICATION + pdo;
    [
        Object::constant(index, 0, Unsigned8, 3),
        Object::rw(index, 1, Unsigned32, 0),
        Object::rw(index, 2, Unsigned8, 255),
        Object::rw(index, 3, Unsigned16, 10),
    ]
}

const fn mapping(index: u16, first: i64, second: i64) -> [Object; 13] {
    let count = if second == 0 { 1 } else { 2 };
    let mut rows = [Object::rw(index, 0, Unsigned8, count); 13];
    let mut sub = 1;
    while sub <= MAPPING_ENTRIES {
        let default = match sub {
            1 => first,
            2 => second,
            _ => 0,
        };
        rows[sub as usize] = Object::rw(index, sub, Unsigned32, default);
        sub += 1;
    }
    rows
}

const fn join<const N: usize>(parts: &[&[Object]]) -> [Object; N] {
    let mut all = [Object::constant(0, 0, Unsigned8, 0); N];
    let mut at = 0;
    let mut part = 0;
    while part < parts.len() {
        let mut row = 0;
        while row < parts[part].len() {
            all[at] = parts[part][row];
            at += 1;
            row += 1;
        }
        part += 1;
    }
    assert!(at == N, "the sum of the parts is the table");
    all
}

const COMMUNICATION: &[Object] = &[
    Object::constant(0x1000, 0, Unsigned32, 0x0002_0192),
    Object::ro(0x1001, 0, Unsigned8, 0).pdo(),
    Object::rw(0x1003, 0, Unsigned8, 0),
    Object::ro(0x1003, 1, Unsigned32, 0),
    Object::ro(0x1003, 2, Unsigned32, 0),
    Object::ro(0x1003, 3, Unsigned32, 0),
    Object::ro(0x1003, 4, Unsigned32, 0),
    Object::ro(0x1003, 5, Unsigned32, 0),
    Object::constant(0x1005, 0, Unsigned32, 0x80),
    Object::string(0x1008, 0, "EPOS4"),
    Object::rw(GUARD_TIME, 0, Unsigned16, 0),
    Object::rw(LIFE_TIME_FACTOR, 0, Unsigned8, 0),
    Object::constant(0x1010, 0, Unsigned8, 1),
    Object::rw(0x1010, 1, Unsigned32, 1),
    Object::constant(0x1011, 0, Unsigned8, 4),
    Object::rw(0x1011, 1, Unsigned32, 1),
    Object::rw(0x1011, 4, Unsigned32, 1),
    Object::ro(0x1014, 0, Unsigned32, 0),
    Object::constant(0x1016, 0, Unsigned8, 2),
    Object::rw(0x1016, 1, Unsigned32, 0),
    Object::rw(0x1016, 2, Unsigned32, 0),
    Object::rw(0x1017, 0, Unsigned16, 0),
    Object::constant(0x1018, 0, Unsigned8, 4),
    Object::ro(0x1018, 1, Unsigned32, 0),
    Object::ro(0x1018, 2, Unsigned32, 0),
    Object::ro(0x1018, 3, Unsigned32, 0),
    Object::ro(0x1018, 4, Unsigned32, 0),
    Object::constant(0x1029, 0, Unsigned8, 1),
    Object::rw(0x1029, 1, Unsigned8, 0).limited(0, 2),
    Object::constant(0x1200, 0, Unsigned8, 2),
    Object::ro(0x1200, 1, Unsigned32, 0),
    Object::ro(0x1200, 2, Unsigned32, 0),
];

const PROGRAM: &[Object] = &[
    Object::constant(0x1F50, 0, Unsigned8, 1),
    Object::wo(0x1F50, 1, Domain),
    Object::constant(0x1F51, 0, Unsigned8, 1),
    Object::ro(0x1F51, 1, Unsigned8, 1),
    Object::constant(0x1F56, 0, Unsigned8, 1),
    Object::ro(0x1F56, 1, Unsigned32, 0x0170_0000),
    Object::constant(0x1F57, 0, Unsigned8, 1),
    Object::ro(0x1F57, 1, Unsigned32, 0),
];

const MANUFACTURER: &[Object] = &[
    Object::rw(0x2000, 0, Unsigned8, 1),
    Object::rw(0x2001, 0, Unsigned8, 9),
    Object::constant(0x2200, 0, Unsigned8, 1),
    Object::ro(0x2200, 1, Unsigned16, 480),
    Object::rw(test_data::INDEX, 0, Domain, 0),
    Object::rw(0x30B0, 0, Integer32, 0).mappable(Mappable::Both),
    Object::rw(0x30B1, 0, Integer32, 0),
    Object::rw(0x30B2, 0, Unsigned16, 500).mappable(Mappable::Both),
    Object::constant(0x30D1, 0, Unsigned8, 2),
    Object::ro(0x30D1, 1, Integer32, 0).pdo(),
    Object::ro(0x30D1, 2, Integer32, 0).pdo(),
    Object::constant(0x30D2, 0, Unsigned8, 1),
    Object::ro(0x30D2, 1, Integer16, 0).pdo(),
    Object::constant(0x30D3, 0, Unsigned8, 1),
    Object::ro(0x30D3, 1, Integer32, 0).pdo(),
    Object::constant(0x30E0, 0, Unsigned8, 3),
    Object::rw(0x30E0, 1, Unsigned32, 30),
    Object::rw(0x30E0, 2, Unsigned16, 2),
    Object::rw(0x30E0, 3, Unsigned16, 1000),
    Object::constant(0x3201, 0, Unsigned8, 1),
    Object::ro(0x3201, 1, Integer16, 320),
];

const PROFILE: &[Object] = &[
    Object::rw(0x6007, 0, Integer16, 3).limited(2, 3),
    Object::ro(0x603F, 0, Unsigned16, 0).pdo(),
    rww(Object::rw(0x6040, 0, Unsigned16, 0)),
    Object::ro(0x6041, 0, Unsigned16, 0).pdo(),
    Object::rw(0x605A, 0, Integer16, 6).limited(6, 6),
    Object::rw(0x605B, 0, Integer16, 0).limited(0, 1),
    Object::rw(0x605C, 0, Integer16, 1).limited(0, 1),
    Object::rw(0x605E, 0, Integer16, 2).limited(0, 2),
    rww(Object::rw(0x6060, 0, Integer8, 1)),
    Object::ro(0x6061, 0, Integer8, 1).pdo(),
    Object::ro(0x6062, 0, Integer32, 0).pdo(),
    Object::ro(0x6064, 0, Integer32, 0).pdo(),
    rww(Object::rw(0x6065, 0, Unsigned32, 2000)),
    rww(Object::rw(0x6066, 0, Unsigned16, 0).limited(0, 0)),
    rww(Object::rw(0x6067, 0, Unsigned32, U32_MAX)),
    rww(Object::rw(0x6068, 0, Unsigned16, 0)),
    Object::ro(0x606B, 0, Integer32, 0).pdo(),
    Object::ro(0x606C, 0, Integer32, 0).pdo(),
    rww(Object::rw(0x6071, 0, Integer16, 0)),
    Object::rw(0x6076, 0, Unsigned32, 100_000),
    Object::ro(0x6077, 0, Integer16, 0).pdo(),
    rww(Object::rw(0x607A, 0, Integer32, 0)),
    Object::constant(0x607B, 0, Unsigned8, 2),
    rww(Object::rw(0x607B, 1, Integer32, 0).limited(0, 0)),
    rww(Object::rw(0x607B, 2, Integer32, 0).limited(0, 0)),
    Object::constant(0x607D, 0, Unsigned8, 2),
    rww(Object::rw(0x607D, 1, Integer32, 0)),
    rww(Object::rw(0x607D, 2, Integer32, 0)),
    rww(Object::rw(0x607F, 0, Unsigned32, SPEED_MAX).limited(1, SPEED_MAX)),
    rww(Object::rw(0x6080, 0, Unsigned32, SPEED_MAX).limited(1, SPEED_MAX)),
    rww(Object::rw(0x6081, 0, Unsigned32, 1000).limited(1, SPEED_MAX)),
    rww(Object::rw(0x6083, 0, Unsigned32, 10_000).limited(1, U32_MAX)),
    rww(Object::rw(0x6084, 0, Unsigned32, 10_000).limited(1, U32_MAX)),
    rww(Object::rw(0x6085, 0, Unsigned32, 10_000).limited(1, U32_MAX)),
    rww(Object::rw(0x6086, 0, Integer16, 0).limited(0, 0)),
    rww(Object::rw(0x6098, 0, Integer8, 7)),
    Object::constant(0x6099, 0, Unsigned8, 2),
    rww(Object::rw(0x6099, 1, Unsigned32, 100)),
    rww(Object::rw(0x6099, 2, Unsigned32, 10)),
    rww(Object::rw(0x609A, 0, Unsigned32, 1000).limited(1, U32_MAX)),
    Object::rw(0x60A8, 0, Unsigned32, 0x00B5_0000).limited(0x00B5_0000, 0x00B5_0000),
    Object::rw(0x60A9, 0, Unsigned32, 0x00B4_4700),
    Object::rw(0x60AA, 0, Unsigned32, 0x00C0_0300).limited(0x00C0_0300, 0x00C0_0300),
    rww(Object::rw(0x60B0, 0, Integer32, 0)),
    rww(Object::rw(0x60B1, 0, Integer32, 0)),
    rww(Object::rw(0x60B2, 0, Integer16, 0)),
    Object::constant(0x60C2, 0, Unsigned8, 2),
    rww(Object::rw(0x60C2, 1, Unsigned8, 0).limited(0, 100)),
    rww(Object::rw(0x60C2, 2, Integer8, -3).limited(-3, -3)),
    rww(Object::rw(0x60C5, 0, Unsigned32, U32_MAX).limited(1, U32_MAX)),
    Object::ro(0x60F4, 0, Integer32, 0).pdo(),
    Object::ro(0x60FD, 0, Unsigned32, 0).pdo(),
    Object::constant(0x60FE, 0, Unsigned8, 1),
    rww(Object::rw(0x60FE, 1, Unsigned32, 0)),
    rww(Object::rw(0x60FF, 0, Integer32, 0)),
    Object::rw(0x6402, 0, Unsigned16, 10),
    Object::ro(0x6502, 0, Unsigned32, 0x3A5).pdo(),
];

/// PDO parameters: 4 RPDOs of 3 + 13 entries, 4 TPDOs of 4 + 13 entries.
const PDO_OBJECTS: usize = 4 * (3 + 13) + 4 * (4 + 13);

/// Entries of the table.
pub const OBJECT_COUNT: usize =
    COMMUNICATION.len() + PDO_OBJECTS + PROGRAM.len() + MANUFACTURER.len() + PROFILE.len();

static OBJECTS: [Object; OBJECT_COUNT] = join(&[
    COMMUNICATION,
    &rpdo_communication(0),
    &rpdo_communication(1),
    &rpdo_communication(2),
    &rpdo_communication(3),
    &mapping(RPDO_MAPPING, CONTROLWORD_ENTRY, 0),
    &mapping(RPDO_MAPPING + 1, CONTROLWORD_ENTRY, 0x6060_0008),
    &mapping(RPDO_MAPPING + 2, CONTROLWORD_ENTRY, 0x607A_0020),
    &mapping(RPDO_MAPPING + 3, CONTROLWORD_ENTRY, 0x60FF_0020),
    &tpdo_communication(0),
    &tpdo_communication(1),
    &tpdo_communication(2),
    &tpdo_communication(3),
    &mapping(TPDO_MAPPING, STATUSWORD_ENTRY, 0),
    &mapping(TPDO_MAPPING + 1, STATUSWORD_ENTRY, 0x6061_0008),
    &mapping(TPDO_MAPPING + 2, STATUSWORD_ENTRY, 0x6064_0020),
    &mapping(TPDO_MAPPING + 3, STATUSWORD_ENTRY, 0x606C_0020),
    PROGRAM,
    MANUFACTURER,
    PROFILE,
]);

/// The table of the drive.
pub static TABLE: Table = Table::new(&OBJECTS);

// Made from network.toml; changes here are lost.

use canmaster::id::NodeId;
use canmaster::motion::experiment::Motor;
use canmaster::network::{Identity, Kind, Master, Network, Node};
use canmaster::time::Duration;

/// Axes of the group.
pub const AXES: usize = 6;
/// When the PDO producer goes ahead without the TPDOs that are missing, us.
pub const TPDO_DEADLINE_US: u16 = 1130;
/// Cycles in a row without a TPDO after which its node counts as lost.
pub const TPDO_MISSING_LIMIT: u8 = 3;
/// The SYNC periods (1006h) that pass the check of the description, us.
pub const SHORTEST_CYCLE_US: u32 = 1960;
pub const LONGEST_CYCLE_US: u32 = 46874;
/// From the last TPDO of a cycle to its first RPDO, us.
pub const COMPUTE_US: u16 = 120;
/// From the first RPDO of a cycle to the end of the last and the guard, us.
pub const RPDOS_US: u16 = 710;
/// Whether all nodes have the same PDOs, mapped alike.
pub const PDOS_ALIKE: bool = true;
/// Buses, in the order of their names.
pub const BUSES: usize = 1;
/// The controller of each: 1 for FDCAN1.
pub const BUS_PERIPHERALS: [u8; BUSES] = [1];
/// Prescaler, segment 1 and segment 2 of the bit timing of each.
pub const BUS_BIT_TIMINGS: [(u16, u16, u16); BUSES] = [(1, 20, 3)];
/// The bus of each axis.
pub const AXIS_BUSES: [u8; AXES] = [0, 0, 0, 0, 0, 0];
/// RPDOs that answer to TPDOs are handed over at the next SYNC, not when they are
/// computed.
pub const RPDOS_AFTER_SYNC: bool = false;
/// So long before SYNC nothing of the master is on the wire, us.
pub const GUARD_US: u16 = 20;
/// Until then a frame that is handed over goes ahead of all TPDOs, us after SYNC.
pub const AFTER_SYNC_US: [u16; BUSES] = [97];
/// One slot in a cycle serves SDO frames, the master's heartbeat and RPDOs on change.
pub const ONE_PLANNED: [bool; BUSES] = [true];
/// SDO requests in operational are handed over from then on, us after SYNC,
pub const SDO_FROM_US: [u16; BUSES] = [0];
/// and until then; 0: none is.
pub const SDO_UNTIL_US: [u16; BUSES] = [97];
/// The answer comes in the cycle after that of the request, and has its planned slot.
pub const SDO_NEXT_CYCLE: [bool; BUSES] = [false];
/// A drive is asked by SDO every so many cycles; 0: never.
pub const SDO_EVERY: [u16; BUSES] = [0];
/// The ramps of each axis are sent on change, to one axis of a bus in a cycle.
pub const RAMPS_ON_CHANGE: [bool; AXES] = [true, true, true, true, true, true];
/// Whether each node sends its heartbeat in operational, too.
pub const HEARTBEATS_IN_OPERATIONAL: [bool; AXES] = [false, false, false, false, false, false];

/// The motors, in the order of the axes.
pub const MOTORS: [Motor; AXES] = [
    Motor {
        increments_per_turn: 2000,
        gear: (1, 1),
        max_speed: 3000,
        max_acceleration: 20000,
        limits: (-2147483647, 2147483647),
        modes: 0x3A5,
    },
    Motor {
        increments_per_turn: 2000,
        gear: (1, 1),
        max_speed: 3000,
        max_acceleration: 20000,
        limits: (-2147483647, 2147483647),
        modes: 0x3A5,
    },
    Motor {
        increments_per_turn: 2000,
        gear: (1, 1),
        max_speed: 3000,
        max_acceleration: 20000,
        limits: (-2147483647, 2147483647),
        modes: 0x3A5,
    },
    Motor {
        increments_per_turn: 2000,
        gear: (1, 1),
        max_speed: 3000,
        max_acceleration: 20000,
        limits: (-2147483647, 2147483647),
        modes: 0x3A5,
    },
    Motor {
        increments_per_turn: 2000,
        gear: (1, 1),
        max_speed: 3000,
        max_acceleration: 20000,
        limits: (-2147483647, 2147483647),
        modes: 0x3A5,
    },
    Motor {
        increments_per_turn: 2000,
        gear: (1, 1),
        max_speed: 3000,
        max_acceleration: 20000,
        limits: (-2147483647, 2147483647),
        modes: 0x3A5,
    },
];

/// What one release runs: "pairs, there and back".
pub static PROGRAM: [u8; 226] = [
    0x02, 0x06, 0xD8, 0x00, 0xD0, 0x07, 0x00, 0x00, 0x01, 0x00, 0x3F, 0x00,
    0x00, 0x00, 0x00, 0x00, 0x40, 0x9C, 0x00, 0x00, 0xB0, 0x04, 0x00, 0x01,
    0xDC, 0x05, 0x00, 0x00, 0x20, 0x03, 0x00, 0x00, 0x00, 0x83, 0xFF, 0xFF,
    0x84, 0x03, 0x00, 0x02, 0xE8, 0x03, 0x00, 0x00, 0x58, 0x02, 0x00, 0x00,
    0x40, 0x9C, 0x00, 0x00, 0xB0, 0x04, 0x00, 0x01, 0xDC, 0x05, 0x00, 0x00,
    0x20, 0x03, 0x00, 0x00, 0x00, 0x83, 0xFF, 0xFF, 0x84, 0x03, 0x00, 0x02,
    0xE8, 0x03, 0x00, 0x00, 0x58, 0x02, 0x00, 0x00, 0x60, 0xEA, 0x00, 0x00,
    0xDC, 0x05, 0x00, 0x03, 0xD0, 0x07, 0x00, 0x00, 0xE8, 0x03, 0x00, 0x00,
    0x60, 0xEA, 0x00, 0x00, 0xDC, 0x05, 0x00, 0x03, 0xD0, 0x07, 0x00, 0x00,
    0xE8, 0x03, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0xFA, 0x00, 0x00, 0x00,
    0x01, 0x00, 0x3F, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    0xE8, 0x03, 0x00, 0x01, 0xB0, 0x04, 0x00, 0x00, 0xBC, 0x02, 0x00, 0x00,
    0x00, 0x00, 0x00, 0x00, 0x4C, 0x04, 0x00, 0x02, 0xDC, 0x05, 0x00, 0x00,
    0x20, 0x03, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0xE8, 0x03, 0x00, 0x01,
    0xB0, 0x04, 0x00, 0x00, 0xBC, 0x02, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    0x4C, 0x04, 0x00, 0x02, 0xDC, 0x05, 0x00, 0x00, 0x20, 0x03, 0x00, 0x00,
    0x00, 0x00, 0x00, 0x00, 0x08, 0x07, 0x00, 0x03, 0x40, 0x06, 0x00, 0x00,
    0x84, 0x03, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x08, 0x07, 0x00, 0x03,
    0x40, 0x06, 0x00, 0x00, 0x84, 0x03, 0x00, 0x00, 0x80, 0x10,
];

/// What nodes have in common.
static KINDS: [Kind; 1] = [
    Kind {
        identity: Identity {
            device_type: Some(0x00020192),
            vendor: Some(0x000000FB),
            product: Some(0x61500000),
            revision: Some(0x01700000),
        },
        heartbeat_ms: 100,
        consumer_ms: 200,
        rpdos: &[
            canmaster::network::Pdo {
                number: 1,
                transmission: canmaster::pdo::Transmission::from_code(1),
                mapping: &[
                    canmaster::pdo::MappingEntry::new(0x6040, 0, 16),
                    canmaster::pdo::MappingEntry::new(0x60FF, 0, 32),
                ],
                },
            canmaster::network::Pdo {
                number: 2,
                transmission: canmaster::pdo::Transmission::from_code(1),
                mapping: &[
                    canmaster::pdo::MappingEntry::new(0x6083, 0, 32),
                    canmaster::pdo::MappingEntry::new(0x6084, 0, 32),
                ],
                },
            canmaster::network::Pdo {
                number: 3,
                transmission: canmaster::pdo::Transmission::from_code(1),
                mapping: &[
                    canmaster::pdo::MappingEntry::new(0x6040, 0, 16),
                    canmaster::pdo::MappingEntry::new(0x607A, 0, 32),
                ],
                },
            canmaster::network::Pdo {
                number: 4,
                transmission: canmaster::pdo::Transmission::from_code(1),
                mapping: &[
                    canmaster::pdo::MappingEntry::new(0x6040, 0, 16),
                    canmaster::pdo::MappingEntry::new(0x6071, 0, 16),
                ],
                },
        ],
        tpdos: &[
            canmaster::network::Pdo {
                number: 1,
                transmission: canmaster::pdo::Transmission::from_code(1),
                mapping: &[
                    canmaster::pdo::MappingEntry::new(0x6041, 0, 16),
                    canmaster::pdo::MappingEntry::new(0x6064, 0, 32),
                ],
                },
        ],
        start_values: &[
            canmaster::network::ConfigWrite::u8(canmaster::id::Address::new(0x6060, 0), 0x3),
            canmaster::network::ConfigWrite::u8(canmaster::id::Address::new(0x60C2, 1), 0x2),
            canmaster::network::ConfigWrite::u32(canmaster::id::Address::new(0x607F, 0), 0xBB8),
            canmaster::network::ConfigWrite::u32(canmaster::id::Address::new(0x6080, 0), 0xBB8),
            canmaster::network::ConfigWrite::u32(canmaster::id::Address::new(0x60C5, 0), 0x4E20),
            canmaster::network::ConfigWrite::u32(canmaster::id::Address::new(0x6085, 0), 0x2710),
            canmaster::network::ConfigWrite::u16(canmaster::id::Address::new(0x6007, 0), 0x3),
        ],
        sdo_timeout: Duration::from_millis(100),
        configured: [0, 0],
    },
];

/// The bus "main".
pub static NETWORK: Network = Network {
    bit_rate: 1000000,
    cycle: Duration::from_micros(2000),
    master: Master {
        node: NodeId::constant::<127>(),
        heartbeat: Duration::from_millis(50),
        silence: Duration::from_millis(600),
        boot_time: Duration::from_millis(1500),
        sdo_tries: 3,
        syncs_before_start: 2,
    },
    nodes: &[
        Node {
            id: NodeId::constant::<1>(),
            mandatory: true,
            name: "axis 1",
            serial: Some(0x26000001),
            kind: &KINDS[0],
        },
        Node {
            id: NodeId::constant::<2>(),
            mandatory: true,
            name: "axis 2",
            serial: Some(0x26000002),
            kind: &KINDS[0],
        },
        Node {
            id: NodeId::constant::<3>(),
            mandatory: true,
            name: "axis 3",
            serial: Some(0x26000003),
            kind: &KINDS[0],
        },
        Node {
            id: NodeId::constant::<4>(),
            mandatory: true,
            name: "axis 4",
            serial: Some(0x26000004),
            kind: &KINDS[0],
        },
        Node {
            id: NodeId::constant::<5>(),
            mandatory: true,
            name: "axis 5",
            serial: Some(0x26000005),
            kind: &KINDS[0],
        },
        Node {
            id: NodeId::constant::<6>(),
            mandatory: true,
            name: "axis 6",
            serial: Some(0x26000006),
            kind: &KINDS[0],
        },
    ],
};

//! The sample network: six maxon EPOS4 with 2000 increments per turn, on one
//! bus at 1 Mbit/s, in profile velocity mode.

use super::{ConfigWrite, Identity, Kind, Master, Network, Node, Pdo};
use crate::id::NodeId;
use crate::objects;
use crate::pdo::{MappingEntry, Transmission};
use crate::time::Duration;

/// SYNC periods in milliseconds; 60C2h wants them in the same unit.
const CYCLE_MS: u8 = 2;
const LONG_CYCLE_MS: u8 = 10;

/// EPOS4: servo drive after CiA 402.
const EPOS4_DEVICE_TYPE: u32 = 0x0002_0192;
/// maxon motor ag.
const MAXON: u32 = 0x0000_00FB;
/// EPOS4 Module 50/5: the hardware version in the upper word.
const EPOS4_50_5: u32 = 0x6150_0000;
/// Serial numbers of the drives: this and the node-ID. A drive without node-ID is
/// found, and given its own, by it.
const FIRST_SERIAL: u32 = 0x2600_0000;
/// Firmware 0170h.
const EPOS4_REVISION: u32 = 0x0170_0000;

/// Profile velocity (CiA 402, modes of operation).
const PROFILE_VELOCITY: u8 = 3;
/// Abort connection option: quick-stop ramp, then disabled.
const QUICK_STOP_ON_LOST_MASTER: u16 = 3;

/// No axis is ever to turn faster, rpm. Well above the program's 2400 rpm.
const MAX_SPEED_RPM: u32 = 3000;
/// No axis is ever to accelerate harder, rpm/s.
const MAX_ACCELERATION_RPM_S: u32 = 20_000;
/// From the highest speed to rest in 0.3 s: the silent phase counts on it.
const QUICK_STOP_RPM_S: u32 = 10_000;

const fn mapped(at: crate::id::Address, bits: u8) -> MappingEntry {
    MappingEntry::new(at.index.0, at.sub.0, bits)
}

/// Taken over, or sampled, at every SYNC.
const EVERY_SYNC: Transmission = Transmission::Synchronous(1);

const RPDOS: &[Pdo] = &[
    Pdo {
        number: 1,
        transmission: EVERY_SYNC,
        mapping: &[
            mapped(objects::CONTROLWORD, 16),
            mapped(objects::TARGET_VELOCITY, 32),
        ],
    },
    Pdo {
        number: 2,
        transmission: EVERY_SYNC,
        mapping: &[
            mapped(objects::PROFILE_ACCELERATION, 32),
            mapped(objects::PROFILE_DECELERATION, 32),
        ],
    },
    Pdo {
        number: 3,
        transmission: EVERY_SYNC,
        mapping: &[
            mapped(objects::CONTROLWORD, 16),
            mapped(objects::TARGET_POSITION, 32),
        ],
    },
    Pdo {
        number: 4,
        transmission: EVERY_SYNC,
        mapping: &[
            mapped(objects::CONTROLWORD, 16),
            mapped(objects::TARGET_TORQUE, 16),
        ],
    },
];

const TPDOS: &[Pdo] = &[
    Pdo {
        number: 1,
        transmission: EVERY_SYNC,
        mapping: &[
            mapped(objects::STATUSWORD, 16),
            mapped(objects::POSITION_ACTUAL, 32),
        ],
    },
    Pdo {
        number: 2,
        transmission: EVERY_SYNC,
        mapping: &[
            mapped(objects::VELOCITY_ACTUAL, 32),
            mapped(objects::TORQUE_ACTUAL, 16),
        ],
    },
];

/// Six axes in 2 ms leave no room for the second: the velocity follows from the
/// positions.
const TPDO1: &[Pdo] = match TPDOS {
    [first, ..] => core::slice::from_ref(first),
    [] => TPDOS,
};

const START_VALUES: &[ConfigWrite] = &start_values(CYCLE_MS);
const LONG_START_VALUES: &[ConfigWrite] = &start_values(LONG_CYCLE_MS);

const fn start_values(cycle_ms: u8) -> [ConfigWrite; 7] {
    [
        ConfigWrite::u8(objects::MODES_OF_OPERATION, PROFILE_VELOCITY),
        ConfigWrite::u8(objects::INTERPOLATION_TIME, cycle_ms),
        ConfigWrite::u32(objects::MAX_PROFILE_VELOCITY, MAX_SPEED_RPM),
        ConfigWrite::u32(objects::MAX_MOTOR_SPEED, MAX_SPEED_RPM),
        ConfigWrite::u32(objects::MAX_ACCELERATION, MAX_ACCELERATION_RPM_S),
        ConfigWrite::u32(objects::QUICK_STOP_DECELERATION, QUICK_STOP_RPM_S),
        ConfigWrite::u16(objects::ABORT_CONNECTION_OPTION, QUICK_STOP_ON_LOST_MASTER),
    ]
}

/// One of the drives.
pub(crate) const fn epos4(id: NodeId, name: &'static str) -> Node {
    Node {
        id,
        name,
        mandatory: true,
        serial: Some(FIRST_SERIAL + id.get() as u32),
        kind: &EPOS4,
    }
}

const EPOS4: Kind = Kind {
    identity: Identity {
        device_type: Some(EPOS4_DEVICE_TYPE),
        vendor: Some(MAXON),
        product: Some(EPOS4_50_5),
        revision: Some(EPOS4_REVISION),
    },
    // Ten per second each, until it is operational and its TPDOs tell: a dead
    // drive is known within two periods.
    heartbeat_ms: 100,
    // Four of the master's periods, so that one lost frame stops nobody.
    consumer_ms: 200,
    rpdos: RPDOS,
    tpdos: TPDO1,
    start_values: START_VALUES,
    sdo_timeout: Duration::from_millis(100),
    // An EPOS4 has no 1020h.
    configured: [0; 2],
};

/// With both TPDOs, in a longer cycle.
const UNHURRIED: Kind = Kind {
    tpdos: TPDOS,
    start_values: LONG_START_VALUES,
    ..EPOS4
};

const fn six() -> [Node; 6] {
    [
        epos4(NodeId::constant::<1>(), "axis 1"),
        epos4(NodeId::constant::<2>(), "axis 2"),
        epos4(NodeId::constant::<3>(), "axis 3"),
        epos4(NodeId::constant::<4>(), "axis 4"),
        epos4(NodeId::constant::<5>(), "axis 5"),
        epos4(NodeId::constant::<6>(), "axis 6"),
    ]
}

/// The same drives with both TPDOs.
const fn unhurried([a, b, c, d, e, f]: [Node; 6]) -> [Node; 6] {
    const fn one(node: Node) -> Node {
        Node {
            kind: &UNHURRIED,
            ..node
        }
    }
    [one(a), one(b), one(c), one(d), one(e), one(f)]
}

const fn network(cycle_ms: u8, nodes: &'static [Node]) -> Network {
    Network {
        bit_rate: 1_000_000,
        cycle: Duration::from_millis(cycle_ms as u32),
        master: Master {
            node: NodeId::MAX,
            heartbeat: Duration::from_millis(50),
            silence: Duration::from_millis(600),
            boot_time: Duration::from_millis(1500),
            sdo_tries: 3,
            syncs_before_start: 2,
        },
        nodes,
    }
}

/// Six drives on one bus: the experiment of the system that this project grew
/// out of.
pub static SIX_EPOS4: Network = network(CYCLE_MS, &const { six() });

/// The same in five times the cycle, with both TPDOs: `networks/one_bus_10ms.toml`.
pub static SIX_EPOS4_10_MS: Network = network(LONG_CYCLE_MS, &const { unhurried(six()) });

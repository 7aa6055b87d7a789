//! The machine after everything was looked up and checked.

use crate::layout::Layout;
use crate::object::{Address, DataType, Direction};
use crate::program::Program;
use crate::timing::BitTiming;

/// A machine: the master, and its nodes on one bus or several.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Machine {
    /// The master's own parameters.
    pub master: Master,
    /// The buses, by name.
    pub buses: Vec<Bus>,
    /// What tells that a node is lost.
    pub liveness: Liveness,
    /// Cycles in a row without a TPDO after which its node counts as lost.
    pub missing_tpdos: u8,
    /// The nodes, in the order of the axes.
    pub nodes: Vec<Node>,
    /// What one release runs; `None`: the axes cannot be moved by the firmware.
    pub program: Option<Program>,
}

impl Machine {
    /// Cycles in a row without a TPDO after which the firmware takes its node for
    /// lost: as many as it counts, where only heartbeats tell.
    pub fn missing_limit(&self) -> u8 {
        match self.liveness {
            Liveness::Tpdo => self.missing_tpdos,
            Liveness::Heartbeat => u8::MAX,
        }
    }
}

/// What tells that a node is lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Liveness {
    /// Its TPDO is missing, or its heartbeat, where it has one.
    #[default]
    Tpdo,
    /// Its heartbeat is missing; TPDOs may be.
    Heartbeat,
}

/// `[master]`
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Master {
    /// Its node-ID.
    pub node_id: u8,
    /// 1017h
    pub heartbeat_ms: u16,
    /// Silence after a reset.
    pub silence_ms: u32,
    /// 1F89h
    pub boot_time_ms: u32,
    /// How often a request is tried.
    pub sdo_tries: u8,
    /// SYNCs before NMT start.
    pub syncs_before_start: u8,
}

/// `[bus.NAME]`
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Bus {
    /// Its name.
    pub name: String,
    /// Which FDCAN: 1 ..= 3.
    pub peripheral: u8,
    /// bit/s
    pub bit_rate: u32,
    /// How the controller makes a bit.
    pub timing: BitTiming,
    /// 1006h
    pub cycle_us: u32,
    /// When the master goes on without the TPDOs that are missing, after SYNC.
    pub tpdo_deadline_us: u32,
    /// The cycle, slot by slot.
    pub layout: Layout,
}

/// `[[node]]`, with what its device says.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Node {
    /// Its node-ID.
    pub id: u8,
    /// What people call it.
    pub name: String,
    /// The place of its bus in [`Machine::buses`].
    pub bus: usize,
    /// Without it the network does not start.
    pub mandatory: bool,
    /// What it must be.
    pub identity: Identity,
    /// 1017h of the node.
    pub heartbeat_ms: u16,
    /// Whether it sends its heartbeat in operational, too.
    pub heartbeat_in_operational: bool,
    /// 1016h of the node: how long it waits for the master.
    pub master_timeout_ms: u16,
    /// How long its SDO server may take.
    pub sdo_timeout_ms: u32,
    /// 1020h:1 and 1020h:2 of a node that is configured already; 0 and 0: it is
    /// configured at every boot-up.
    pub configured: [u32; 2],
    /// From SYNC to its request to send TPDOs, at best.
    pub tpdo_earliest_us: u32,
    /// The same at worst.
    pub tpdo_latency_us: u32,
    /// From an SDO request to its answer, at best and at worst; `None`: nobody
    /// knows.
    pub sdo_latency_us: Option<(u32, u32)>,
    /// RPDOs in use, by number.
    pub rpdos: Vec<Pdo>,
    /// TPDOs in use, by number.
    pub tpdos: Vec<Pdo>,
    /// Increments of the encoder for a turn of the motor.
    pub increments_per_turn: Option<u32>,
    /// Turns of the motor for turns of the load.
    pub gear: (u32, u32),
    /// 6502h as the EDS has it; `None`: it says nothing.
    pub supported_modes: Option<u32>,
    /// User units of a turn of the load.
    pub units_per_turn: Option<u32>,
    /// Start values in their order.
    pub start_values: Vec<Write>,
}

/// A motor with its encoder, gear and limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Motor {
    /// Increments of the encoder for a turn of the motor.
    pub increments_per_turn: u32,
    /// Turns of the motor for turns of the load.
    pub gear: (u32, u32),
    /// rpm
    pub max_speed: u32,
    /// rpm/s
    pub max_acceleration: u32,
    /// No farther from home than these, in increments: the lower, the upper.
    pub limits: (i32, i32),
    /// Modes of operation that the drive has, and whose RPDO is mapped, as 6502h.
    pub modes: u32,
}

/// Objects of CiA 402 that limit an axis.
const MAX_PROFILE_VELOCITY: Address = Address::new(0x607F, 0);
const MAX_MOTOR_SPEED: Address = Address::new(0x6080, 0);
const MAX_ACCELERATION: Address = Address::new(0x60C5, 0);
const MIN_POSITION: Address = Address::new(0x607D, 1);
const MAX_POSITION: Address = Address::new(0x607D, 2);
/// What is not limited is a number that the firmware can still count with.
const UNLIMITED: u32 = i32::MAX as u32;
const ANYWHERE: (i32, i32) = (-i32::MAX, i32::MAX);
const CONTROLWORD: u16 = 0x6040;
const RAMPS: [u16; 2] = [0x6083, 0x6084];
/// The target of each mode, and the modes that it is of, as 6502h has them: profile
/// velocity, homing and cyclic synchronous velocity; profile position and cyclic
/// synchronous position; cyclic synchronous torque.
const TARGETS: [(u16, u32); 3] = [
    (0x60FF, 1 << 2 | 1 << 5 | 1 << 8),
    (0x607A, 1 << 0 | 1 << 7),
    (0x6071, 1 << 9),
];

impl Motor {
    /// Increments and gear, speed and acceleration, limits and modes.
    pub const fn new(
        increments_per_turn: u32,
        gear: (u32, u32),
        max_speed: u32,
        max_acceleration: u32,
        limits: (i32, i32),
        modes: u32,
    ) -> Motor {
        Motor {
            increments_per_turn,
            gear,
            max_speed,
            max_acceleration,
            limits,
            modes,
        }
    }
}

impl Node {
    /// Its motor, within the limits that are written to the drive. `None`
    /// without [`increments_per_turn`](Self::increments_per_turn).
    pub fn motor(&self) -> Option<Motor> {
        let written = |at: Address| {
            let write = self.start_values.iter().rfind(|write| write.at == at);
            write.map(|write| write.value)
        };
        let least = |all: &[Address]| {
            let values = all.iter().filter_map(|at| written(*at));
            values.min().unwrap_or(UNLIMITED).min(UNLIMITED)
        };
        let limits = match (written(MIN_POSITION), written(MAX_POSITION)) {
            (Some(least), Some(most)) => (least as i32, most as i32),
            _ => ANYWHERE,
        };
        Some(Motor {
            increments_per_turn: self.increments_per_turn?,
            gear: self.gear,
            max_speed: least(&[MAX_PROFILE_VELOCITY, MAX_MOTOR_SPEED]),
            max_acceleration: least(&[MAX_ACCELERATION]),
            limits,
            modes: self.modes(),
        })
    }

    /// Modes of operation that the drive has, as far as the EDS says, and whose
    /// target an RPDO carries, as 6502h.
    pub fn modes(&self) -> u32 {
        let mapped = TARGETS.iter().filter(|(target, _)| {
            let mut rpdos = self.rpdos.iter();
            rpdos.any(|pdo| pdo.carries(CONTROLWORD) && pdo.carries(*target))
        });
        let mapped = mapped.fold(0, |all, (_, modes)| all | modes);
        self.supported_modes.unwrap_or(u32::MAX) & mapped
    }
}

/// Expected identity; `None` is not checked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// 1000h
    pub device_type: Option<u32>,
    /// 1018h:1
    pub vendor: Option<u32>,
    /// 1018h:2
    pub product: Option<u32>,
    /// 1018h:3
    pub revision: Option<u32>,
    /// 1018h:4
    pub serial: Option<u32>,
}

/// When the master sends an RPDO.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Send {
    /// In every cycle.
    #[default]
    EveryCycle,
    /// When its values change; to one node of a bus in a cycle.
    OnChange,
}

/// A PDO in use.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Pdo {
    /// Seen from the node.
    pub direction: Direction,
    /// 1 ..= 4
    pub number: u8,
    /// Transmission type.
    pub transmission: u8,
    /// When the master sends it; of an RPDO.
    pub send: Send,
    /// What it carries.
    pub mapping: Vec<Mapped>,
}

/// Controlword, and the targets of each mode of CiA 402.
const ANSWERS_TO_TPDOS: [u16; 6] = [0x6040, 0x6042, 0x6071, 0x607A, 0x60C1, 0x60FF];

impl Pdo {
    /// Whether it carries a controlword or a target: what the master works out
    /// from the TPDOs of the cycle.
    pub fn answers_to_tpdos(&self) -> bool {
        ANSWERS_TO_TPDOS.iter().any(|index| self.carries(*index))
    }

    /// Whether it is one of those of which only that of the active mode is sent in a
    /// cycle: it carries a controlword.
    pub fn is_of_a_mode(&self) -> bool {
        self.carries(CONTROLWORD)
    }

    /// Whether it carries an acceleration or a deceleration of CiA 402.
    pub fn has_ramps(&self) -> bool {
        RAMPS.iter().any(|index| self.carries(*index))
    }

    fn carries(&self, index: u16) -> bool {
        self.mapping.iter().any(|entry| entry.at.index == index)
    }

    /// Its identifier at a node (CiA 301, 7.3.5).
    pub fn cob_id(&self, node: u8) -> u16 {
        self.direction.function_code(self.number) + u16::from(node)
    }

    /// Its length in whole bytes.
    pub fn bytes(&self) -> u8 {
        let bits: u32 = self.mapping.iter().map(|entry| u32::from(entry.bits)).sum();
        bits.div_ceil(u8::BITS) as u8
    }
}

/// One object in a PDO.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mapped {
    /// The object.
    pub at: Address,
    /// Its name in the EDS.
    pub name: String,
    /// Its type.
    pub data_type: DataType,
    /// Its length.
    pub bits: u8,
}

impl Mapped {
    /// As the mapping parameter has it (CiA 301, 7.5.2.36).
    pub fn word(&self) -> u32 {
        u32::from(self.at.index) << 16 | u32::from(self.at.sub) << 8 | u32::from(self.bits)
    }
}

/// One write of a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Write {
    /// Where.
    pub at: Address,
    /// The value's bits; those above `bytes` are 0.
    pub value: u32,
    /// 1, 2 or 4
    pub bytes: u8,
}

impl Write {
    /// A value of so many bytes; what lies above them is cut off.
    pub fn new(at: Address, value: i128, bytes: u8) -> Write {
        let mask = u64::MAX >> (u64::BITS - u32::from(bytes) * u8::BITS);
        Write {
            at,
            value: (value as u64 & mask) as u32,
            bytes,
        }
    }
}

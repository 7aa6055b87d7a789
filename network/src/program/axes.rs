//! The axes that a program moves, as the firmware leads them.

use crate::model::{Machine, Motor, Node};
use crate::object::Address;

/// The axes of a machine.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Group {
    /// In their order.
    pub axes: Vec<Axis>,
    /// SYNC period in microseconds.
    pub cycle_us: u32,
}

/// One axis: units and limits.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Axis {
    /// What its node is called.
    pub name: String,
    /// Its motor.
    pub motor: Motor,
    /// User units of a turn of the load, if it has them.
    pub units_per_turn: Option<u32>,
    /// As 6060h, when a program begins.
    pub mode: u8,
    /// The modes that it can be led in, bits as in 6502h.
    pub modes: u32,
    /// rpm
    pub velocity_max: u32,
    /// rpm/s
    pub acceleration_max: u32,
    /// Increments from home.
    pub travel: (i32, i32),
}

/// As the firmware limits an axis without other limits: rpm, rpm/s, and increments
/// from home.
const VELOCITY_MAX: u32 = 10_000;
const ACCELERATION_MAX: u32 = 100_000;
const TRAVEL_MAX: i64 = (1 << 30) - 1;
/// A program cannot ask for more torque, per mille of the rated one.
pub(super) const TORQUE_MAX: i64 = 1000;

/// In the set of a move: its target is a torque.
pub(super) const TORQUE: u8 = 1 << 7;

/// 6060h
const MODES_OF_OPERATION: Address = Address::new(0x6060, 0);
/// Modes of operation by their numbers.
pub(super) const PROFILE_POSITION: u8 = 1;
const PROFILE_VELOCITY: u8 = 3;
pub(super) const HOMING: u8 = 6;
pub(super) const CYCLIC_TORQUE: u8 = 10;

/// The modes that the firmware leads axes in, by the names of `network.toml`.
pub(super) const MODES: [(&str, u8); 6] = [
    ("profile position", PROFILE_POSITION),
    ("profile velocity", PROFILE_VELOCITY),
    ("homing", HOMING),
    ("cyclic synchronous position", 8),
    ("cyclic synchronous velocity", 9),
    ("cyclic synchronous torque", CYCLIC_TORQUE),
];

/// What the mode is called.
pub(super) fn mode_name(mode: u8) -> &'static str {
    let known = MODES.iter().find(|(_, code)| *code == mode);
    known.map_or("none", |(name, _)| *name)
}

/// The bit of a mode in 6502h.
pub(super) const fn mode_bit(mode: u8) -> u32 {
    1 << (mode - 1)
}

impl Group {
    /// The axes of a machine; `None` if one has no encoder.
    pub fn of(machine: &Machine) -> Option<Group> {
        let axes: Option<Vec<Axis>> = machine.nodes.iter().map(Axis::of).collect();
        Some(Group {
            axes: axes?,
            cycle_us: machine.buses.first()?.cycle_us,
        })
    }

    /// Axes, and their SYNC period.
    pub const fn new(axes: Vec<Axis>, cycle_us: u32) -> Group {
        Group { axes, cycle_us }
    }

    /// Whole cycles that last at least `ms`.
    pub(super) fn cycles(&self, ms: f64) -> u32 {
        (ms * 1000.0 / f64::from(self.cycle_us)).ceil() as u32
    }
}

impl Axis {
    fn of(node: &Node) -> Option<Axis> {
        let mode = node
            .start_values
            .iter()
            .rfind(|write| write.at == MODES_OF_OPERATION);
        Some(Axis {
            units_per_turn: node.units_per_turn,
            mode: mode.map_or(PROFILE_VELOCITY, |mode| mode.value as u8),
            ..Axis::new(node.name.clone(), node.motor()?)
        })
    }

    /// An axis in profile velocity mode.
    pub fn new(name: String, motor: Motor) -> Axis {
        let margin = i64::from(motor.increments_per_turn / 4);
        let (lower, upper) = motor.limits;
        let lower = (i64::from(lower) + margin).clamp(-TRAVEL_MAX, 0);
        let upper = (i64::from(upper) - margin).clamp(0, TRAVEL_MAX);
        Axis {
            name,
            motor,
            units_per_turn: None,
            mode: PROFILE_VELOCITY,
            modes: motor.modes,
            velocity_max: motor.max_speed.min(VELOCITY_MAX),
            acceleration_max: motor.max_acceleration.min(ACCELERATION_MAX),
            travel: (lower as i32, upper as i32),
        }
    }

    /// Increments per cycle that are 1 rpm.
    pub(super) fn per_rpm(&self, cycle_us: u32) -> f64 {
        const MINUTE_US: f64 = 60e6;
        f64::from(self.motor.increments_per_turn) * f64::from(cycle_us) / MINUTE_US
    }

    /// Increments per cycle squared that are 1 rpm/s.
    pub(super) fn per_rpm_s(&self, cycle_us: u32) -> f64 {
        self.per_rpm(cycle_us) * f64::from(cycle_us) / 1e6
    }
}

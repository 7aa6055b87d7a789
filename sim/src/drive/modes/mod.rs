//! Modes of operation (CiA 402-2, 9), one file each.
//!
//! A mode turns set values into what the controllers follow (a position, a
//! speed, a torque) and into the bits of the statusword that are its own.

pub mod cyclic_position;
pub mod cyclic_torque;
pub mod cyclic_velocity;
pub mod homing;
pub mod homing_methods;
pub mod interpolation;
pub mod profile_position;
pub mod profile_velocity;
pub mod trapezoid;

use super::dictionary::Dictionary;
use super::ramp::Slopes;
use super::servo::Measured;
use super::travel::Inputs;
use cyclic_position::CyclicPosition;
use cyclic_torque::CyclicTorque;
use cyclic_velocity::CyclicVelocity;
use homing::Homing;
use profile_position::ProfilePosition;
use profile_velocity::ProfileVelocity;
use trapezoid::MoveLimits;

/// Bit 10 of the statusword.
pub const TARGET_REACHED: u16 = 1 << 10;
/// Bit 11 of the statusword.
pub const INTERNAL_LIMIT: u16 = 1 << 11;
/// Bit 12 of the statusword in profile velocity: the speed is zero.
pub const SPEED_ZERO: u16 = 1 << 12;
/// Bit 12 in profile position: a set-point is taken.
pub const SETPOINT_ACKNOWLEDGE: u16 = 1 << 12;
/// Bit 12 in homing.
pub const HOMING_ATTAINED: u16 = 1 << 12;
/// Bit 12 in the cyclic modes: the drive follows the command.
pub const FOLLOWS: u16 = 1 << 12;
/// Bit 13 of the statusword in the position modes.
pub const FOLLOWING_ERROR: u16 = 1 << 13;
/// Bit 13 in homing.
pub const HOMING_ERROR: u16 = 1 << 13;
/// Bit 8 of the controlword.
const HALT: u16 = 1 << 8;

/// A mode of operation that the drive has (6502h). Selecting another one in
/// 6060h is refused with 06090030h.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// 1.
    ProfilePosition,
    /// 3.
    ProfileVelocity,
    /// 6.
    Homing,
    /// 8.
    CyclicPosition,
    /// 9.
    CyclicVelocity,
    /// 10.
    CyclicTorque,
}

impl Mode {
    /// The mode with this value of 6060h.
    pub const fn from_code(code: i8) -> Option<Mode> {
        match code {
            1 => Some(Mode::ProfilePosition),
            3 => Some(Mode::ProfileVelocity),
            6 => Some(Mode::Homing),
            8 => Some(Mode::CyclicPosition),
            9 => Some(Mode::CyclicVelocity),
            10 => Some(Mode::CyclicTorque),
            _ => None,
        }
    }

    /// The value of 6060h and 6061h.
    pub const fn code(self) -> i8 {
        match self {
            Mode::ProfilePosition => 1,
            Mode::ProfileVelocity => 3,
            Mode::Homing => 6,
            Mode::CyclicPosition => 8,
            Mode::CyclicVelocity => 9,
            Mode::CyclicTorque => 10,
        }
    }
}

/// What the modes share.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Largest speed, rpm: 607Fh and 6080h.
    pub speed: f64,
    /// 6083h and 6084h below 60C5h, rpm/s.
    pub profile: Slopes,
    /// 6085h below 60C5h, rpm/s.
    pub quick_stop: f64,
    /// Largest speed of the motor in every mode, rpm: 6080h.
    pub motor: f64,
    /// 607Dh, increments; none while the minimum is not below the maximum.
    pub software: Option<(i64, i64)>,
}

impl Limits {
    /// As the dictionary stands now.
    pub fn read(od: &Dictionary) -> Limits {
        let largest = od.number(0x60C5, 0) as f64;
        let slope = |index| (od.number(index, 0) as f64).min(largest);
        Limits {
            speed: od.rpm(0x607F, 0).min(od.number(0x6080, 0) as f64),
            profile: Slopes {
                acceleration: slope(0x6083),
                deceleration: slope(0x6084),
            },
            quick_stop: slope(0x6085),
            motor: od.number(0x6080, 0) as f64,
            software: software_limits(od),
        }
    }
}

/// 607Dh as it counts.
pub fn software_limits(od: &Dictionary) -> Option<(i64, i64)> {
    let (min, max) = (od.number(0x607D, 1), od.number(0x607D, 2));
    (min < max).then_some((min, max))
}

/// A move at `speed` rpm as the dictionary limits it.
fn move_limits(od: &Dictionary, speed: f64, per_rpm: f64) -> MoveLimits {
    let limits = Limits::read(od);
    MoveLimits {
        speed: speed.min(limits.speed) * per_rpm,
        acceleration: limits.profile.acceleration * per_rpm,
        deceleration: limits.profile.deceleration * per_rpm,
    }
}

/// 60C2h in seconds; 0: no interpolation.
fn period_s(od: &Dictionary) -> f64 {
    od.number(0x60C2, 1) as f64 * 10f64.powi(od.number(0x60C2, 2) as i32)
}

/// What a mode gets to see in a control cycle.
#[derive(Clone, Copy, Debug)]
pub struct Cycle<'a> {
    /// Set values.
    pub od: &'a Dictionary,
    /// The controlword that acts.
    pub controlword: u16,
    /// Limits.
    pub limits: Limits,
    /// What the drive measured.
    pub measured: Measured,
    /// Actual position, not wrapped.
    pub position: i64,
    /// The index pulse that was passed in the last cycle.
    pub index: Option<i64>,
    /// The switches.
    pub inputs: Inputs,
    /// Motor current.
    pub current_ma: f64,
    /// The speed demand of the last cycle, rpm.
    pub demand: f64,
    /// Increments per second and rpm.
    pub per_rpm: f64,
    /// Length of the cycle in the drive's own time, seconds.
    pub seconds: f64,
    /// The drive's own time, seconds.
    pub now_s: f64,
}

impl Cycle<'_> {
    fn halt(&self) -> bool {
        self.controlword & HALT != 0
    }
}

/// Where the axis shall be at the end of the cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Increments.
    pub position: f64,
    /// Increments per second.
    pub rate: f64,
    /// Increments per second squared.
    pub acceleration: f64,
}

/// What the controllers follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Demand {
    /// The position controller.
    Position(Motion),
    /// The velocity controller, rpm.
    Speed(f64),
    /// The motor directly, per mille of rated torque.
    Torque(f64),
}

/// What a mode answers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// What to follow.
    pub demand: Demand,
    /// Bits 10 to 13 of the statusword.
    pub bits: u16,
    /// An error that the mode has noticed.
    pub error: Option<u16>,
    /// Homing is done: this is added to every position from now on.
    pub shift: Option<i64>,
}

impl From<Demand> for Outcome {
    fn from(demand: Demand) -> Outcome {
        Outcome {
            demand,
            bits: 0,
            error: None,
            shift: None,
        }
    }
}

/// The modes with what they remember.
#[derive(Clone, Debug, Default)]
pub struct Modes {
    /// The one that has the axis.
    active: Option<Mode>,
    profile_position: ProfilePosition,
    profile_velocity: ProfileVelocity,
    homing: Homing,
    cyclic_position: CyclicPosition,
    cyclic_velocity: CyclicVelocity,
    cyclic_torque: CyclicTorque,
}

impl Modes {
    /// One control cycle in operation enabled. A mode that was not there in the
    /// cycle before takes the axis over as it is.
    pub fn step(&mut self, mode: Mode, cycle: &Cycle<'_>) -> Outcome {
        if self.active != Some(mode) {
            self.active = Some(mode);
            self.enter(mode, cycle);
        }
        match mode {
            Mode::ProfilePosition => self.profile_position.step(cycle),
            Mode::ProfileVelocity => self.profile_velocity.step(cycle),
            Mode::Homing => self.homing.step(cycle),
            Mode::CyclicPosition => self.cyclic_position.step(cycle),
            Mode::CyclicVelocity => self.cyclic_velocity.step(cycle),
            Mode::CyclicTorque => self.cyclic_torque.step(cycle),
        }
    }

    fn enter(&mut self, mode: Mode, cycle: &Cycle<'_>) {
        match mode {
            Mode::ProfilePosition => self.profile_position.enter(cycle),
            Mode::ProfileVelocity => {}
            Mode::Homing => self.homing.enter(cycle),
            Mode::CyclicPosition => self.cyclic_position.enter(cycle),
            Mode::CyclicVelocity => self.cyclic_velocity.enter(cycle),
            Mode::CyclicTorque => self.cyclic_torque.enter(cycle),
        }
    }

    /// A controlword was written. Set-points and homing are started in the mode
    /// that has the axis.
    pub fn control(&mut self, controlword: u16, od: &Dictionary, per_rpm: f64) {
        let active = |mode| self.active == Some(mode);
        let (position, homing) = (active(Mode::ProfilePosition), active(Mode::Homing));
        self.profile_position
            .control(controlword, od, position, per_rpm);
        self.homing.control(controlword, homing);
    }

    /// The entry was written: a cyclic mode takes it as its next set value.
    pub fn set(&mut self, index: u16, od: &Dictionary, now_s: f64) {
        match (self.active, index) {
            (Some(Mode::CyclicPosition), 0x607A) => self.cyclic_position.set(od, now_s),
            (Some(Mode::CyclicVelocity), 0x60FF) => self.cyclic_velocity.set(od, now_s),
            (Some(Mode::CyclicTorque), 0x6071) => self.cyclic_torque.set(od, now_s),
            _ => {}
        }
    }

    /// The axis does not follow its mode. Answers bits 10 to 13.
    pub fn idle(&mut self, mode: Mode, measured: Measured) -> u16 {
        self.active = None;
        match mode {
            Mode::ProfileVelocity if measured.standstill => SPEED_ZERO,
            _ => 0,
        }
    }
}

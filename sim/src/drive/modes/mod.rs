//! Modes of operation (CiA 402-2, 9), one file each.
//!
//! A mode turns set values into the speed that the velocity controller follows
//! and into the bits of the statusword that are its own.

pub mod hold;
pub mod profile_velocity;

use super::dictionary::Dictionary;
use super::ramp::Slopes;
use super::servo::Measured;
use profile_velocity::ProfileVelocity;

/// Bit 10 of the statusword.
pub const TARGET_REACHED: u16 = 1 << 10;
/// Bit 11 of the statusword.
pub const INTERNAL_LIMIT: u16 = 1 << 11;
/// Bit 12 of the statusword: in profile velocity, the speed is zero.
pub const SPEED_ZERO: u16 = 1 << 12;
/// Bit 8 of the controlword.
const HALT: u16 = 1 << 8;

/// A mode of operation that the simulated drive has. Selecting another one in
/// 6060h is refused with 06090030h.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// 1: without a set-point it holds still, which is all that this model
    /// does so far.
    ProfilePosition,
    /// 3.
    ProfileVelocity,
}

impl Mode {
    /// The mode with this value of 6060h.
    pub const fn from_code(code: i8) -> Option<Mode> {
        match code {
            1 => Some(Mode::ProfilePosition),
            3 => Some(Mode::ProfileVelocity),
            _ => None,
        }
    }

    /// The value of 6060h and 6061h.
    pub const fn code(self) -> i8 {
        match self {
            Mode::ProfilePosition => 1,
            Mode::ProfileVelocity => 3,
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
        }
    }
}

/// What a mode gets to see in a control cycle.
#[derive(Clone, Copy, Debug)]
pub struct Cycle<'a> {
    /// Set values.
    pub od: &'a Dictionary,
    /// Limits.
    pub limits: Limits,
    /// What the drive measured.
    pub measured: Measured,
    /// The demand of the last cycle, rpm.
    pub demand: f64,
    /// Length of the cycle in the drive's own time, seconds.
    pub seconds: f64,
}

impl Cycle<'_> {
    fn halt(&self) -> bool {
        self.od.number(0x6040, 0) as u16 & HALT != 0
    }
}

/// What a mode answers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// The speed to follow, rpm.
    pub demand: f64,
    /// Bits 10 to 13 of the statusword.
    pub bits: u16,
}

/// The modes with what they remember.
#[derive(Clone, Debug, Default)]
pub struct Modes {
    profile_velocity: ProfileVelocity,
}

impl Modes {
    /// One control cycle in operation enabled.
    pub fn step(&mut self, mode: Mode, cycle: Cycle<'_>) -> Outcome {
        match mode {
            Mode::ProfilePosition => hold::step(cycle),
            Mode::ProfileVelocity => self.profile_velocity.step(cycle),
        }
    }

    /// Bits 10 to 13 while the axis does not follow its mode.
    pub fn idle_bits(&self, mode: Mode, measured: Measured) -> u16 {
        match mode {
            Mode::ProfileVelocity if measured.standstill => SPEED_ZERO,
            _ => 0,
        }
    }
}

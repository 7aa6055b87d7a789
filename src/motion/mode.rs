//! Modes of operation, objects 6060h, 6061h and 6502h (CiA 402-2, clause 8.5.2).

use crate::words::in_words;

/// A mode of operation that an axis can be led in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Mode {
    /// The drive makes its own move to each set-point (CiA 402-2, clause 10).
    ProfilePosition = 1,
    /// The drive ramps to a target velocity; the master closes the position loop
    /// over it (clause 15).
    #[default]
    ProfileVelocity = 3,
    /// The drive searches for its home (clause 11).
    Homing = 6,
    /// A position every cycle (clause 13).
    CyclicPosition = 8,
    /// A velocity every cycle; the master closes the position loop over it
    /// (clause 17).
    CyclicVelocity = 9,
    /// A torque every cycle (clause 18).
    CyclicTorque = 10,
}

impl Mode {
    /// All of them.
    pub const ALL: [Mode; 6] = [
        Mode::ProfilePosition,
        Mode::ProfileVelocity,
        Mode::Homing,
        Mode::CyclicPosition,
        Mode::CyclicVelocity,
        Mode::CyclicTorque,
    ];

    /// Those of an EPOS4, as 6502h has them.
    pub const EPOS4: u32 = 0x3A5;

    /// The mode of a value of 6060h or 6061h.
    pub fn of(code: i8) -> Option<Mode> {
        Mode::ALL.into_iter().find(|mode| mode.code() == code)
    }

    /// The value of 6060h.
    pub const fn code(self) -> i8 {
        self as i8
    }

    /// Whether 6502h names it.
    pub const fn is_in(self, supported: u32) -> bool {
        supported >> (self as u8 - 1) & 1 != 0
    }

    /// Which RPDO carries its target, counted from 0: 6040+60FF, 6083+6084,
    /// 6040+607A, 6040+6071.
    pub const fn rpdo(self) -> u8 {
        match self {
            Mode::ProfileVelocity | Mode::CyclicVelocity | Mode::Homing => 0,
            Mode::ProfilePosition | Mode::CyclicPosition => 2,
            Mode::CyclicTorque => 3,
        }
    }

    /// Whether the drive's ramps, 6083h and 6084h, count.
    pub const fn has_ramps(self) -> bool {
        matches!(self, Mode::ProfileVelocity | Mode::ProfilePosition)
    }

    /// Whether the drive makes the motion by itself and is told to begin by bit 4
    /// of the controlword.
    pub const fn is_led_by_drive(self) -> bool {
        matches!(self, Mode::ProfilePosition | Mode::Homing)
    }

    /// Whether the master closes the position loop.
    pub(super) const fn is_velocity(self) -> bool {
        matches!(self, Mode::ProfileVelocity | Mode::CyclicVelocity)
    }

    /// Those of which the path is one of positions, as bits of 6502h.
    pub(super) const WITH_POSITION: u32 = 1 << 2 | 1 << 7 | 1 << 8;

    /// Whether the path is one of positions.
    pub(super) const fn has_position(self) -> bool {
        self.is_in(Mode::WITH_POSITION)
    }
}

in_words!(Mode {
    Mode::ProfilePosition => ("profile position"),
    Mode::ProfileVelocity => ("profile velocity"),
    Mode::Homing => ("homing"),
    Mode::CyclicPosition => ("cyclic synchronous position"),
    Mode::CyclicVelocity => ("cyclic synchronous velocity"),
    Mode::CyclicTorque => ("cyclic synchronous torque"),
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_and_bits_of_the_profile() {
        for (mode, code) in Mode::ALL.into_iter().zip([1, 3, 6, 8, 9, 10]) {
            assert_eq!(mode.code(), code);
            assert_eq!(Mode::of(code), Some(mode));
            assert!(mode.is_in(1 << (code - 1)) && mode.is_in(Mode::EPOS4));
            assert!(!mode.is_in(!(1 << (code - 1))));
        }
        for code in [i8::MIN, -1, 0, 2, 4, 5, 7, 11] {
            assert_eq!(Mode::of(code), None);
        }
    }
}

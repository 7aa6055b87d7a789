//! From the units of the object dictionary to those of the control loop.

use crate::time::Duration;

/// Seconds per minute.
const MINUTE: f32 = 60.0;
/// Microseconds per second.
const SECOND_US: f32 = 1_000_000.0;

/// Factors between rpm, the unit of 60A9h, and increments per cycle, the unit in
/// which references are computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Increments per cycle that are 1 rpm.
    per_rpm: f32,
    /// rpm that are one increment per cycle.
    rpm: f32,
    /// Cycles per second.
    cycles_per_second: f32,
}

impl Scale {
    /// Values stay what they are, for a drive that is told them.
    pub const NONE: Scale = Scale {
        per_rpm: 1.0,
        rpm: 1.0,
        cycles_per_second: 1.0,
    };

    /// The factors for an encoder of `increments_per_turn` and a cycle.
    pub const fn new(increments_per_turn: u32, cycle: Duration) -> Scale {
        let cycle_s = cycle.as_micros() as f32 / SECOND_US;
        let per_rpm = increments_per_turn as f32 / MINUTE * cycle_s;
        Scale {
            per_rpm,
            rpm: 1.0 / per_rpm,
            cycles_per_second: 1.0 / cycle_s,
        }
    }

    /// The factors for what is counted by itself, in units and seconds.
    pub fn of_units(self) -> Scale {
        Scale {
            per_rpm: 1.0 / self.cycles_per_second,
            rpm: self.cycles_per_second,
            cycles_per_second: self.cycles_per_second,
        }
    }

    /// rpm to increments per cycle.
    pub fn velocity(self, rpm: f32) -> f32 {
        rpm * self.per_rpm
    }

    /// rpm/s to increments per cycle squared.
    pub fn acceleration(self, rpm_per_s: f32) -> f32 {
        rpm_per_s * self.per_rpm / self.cycles_per_second
    }

    /// rpm that are one increment per cycle.
    pub const fn rpm_per_increment(self) -> f32 {
        self.rpm
    }

    /// Increments per cycle to rpm.
    pub fn rpm(self, velocity: f32) -> f32 {
        velocity * self.rpm
    }

    /// Increments per cycle squared to rpm/s.
    pub fn rpm_per_s(self, acceleration: f32) -> f32 {
        acceleration * self.cycles_per_second * self.rpm
    }

    /// Seconds to cycles.
    pub fn cycles(self, seconds: f32) -> f32 {
        seconds * self.cycles_per_second
    }

    /// A rate in 1/s to one in 1/cycle.
    pub fn per_cycle(self, per_second: f32) -> f32 {
        per_second / self.cycles_per_second
    }
}

//! What the firmware leads: motors as the network describes them, as a group.
//!
//! [`group`] is worked out by the compiler, for a static.

use super::mode::Mode;
use super::position_control::Tuning;
use super::{AxisConfig, GroupConfig, Scale};
use crate::time::Duration;

/// A motor with its encoder, gear and limits, as the network describes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Motor {
    /// Increments of the encoder (6064h) for a turn of the motor.
    pub increments_per_turn: u32,
    /// Turns of the motor for turns of the load.
    pub gear: (u32, u32),
    /// No faster, rpm of the motor (607Fh).
    pub max_speed: u32,
    /// No harder, rpm/s of the motor (60C5h).
    pub max_acceleration: u32,
    /// No farther from home than these, increments (607Dh): the lower, the upper.
    pub limits: (i32, i32),
    /// Modes of operation that the drive has (6502h) and the network has mapped.
    pub modes: u32,
}

impl Motor {
    /// 500 lines, four edges, no gear, and the limits of the sample network.
    pub const SAMPLE: Motor = Motor {
        increments_per_turn: 2000,
        gear: (1, 1),
        max_speed: 3000,
        max_acceleration: 20_000,
        limits: (-i32::MAX, i32::MAX),
        modes: Mode::EPOS4,
    };

    /// The motor with its drive as the group leads it.
    const fn config(&self, cycle: Duration) -> AxisConfig {
        let turn = self.increments_per_turn;
        let (lower, upper) = self.room();
        AxisConfig {
            increments_per_turn: turn,
            velocity_max: least(VELOCITY_MAX, self.max_speed),
            acceleration_max: least(ACCELERATION_MAX, self.max_acceleration),
            travel: (lower as i32, upper as i32),
            following_error_max: self.following_error(),
            in_position: 2,
            scale: Scale::new(turn, cycle),
            modes: self.modes,
            mode: Mode::ProfileVelocity,
            torque_max: TORQUE_MAX,
        }
    }

    /// A quarter turn. A velocity loop 5 ms slower than assumed is 300 increments
    /// of 2000 late at 1800 rpm until the position loop has caught up.
    const fn following_error(&self) -> u32 {
        self.increments_per_turn / 4
    }

    /// How far from home a target may be, in increments: the lower end, 0 at
    /// most, and the upper, 0 at least. The position may be off by the following
    /// error before the group stops, and is still within the limits.
    const fn room(&self) -> (i64, i64) {
        let (lower, upper) = self.limits;
        let margin = self.following_error() as i64;
        (
            between(lower as i64 + margin, -TRAVEL_MAX, 0),
            between(upper as i64 - margin, 0, TRAVEL_MAX),
        )
    }
}

/// Of an axis without another limit, rpm.
const VELOCITY_MAX: u32 = 10_000;
/// Of a stop, if the motors can, rpm/s.
const STOP_DECELERATION: u32 = 3000;
/// The drives' ramps at least, rpm/s.
const RAMP_MIN: u32 = 1000;
/// Of an axis without another limit, rpm/s.
const ACCELERATION_MAX: u32 = 100_000;
/// The steepest that a long cycle may be at all, rpm/s.
const STEEPEST: u32 = 4000;
/// The drives' velocity loops take that long, microseconds; a longer cycle is long.
const LONG_US: u32 = 10_000;
/// Rated torque, per mille.
const TORQUE_MAX: u16 = 1000;
/// Increments from home: from end to end it is less than 2^31.
const TRAVEL_MAX: i64 = (1 << 30) - 1;

const fn least(a: u32, b: u32) -> u32 {
    if a < b { a } else { b }
}

const fn between(x: i64, least: i64, most: i64) -> i64 {
    if x < least {
        least
    } else if x > most {
        most
    } else {
        x
    }
}

/// The steepest ramp, rpm/s. In a long cycle the speed changes by so little in one
/// that the position loop, which sees it a cycle later, keeps up.
const fn steepest(cycle: Duration) -> u32 {
    const RPM_PER_CYCLE: u32 = 12;
    const US_PER_S: u32 = 1_000_000;
    match cycle.as_micros() {
        0..=LONG_US => STEEPEST,
        us => RPM_PER_CYCLE * US_PER_S / us,
    }
}

/// How much steeper than the reference the drive's ramps are: at cycles up to 10 ms
/// by half. A longer cycle would wait longer at the end of each ramp, so that the
/// axis would be ahead.
const fn ramp_percent(cycle: Duration) -> u32 {
    const WHOLE: u32 = 100;
    const MORE: u32 = 50;
    let us = cycle.as_micros();
    WHOLE + MORE * LONG_US / if us > LONG_US { us } else { LONG_US }
}

/// The group of these axes.
pub const fn group<const N: usize>(
    motors: &[Motor; N],
    cycle: Duration,
    missing_tpdo_max: u8,
) -> GroupConfig<N> {
    let mut axes = [Motor::SAMPLE.config(cycle); N];
    let mut stop_deceleration = STOP_DECELERATION;
    let (mut left, mut given): (&mut [AxisConfig], &[Motor]) = (&mut axes, motors);
    while let (Some((axis, more)), Some((motor, others))) =
        (left.split_first_mut(), given.split_first())
    {
        *axis = motor.config(cycle);
        stop_deceleration = least(stop_deceleration, motor.max_acceleration);
        (left, given) = (more, others);
    }
    GroupConfig {
        cycle,
        axes,
        tuning: Tuning::for_cycle(cycle),
        // A drive may wait for standstill for 1 s on the way down (30E0h:3).
        enable_timeout: Duration::from_millis(2000),
        missing_tpdo_max,
        stop_deceleration,
        // 606Ch carries 1 rpm of noise, the creeping of the position loop 3 rpm.
        standstill_rpm: 6,
        settle_cycles: 5,
        settle_timeout: Duration::from_millis(2000),
        ramp_percent: ramp_percent(cycle),
        // No more than the group's own ramps need, or a long cycle overshoots.
        ramp_min: least(RAMP_MIN, 2 * steepest(cycle)),
    }
}

const SAMPLE_CYCLE: Duration = Duration::from_millis(10);

/// The group of six axes of the sample network, at a cycle of 10 ms.
pub static GROUP: GroupConfig<6> = group(&[Motor::SAMPLE; 6], SAMPLE_CYCLE, 3);

//! The motion program of the firmware: motors in pairs, there and back.
//!
//! Each pair gets one command and must start and stop in step: of six axes 1
//! and 3, 2 and 4, 5 and 6, each pair with its own target, speed and ramps. There,
//! a pause, and back. More axes repeat this by sixes; of what is left over, two
//! are a pair and an odd one goes alone.
//!
//! The final decelerations are chosen so that the moment at which an axis falls
//! below 5 rpm (stopped, by the project's definition) lies on the reference's
//! ramp: at 800 rpm/s it is 6 ms before the end of the ramp, and the tail of a
//! velocity loop of 10 ms, 8 rpm when the ramp ends, is cut by the advance.
//!
//! Everything is worked out by the compiler: [`steps`] and [`group`] are for
//! statics.

use super::group::{AxisConfig, GroupConfig};
use super::position_control::Tuning;
use super::program::{AxisMove, Program, Step};
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
}

impl Motor {
    /// 500 lines, four edges, no gear, and the limits of the sample network.
    pub const SAMPLE: Motor = Motor {
        increments_per_turn: 2000,
        gear: (1, 1),
        max_speed: 3000,
        max_acceleration: 20_000,
        limits: (-i32::MAX, i32::MAX),
    };

    /// The motor with its drive as the group leads it.
    const fn config(&self, cycle: Duration) -> AxisConfig {
        let turn = self.increments_per_turn;
        let (lower, upper) = self.room();
        AxisConfig {
            increments_per_turn: turn,
            velocity_max: least(VELOCITY_MAX, self.max_speed),
            acceleration_max: least(ACCELERATION_MAX, self.max_acceleration),
            travel_max: if -lower > upper { -lower } else { upper } as u32,
            following_error_max: self.following_error(),
            in_position: 2,
            tuning: Tuning::for_cycle(cycle),
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
        let far = TRAVEL_MAX as i64 * self.increments_per_turn as i64;
        (
            between(lower as i64 + margin, -far, 0),
            between(upper as i64 - margin, 0, far),
        )
    }

    /// What `turns` of the load come to, in increments; if there is more room on
    /// the other side of home than this way, that way.
    const fn target(&self, turns: i32) -> i32 {
        let motor = turns as i64 * self.increments_per_turn as i64 * self.gear.0 as i64;
        let increments = motor / self.gear.1 as i64;
        let (least, most) = self.room();
        let (there, other) = (
            between(increments, least, most),
            between(-increments, least, most),
        );
        if there.abs() >= other.abs() {
            there as i32
        } else {
            other as i32
        }
    }
}

/// 20 % above the fastest move, rpm: room for the position loop.
const VELOCITY_MAX: u32 = 2200;
/// Of a stop, if the motors can, rpm/s.
const STOP_DECELERATION: u32 = 3000;
/// The drives' ramps at least, rpm/s.
const RAMP_MIN: u32 = 1000;
/// Twice the steepest ramp of the program, rpm/s.
const ACCELERATION_MAX: u32 = 4000;
/// The drives' velocity loops take that long, microseconds; a longer cycle is long.
const LONG_US: u32 = 10_000;
/// Turns of the motor from home.
const TRAVEL_MAX: u32 = 1000;

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

/// What one pair does in one move: turns, rpm, rpm/s up, rpm/s down.
struct Part(i32, u32, u32, u32);

/// Axes of a pattern, and its pairs.
const AXES: usize = 6;
const PAIRS: u8 = 3;
/// There.
const THERE: [Part; PAIRS as usize] = [
    Part(20, 1200, 1500, 800),
    Part(-16, 900, 1000, 600),
    Part(30, 1500, 2000, 1000),
];
/// And back.
const BACK: [Part; PAIRS as usize] = [
    Part(0, 1000, 1200, 700),
    Part(0, 1100, 1500, 800),
    Part(0, 1800, 1600, 900),
];
/// Between the two.
const DWELL: Duration = Duration::from_millis(500);

/// The part that an axis plays among `axes`, both counted from 0: which of a
/// pattern's pairs it belongs to.
const fn pair(axis: usize, axes: usize) -> u8 {
    let two_left = axes - axis / AXES * AXES == 2;
    match axis % AXES {
        0 | 2 => 0,
        1 if two_left => 0,
        1 | 3 => 1,
        _ => 2,
    }
}

/// One move of all axes.
const fn step<const N: usize>(
    motors: &[Motor; N],
    cycle: Duration,
    parts: &[Part; PAIRS as usize],
) -> Step<N> {
    let [first, second, third] = parts;
    let mut moves = [None; N];
    let mut axis = 0;
    let (mut left, mut given): (&mut [Option<AxisMove>], &[Motor]) = (&mut moves, motors);
    while let (Some((part, more)), Some((motor, others))) =
        (left.split_first_mut(), given.split_first())
    {
        let pair = pair(axis, N);
        let Part(turns, velocity, acceleration, deceleration) = match pair {
            0 => first,
            1 => second,
            _ => third,
        };
        let speed = least(VELOCITY_MAX, motor.max_speed);
        let ramp = least(ACCELERATION_MAX, motor.max_acceleration) / 2;
        let ramp = least(ramp, steepest(cycle));
        *part = Some(AxisMove {
            target: motor.target(*turns),
            velocity: least(*velocity, speed - speed / 6),
            acceleration: least(*acceleration, ramp),
            deceleration: least(*deceleration, ramp),
            set: (axis / AXES) as u8 * PAIRS + pair + 1,
        });
        (left, given) = (more, others);
        axis += 1;
    }
    Step::Move(moves)
}

/// There, a pause, and back; see the module.
pub const fn steps<const N: usize>(motors: &[Motor; N], cycle: Duration) -> [Step<N>; 3] {
    [
        step(motors, cycle, &THERE),
        Step::Dwell(DWELL),
        step(motors, cycle, &BACK),
    ]
}

/// The steepest ramp, rpm/s. In a long cycle the speed changes by so little in one
/// that the position loop, which sees it a cycle later, keeps up.
const fn steepest(cycle: Duration) -> u32 {
    const RPM_PER_CYCLE: u32 = 12;
    const US_PER_S: u32 = 1_000_000;
    match cycle.as_micros() {
        0..=LONG_US => ACCELERATION_MAX,
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

/// The group of these axes that runs `steps`.
pub const fn group<const N: usize>(
    motors: &[Motor; N],
    cycle: Duration,
    missing_tpdo_max: u8,
    steps: &'static [Step<N>],
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
        program: Program {
            name: "pairs, there and back",
            steps,
        },
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

static SAMPLE_STEPS: [Step<6>; 3] = steps(&[Motor::SAMPLE; 6], SAMPLE_CYCLE);

/// Six axes like those of the sample network, at a cycle of 10 ms.
pub static GROUP: GroupConfig<6> = group(&[Motor::SAMPLE; 6], SAMPLE_CYCLE, 3, &SAMPLE_STEPS);

//! The motion program of the firmware: six motors in three pairs.
//!
//! Each pair gets one command and must start and stop in step: axes 1 and 3,
//! axes 2 and 4, axes 5 and 6, each pair with its own target, speed and ramps.
//! There, a pause, and back.
//!
//! The final decelerations are chosen so that the moment at which an axis falls
//! below 5 rpm (stopped, by the project's definition) lies on the reference's
//! ramp: at 800 rpm/s it is 6 ms before the end of the ramp, and the tail of a
//! velocity loop of 10 ms, 8 rpm when the ramp ends, is cut by the advance.

use super::group::{AxisConfig, GroupConfig};
use super::position_control::Tuning;
use super::program::{AxisMove, Program, Step};
use crate::time::Duration;

/// Increments per turn of the motors' encoders: 500 lines, four edges.
const TURN: i32 = 2000;

/// There and back of one pair.
const fn part(
    set: u8,
    turns: i32,
    velocity: u32,
    acceleration: u32,
    deceleration: u32,
) -> Option<AxisMove> {
    Some(AxisMove {
        target: turns * TURN,
        velocity,
        acceleration,
        deceleration,
        set,
    })
}

/// One move of all six axes from what the three pairs do.
const fn pairs(
    first: Option<AxisMove>,
    second: Option<AxisMove>,
    third: Option<AxisMove>,
) -> Step<6> {
    Step::Move([first, second, first, second, third, third])
}

/// There, a pause, and back; see the module.
pub const PROGRAM: Program<6> = Program {
    name: "three pairs, there and back",
    steps: &[
        pairs(
            part(1, 20, 1200, 1500, 800),
            part(2, -16, 900, 1000, 600),
            part(3, 30, 1500, 2000, 1000),
        ),
        Step::Dwell(Duration::from_millis(500)),
        pairs(
            part(1, 0, 1000, 1200, 700),
            part(2, 0, 1100, 1500, 800),
            part(3, 0, 1800, 1600, 900),
        ),
    ],
};

/// One of the six motors with its drive.
const AXIS: AxisConfig = AxisConfig {
    increments_per_turn: TURN as u32,
    // 20 % above the fastest move, for the position loop.
    velocity_max: 2200,
    // Twice the steepest ramp of the program.
    acceleration_max: 4000,
    travel_max: 1000 * TURN as u32,
    // A quarter turn. A velocity loop 5 ms slower than assumed is 300 increments
    // late at 1800 rpm until the position loop has caught up.
    following_error_max: TURN as u32 / 4,
    in_position: 2,
    tuning: Tuning::MILLISECONDS_10,
};

/// The group of six axes that runs [`PROGRAM`], at a cycle of 10 ms.
pub static GROUP: GroupConfig<6> = GroupConfig {
    cycle: Duration::from_millis(10),
    axes: [AXIS; 6],
    program: PROGRAM,
    // A drive may wait for standstill for 1 s on the way down (30E0h:3).
    enable_timeout: Duration::from_millis(2000),
    missing_tpdo_max: 3,
    stop_deceleration: 3000,
    // 606Ch carries 1 rpm of noise, the creeping of the position loop 3 rpm.
    standstill_rpm: 6,
    settle_cycles: 5,
    settle_timeout: Duration::from_millis(2000),
    ramp_percent: 150,
    ramp_min: 1000,
};

//! The program that an image has if its description names no other: motors in
//! pairs, there and back (S1's experiment).
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

use super::axes::{Axis, Group};
use super::{Action, Move, Part, Program, Step};

/// What one pair does in one move: turns, rpm, rpm/s up, rpm/s down.
struct Pair(i32, u32, u32, u32);

/// Axes of a pattern, and its pairs.
const AXES: usize = 6;
const PAIRS: u8 = 3;
/// There.
const THERE: [Pair; PAIRS as usize] = [
    Pair(20, 1200, 1500, 800),
    Pair(-16, 900, 1000, 600),
    Pair(30, 1500, 2000, 1000),
];
/// And back.
const BACK: [Pair; PAIRS as usize] = [
    Pair(0, 1000, 1200, 700),
    Pair(0, 1100, 1500, 800),
    Pair(0, 1800, 1600, 900),
];
/// Between the two, ms.
const DWELL: f64 = 500.0;
/// The drives' velocity loops take that long; a longer cycle is long.
const LONG_US: u32 = 10_000;
/// In a long cycle the speed changes by so little in one that the position loop,
/// which sees it a cycle later, keeps up.
const RPM_PER_CYCLE: u32 = 12;
const US_PER_S: u32 = 1_000_000;
/// No program of this kind is faster, or steeper.
const FASTEST: u32 = 2200;
const STEEPEST: u32 = 2000;

/// The program for these axes.
pub fn pairs(group: &Group) -> Program {
    let go = |pairs| Step {
        line: 0,
        action: Action::Move(step(group, pairs)),
    };
    let cycles = group.cycles(DWELL);
    Program {
        name: "pairs, there and back".to_string(),
        axes: group.axes.len(),
        cycle_us: group.cycle_us,
        steps: vec![
            go(&THERE),
            Step {
                line: 0,
                action: Action::Wait { cycles },
            },
            go(&BACK),
        ],
    }
}

/// The pair that an axis belongs to, among `axes`; all are counted from 0.
fn pair(axis: usize, axes: usize) -> u8 {
    let two_left = axes - axis / AXES * AXES == 2;
    match axis % AXES {
        0 | 2 => 0,
        1 if two_left => 0,
        1 | 3 => 1,
        _ => 2,
    }
}

/// One move of all axes.
fn step(group: &Group, pairs: &[Pair; PAIRS as usize]) -> Move {
    let steepest = match group.cycle_us {
        0..=LONG_US => STEEPEST,
        us => (RPM_PER_CYCLE * US_PER_S / us).min(STEEPEST),
    };
    let part = |(axis, of): (usize, &Axis)| {
        let pair = pair(axis, group.axes.len());
        let [first, second, third] = pairs;
        let Pair(turns, velocity, acceleration, deceleration) = match pair {
            0 => first,
            1 => second,
            _ => third,
        };
        let speed = of.velocity_max.min(FASTEST);
        let ramp = (of.acceleration_max / 2).min(steepest);
        Part {
            axis,
            target: target(of, *turns),
            velocity: (*velocity).min(speed - speed / 6),
            acceleration: (*acceleration).min(ramp),
            deceleration: (*deceleration).min(ramp),
            set: (axis / AXES) as u8 * PAIRS + pair + 1,
        }
    };
    Move {
        parts: group.axes.iter().enumerate().map(part).collect(),
        ..Move::default()
    }
}

/// What `turns` of the load come to, in increments; if there is more room on the
/// other side of home than this way, that way.
fn target(axis: &Axis, turns: i32) -> i32 {
    let (of_motor, of_load) = axis.motor.gear;
    let turn = i64::from(axis.motor.increments_per_turn) * i64::from(of_motor);
    let increments = i64::from(turns) * turn / i64::from(of_load);
    let (least, most) = (i64::from(axis.travel.0), i64::from(axis.travel.1));
    let there = increments.clamp(least, most);
    let other = (-increments).clamp(least, most);
    let farther = if there.abs() >= other.abs() {
        there
    } else {
        other
    };
    farther as i32
}

//! How long a move takes: the shortest whole cycles that keep the limits.

use super::axes::{Group, TORQUE};
use super::{Move, Part};

/// Longest move in cycles: what the firmware plans.
pub(super) const CYCLES_MAX: u32 = 1 << 22;
/// What is looked at to say how long one is that is too long.
const FAR: u64 = 1 << 48;

/// One axis of a set.
struct Leg {
    way: f64,
    velocity: f64,
    up: f64,
    down: f64,
}

/// Cycles of a move whose axes begin at rest at `from`; targets count from there if
/// it is relative.
pub(super) fn cycles(group: &Group, a_move: &Move, from: &[i64]) -> u64 {
    let sets = a_move.parts.iter().map(|part| part.set);
    let of_set = |set: u8| {
        let parts = a_move.parts.iter().filter(|part| part.set == set);
        let legs: Vec<Leg> = parts
            .filter_map(|part| leg(group, part, a_move.relative, from))
            .collect();
        shortest(&legs, jerk(group, a_move, set))
    };
    sets.map(of_set).max().unwrap_or(0)
}

fn leg(group: &Group, part: &Part, relative: bool, from: &[i64]) -> Option<Leg> {
    let axis = group.axes.get(part.axis)?;
    let from = if relative { 0 } else { *from.get(part.axis)? };
    let (speed, slope) = if part.set & TORQUE != 0 {
        // Per mille a second, and a second squared.
        let cycle = f64::from(group.cycle_us) / 1e6;
        (cycle, cycle * cycle)
    } else {
        (axis.per_rpm(group.cycle_us), axis.per_rpm_s(group.cycle_us))
    };
    Some(Leg {
        way: (i64::from(part.target) - from).abs() as f64,
        velocity: f64::from(part.velocity) * speed,
        up: f64::from(part.acceleration) * slope,
        down: f64::from(part.deceleration) * slope,
    })
}

/// Cycles in which the steepest ramp of a set builds up.
fn jerk(group: &Group, a_move: &Move, set: u8) -> u64 {
    if a_move.jerk == 0 {
        return 0;
    }
    let parts = a_move.parts.iter().filter(|part| part.set == set);
    let steepest = parts
        .map(|part| part.acceleration.max(part.deceleration))
        .max();
    let seconds = f64::from(steepest.unwrap_or(0)) / f64::from(a_move.jerk);
    group.cycles(seconds * 1000.0).max(1).into()
}

/// All legs share their phases: so much at constant speed as the ramps would be, and
/// the ramps, from which it follows how fast they are.
fn shortest(legs: &[Leg], jerk: u64) -> u64 {
    let fits = |weight: u64| {
        let speed = |leg: &Leg| leg.way / weight as f64;
        let (mut up, mut down) = (1.0f64, 1.0f64);
        for leg in legs {
            up = up.max((speed(leg) / leg.up).ceil());
            down = down.max((speed(leg) / leg.down).ceil());
        }
        let ramps = (up as u64).saturating_add(down as u64);
        let ramps = ramps.saturating_add(2 * jerk);
        let slow = legs.iter().all(|leg| speed(leg) <= leg.velocity);
        (slow && 2 * weight >= ramps).then_some(weight + ramps.div_ceil(2))
    };
    let (mut low, mut high) = (1, FAR);
    while low < high {
        let middle = low + (high - low) / 2;
        match fits(middle) {
            Some(_) => high = middle,
            None => low = middle + 1,
        }
    }
    fits(high).unwrap_or(FAR)
}

//! What the drive watches of its motion: following error, software limits,
//! limit switches.

use super::dictionary::Dictionary;
use super::errors;
use super::modes::{Cycle, Demand, Mode, Outcome, software_limits};
use super::travel::Inputs;

/// 6065h: not watched.
const NO_WINDOW: i64 = u32::MAX as i64;

/// Whether a control cycle in `mode` can end in an error by itself.
pub(super) fn is_needed(mode: Mode, od: &Dictionary, has_switches: bool) -> bool {
    mode != Mode::ProfileVelocity || has_switches || software_limits(od).is_some()
}

/// The error that the cycle ends in. `following` is demand minus actual
/// position, in increments, of a mode that controls the position.
pub(super) fn check(
    mode: Mode,
    cycle: &Cycle<'_>,
    outcome: &Outcome,
    following: Option<f64>,
) -> Option<u16> {
    let window = cycle.od.number(0x6065, 0);
    let lagging = |error: f64| window != NO_WINDOW && error.abs() > window as f64;
    if following.is_some_and(lagging) {
        return Some(errors::FOLLOWING);
    }
    if mode == Mode::Homing {
        return outcome.error;
    }
    let direction = direction(cycle, outcome);
    limit_switch(cycle.inputs, direction)
        .or_else(|| software_limit(cycle, outcome, direction))
        .or(outcome.error)
}

/// Which way the axis goes, or is pushed.
fn direction(cycle: &Cycle<'_>, outcome: &Outcome) -> f64 {
    match outcome.demand {
        Demand::Position(motion) => motion.rate,
        Demand::Speed(speed) => speed,
        Demand::Torque(_) if cycle.measured.standstill => 0.0,
        Demand::Torque(_) => cycle.measured.velocity,
    }
}

/// Away from a closed switch the axis may go.
fn limit_switch(inputs: Inputs, direction: f64) -> Option<u16> {
    if inputs.negative && direction < 0.0 {
        Some(errors::NEGATIVE_LIMIT)
    } else if inputs.positive && direction > 0.0 {
        Some(errors::POSITIVE_LIMIT)
    } else {
        None
    }
}

/// 607Dh holds for the demand of a position mode and for the actual position of
/// the others. Back inside the axis may go.
fn software_limit(cycle: &Cycle<'_>, outcome: &Outcome, direction: f64) -> Option<u16> {
    let (min, max) = cycle.limits.software?;
    let position = match outcome.demand {
        Demand::Position(motion) => motion.position.round() as i64,
        Demand::Speed(_) | Demand::Torque(_) => cycle.position,
    };
    let outside = position < min && direction < 0.0 || position > max && direction > 0.0;
    outside.then_some(errors::SOFTWARE_LIMIT)
}

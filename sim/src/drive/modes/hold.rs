//! Standing still: a position mode that was given no set-point.

use super::{Cycle, Outcome, TARGET_REACHED};
use crate::drive::ramp;

/// Slows down with 6084h if the axis moves, and holds it at zero.
pub fn step(cycle: Cycle<'_>) -> Outcome {
    let demand = ramp::step(cycle.demand, 0.0, cycle.limits.profile, cycle.seconds);
    let bits = if cycle.measured.standstill {
        TARGET_REACHED
    } else {
        0
    };
    Outcome { demand, bits }
}

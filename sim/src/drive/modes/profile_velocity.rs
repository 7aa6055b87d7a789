//! Profile velocity (CiA 402-2, 16): the speed follows 60FFh with the ramps of
//! 6083h and 6084h.

use super::{Cycle, Demand, INTERNAL_LIMIT, Outcome, SPEED_ZERO, TARGET_REACHED};
use crate::drive::ramp;

/// Window around the target in which bit 10 is set, rpm.
const WINDOW_RPM: f64 = 30.0;
/// For how long the speed has to stay in the window, seconds.
const WINDOW_S: f64 = 0.002;

/// What the mode remembers.
#[derive(Clone, Debug, Default)]
pub struct ProfileVelocity {
    in_window_s: f64,
}

impl ProfileVelocity {
    /// One control cycle.
    pub fn step(&mut self, cycle: &Cycle<'_>) -> Outcome {
        let wanted = cycle.od.rpm(0x60FF, 0);
        let limited = wanted.clamp(-cycle.limits.speed, cycle.limits.speed);
        let target = if cycle.halt() { 0.0 } else { limited };
        let demand = ramp::step(cycle.demand, target, cycle.limits.profile, cycle.seconds);

        let near = (cycle.measured.velocity - target).abs() < WINDOW_RPM;
        self.in_window_s = if near {
            self.in_window_s + cycle.seconds
        } else {
            0.0
        };
        let mut bits = 0;
        if demand == target && self.in_window_s >= WINDOW_S {
            bits |= TARGET_REACHED;
        }
        if limited != wanted {
            bits |= INTERNAL_LIMIT;
        }
        if cycle.measured.standstill {
            bits |= SPEED_ZERO;
        }
        Outcome {
            bits,
            ..Outcome::from(Demand::Speed(demand))
        }
    }
}

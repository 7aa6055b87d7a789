//! Cyclic synchronous velocity (CiA 402-2, 14): the speed follows 60FFh and
//! 60B1h without a ramp; 6083h, 6084h and 60C5h mean nothing here.

use super::interpolation::Interpolation;
use super::{Cycle, Demand, FOLLOWS, INTERNAL_LIMIT, Outcome};
use crate::drive::dictionary::Dictionary;
use crate::drive::errors;

/// What the mode remembers.
#[derive(Clone, Debug, Default)]
pub struct CyclicVelocity {
    interpolation: Interpolation,
}

impl CyclicVelocity {
    /// The mode takes the axis over at its speed and goes to what 60FFh says.
    pub fn enter(&mut self, cycle: &Cycle<'_>) {
        self.interpolation = Interpolation::begin(cycle.demand, cycle.now_s);
        self.set(cycle.od, cycle.now_s);
    }

    /// 60FFh was written.
    pub fn set(&mut self, od: &Dictionary, now_s: f64) {
        let target = od.rpm(0x60FF, 0);
        self.interpolation.set(target, now_s, super::period_s(od));
    }

    /// One control cycle.
    pub fn step(&mut self, cycle: &Cycle<'_>) -> Outcome {
        let wanted = self.interpolation.value(cycle.now_s) + cycle.od.rpm(0x60B1, 0);
        let speed = wanted.clamp(-cycle.limits.motor, cycle.limits.motor);
        let period_s = super::period_s(cycle.od);
        let overdue = cycle.od.operational && self.interpolation.overdue(cycle.now_s, period_s);
        let bits = if speed == wanted {
            FOLLOWS
        } else {
            INTERNAL_LIMIT
        };
        Outcome {
            bits,
            error: overdue.then_some(errors::RPDO_TIMEOUT),
            ..Outcome::from(Demand::Speed(speed))
        }
    }
}

//! Cyclic synchronous torque (CiA 402-2, 15): the torque follows 6071h and
//! 60B2h, per mille of the rated torque (6076h).

use super::interpolation::Interpolation;
use super::{Cycle, Demand, FOLLOWS, INTERNAL_LIMIT, Outcome};
use crate::drive::dictionary::Dictionary;
use crate::drive::errors;

/// What the mode remembers.
#[derive(Clone, Debug, Default)]
pub struct CyclicTorque {
    interpolation: Interpolation,
}

impl CyclicTorque {
    /// From no torque to what 6071h says.
    pub fn enter(&mut self, cycle: &Cycle<'_>) {
        self.interpolation = Interpolation::begin(0.0, cycle.now_s);
        self.set(cycle.od, cycle.now_s);
    }

    /// 6071h was written.
    pub fn set(&mut self, od: &Dictionary, now_s: f64) {
        let target = od.number(0x6071, 0) as f64;
        self.interpolation.set(target, now_s, super::period_s(od));
    }

    /// One control cycle. At the largest speed of 6080h the torque that would
    /// make it faster is taken away.
    pub fn step(&mut self, cycle: &Cycle<'_>) -> Outcome {
        let wanted = self.interpolation.value(cycle.now_s) + cycle.od.number(0x60B2, 0) as f64;
        let velocity = cycle.measured.velocity;
        let too_fast = velocity.abs() >= cycle.limits.motor && velocity * wanted > 0.0;
        let period_s = super::period_s(cycle.od);
        let overdue = cycle.od.operational && self.interpolation.overdue(cycle.now_s, period_s);
        Outcome {
            bits: if too_fast { INTERNAL_LIMIT } else { FOLLOWS },
            error: overdue.then_some(errors::RPDO_TIMEOUT),
            ..Outcome::from(Demand::Torque(if too_fast { 0.0 } else { wanted }))
        }
    }
}

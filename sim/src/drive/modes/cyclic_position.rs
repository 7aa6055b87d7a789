//! Cyclic synchronous position (CiA 402-2, 13): the position follows 607Ah.

use super::interpolation::Interpolation;
use super::{Cycle, Demand, FOLLOWS, Motion, Outcome};
use crate::drive::dictionary::Dictionary;
use crate::drive::errors;

/// What the mode remembers.
#[derive(Clone, Debug, Default)]
pub struct CyclicPosition {
    interpolation: Interpolation,
    /// The last set value, not wrapped.
    target: i64,
    followed: bool,
}

impl CyclicPosition {
    /// The mode takes the axis over where it is. 607Ah acts when it is written
    /// next: an old value moves nothing.
    pub fn enter(&mut self, cycle: &Cycle<'_>) {
        self.target = cycle.position;
        self.interpolation = Interpolation::begin(cycle.position as f64, cycle.now_s);
        self.followed = false;
    }

    /// 607Ah was written. It wraps at 32 bits, as the position does: the
    /// shorter way is meant.
    pub fn set(&mut self, od: &Dictionary, now_s: f64) {
        let wrapped = od.number(0x607A, 0) as i32;
        self.target += i64::from(wrapped.wrapping_sub(self.target as i32));
        let period_s = super::period_s(od);
        self.interpolation.set(self.target as f64, now_s, period_s);
        self.followed = true;
    }

    /// One control cycle.
    pub fn step(&mut self, cycle: &Cycle<'_>) -> Outcome {
        let period_s = super::period_s(cycle.od);
        // Without interpolation the drive knows the speed from 60B1h only.
        let rate = if period_s > 0.0 {
            self.interpolation.slope(cycle.now_s)
        } else {
            cycle.od.rpm(0x60B1, 0) * cycle.per_rpm
        };
        let offset = cycle.od.number(0x60B0, 0) as f64;
        let motion = Motion {
            position: self.interpolation.value(cycle.now_s) + offset,
            rate,
            acceleration: self.interpolation.bend(cycle.now_s),
        };
        let overdue = cycle.od.operational && self.interpolation.overdue(cycle.now_s, period_s);
        Outcome {
            bits: if self.followed { FOLLOWS } else { 0 },
            error: overdue.then_some(errors::RPDO_TIMEOUT),
            ..Outcome::from(Demand::Position(motion))
        }
    }
}

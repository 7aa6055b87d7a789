//! Profile position (CiA 402-2, 10): set-points are handed over with bits 4 and
//! 12, carried out with the ramps of 6083h and 6084h at 6081h.

use super::trapezoid::{MoveLimits, Trapezoid};
use super::{Cycle, Demand, INTERNAL_LIMIT, Motion, Outcome, SETPOINT_ACKNOWLEDGE, TARGET_REACHED};
use crate::drive::dictionary::Dictionary;

/// Bit 4 of the controlword.
const NEW_SETPOINT: u16 = 1 << 4;
/// Bit 5: at once, instead of after the running move.
const IMMEDIATELY: u16 = 1 << 5;
/// Bit 6: 607Ah is relative to the set-point before.
const RELATIVE: u16 = 1 << 6;
/// Bit 15: moves on for ever in the direction of 607Ah.
const ENDLESS: u16 = 1 << 15;
/// 6067h: no window, the end of the profile counts.
const NO_WINDOW: i64 = u32::MAX as i64;

/// What was handed over with a rising edge of bit 4.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Request {
    controlword: u16,
    /// 607Ah.
    number: i32,
    limits: MoveLimits,
}

/// A move.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SetPoint {
    target: f64,
    limits: MoveLimits,
    /// 607Dh has cut it off.
    cut: bool,
}

/// What the mode remembers.
#[derive(Clone, Debug, Default)]
pub struct ProfilePosition {
    profile: Trapezoid,
    requests: Vec<Request>,
    /// The move under way or done.
    active: Option<SetPoint>,
    /// The one that waits for its end.
    next: Option<SetPoint>,
    arrived: bool,
    acknowledged: bool,
    controlword: u16,
    in_window_s: f64,
}

impl ProfilePosition {
    /// The mode takes the axis over: without a set-point it comes to rest.
    pub fn enter(&mut self, cycle: &Cycle<'_>) {
        *self = ProfilePosition {
            profile: Trapezoid::begin(cycle.position as f64, cycle.demand * cycle.per_rpm),
            controlword: self.controlword,
            ..ProfilePosition::default()
        };
    }

    /// A controlword was written. A set-point counts in operation enabled only:
    /// `running`.
    pub fn control(&mut self, controlword: u16, od: &Dictionary, running: bool, per_rpm: f64) {
        let rising = controlword & !self.controlword & NEW_SETPOINT != 0;
        self.controlword = controlword;
        if rising && running {
            self.requests.push(Request {
                controlword,
                number: od.number(0x607A, 0) as i32,
                limits: super::move_limits(od, od.rpm(0x6081, 0), per_rpm),
            });
        }
    }

    /// One control cycle.
    pub fn step(&mut self, cycle: &Cycle<'_>) -> Outcome {
        for request in std::mem::take(&mut self.requests) {
            self.accept(request, cycle);
        }
        if self.controlword & NEW_SETPOINT == 0 && self.next.is_none() {
            self.acknowledged = false;
        }
        let before = self.profile.rate;
        let brake = cycle.limits.profile.deceleration * cycle.per_rpm;
        let halt = cycle.halt();
        match self.active {
            Some(set) if !halt => self.follow(set, cycle.seconds),
            _ => self.profile.run(0.0, brake, cycle.seconds),
        }
        let mut bits = 0;
        let reached = if halt || self.active.is_none() {
            self.profile.rate == 0.0 && cycle.measured.standstill
        } else {
            self.arrived && self.next.is_none() && self.in_window(cycle)
        };
        if reached {
            bits |= TARGET_REACHED;
        }
        if self.acknowledged {
            bits |= SETPOINT_ACKNOWLEDGE;
        }
        if self.active.is_some_and(|set| set.cut) {
            bits |= INTERNAL_LIMIT;
        }
        let motion = Motion {
            position: self.profile.position,
            rate: self.profile.rate,
            acceleration: (self.profile.rate - before) / cycle.seconds,
        };
        Outcome {
            bits,
            ..Outcome::from(Demand::Position(motion))
        }
    }

    fn follow(&mut self, set: SetPoint, seconds: f64) {
        self.arrived = self.profile.approach(set.target, set.limits, seconds);
        if self.arrived
            && let Some(next) = self.next.take()
        {
            self.start(next);
        }
    }

    fn start(&mut self, set: SetPoint) {
        self.active = Some(set);
        self.arrived = false;
        self.in_window_s = 0.0;
    }

    /// One set-point can wait. While it does, bit 12 stays set and only a
    /// set-point that is to act at once is accepted: it replaces both.
    fn accept(&mut self, request: Request, cycle: &Cycle<'_>) {
        let immediately = request.controlword & IMMEDIATELY != 0;
        let busy = self.active.is_some() && !self.arrived;
        if busy && self.next.is_some() && !immediately {
            return;
        }
        let set = self.set_point(request, cycle);
        self.acknowledged = true;
        if busy && !immediately {
            self.next = Some(set);
        } else {
            self.next = None;
            self.start(set);
        }
    }

    fn set_point(&self, request: Request, cycle: &Cycle<'_>) -> SetPoint {
        let has = |bit| request.controlword & bit != 0;
        // Relative to the target before, or to where the axis rests.
        let last = self.next.or(self.active);
        let targets = last.map(|set| set.target).filter(|t| t.is_finite());
        let base = targets.unwrap_or(self.profile.position);
        let wanted = if has(ENDLESS) {
            f64::INFINITY.copysign(f64::from(request.number))
        } else if has(RELATIVE) {
            base + f64::from(request.number)
        } else {
            // In the turn of the 32-bit counter that the axis is in.
            let turns = cycle.position - i64::from(cycle.position as i32);
            (turns + i64::from(request.number)) as f64
        };
        let target = match cycle.limits.software {
            Some((min, max)) => wanted.clamp(min as f64, max as f64),
            None => wanted,
        };
        SetPoint {
            target,
            limits: request.limits,
            cut: target != wanted,
        }
    }

    /// 6067h for 6068h milliseconds.
    fn in_window(&mut self, cycle: &Cycle<'_>) -> bool {
        let window = cycle.od.number(0x6067, 0);
        if window == NO_WINDOW {
            return true;
        }
        let error = (self.profile.position - cycle.position as f64).abs();
        self.in_window_s = if error <= window as f64 {
            self.in_window_s + cycle.seconds
        } else {
            0.0
        };
        let time_s = cycle.od.number(0x6068, 0) as f64 / 1000.0;
        self.in_window_s > 0.0 && self.in_window_s >= time_s
    }
}

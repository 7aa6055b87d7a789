//! Homing (CiA 402-2, 11): finding the zero of the position.
//!
//! A search that finds nothing goes on until something stops it: a limit switch
//! where there is one, else a hard stop and with it the following error, else
//! the master.

use super::homing_methods::{Leg, Switch, Until, legs};
use super::trapezoid::{MoveLimits, Trapezoid};
use super::{Cycle, Demand, HOMING_ATTAINED, HOMING_ERROR, Motion, Outcome, TARGET_REACHED};
use crate::drive::travel::Inputs;
use std::collections::VecDeque;

/// Bit 4 of the controlword: start, and go on.
const START: u16 = 1 << 4;

#[derive(Clone, Debug, Default, PartialEq)]
enum Phase {
    /// Not started, or interrupted.
    #[default]
    Idle,
    /// The legs that are left; the first is under way.
    Search {
        legs: VecDeque<Leg>,
        /// The first leg was turned round at a limit switch.
        turned: bool,
        /// The switch of an `Opens` leg was seen closed.
        seen: bool,
        /// Where the last edge was.
        mark: i64,
    },
    /// On the way from the mark by 30B1h.
    Leave {
        target: f64,
    },
    Done,
    Failed,
}

/// What the mode remembers.
#[derive(Clone, Debug, Default)]
pub struct Homing {
    profile: Trapezoid,
    phase: Phase,
    controlword: u16,
    start: bool,
}

/// What a leg has come to.
enum End {
    NotYet,
    /// At this position.
    At(i64),
    /// The way is blocked.
    Blocked,
}

impl Homing {
    /// The mode takes the axis over and brings it to rest.
    pub fn enter(&mut self, cycle: &Cycle<'_>) {
        self.profile = Trapezoid::begin(cycle.position as f64, cycle.demand * cycle.per_rpm);
        self.phase = Phase::Idle;
        self.start = false;
    }

    /// A controlword was written.
    pub fn control(&mut self, controlword: u16, running: bool) {
        let rising = controlword & !self.controlword & START != 0;
        self.controlword = controlword;
        self.start |= rising && running;
    }

    /// One control cycle.
    pub fn step(&mut self, cycle: &Cycle<'_>) -> Outcome {
        if std::mem::take(&mut self.start) {
            self.begin(cycle);
        }
        let going = self.controlword & START != 0;
        if !going && matches!(self.phase, Phase::Search { .. } | Phase::Leave { .. }) {
            self.phase = Phase::Idle;
        }
        let before = self.profile.rate;
        let slope = cycle.od.number(0x609A, 0) as f64 * cycle.per_rpm;
        let shift = match self.phase {
            Phase::Search { .. } if !cycle.halt() => self.search(slope, cycle),
            Phase::Leave { target } if !cycle.halt() => self.leave(target, slope, cycle),
            _ => self.rest(slope, cycle),
        };
        let motion = Motion {
            position: self.profile.position,
            rate: self.profile.rate,
            acceleration: (self.profile.rate - before) / cycle.seconds,
        };
        Outcome {
            bits: self.bits(cycle),
            shift,
            ..Outcome::from(Demand::Position(motion))
        }
    }

    /// CiA 402-2, table of bits 10, 12 and 13 in homing.
    fn bits(&self, cycle: &Cycle<'_>) -> u16 {
        let still = self.profile.rate == 0.0 && cycle.measured.standstill;
        let rest = if still { TARGET_REACHED } else { 0 };
        match self.phase {
            Phase::Idle => rest,
            Phase::Search { .. } | Phase::Leave { .. } => {
                if cycle.halt() {
                    rest
                } else {
                    0
                }
            }
            Phase::Done => HOMING_ATTAINED | TARGET_REACHED,
            Phase::Failed => HOMING_ERROR | rest,
        }
    }

    fn begin(&mut self, cycle: &Cycle<'_>) {
        let method = cycle.od.number(0x6098, 0) as i8;
        let Some(legs) = legs(method) else {
            self.phase = Phase::Failed;
            return;
        };
        let mut legs = VecDeque::from(legs);
        // On the switch already: off it at once.
        if let Some(Leg {
            until: Until::Closed(switch),
            ..
        }) = legs.front()
            && closed(*switch, cycle.inputs)
        {
            legs.pop_front();
        }
        self.phase = Phase::Search {
            legs,
            turned: false,
            seen: false,
            mark: cycle.position,
        };
    }

    fn rest(&mut self, slope: f64, cycle: &Cycle<'_>) -> Option<i64> {
        self.profile.run(0.0, slope, cycle.seconds);
        None
    }

    fn search(&mut self, slope: f64, cycle: &Cycle<'_>) -> Option<i64> {
        let Phase::Search {
            legs,
            turned,
            seen,
            mark,
        } = &mut self.phase
        else {
            return None;
        };
        let Some(leg) = legs.front().copied() else {
            return self.found(cycle);
        };
        let direction = leg.direction.sign();
        // While the axis still comes back from the leg before nothing counts.
        let on_leg = self.profile.rate * direction > 0.0;
        let end = if on_leg {
            end(leg, seen, cycle)
        } else {
            End::NotYet
        };
        match end {
            End::NotYet => {}
            End::At(position) => {
                legs.pop_front();
                *mark = position;
                *seen = false;
            }
            End::Blocked if leg.until == Until::Closed(Switch::Home) && !*turned => {
                legs[0].direction = leg.direction.reversed();
                *turned = true;
            }
            End::Blocked => self.phase = Phase::Failed,
        }
        let speed = cycle.od.rpm(0x6099, if leg.slow { 2 } else { 1 });
        let speed = speed.min(cycle.limits.motor) * cycle.per_rpm * direction;
        let wanted = if matches!(end, End::NotYet) {
            speed
        } else {
            0.0
        };
        self.profile.run(wanted, slope, cycle.seconds);
        None
    }

    /// The mark of the last leg is the zero, 30B1h away from the end of the
    /// run. Method 37 does not move.
    fn found(&mut self, cycle: &Cycle<'_>) -> Option<i64> {
        let Phase::Search { mark, .. } = self.phase else {
            return None;
        };
        if cycle.od.number(0x6098, 0) == 37 {
            self.phase = Phase::Done;
            return Some(self.home(cycle.position, cycle));
        }
        // At a hard stop the demand is beyond the axis.
        if self.profile.rate == 0.0 {
            self.profile.position = cycle.position as f64;
        }
        let target = mark as f64 + cycle.od.number(0x30B1, 0) as f64;
        self.phase = Phase::Leave { target };
        None
    }

    fn leave(&mut self, target: f64, slope: f64, cycle: &Cycle<'_>) -> Option<i64> {
        let limits = MoveLimits {
            speed: cycle.od.rpm(0x6099, 1) * cycle.per_rpm,
            acceleration: slope,
            deceleration: slope,
        };
        if !self.profile.approach(target, limits, cycle.seconds) {
            return None;
        }
        self.phase = Phase::Done;
        Some(self.home(target.round() as i64, cycle))
    }

    /// 30B0h is the name of the position `at` from now on.
    fn home(&mut self, at: i64, cycle: &Cycle<'_>) -> i64 {
        let shift = cycle.od.number(0x30B0, 0) - at;
        self.profile.position += shift as f64;
        shift
    }
}

fn closed(switch: Switch, inputs: Inputs) -> bool {
    use super::homing_methods::Direction::{Negative, Positive};
    match switch {
        Switch::Limit(Negative) => inputs.negative,
        Switch::Limit(Positive) => inputs.positive,
        Switch::Home => inputs.home,
    }
}

fn end(leg: Leg, seen: &mut bool, cycle: &Cycle<'_>) -> End {
    let here = End::At(cycle.position);
    match leg.until {
        Until::Closed(switch) if closed(switch, cycle.inputs) => return here,
        Until::Opens(switch) => {
            if closed(switch, cycle.inputs) {
                *seen = true;
            } else if *seen {
                return here;
            }
        }
        Until::Index => {
            if let Some(at) = cycle.index {
                return End::At(at);
            }
        }
        Until::Current => {
            let threshold = cycle.od.number(0x30B2, 0) as f64;
            if cycle.current_ma * leg.direction.sign() >= threshold {
                return here;
            }
        }
        Until::Closed(_) => {}
    }
    // A hard stop is sought behind the switch, if there is one.
    let blocked = closed(Switch::Limit(leg.direction), cycle.inputs);
    if blocked && leg.until != Until::Current {
        End::Blocked
    } else {
        End::NotYet
    }
}

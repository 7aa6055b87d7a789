//! Moves of several axes that start in one SYNC and arrive in one SYNC.
//!
//! Each leg goes from a velocity to a constant one, keeps it, and brakes to rest,
//! all in whole cycles. Given how many cycles the whole takes, how long it speeds
//! up and how long it brakes, the constant velocity is a quotient; so the search
//! is one for whole numbers, the smallest that keep the limits. The slowest leg
//! of a set decides for all. Legs of a set that all begin at rest share their
//! phases and so stay on a straight line.
//!
//! With a jerk, each change of velocity is led in and out by phases of constant
//! jerk as long as the full acceleration needs. That takes no more way than a
//! ramp of the same length, so that nothing else changes.

use super::fixed::{self, ceil};
use super::path::{Knot, LEG_KNOTS, Point};
use super::{greater, next};
use heapless::Vec;

/// Longest move in cycles: times stay exact in single precision.
pub const CYCLES_MAX: u32 = 1 << 22;
/// Rounds in which the phases grow until they keep the limits; near the shortest
/// time they grow by little, and a cycle more ends that.
const ROUNDS: u32 = 40;
/// What single precision may make of a limit, relative.
const ROUNDING: f32 = 1.0 + 1.0 / 131_072.0;
/// The knots of one leg: one leads the acceleration to 0, three speed up, one keeps
/// the velocity, three brake.
pub type Knots = Vec<Knot, LEG_KNOTS>;

/// One axis' part of a move, in increments and cycles; limits are positive. What is
/// long stands last: the rest is reached by short instructions.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Leg {
    /// Legs with the same number arrive together; `None`: it is not moved.
    pub set: Option<u8>,
    /// Where it ends at rest, increments of 6064h; the shorter way around.
    pub target: i32,
    /// Position from which the targets of its axis count.
    pub home: i32,
    /// Increments per cycle.
    pub velocity: f32,
    /// Increments per cycle squared.
    pub acceleration: f32,
    /// Increments per cycle squared.
    pub deceleration: f32,
    /// Increments per cycle cubed; 0: no limit.
    pub jerk: f32,
    /// What [`plan`] makes of it. Its steepest slopes, increments per cycle squared:
    /// while its speed grows.
    pub up: f32,
    /// While it shrinks.
    pub down: f32,
    /// An axis that cannot brake before its target turns around: no farther than so
    /// many increments from where it begins.
    pub turn: f32,
    /// What it keeps of it meanwhile.
    pub work: Work,
    /// Where it begins.
    pub from: Point,
    /// And the knots.
    pub knots: Knots,
}

/// A leg as the search sees it.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Work {
    /// Cycles before the phases, in which the acceleration is led to 0.
    lead: u32,
    /// What is left after them.
    way: f32,
    speed: f32,
    /// Where the last of the knots ends.
    at: Knot,
}

impl Leg {
    /// An axis that is not moved.
    pub const ZERO: Leg = Leg {
        from: Point::at_rest(0),
        target: 0,
        home: 0,
        velocity: 0.0,
        acceleration: 0.0,
        deceleration: 0.0,
        jerk: 0.0,
        set: None,
        knots: Vec::new(),
        up: 0.0,
        down: 0.0,
        turn: 0.0,
        work: Work {
            lead: 0,
            way: 0.0,
            speed: 0.0,
            at: Knot {
                cycles: 0,
                position: 0,
                velocity: 0,
            },
        },
    };
}

/// Phases in cycles, as they are searched for: all of it, speeding up, braking; what is
/// left over is at constant velocity. Each ramp is led in and out in `jerk` cycles.
#[derive(Clone, Copy, Debug, Default)]
struct Phases {
    total: u32,
    up: u32,
    down: u32,
    jerk: u32,
}

impl Leg {
    /// Begins with the phase that leads the acceleration to 0.
    fn begin(&mut self) {
        const THIRD: f32 = 1.0 / 3.0;
        let Point {
            position,
            velocity,
            acceleration,
        } = self.from;
        self.knots.clear();
        self.work.at = Knot {
            cycles: 0,
            position,
            velocity,
        };
        self.work.lead = 0;
        if self.jerk > 0.0 && velocity != 0 {
            self.work.lead = ceil(acceleration.abs() / self.jerk);
            let time = self.work.lead as f32;
            let gained = acceleration * time;
            let way = velocity.wrapping_mul(i64::from(self.work.lead));
            let way = way.wrapping_add(fixed::fixed(gained * time * THIRD));
            self.add(self.work.lead, velocity + fixed::fixed(0.5 * gained), way);
        }
        let way = fixed::whole(self.target).wrapping_sub(self.work.at.position);
        self.work.way = fixed::float(way);
        self.work.speed = fixed::float(self.work.at.velocity);
    }

    /// A knot more.
    #[inline(never)]
    fn add(&mut self, cycles: u32, velocity: i64, way: i64) {
        let at = &mut self.work.at;
        at.cycles = cycles;
        at.position = at.position.wrapping_add(way);
        at.velocity = velocity;
        if cycles > 0 {
            // There is room: a leg has no more.
            let _ = self.knots.push(*at);
        }
    }

    /// To `velocity` in `cycles`, each end in `jerk`.
    #[inline(never)]
    fn ramp(&mut self, velocity: i64, cycles: u32, jerk: u32) {
        const SIXTH: u32 = 6;
        let from = self.work.at.velocity;
        let times = i64::from(jerk);
        let gained = fixed::div(velocity - from, cycles - jerk).wrapping_mul(times);
        let bend = fixed::div(gained, SIXTH).wrapping_mul(times);
        let (led_in, led_out) = (from + (gained >> 1), velocity - (gained >> 1));
        let middle = cycles - 2 * jerk;
        self.add(jerk, led_in, from.wrapping_mul(times) + bend);
        let mean = (led_in + led_out) >> 1;
        self.add(middle, led_out, mean.wrapping_mul(i64::from(middle)));
        self.add(jerk, velocity, velocity.wrapping_mul(times) - bend);
    }

    /// The knots in these phases.
    #[inline(never)]
    fn lay(&mut self, phases: &Phases) {
        let Phases {
            total,
            up,
            down,
            jerk,
        } = *phases;
        let target = fixed::whole(self.target);
        let way = target.wrapping_sub(self.work.at.position);
        // Twice what the constant velocity has to cover would not fit.
        let cover = way.wrapping_sub((self.work.at.velocity >> 1).wrapping_mul(i64::from(up)));
        let cruise = fixed::div(cover, 2 * total - up - down) << 1;
        let (from, to) = (self.work.speed, fixed::float(cruise));
        self.up = (to - from).abs() / (up - jerk) as f32;
        self.down = to.abs() / (down - jerk) as f32;
        self.turn = 0.0;
        if from.abs() > to.abs() || from * to < 0.0 {
            self.down = greater(self.down, self.up);
        }
        if from * to < 0.0 {
            // The jerk keeps it going a little longer.
            self.turn = 0.5 * from * (up as f32 * from / (from - to) + jerk as f32);
        }
        self.ramp(cruise, up, jerk);
        self.ramp(cruise, total - up - down, 0);
        self.ramp(0, down, jerk);
        if let Some(last) = self.knots.last_mut() {
            last.position = target;
        }
    }
}

impl Phases {
    /// Whether there are phases of `total` cycles that keep the limits of the legs of
    /// `set` (bit n for leg n): then these are they.
    #[inline(never)]
    fn fit(&mut self, legs: &[Leg], set: u32, total: u32) -> bool {
        let shortest = (2 * self.jerk).max(1);
        self.total = total;
        (self.up, self.down) = (shortest, shortest);
        for _ in 0..ROUNDS {
            let (up, down) = (self.up, self.down);
            if up + down > total {
                return false;
            }
            let weight = (2 * total - up - down) as f32;
            let mut left = set;
            while let Some(n) = next(&mut left) {
                let Some(leg) = legs.get(n) else { break };
                let from = leg.work.speed;
                let cruise = (2.0 * leg.work.way - from * up as f32) / weight;
                if cruise.abs() > leg.velocity * ROUNDING {
                    return false;
                }
                let mut slope = leg.acceleration;
                let turns = cruise * from < 0.0 && slope > leg.deceleration;
                if turns || (cruise * from >= 0.0 && cruise.abs() < from.abs()) {
                    slope = leg.deceleration;
                }
                self.up = self.up.max(self.ramp(cruise - from, slope));
                self.down = self.down.max(self.ramp(cruise, leg.deceleration));
            }
            if (up, down) == (self.up, self.down) {
                return true;
            }
        }
        false
    }

    /// Cycles of a change of speed.
    #[inline(never)]
    fn ramp(&self, speed: f32, slope: f32) -> u32 {
        ceil(speed.abs() / (slope * ROUNDING)) + self.jerk
    }

    /// The shortest phases of at least `at_least` cycles.
    fn shortest(&mut self, legs: &[Leg], set: u32, at_least: u32) -> Option<u32> {
        let (mut low, mut high) = (at_least, at_least);
        while !self.fit(legs, set, high) {
            low = high + 1;
            high = CYCLES_MAX.min(2 * low);
            if low > CYCLES_MAX {
                return None;
            }
        }
        while low < high {
            let middle = low.midpoint(high);
            if self.fit(legs, set, middle) {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        Some(high)
    }
}

/// Plans the legs: their knots and what goes with them.
///
/// # Errors
/// The first leg, counted from 0, of a set that takes longer than [`CYCLES_MAX`]
/// cycles.
pub fn plan(legs: &mut [Leg]) -> Result<(), u8> {
    let mut done = 0;
    for first in 0..legs.len() {
        let set = legs.get(first).and_then(|leg| leg.set);
        if set.is_none() || done >> first & 1 != 0 {
            continue;
        }
        let mut members = 0;
        for leg in legs.iter().rev() {
            members = members << 1 | u32::from(leg.set == set);
        }
        done |= members;
        if plan_set(legs, members).is_none() {
            return Err(first as u8);
        }
    }
    Ok(())
}

#[inline(never)]
fn plan_set(legs: &mut [Leg], set: u32) -> Option<()> {
    let mut phases = Phases::default();
    let mut moving = false;
    let mut left = set;
    while let Some(n) = next(&mut left) {
        let leg = legs.get_mut(n)?;
        leg.begin();
        moving |= leg.from.velocity != 0;
        if leg.jerk > 0.0 {
            let most = greater(leg.acceleration, leg.deceleration);
            phases.jerk = phases.jerk.max(ceil(most / leg.jerk));
        }
    }
    // In motion each has its own phases, and only the end is common.
    let group = |n: usize| if moving { 1 << n } else { set };
    let (mut total, mut before) = (1u32, 0);
    while total != before {
        before = total;
        left = set;
        while let Some(n) = next(&mut left) {
            let lead = legs.get(n)?.work.lead;
            let at_least = total.saturating_sub(lead).max(1);
            let own = phases.shortest(legs, group(n), at_least)?;
            // None has to wait longer for another at the end.
            total = total.max(own + lead);
        }
    }
    left = set;
    while let Some(n) = next(&mut left) {
        let own = total - legs.get(n)?.work.lead;
        if !phases.fit(legs, group(n), own) {
            return None;
        }
        legs.get_mut(n)?.lay(&phases);
    }
    Some(())
}

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

/// One axis' part of a move, in increments and cycles; limits are positive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Leg {
    /// Where it begins.
    pub from: Point,
    /// Where it ends at rest, increments of 6064h; the shorter way around.
    pub target: i32,
    /// Increments per cycle.
    pub velocity: f32,
    /// Increments per cycle squared.
    pub acceleration: f32,
    /// Increments per cycle squared.
    pub deceleration: f32,
    /// Increments per cycle cubed; 0: no limit.
    pub jerk: f32,
    /// Legs with the same number arrive together.
    pub set: u8,
}

/// A leg as the search sees it.
#[derive(Clone, Copy, Default)]
struct Reduced {
    way: f32,
    from: f32,
    velocity: f32,
    acceleration: f32,
    deceleration: f32,
    /// Cycles before, in which its acceleration is led to 0.
    lead: u32,
}

/// Phases in cycles: all of it, speeding up, braking; what is left over is at
/// constant velocity. Each ramp is led in and out in `jerk` cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Phases {
    total: u32,
    up: u32,
    down: u32,
    jerk: u32,
}

impl Reduced {
    fn of(leg: &Leg, from: &Knot, lead: u32) -> Reduced {
        let way = fixed::whole(leg.target).wrapping_sub(from.position);
        Reduced {
            lead,
            way: fixed::float(way),
            from: fixed::float(from.velocity),
            velocity: leg.velocity,
            acceleration: leg.acceleration,
            deceleration: leg.deceleration,
        }
    }

    /// The constant velocity that these phases ask for.
    fn cruise(&self, phases: &Phases) -> f32 {
        let weight = 2 * phases.total - phases.up - phases.down;
        (2.0 * self.way - self.from * phases.up as f32) / weight as f32
    }

    /// How steep it may go from its velocity to `cruise`.
    fn slope(&self, cruise: f32) -> f32 {
        if cruise * self.from < 0.0 {
            let steeper = self.acceleration > self.deceleration;
            if steeper {
                self.deceleration
            } else {
                self.acceleration
            }
        } else if cruise.abs() < self.from.abs() {
            self.deceleration
        } else {
            self.acceleration
        }
    }
}

/// The members of a set: bit n for leg n.
fn members(legs: &[Reduced], set: u32) -> impl Iterator<Item = &Reduced> {
    let legs = legs.iter().enumerate();
    legs.filter_map(move |(n, leg)| (set >> n & 1 != 0).then_some(leg))
}

/// Phases of `total` cycles that keep the limits of all of `set`.
#[inline(never)]
fn fit(legs: &[Reduced], set: u32, total: u32, jerk: u32) -> Option<Phases> {
    let shortest = (2 * jerk).max(1);
    let mut phases = Phases {
        total,
        up: shortest,
        down: shortest,
        jerk,
    };
    for _ in 0..ROUNDS {
        if phases.up + phases.down > total {
            return None;
        }
        let (mut up, mut down) = (phases.up, phases.down);
        for leg in members(legs, set) {
            let cruise = leg.cruise(&phases);
            if cruise.abs() > leg.velocity * ROUNDING {
                return None;
            }
            let cycles = |speed: f32, slope: f32| ceil(speed.abs() / (slope * ROUNDING)) + jerk;
            up = up.max(cycles(cruise - leg.from, leg.slope(cruise)));
            down = down.max(cycles(cruise, leg.deceleration));
        }
        if (up, down) == (phases.up, phases.down) {
            return Some(phases);
        }
        (phases.up, phases.down) = (up, down);
    }
    None
}

/// The shortest phases for `set` of at least `at_least` cycles.
#[inline(never)]
fn shortest(legs: &[Reduced], set: u32, at_least: u32, jerk: u32) -> Option<Phases> {
    let mut low = at_least.max(1);
    for leg in members(legs, set) {
        low = low.max(ceil(leg.way.abs() / (leg.velocity * ROUNDING)));
    }
    let (mut high, mut best) = (low, None);
    while best.is_none() {
        if low > CYCLES_MAX {
            return None;
        }
        best = fit(legs, set, high, jerk);
        if best.is_none() {
            low = high + 1;
            high = CYCLES_MAX.min(2 * high).max(low);
        }
    }
    while low < high {
        let middle = low.midpoint(high);
        match fit(legs, set, middle, jerk) {
            None => low = middle + 1,
            found => (high, best) = (middle, found),
        }
    }
    best
}

/// Knots from where `out` ends on: to `velocity` in `cycles`, each end in `jerk`.
fn ramp(at: &mut Knot, out: &mut Knots, velocity: i64, cycles: u32, jerk: u32) {
    let from = at.velocity;
    let mut push = |cycles: u32, velocity: i64, way: i64| {
        at.cycles = cycles;
        at.position = at.position.wrapping_add(way);
        at.velocity = velocity;
        if cycles > 0 {
            // There is room: a leg has no more.
            let _ = out.push(*at);
        }
    };
    let mean = |from: i64, to: i64, cycles: u32| ((from + to) >> 1).wrapping_mul(i64::from(cycles));
    if jerk == 0 {
        push(cycles, velocity, mean(from, velocity, cycles));
        return;
    }
    const SIXTH: u32 = 6;
    let times = i64::from(jerk);
    let gained = fixed::div(velocity - from, cycles - jerk).wrapping_mul(times);
    let bend = fixed::div(gained, SIXTH).wrapping_mul(times);
    let (led_in, led_out) = (from + (gained >> 1), velocity - (gained >> 1));
    let middle = cycles - 2 * jerk;
    push(jerk, led_in, from.wrapping_mul(times) + bend);
    push(middle, led_out, mean(led_in, led_out, middle));
    push(jerk, velocity, velocity.wrapping_mul(times) - bend);
}

/// The knots of `leg` in these phases.
#[inline(never)]
fn knots(leg: &Leg, phases: &Phases, at: &mut Knot, out: &mut Knots) {
    let Phases {
        total,
        up,
        down,
        jerk,
    } = *phases;
    let target = fixed::whole(leg.target);
    let way = target.wrapping_sub(at.position);
    // Twice what the constant velocity has to cover would not fit.
    let cover = way.wrapping_sub((at.velocity >> 1).wrapping_mul(i64::from(up)));
    let cruise = fixed::div(cover, 2 * total - up - down) << 1;
    ramp(at, out, cruise, up, jerk);
    let cycles = total - up - down;
    if cycles > 0 {
        at.cycles = cycles;
        at.position = at
            .position
            .wrapping_add(cruise.wrapping_mul(i64::from(cycles)));
        let _ = out.push(*at);
    }
    ramp(at, out, 0, down, jerk);
    if let Some(last) = out.last_mut() {
        last.position = target;
    }
}

/// A leg that takes longer than [`CYCLES_MAX`] cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLong {
    /// Counted from 0.
    pub leg: u8,
}

/// Plans `legs` into `out`, as many; where there is no leg there are no knots.
/// Returns the cycles of the slowest.
///
/// # Errors
/// [`TooLong`] for the first leg of the set that takes too long.
pub fn plan(legs: &[Option<Leg>], out: &mut [Knots]) -> Result<u32, TooLong> {
    let mut longest = 0;
    let mut left = 0u32;
    for (n, (leg, out)) in legs.iter().zip(&mut *out).enumerate() {
        out.clear();
        left |= u32::from(leg.is_some()) << n;
    }
    while left != 0 {
        let first = left.trailing_zeros();
        let number = legs
            .get(first as usize)
            .copied()
            .flatten()
            .map_or(0, |leg| leg.set);
        let mut set = 0;
        for (n, leg) in legs.iter().enumerate() {
            let same = leg.is_some_and(|leg| leg.set == number);
            set |= u32::from(same) << n;
        }
        left &= !set;
        let cycles = plan_set(legs, set, out).ok_or(TooLong { leg: first as u8 })?;
        longest = longest.max(cycles);
    }
    Ok(longest)
}

/// The most legs.
const LEGS: usize = 16;

fn plan_set(legs: &[Option<Leg>], set: u32, out: &mut [Knots]) -> Option<u32> {
    let mut reduced = [Reduced::default(); LEGS];
    let mut starts = [Knot::default(); LEGS];
    let (mut jerk, mut moving, mut still) = (0, false, true);
    for (n, leg) in legs.iter().enumerate() {
        let (Some(leg), true) = (leg, set >> n & 1 != 0) else {
            continue;
        };
        if leg.jerk > 0.0 {
            let most = leg.acceleration.max(leg.deceleration);
            jerk = jerk.max(ceil(most / leg.jerk).max(1));
        }
        moving |= leg.from.velocity != 0;
        still &= leg.from.velocity == 0 && fixed::whole(leg.target) == leg.from.position;
    }
    if still {
        return Some(0);
    }
    let timed = legs
        .iter()
        .zip(&mut reduced)
        .zip(starts.iter_mut().zip(&mut *out));
    for (n, ((leg, reduced), (start, out))) in timed.enumerate() {
        let (Some(leg), true) = (leg, set >> n & 1 != 0) else {
            continue;
        };
        let lead = if moving && leg.jerk > 0.0 {
            ceil(leg.from.acceleration.abs() / leg.jerk)
        } else {
            0
        };
        *start = led_to_constant(&leg.from, lead, out);
        *reduced = Reduced::of(leg, start, lead);
    }
    // In motion each has its own phases, and only the end is common.
    let common = if moving {
        own_phases(&reduced, set, jerk)?
    } else {
        shortest(&reduced, set, 1, jerk)?
    };
    for (n, ((leg, start), out)) in legs.iter().zip(&mut starts).zip(out).enumerate() {
        let (Some(leg), true) = (leg, set >> n & 1 != 0) else {
            continue;
        };
        let phases = if moving {
            let lead = reduced.get(n).map_or(0, |leg| leg.lead);
            fit(&reduced, 1 << n, common.total - lead, jerk)?
        } else {
            common
        };
        knots(leg, &phases, start, out);
    }
    Some(common.total)
}

/// Where the acceleration that `from` has is led to 0 in `cycles`.
fn led_to_constant(from: &Point, cycles: u32, out: &mut Knots) -> Knot {
    let mut at = Knot {
        cycles,
        position: from.position,
        velocity: from.velocity,
    };
    if cycles > 0 {
        const THIRD: f32 = 1.0 / 3.0;
        let time = cycles as f32;
        let gained = from.acceleration * time;
        let way = from.velocity.wrapping_mul(i64::from(cycles));
        at.position = at
            .position
            .wrapping_add(way + fixed::fixed(gained * time * THIRD));
        at.velocity += fixed::fixed(0.5 * gained);
        let _ = out.push(at);
    }
    at
}

/// The shortest time in which each of `set` can arrive by phases of its own.
fn own_phases(legs: &[Reduced], set: u32, jerk: u32) -> Option<Phases> {
    let mut common = Phases {
        total: 1,
        up: 0,
        down: 0,
        jerk,
    };
    loop {
        let before = common.total;
        for (n, leg) in legs.iter().enumerate() {
            if set >> n & 1 != 0 {
                let left = common.total.saturating_sub(leg.lead);
                let own = match fit(legs, 1 << n, left, jerk) {
                    None => shortest(legs, 1 << n, left, jerk)?,
                    Some(fits) => fits,
                };
                common.total = common.total.max(own.total + leg.lead);
            }
        }
        // None had to wait longer for another.
        if common.total == before {
            return Some(common);
        }
    }
}

/// Where a path that begins at `from` turns around on its way, in 2^-32
/// increments: a leg that cannot brake before its target comes back.
pub fn turning_point(from: &Point, knots: &[Knot]) -> Option<i64> {
    let (mut position, mut speed) = (from.position, fixed::float(from.velocity));
    for knot in knots {
        let next = fixed::float(knot.velocity);
        if speed * next < 0.0 {
            let until_rest = 0.5 * knot.cycles as f32 * speed / (speed - next);
            return Some(position.wrapping_add(fixed::fixed(speed * until_rest)));
        }
        (position, speed) = (knot.position, next);
    }
    None
}

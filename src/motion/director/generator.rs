//! Set-point generators: a sine, a table, way-points with blends.

use super::format::{Generator, Kind, members, within};
use crate::motion::AxisConfig;
use crate::motion::fixed::{self, ceil};
use crate::motion::path::Knot;
use crate::motion::program::{AxisMove, Limit, PlanError};
use crate::motion::scale::Scale;

/// Pieces of a period of a sine: between two, a cubic is off by 4e-7 of the
/// amplitude.
const PIECES: u32 = 64;
/// Numbers of each axis of way-points: velocity and acceleration.
const HEAD: usize = 2;
/// Blends are at least so long, and even.
const BLEND_MIN: u32 = 2;

/// The sine and cosine of `k / n` of a turn, to 1e-7.
fn sin_cos(k: u32, n: u32) -> (f32, f32) {
    const QUARTERS: u32 = 4;
    let k = k % n * QUARTERS;
    let (quarter, rest) = (k / n, (k % n) as f32 / n as f32);
    let (sine, cosine) = (quarter_sine(rest), quarter_sine(1.0 - rest));
    match quarter {
        0 => (sine, cosine),
        1 => (cosine, -sine),
        2 => (-sine, -cosine),
        _ => (-cosine, sine),
    }
}

/// The sine of `x` quarters of a turn, 0 .. 1: the first terms of its series.
fn quarter_sine(x: f32) -> f32 {
    const TERMS: [f32; 6] = [
        -3.598_843e-6,
        1.604_411_8e-4,
        -4.681_754e-3,
        7.969_262_6e-2,
        -6.459_641e-1,
        core::f32::consts::FRAC_PI_2,
    ];
    let square = x * x;
    x * TERMS.iter().fold(0.0, |sum, term| sum * square + term)
}

/// Turns of a sine in a cycle, as an angle.
fn angle(generator: &Generator<'_>) -> f32 {
    core::f32::consts::TAU / (f32::from(generator.points) * f32::from(generator.cycles))
}

/// The limits of an axis against what a generator asks of it, as far as that does
/// not depend on where the axis is.
pub(super) fn check(
    generator: &Generator<'_>,
    member: usize,
    axis: u8,
    limits: &AxisConfig,
    scale: Scale,
) -> Result<(), PlanError> {
    let speed = |velocity: f32| {
        let rpm = scale.rpm(velocity);
        within(axis, Limit::Velocity, rpm, limits.velocity_max)
    };
    let slope = |acceleration: f32| {
        let slope = scale.rpm_per_s(acceleration);
        within(axis, Limit::Acceleration, slope, limits.acceleration_max)
    };
    match generator.kind {
        Kind::Sine => {
            let (amplitude, angle) = (generator.number(member) as f32, angle(generator));
            speed(amplitude * angle)?;
            slope(amplitude * angle * angle)
        }
        Kind::Table => {
            let cycles = f32::from(generator.cycles);
            let mut from = (0, 0.0);
            for point in 0..generator.points {
                let to = table(generator, member, point);
                let way = to.0.wrapping_sub(from.0) as f32 / cycles;
                let ends = 2.0 * (from.1 + to.1);
                // The cubic is steepest at its ends, and fastest there or between.
                slope((6.0 * way - ends - 2.0 * from.1) / cycles)?;
                slope((6.0 * way - ends - 2.0 * to.1) / cycles)?;
                speed(to.1)?;
                speed(1.5 * way - 0.125 * ends)?;
                from = to;
            }
            Ok(())
        }
        Kind::Points => {
            let part = |target| AxisMove {
                target,
                velocity: generator.number(HEAD * member) as u32,
                acceleration: generator.number(HEAD * member + 1) as u32,
                deceleration: generator.number(HEAD * member + 1) as u32,
                set: 0,
            };
            (0..generator.points).try_for_each(|point| {
                let target = way_point(generator, member, point);
                part(target).keeps(axis, limits, true)
            })
        }
    }
}

/// A point of a table: increments from the start, and increments per cycle.
fn table(generator: &Generator<'_>, member: usize, point: u16) -> (i32, f32) {
    let at = |point: u16| {
        let place = usize::from(point) * generator.members() + member;
        generator.number(place)
    };
    let before = if point == 0 { 0 } else { at(point - 1) };
    let slope = if point + 1 >= generator.points {
        0.0
    } else {
        let both = f32::from(generator.cycles) * 2.0;
        at(point + 1).wrapping_sub(before) as f32 / both
    };
    (at(point), slope)
}

/// A way-point: increments from home.
fn way_point(generator: &Generator<'_>, member: usize, point: u16) -> i32 {
    let axes = generator.members();
    generator.number(axes * (HEAD + usize::from(point)) + member)
}

/// The steepest slope of an axis in rpm/s, if the generator tells.
pub(super) fn slope(generator: &Generator<'_>, member: usize, scale: Scale) -> Option<f32> {
    match generator.kind {
        Kind::Sine => {
            let angle = angle(generator);
            Some(scale.rpm_per_s((generator.number(member) as f32 * angle * angle).abs()))
        }
        Kind::Table => None,
        Kind::Points => Some(generator.number(HEAD * member + 1) as f32),
    }
}

/// How far an axis comes from where it begins, both ways.
pub(super) fn reach(generator: &Generator<'_>, member: usize) -> [i32; 2] {
    match generator.kind {
        Kind::Sine => [0, generator.number(member).saturating_mul(2)],
        Kind::Table => {
            let ways = (0..generator.points).map(|point| table(generator, member, point).0);
            ways.fold([0, 0], |[low, high], way| [low.min(way), high.max(way)])
        }
        // They count from home, and were checked.
        Kind::Points => [0, 0],
    }
}

/// How a generator runs: the same for all of its axes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Run {
    /// Which knot comes next.
    pub(super) knot: u32,
    /// Cycles of each blend.
    blend: u32,
}

/// Where an axis of a generator begins, and what it is told about it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Begin {
    /// Increments of 6064h.
    pub(super) from: i32,
    /// Its home.
    pub(super) home: i32,
}

impl Run {
    /// From the beginning.
    pub(super) fn new(
        generator: &Generator<'_>,
        begin: &[Begin],
        scale: &dyn Fn(usize) -> Scale,
    ) -> Run {
        let mut run = Run::default();
        if generator.kind == Kind::Points {
            run.blend = BLEND_MIN;
            while let longer @ 1.. = run.blend_that_lacks(generator, begin, scale) {
                run.blend = longer;
            }
        }
        run
    }

    /// How long the blends have to be, if longer than they are; else 0.
    fn blend_that_lacks(
        &self,
        generator: &Generator<'_>,
        begin: &[Begin],
        scale: &dyn Fn(usize) -> Scale,
    ) -> u32 {
        let mut needed = 0;
        for corner in 0..=generator.points {
            for (axis, member) in members(generator.axes) {
                let speed = |leg| {
                    let cycles = self.leg_cycles(generator, begin, scale, leg);
                    way(generator, begin, axis, member, leg) / cycles.max(1) as f32
                };
                let before = if corner == 0 { 0.0 } else { speed(corner - 1) };
                let after = if corner == generator.points {
                    0.0
                } else {
                    speed(corner)
                };
                let most = scale(axis).acceleration(generator.number(HEAD * member + 1) as f32);
                needed = ceil((after - before).abs() / most).max(needed);
            }
        }
        if needed > self.blend {
            needed.next_multiple_of(BLEND_MIN)
        } else {
            0
        }
    }

    /// Cycles from one way-point to the next, for the slowest axis.
    fn leg_cycles(
        &self,
        generator: &Generator<'_>,
        begin: &[Begin],
        scale: &dyn Fn(usize) -> Scale,
        leg: u16,
    ) -> u32 {
        members(generator.axes).fold(self.blend, |cycles, (axis, member)| {
            let most = scale(axis).velocity(generator.number(HEAD * member) as f32);
            let way = way(generator, begin, axis, member, leg);
            cycles.max(ceil(way.abs() / most))
        })
    }

    /// The next knot of an axis; `None`: the last was before.
    pub(super) fn next(
        &self,
        generator: &Generator<'_>,
        begin: &[Begin],
        scale: &dyn Fn(usize) -> Scale,
        axis: usize,
        member: usize,
    ) -> Option<Knot> {
        let k = self.knot;
        let from = begin.get(axis).map_or(0, |begin| begin.from);
        let points = u32::from(generator.points);
        let cycles = u32::from(generator.cycles);
        match generator.kind {
            Kind::Sine => {
                let span = points.div_ceil(PIECES);
                let last = points * u32::from(generator.periods);
                let before = k * span;
                let at = last.min(before + span);
                let amplitude = generator.number(member) as f32;
                let (sine, cosine) = if at == last {
                    (0.0, 1.0)
                } else {
                    sin_cos(at, points)
                };
                let offset = fixed::fixed(amplitude * (1.0 - cosine));
                (before < last).then(|| Knot {
                    cycles: (at - before) * cycles,
                    position: fixed::whole(from).wrapping_add(offset),
                    velocity: fixed::fixed(amplitude * angle(generator) * sine),
                })
            }
            Kind::Table => (k < points).then(|| {
                let (offset, velocity) = table(generator, member, k as u16);
                Knot {
                    cycles,
                    position: fixed::whole(from.wrapping_add(offset)),
                    velocity: fixed::fixed(velocity),
                }
            }),
            Kind::Points => {
                // Blend, straight, blend, straight, ..., blend.
                let leg = (k / 2) as u16;
                let straight = k % 2 == 1;
                if k > 2 * points {
                    return None;
                }
                let to = place(generator, begin, axis, member, leg);
                if leg == generator.points {
                    return Some(Knot {
                        cycles: self.blend,
                        position: fixed::whole(to),
                        velocity: 0,
                    });
                }
                let cycles = self.leg_cycles(generator, begin, scale, leg);
                let way = place(generator, begin, axis, member, leg + 1).wrapping_sub(to);
                let velocity = fixed::div(fixed::whole(way), cycles);
                let half = velocity.wrapping_mul(i64::from(self.blend / 2));
                Some(if straight {
                    Knot {
                        cycles: cycles - self.blend,
                        position: fixed::whole(to.wrapping_add(way)).wrapping_sub(half),
                        velocity,
                    }
                } else {
                    Knot {
                        cycles: self.blend,
                        position: fixed::whole(to).wrapping_add(half),
                        velocity,
                    }
                })
            }
        }
    }
}

/// Where the leg of that number begins: the first where the axis is.
fn place(generator: &Generator<'_>, begin: &[Begin], axis: usize, member: usize, leg: u16) -> i32 {
    let begin = begin.get(axis).copied().unwrap_or_default();
    match leg.checked_sub(1) {
        None => begin.from,
        Some(point) => begin.home.wrapping_add(way_point(generator, member, point)),
    }
}

/// Increments of a leg.
fn way(generator: &Generator<'_>, begin: &[Begin], axis: usize, member: usize, leg: u16) -> f32 {
    let from = place(generator, begin, axis, member, leg);
    place(generator, begin, axis, member, leg + 1).wrapping_sub(from) as f32
}

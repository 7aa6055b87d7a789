//! Paths as points with cubics between them: sines, trapezoids, tables, way-points.

use std::f64::consts::TAU;

use super::{Member, Path, Point};

/// Points of a period of a sine at most: the cubic between two is off by 4e-8 of the
/// amplitude, then.
const PIECES: u32 = 64;
/// As near to the sine the points have to be, in increments.
const NEAR: f64 = 1.0 / 16.0;
/// A cubic over the angle h is off by h^4 / 384.
const CUBIC: f64 = 384.0;
/// A shape of this height, times an amplitude, is as many increments as the
/// amplitude has 2^-2.
const UNIT: i32 = 1 << 30;
const UNIT_AMPLITUDE: i32 = 4;
/// The largest amplitude: four times as much is a number of 32 bits.
pub(super) const AMPLITUDE_MAX: i64 = (1 << 28) - 1;
/// Most cycles from one point to the next.
const CYCLES_MAX: u32 = u16::MAX as u32;

/// Where the members of a path begin, and how far they go.
pub(super) struct Begin {
    pub(super) axis: usize,
    /// Increments.
    pub(super) amplitude: i64,
}

/// One shape for all, from where they are.
fn shared(members: &[Begin], times: i32, periods: u16, points: Vec<Point>) -> Path {
    let member = |begin: &Begin| Member {
        axis: begin.axis,
        amplitude: begin.amplitude as i32 * times,
        begin: 0,
    };
    Path {
        relative: true,
        flying: false,
        periods,
        shared: true,
        members: members.iter().map(member).collect(),
        points,
    }
}

/// A point more; a longer time than a point can have is made of several, if
/// nothing moves.
fn rest(points: &mut Vec<Point>, cycles: u32, at: &[i32]) {
    let mut left = cycles;
    while left > 0 {
        let now = left.min(CYCLES_MAX);
        points.push(Point {
            cycles: now as u16,
            shapes: at.iter().map(|at| (*at, 0)).collect(),
        });
        left -= now;
    }
}

/// A sine of the velocity: from rest, between the start and twice the amplitude,
/// whole periods of so many cycles.
pub(super) fn sine(members: &[Begin], cycles: u32, periods: u16) -> Path {
    let farthest = members.iter().map(|m| m.amplitude.unsigned_abs()).max();
    let farthest = farthest.unwrap_or(0) as f64;
    let off = |pieces: u32| farthest * (TAU / f64::from(pieces)).powi(4) / CUBIC;
    let most = PIECES.min(cycles).max(1);
    let longest = cycles.div_ceil(CYCLES_MAX).max(1);
    let mut pieces = most.min(8).max(longest);
    while pieces < most && off(pieces) > NEAR {
        // Even, so that one ends farthest away.
        pieces += 2;
    }
    // The height is 2, so that a unit of it is half as much.
    let height = f64::from(UNIT / 2);
    let step = TAU / f64::from(cycles);
    let at = |piece: u32| (u64::from(piece) * u64::from(cycles) / u64::from(pieces)) as u32;
    let points = (1..=pieces).map(|piece| {
        let angle = step * f64::from(at(piece));
        let shape = if piece == pieces {
            (0, 0)
        } else {
            let position = height * (1.0 - angle.cos());
            (
                position.round() as i32,
                (height * step * angle.sin()).round() as i32,
            )
        };
        Point {
            cycles: (at(piece) - at(piece - 1)) as u16,
            shapes: vec![shape],
        }
    });
    shared(members, 2 * UNIT_AMPLITUDE, periods, points.collect())
}

/// There and back with a trapezoid of the velocity each: cycles of a ramp, at
/// constant speed, at rest.
pub(super) fn trapezoid(members: &[Begin], phases: [u32; 3], periods: u16) -> Path {
    let [ramp, speed, at_rest] = phases;
    let whole = f64::from(UNIT);
    let velocity = whole / f64::from(ramp + speed);
    let round = |x: f64| x.round() as i32;
    let mut points = Vec::new();
    for (from, to) in [(0.0, whole), (whole, 0.0)] {
        let way: f64 = if from < to { 1.0 } else { -1.0 };
        let ramped = velocity * f64::from(ramp) / 2.0;
        let mut point = |cycles: u32, position: f64, velocity: f64| {
            if cycles > 0 {
                points.push(Point {
                    cycles: cycles as u16,
                    shapes: vec![(round(position), round(velocity))],
                });
            }
        };
        point(ramp, from + way * ramped, way * velocity);
        point(speed, to - way * ramped, way * velocity);
        point(ramp, to, 0.0);
        rest(&mut points, at_rest, &[round(to)]);
    }
    shared(members, UNIT_AMPLITUDE, periods, points)
}

/// What a path of its own for each member is made of: cycles, and of each member
/// its position from the begin, and its velocity.
pub(super) type Knot = (u32, Vec<(f64, f64)>);

/// Shapes of their own: as fine as the farthest point lets them be. `None`: too far
/// or too fast for the numbers.
pub(super) fn own(axes: &[usize], begins: &[i32], knots: &[Knot]) -> Option<Path> {
    let mut members = Vec::new();
    let mut fine = Vec::new();
    for (member, (axis, begin)) in axes.iter().zip(begins).enumerate() {
        let of = |(_, all): &Knot| all.get(member).copied().unwrap_or_default();
        let farthest = knots.iter().map(|knot| {
            let (position, velocity) = of(knot);
            position.abs().max(velocity.abs())
        });
        let farthest = farthest.fold(1.0, f64::max);
        let bits = (farthest.log2().ceil() as u32).checked_add(2)?;
        if bits > 30 {
            return None;
        }
        members.push(Member {
            axis: *axis,
            amplitude: 1 << bits,
            begin: *begin,
        });
        fine.push((1u64 << (u32::BITS - bits)) as f64);
    }
    let points = knots.iter().map(|(cycles, all)| {
        let shapes = all.iter().zip(&fine).map(|((position, velocity), fine)| {
            (
                (position * fine).round() as i32,
                (velocity * fine).round() as i32,
            )
        });
        Some(Point {
            cycles: u16::try_from(*cycles).ok()?,
            shapes: shapes.collect(),
        })
    });
    Some(Path {
        relative: false,
        flying: false,
        periods: 1,
        shared: false,
        members,
        points: points.collect::<Option<_>>()?,
    })
}

/// The points of a table at equal distances of time, from where the axes are; the
/// slope at each follows from its neighbours, and at the end is 0.
pub(super) fn table(rows: &[Vec<i64>], cycles: u32) -> Vec<Knot> {
    let at = |row: usize, member: usize| {
        let row = row.checked_sub(1).and_then(|row| rows.get(row));
        row.and_then(|row| row.get(member))
            .map_or(0.0, |x| *x as f64)
    };
    let knot = |row: usize, values: &Vec<i64>| {
        let slope = |member: usize| {
            if row == rows.len() {
                return 0.0;
            }
            (at(row + 1, member) - at(row - 1, member)) / (2.0 * f64::from(cycles))
        };
        let members = 0..values.len();
        (cycles, members.map(|m| (at(row, m), slope(m))).collect())
    };
    rows.iter()
        .enumerate()
        .map(|(n, row)| knot(n + 1, row))
        .collect()
}

/// Way-points from where the axes are: straight lines at constant speed, the slowest
/// axis deciding, and at each corner a parabola that begins before it and ends as
/// long behind it. `limits`: increments per cycle, and per cycle squared.
pub(super) fn way_points(rows: &[Vec<i64>], limits: &[(f64, f64)]) -> Vec<Knot> {
    let legs = rows.len();
    let axes = limits.len();
    let place = |row: usize, axis: usize| {
        let row = row.checked_sub(1).and_then(|row| rows.get(row));
        row.and_then(|row| row.get(axis)).map_or(0.0, |x| *x as f64)
    };
    let way = |leg: usize, axis: usize| place(leg + 1, axis) - place(leg, axis);
    // Cycles of each leg from corner to corner, and of the blend at each corner.
    let mut times: Vec<f64> = (0..legs)
        .map(|leg| {
            let least = (0..axes).map(|axis| way(leg, axis).abs() / limits[axis].0);
            least.fold(1.0, f64::max).ceil()
        })
        .collect();
    let mut blends = vec![0.0f64; legs + 1];
    loop {
        let speed = |leg: Option<usize>, axis: usize| match leg.filter(|leg| *leg < legs) {
            Some(leg) => way(leg, axis) / times[leg],
            None => 0.0,
        };
        for (corner, blend) in blends.iter_mut().enumerate() {
            let needed = (0..axes).map(|axis| {
                let change = speed(Some(corner), axis) - speed(corner.checked_sub(1), axis);
                change.abs() / limits[axis].1
            });
            // Even, so that the corner is in the middle of it.
            *blend = 2.0 * (needed.fold(1.0, f64::max) / 2.0).ceil();
        }
        let mut longer = false;
        for (leg, time) in times.iter_mut().enumerate() {
            let needed = (blends[leg] + blends[leg + 1]) / 2.0;
            if *time < needed {
                *time = (*time + 1.0).max((*time * 1.01).ceil());
                longer = true;
            }
        }
        if !longer {
            break;
        }
    }
    let mut knots = Vec::new();
    for corner in 0..=legs {
        let velocity = |leg: usize, axis: usize| {
            if leg < legs {
                way(leg, axis) / times[leg]
            } else {
                0.0
            }
        };
        let half = blends[corner] / 2.0;
        let after = |axis: usize| {
            let velocity = velocity(corner, axis);
            (place(corner, axis) + velocity * half, velocity)
        };
        knots.push((blends[corner] as u32, (0..axes).map(after).collect()));
        if corner < legs {
            let straight = times[corner] - half - blends[corner + 1] / 2.0;
            let before = |axis: usize| {
                let velocity = velocity(corner, axis);
                let end = place(corner + 1, axis) - velocity * blends[corner + 1] / 2.0;
                (end, velocity)
            };
            if straight > 0.0 {
                knots.push((straight as u32, (0..axes).map(before).collect()));
            }
        }
    }
    split(knots)
}

/// Pieces of constant speed that are longer than a point can be, in several.
fn split(knots: Vec<Knot>) -> Vec<Knot> {
    let mut out: Vec<Knot> = Vec::new();
    for (mut cycles, all) in knots {
        while cycles > CYCLES_MAX {
            let left = f64::from(cycles - CYCLES_MAX);
            let at = all
                .iter()
                .map(|(at, velocity)| (at - velocity * left, *velocity));
            out.push((CYCLES_MAX, at.collect()));
            cycles -= CYCLES_MAX;
        }
        out.push((cycles, all));
    }
    out
}

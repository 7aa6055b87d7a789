//! Plans, and the paths that they make: limits, arrivals, continuity.

use canmaster::motion::path::{Knot, Path, Point};
use canmaster::motion::plan::{self, Knots, Leg};
use proptest::prelude::*;

const ONE: f64 = 4_294_967_296.0;

fn planned(legs: &[Option<Leg>]) -> (u32, Vec<Knots>) {
    let mut legs: Vec<Leg> = legs.iter().cloned().map(or_none).collect();
    plan::plan(&mut legs).unwrap();
    let cycles = |leg: &Leg| leg.knots.iter().map(|knot| knot.cycles).sum();
    let longest = legs
        .iter()
        .filter(|leg| leg.set.is_some())
        .map(cycles)
        .max();
    let knots = legs.into_iter().map(|leg| leg.knots);
    (longest.unwrap_or(0), knots.collect())
}

fn or_none(leg: Option<Leg>) -> Leg {
    leg.unwrap_or(Leg::ZERO)
}

fn path(from: Point, knots: &[Knot]) -> Path {
    let mut path = Path::new(&from);
    for knot in knots {
        path.push(knot, false);
    }
    path
}

/// All points of a path, the first included, in increments and cycles.
fn points(from: Point, knots: &[Knot]) -> Vec<(f64, f64, f64)> {
    let mut path = path(from, knots);
    let mut all = Vec::new();
    // Summed exactly.
    let mut whole = 0i64;
    let mut last = from.position;
    // Its first piece begins with the first step.
    let mut speed = from.velocity as f64 / ONE;
    all.push((0.0, speed, f64::from(from.acceleration)));
    loop {
        let point = path.advance();
        whole += point.position.wrapping_sub(last);
        last = point.position;
        speed = point.velocity as f64 / ONE;
        all.push((whole as f64 / ONE, speed, f64::from(point.acceleration)));
        if path.is_over() {
            assert!(!path.is_dry());
            return all;
        }
    }
}

fn leg(way: i32, velocity: f32, acceleration: f32, deceleration: f32) -> Leg {
    Leg {
        from: Point::at_rest(1000),
        target: 1000i32.wrapping_add(way),
        velocity,
        acceleration,
        deceleration,
        set: Some(0),
        ..Leg::ZERO
    }
}

/// Checks one leg's points against its limits and its end.
fn check(leg: &Leg, points: &[(f64, f64, f64)], cycles: u32) {
    assert_eq!(points.len() as u32, cycles + 1, "{leg:?}");
    let way = f64::from(leg.target) * ONE - leg.from.position as f64;
    let (end, speed, slope) = *points.last().unwrap();
    assert!((end - way / ONE).abs() < 1e-6, "{end} {leg:?}");
    assert_eq!((speed, slope), (0.0, 0.0));
    let first = (leg.from.velocity as f64 / ONE).abs();
    let steepest = f64::from(leg.acceleration.max(leg.deceleration)) * 1.001 + 1e-5;
    let jerk = f64::from(leg.jerk);
    for pair in points.windows(2) {
        let [(p0, v0, a0), (p1, v1, a1)] = [pair[0], pair[1]];
        let fastest = f64::from(leg.velocity).max(first) * 1.001 + 0.05;
        assert!(v1.abs() <= fastest, "{v1} {leg:?}");
        assert!((v1 - v0).abs() <= steepest, "{v0} {v1} {leg:?}");
        // The way of a cycle is that of its velocities.
        assert!(
            (p1 - p0 - 0.5 * (v0 + v1)).abs() <= steepest + 0.1,
            "{leg:?}"
        );
        if jerk > 0.0 {
            // A piece that bends by less than 1/64 increment is a ramp: from 3/64
            // increments/cycle^2 to 0 in two cycles or more.
            let ramp = if a0.abs() < 3.0 / 64.0 { a0.abs() } else { 0.0 };
            let most = jerk * 1.01 + 1e-4 + ramp;
            assert!((a1 - a0).abs() <= most, "{a0} {a1} {leg:?}");
        }
    }
}

#[test]
fn a_trapezoid_in_whole_cycles() {
    let leg = leg(40_000, 400.0, 5.0, 2.5);
    let (cycles, knots) = planned(&[Some(leg.clone())]);
    // 80 up, 160 down, and 40 000 - 48 000 / 2 at 400: no less.
    assert!((219..=222).contains(&cycles) || cycles == 220, "{cycles}");
    assert_eq!(knots[0].len(), 3);
    check(&leg, &points(leg.from, &knots[0]), cycles);
}

#[test]
fn nothing_to_do_takes_two_cycles() {
    let leg = leg(0, 1.0, 1.0, 1.0);
    let (cycles, knots) = planned(&[Some(leg.clone()), None]);
    assert_eq!(cycles, 2);
    assert!(
        points(leg.from, &knots[0])
            .iter()
            .all(|point| *point == (0.0, 0.0, 0.0))
    );
    assert!(knots[1].is_empty());
}

#[test]
fn one_increment_as_slow_as_may_be() {
    for way in [1, -1, 2] {
        let leg = leg(way, 0.001, 0.000_01, 0.000_01);
        let (cycles, knots) = planned(&[Some(leg.clone())]);
        check(&leg, &points(leg.from, &knots[0]), cycles);
    }
}

#[test]
fn what_takes_too_long_is_named() {
    let slow = leg(i32::MAX, 0.001, 1.0, 1.0);
    assert_eq!(plan::plan(&mut [Leg::ZERO, slow]), Err(1));
    // 2^22 cycles at most.
    assert_eq!(plan::plan(&mut [leg(1 << 30, 200.0, 1.0, 1.0)]), Err(0));
    let (cycles, _) = planned(&[Some(leg(830_000_000, 200.0, 1.0, 1.0))]);
    assert!((4_150_000..=4_150_200).contains(&cycles), "{cycles}");
}

#[test]
fn a_billion_increments_there_and_back_do_not_drift() {
    let mut at = Point::at_rest(0);
    for target in [1_000_000_000, -1_000_000_000, 1_000_000_000, 0] {
        let leg = Leg {
            from: at,
            target,
            ..leg(0, 4000.0, 7.0, 3.0)
        };
        let (cycles, knots) = planned(&[Some(leg.clone())]);
        let mut path = path(at, &knots[0]);
        let mut last = at;
        for _ in 0..cycles {
            let point = path.advance();
            let way = point.position.wrapping_sub(last.position) as f64 / ONE;
            assert!(way.abs() < 4001.0 && (way - last.velocity as f64 / ONE).abs() < 8.0);
            last = point;
        }
        assert!(path.is_over() && last == Point::at_rest(target));
        at = last;
    }
}

#[test]
fn the_shorter_way_around_the_wrap() {
    let leg = Leg {
        from: Point::at_rest(i32::MAX - 10),
        target: i32::MIN + 10,
        ..leg(0, 5.0, 1.0, 1.0)
    };
    let (cycles, knots) = planned(&[Some(leg.clone())]);
    let last = points(leg.from, &knots[0]);
    assert_eq!(last.len() as u32, cycles + 1);
    assert!((last[cycles as usize].0 - 21.0).abs() < 1e-6);
}

/// A ramp is a ramp: one acceleration, no bend.
#[test]
fn ramps_have_one_acceleration() {
    let leg = leg(1_000_000, 600.0, 3.3, 2.2);
    let (_, knots) = planned(&[Some(leg.clone())]);
    let all = points(leg.from, &knots[0]);
    let up = knots[0][0].cycles as usize;
    assert!(all[1..up].windows(2).all(|pair| pair[0].2 == pair[1].2));
    let cruise = &all[up..up + knots[0][1].cycles as usize];
    assert!(cruise.iter().all(|point| point.2 == 0.0));
}

fn limits() -> impl Strategy<Value = (f32, f32, f32)> {
    (2.0f32..2000.0, 0.01f32..60.0, 0.01f32..60.0)
}

fn any_leg() -> impl Strategy<Value = Leg> {
    (-3_000_000i32..3_000_000, limits(), 0u8..2).prop_map(|(way, (v, a, d), set)| Leg {
        set: Some(set),
        ..leg(way, v, a, d)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn from_rest_every_limit_is_kept(legs in prop::collection::vec(any_leg(), 1..6), jerk in prop_oneof![Just(0.0f32), 0.05f32..1.0]) {
        let legs: Vec<_> = legs
            .into_iter()
            .map(|leg| Some(Leg { jerk: jerk * leg.acceleration.min(leg.deceleration), ..leg }))
            .collect();
        let (_, knots) = planned(&legs);
        for set in 0..2 {
            let mut lengths = Vec::new();
            for (leg, knots) in legs.iter().flatten().zip(&knots) {
                if leg.set == Some(set) {
                    let cycles: u32 = knots.iter().map(|knot| knot.cycles).sum();
                    lengths.push(cycles);
                    check(leg, &points(leg.from, knots), cycles);
                }
            }
            prop_assert!(lengths.windows(2).all(|pair| pair[0] == pair[1]), "{lengths:?}");
        }
    }

    /// From rest the legs of a set stay on a straight line.
    #[test]
    fn a_set_stays_on_a_straight_line(first in any_leg(), second in any_leg()) {
        let set = first.set;
        let legs = [Some(first), Some(Leg { set, ..second })];
        let (_, knots) = planned(&legs);
        let [a, b] = [0, 1].map(|n| points(legs[n].as_ref().unwrap().from, &knots[n]));
        let way = |n: usize| f64::from(legs[n].as_ref().unwrap().target.wrapping_sub(1000));
        for (a, b) in a.iter().zip(&b) {
            // Single precision over the way of a ramp.
            let rounding = 2.4e-7 * (way(0) * way(1)).abs();
            let most = 0.1 * (way(0).abs() + way(1).abs()) + 0.1 + rounding;
            prop_assert!((a.0 * way(1) - b.0 * way(0)).abs() <= most);
        }
    }

    /// Another target at any moment: no jump in velocity, the limits are kept, and
    /// all arrive together.
    #[test]
    fn a_move_is_replaced_without_a_jump(
        first in prop::collection::vec(any_leg(), 2..5),
        targets in prop::collection::vec(-200_000i32..200_000, 5),
        at in 0.0f64..1.0,
        jerk in prop_oneof![Just(0.0f32), 0.05f32..1.0],
    ) {
        let first: Vec<_> = first
            .into_iter()
            .map(|leg| Some(Leg { jerk: jerk * leg.acceleration.min(leg.deceleration), set: Some(0), ..leg }))
            .collect();
        let (cycles, knots) = planned(&first);
        let when = (f64::from(cycles) * at) as u32;
        prop_assume!(when > 0);
        let mut second = Vec::new();
        for ((leg, knots), target) in first.iter().flatten().zip(&knots).zip(&targets) {
            let mut path = path(leg.from, knots);
            let mut from = leg.from;
            for _ in 0..when {
                from = path.advance();
            }
            second.push(Some(Leg { from, target: *target, ..leg.clone() }));
        }
        let (cycles, knots) = planned(&second);
        for (leg, knots) in second.iter().flatten().zip(&knots) {
            check(leg, &points(leg.from, knots), cycles);
        }
    }
}

/// What an announced path does at its first step: it goes on from where the old
/// one is.
#[test]
fn the_announced_path_takes_over_in_its_step() {
    let leg = leg(100_000, 300.0, 3.0, 3.0);
    let (_, knots) = planned(&[Some(leg.clone())]);
    let mut path = path(leg.from, &knots[0]);
    for _ in 0..50 {
        path.advance();
    }
    let mut ahead = path;
    let from = (0..3).map(|_| ahead.advance()).last().unwrap();
    let back = Leg {
        from,
        target: 0,
        ..leg.clone()
    };
    let (cycles, knots) = planned(&[Some(back.clone())]);
    for knot in &knots[0] {
        path.push(knot, true);
    }
    let before = (0..3).map(|_| path.advance()).last().unwrap();
    assert_eq!(before, from);
    path.cut();
    let mut speed = before.velocity as f64 / ONE;
    for _ in 0..cycles {
        let point = path.advance();
        let next = point.velocity as f64 / ONE;
        assert!((next - speed).abs() <= 3.0 * 1.001 + 1e-3);
        speed = next;
    }
    assert!(path.is_over());
    assert_eq!(path.point(), Point::at_rest(0));
}

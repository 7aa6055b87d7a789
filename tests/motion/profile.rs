//! Profiles: exact ends, limits kept, no jumps, over the wrap.

use canmaster::motion::{Limits, NotFeasible, Profile, Timing};
use proptest::prelude::*;

fn limits() -> impl Strategy<Value = Limits> {
    // At 10 ms: 3 to 15 000 rpm, 30 to 30 000 rpm/s.
    (1.0f32..5000.0, 0.1f32..100.0, 0.1f32..100.0).prop_map(|(velocity, up, down)| Limits {
        velocity,
        acceleration: up,
        deceleration: down,
    })
}

/// Single precision, in units of the value.
const RELATIVE: f32 = 1e-5;

proptest! {
    #[test]
    fn moves_keep_their_limits_and_end_exactly(
        start in any::<i32>(),
        distance in -2_000_000i32..2_000_000,
        limits in limits(),
    ) {
        let timing = Timing::shortest(distance, &limits).unwrap();
        let target = start.wrapping_add(distance);
        let profile = Profile::new(start, target, timing);
        let total = timing.total() as i32;
        for t in [-5, 0] {
            prop_assert_eq!(profile.at(t).minus(start), 0.0);
        }
        for t in [total, total + 7] {
            prop_assert_eq!(profile.at(t).minus(target), 0.0);
            prop_assert_eq!(profile.at(t).velocity, 0.0);
        }
        let sign = distance.signum() as f32;
        for t in (0..total).take(3000) {
            let (now, next) = (profile.at(t), profile.at(t + 1));
            prop_assert!(now.velocity * sign >= 0.0);
            prop_assert!(now.velocity.abs() <= limits.velocity * (1.0 + RELATIVE));
            let slope = if now.acceleration * sign >= 0.0 { limits.acceleration } else { limits.deceleration };
            prop_assert!(now.acceleration.abs() <= slope * (1.0 + RELATIVE));
            // The way is the mean velocity: no jump in position or velocity.
            let way = (next.position.wrapping_sub(now.position)) as f32 + next.fraction - now.fraction;
            let mean = (now.velocity + next.velocity) / 2.0;
            prop_assert!((way - mean).abs() < 0.6, "{} {} {}", t, way, mean);
        }
    }

    /// Nothing shorter by more than the three cycles that rounding costs.
    #[test]
    fn moves_are_not_slower_than_needed(distance in 1i32..1_000_000, limits in limits()) {
        let Limits { velocity: v, acceleration: a, deceleration: b } = limits;
        let (v, a, b, s) = (f64::from(v), f64::from(a), f64::from(b), f64::from(distance));
        let ramps = v * v / (2.0 * a) + v * v / (2.0 * b);
        let least = if s > ramps {
            v / a + v / b + (s - ramps) / v
        } else {
            let peak = (2.0 * s * a * b / (a + b)).sqrt();
            peak / a + peak / b
        };
        let total = f64::from(Timing::shortest(distance, &limits).unwrap().total());
        prop_assert!(total >= least * (1.0 - 1e-5) && total <= least * (1.0 + 1e-5) + 3.0,
            "{total} {least}");
    }

    /// Moves of one set keep their own limits with the phases of all.
    #[test]
    fn shared_phases_slow_down_only(
        one in 1i32..500_000,
        other in 1i32..500_000,
        limits_one in limits(),
        limits_other in limits(),
    ) {
        let a = Timing::shortest(one, &limits_one).unwrap();
        let b = Timing::shortest(other, &limits_other).unwrap();
        let both = a.together(b);
        for (distance, limits) in [(one, limits_one), (other, limits_other)] {
            let (up, down) = Profile::new(0, distance, both).accelerations();
            prop_assert!(up <= limits.acceleration * (1.0 + RELATIVE));
            prop_assert!(down <= limits.deceleration * (1.0 + RELATIVE));
        }
    }
}

#[test]
fn limits_that_are_no_limits_are_refused() {
    let good = Limits {
        velocity: 10.0,
        acceleration: 1.0,
        deceleration: 1.0,
    };
    for bad in [0.0, -1.0, f32::NAN] {
        for limits in [
            Limits {
                velocity: bad,
                ..good
            },
            Limits {
                acceleration: bad,
                ..good
            },
            Limits {
                deceleration: bad,
                ..good
            },
        ] {
            assert_eq!(Timing::shortest(1000, &limits), Err(NotFeasible));
        }
    }
    let slow = Limits {
        velocity: 1e-6,
        ..good
    };
    assert_eq!(Timing::shortest(i32::MAX, &slow), Err(NotFeasible));
}

#[test]
fn a_move_of_no_distance_takes_no_time() {
    let limits = Limits {
        velocity: 10.0,
        acceleration: 1.0,
        deceleration: 1.0,
    };
    let timing = Timing::shortest(0, &limits).unwrap();
    assert_eq!(timing.total(), 0);
    assert_eq!(Profile::new(5, 5, timing).at(0).position, 5);
}

//! Arrivals, and pairs that stop together, over many seeds.

use canmaster::motion::Order;
use canmaster::motion::mode::Mode;
use canmaster::motion::{AxisMove, GroupState};

use crate::compiled::pairs;
use crate::rig::{ALL, AXES, CYCLE_MS, READY, Rig};

/// Worst figures of one round trip.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    /// Distance from the target from 100 ms after the stop, increments.
    error: f64,
    /// Way beyond the target, increments.
    overshoot: f64,
    /// Time between the stops of a pair, milliseconds.
    apart_ms: f64,
}

impl Worst {
    fn and(self, other: Worst) -> Worst {
        Worst {
            error: self.error.max(other.error),
            overshoot: self.overshoot.max(other.overshoot),
            apart_ms: self.apart_ms.max(other.apart_ms),
        }
    }
}

/// The pairs of the experiment, axes counted from 0.
const PAIRS: [(usize, usize); 3] = [(0, 2), (1, 3), (4, 5)];

/// There and back, each move judged 450 ms after its arrival.
fn round_trip(rig: &mut Rig, homes: &[f64; AXES]) -> Worst {
    let mut worst = Worst::default();
    let mut from = [0.0; AXES];
    rig.released();
    for moves in pairs() {
        rig.observe_anew();
        rig.go(|n| moves[n]);
        rig.arrive(1000);
        for _ in 0..45 {
            rig.step(READY);
        }
        assert_eq!(rig.group.state(), GroupState::Moving, "{}", rig.last());
        for (n, part) in moves.iter().enumerate() {
            let target = f64::from(part.target);
            let seen = rig.observed[n];
            let error = |p: f64| (p - homes[n] - target).abs();
            let beyond = if target > from[n] {
                seen.highest - homes[n] - target
            } else {
                target - (seen.lowest - homes[n])
            };
            worst.error = worst.error.max(error(seen.low)).max(error(seen.high));
            worst.overshoot = worst.overshoot.max(beyond);
            from[n] = target;
        }
        for (a, b) in PAIRS {
            let apart = (rig.observed[a].stopped_ms - rig.observed[b].stopped_ms).abs();
            worst.apart_ms = worst.apart_ms.max(apart);
        }
    }
    rig.order(Order::Finish);
    rig.step(READY);
    assert_eq!(rig.group.state(), GroupState::Standby);
    worst
}

fn over_seeds(mode: Mode, seeds: core::ops::Range<u64>, trips: u32) -> Worst {
    let mut worst = Worst::default();
    for seed in seeds {
        let mut rig = if mode == Mode::ProfileVelocity {
            Rig::standby(seed)
        } else {
            Rig::in_mode(seed, mode)
        };
        let homes = core::array::from_fn(|n| f64::from(rig.group.view(n).unwrap().home));
        for _ in 0..trips {
            let trip = round_trip(&mut rig, &homes);
            worst = worst.and(trip);
        }
    }
    worst
}

#[test]
fn position_control_by_speed_mode_arrives_exactly_and_pairs_stop_together() {
    let worst = over_seeds(Mode::ProfileVelocity, 0..40, 2);
    println!("{worst:?}");
    assert!(worst.error <= 2.0, "{worst:?}");
    assert!(worst.overshoot <= 2.0, "{worst:?}");
    assert!(worst.apart_ms < 10.0, "{worst:?}");
}

#[test]
fn cyclic_velocity_arrives_as_well() {
    let worst = over_seeds(Mode::CyclicVelocity, 0..10, 1);
    println!("{worst:?}");
    assert!(worst.error <= 2.0, "{worst:?}");
    assert!(worst.overshoot <= 5.0, "{worst:?}");
}

/// The target 607Ah itself: the first and the last change are in the same cycle
/// for all six, and the last target is exact.
#[test]
fn in_cyclic_position_all_start_and_arrive_in_one_sync() {
    for (seed, jerk) in [(1, 0), (2, 0), (3, 20_000)] {
        let mut rig = Rig::in_mode(seed, Mode::CyclicPosition);
        rig.released();
        let homes: [i32; AXES] = core::array::from_fn(|n| rig.group.view(n).unwrap().home);
        let ways = [40_000, -7000, 123_456, 20, -99_999, 1];
        let parts = core::array::from_fn(|n| AxisMove {
            target: ways[n],
            velocity: 900,
            acceleration: 1500,
            deceleration: 1100,
            set: 0,
        });
        rig.director.go(&rig.group, ALL, &parts, jerk).unwrap();
        let mut last = rig.commands.map(|command| command.target);
        let (mut first_change, mut last_change) = ([0i32; AXES], [0i32; AXES]);
        for cycle in 1..2000i32 {
            rig.step(READY);
            for n in 0..AXES {
                let target = rig.commands[n].target;
                let way = target.wrapping_sub(last[n]);
                // 900 rpm are 300 increments a cycle.
                assert!(way.abs() <= 301, "axis {n}: {way} in {cycle}");
                if way != 0 {
                    if first_change[n] == 0 {
                        first_change[n] = cycle;
                    }
                    last_change[n] = cycle;
                }
                last[n] = target;
            }
        }
        for (n, way) in ways.iter().enumerate() {
            assert_eq!(last[n], homes[n] + way, "axis {n}");
        }
        // The long ways: the short ones move by less than half an increment at
        // their ends.
        for n in [1, 2, 4] {
            assert!(first_change[n] - first_change[0] <= 3, "{first_change:?}");
            assert!(
                last_change[0].abs_diff(last_change[n]) <= 6,
                "{last_change:?}"
            );
        }
        assert!(rig.group.all_arrived(), "{}", rig.last());
        for (drive, (home, way)) in rig.drives.iter().zip(homes.iter().zip(ways)) {
            assert!((drive.position - f64::from(home + way)).abs() <= 5.0);
        }
    }
}

/// Up to two TPDOs of an axis in a row may be missing: the axis goes on by
/// feed-forward and arrives all the same.
#[test]
fn missing_tpdos_do_not_lose_the_target() {
    for seed in 0..5 {
        let mut rig = Rig::moving(seed, 0);
        let homes: [i32; AXES] = core::array::from_fn(|n| rig.group.view(n).unwrap().home);
        rig.step(READY);
        while !rig.group.all_arrived() {
            let phase = rig.cycle % 5;
            for (n, silent) in rig.silent.iter_mut().enumerate() {
                *silent = phase as usize == n || phase as usize == n + 1;
            }
            rig.step(READY);
            assert!(f64::from(rig.cycle) * CYCLE_MS < 20_000.0, "{}", rig.last());
        }
        for (n, home) in homes.into_iter().enumerate() {
            let target = f64::from(home + crate::rig::far(n).target);
            assert!((rig.drives[n].position - target).abs() <= 3.0);
        }
    }
}

/// Another target in the middle of the motion, in every mode with a position.
#[test]
fn a_target_is_replaced_in_motion() {
    for mode in [
        Mode::ProfileVelocity,
        Mode::CyclicVelocity,
        Mode::CyclicPosition,
    ] {
        for jerk in [0, 30_000] {
            let mut rig = if mode == Mode::ProfileVelocity {
                Rig::standby(4)
            } else {
                Rig::in_mode(4, mode)
            };
            rig.released();
            let home = rig.group.view(0).unwrap().home;
            rig.go(crate::rig::far);
            for _ in 0..100 {
                rig.step(READY);
            }
            let target = |n: usize| [-5000, 90_000, 70_000, 10, 4000, 4100][n];
            let parts = core::array::from_fn(|n| AxisMove {
                target: target(n),
                set: 0,
                ..crate::rig::far(n)
            });
            rig.director.go(&rig.group, ALL, &parts, jerk).unwrap();
            let mut speed = rig.drives.each_ref().map(|drive| drive.velocity);
            rig.step(READY);
            let mut cycles = 0;
            while !rig.group.all_arrived() {
                rig.step(READY);
                cycles += 1;
                assert!(cycles < 1500, "{}", rig.last());
                for (drive, speed) in rig.drives.iter().zip(&mut speed) {
                    // 2000 rpm/s are 20 rpm in a cycle; the loop and a set-point
                    // in whole increments add some.
                    let change = (drive.velocity - *speed).abs();
                    assert!(change < 60.0, "{mode}: {change}");
                    *speed = drive.velocity;
                }
            }
            let error = rig.drives[0].position - f64::from(home + target(0));
            assert!(error.abs() <= 3.0, "{mode}: {error}");
        }
    }
}

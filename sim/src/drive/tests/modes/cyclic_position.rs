//! Cyclic synchronous position (CiA 402-2, 13).

use super::{BIT_12, BIT_13, Cyclic, at};
use crate::drive::cia402::State;
use canmaster::nmt::State as Nmt;
use std::f64::consts::TAU;

const TARGET: u32 = 0x607A_0020;

#[test]
fn the_axis_follows_a_sine_through_60c2() {
    let mut c = Cyclic::new(at(0.0), 8, TARGET, 2, 0);
    assert_eq!(c.rig.state(), State::OperationEnabled);
    assert_eq!(c.rig.bits(BIT_12), BIT_12);
    let mut worst: f64 = 0.0;
    let sine = |n: f64| 4000.0 * (1.0 - (TAU * n / 250.0).cos());
    for n in 1..=500 {
        c.set(sine(f64::from(n)).round() as i32);
        // Set with this SYNC, met with the next one: now.
        let error = c.rig.drive().truth().position_inc - sine(f64::from(n));
        worst = worst.max(error.abs());
    }
    assert!(worst < 40.0, "{worst}");
    assert_eq!(c.rig.bits(BIT_12 | BIT_13), BIT_12);
    assert!(c.rig.sent(0x081).is_empty());
    c.set(0);
    for _ in 0..100 {
        c.set(0);
    }
    assert!(c.rig.position().abs() <= 1);
}

/// How much the torque of a slow move jumps about.
fn roughness(interpolated: bool) -> f64 {
    let mut c = Cyclic::new(at(0.0), 8, TARGET, 10, 0);
    if !interpolated {
        c.rig.write(0x60C2, 1, &[0]).unwrap();
    }
    c.rig.drives[0].keep_samples();
    for n in 1..=60 {
        c.set(n * 200);
    }
    assert_eq!(c.rig.state(), State::OperationEnabled);
    let samples = c.rig.drives[0].take_samples();
    let jumps = samples.windows(2).skip(500);
    jumps
        .map(|w| (w[1].plant.torque - w[0].plant.torque).abs())
        .sum()
}

#[test]
fn without_interpolation_it_steps() {
    let (smooth, stepped) = (roughness(true), roughness(false));
    assert!(stepped > 3.0 * smooth, "{stepped} {smooth}");
}

/// 60C2h says 2 ms, the SYNC comes every 10 ms: the drive misses four of five.
#[test]
fn a_period_shorter_than_that_of_the_sync_is_8250() {
    let c = Cyclic::told(at(0.0), 8, TARGET, 10, 2, 0);
    assert_eq!(c.rig.sent(0x081), [[0x50, 0x82, 0x10, 0, 0, 0, 0, 0]]);
}

/// 60C2h says 40 ms, the SYNC comes every 10 ms: each set value is replaced on the
/// way to it, so that the axis lags behind.
#[test]
fn with_a_period_longer_than_that_of_the_sync_the_axis_lags() {
    let lag = |period| {
        let mut c = Cyclic::told(at(0.0), 8, TARGET, 10, period, 0);
        for n in 1..=50 {
            c.set(n * 200);
        }
        assert_eq!(c.rig.state(), State::OperationEnabled);
        10_000.0 - c.rig.drive().truth().position_inc
    };
    let (right, long) = (lag(10), lag(40));
    assert!(right.abs() < 40.0, "{right}");
    assert!(long > 500.0, "{long}");
}

#[test]
fn a_set_value_that_stays_away_is_8250() {
    let mut c = Cyclic::new(at(0.0), 8, TARGET, 4, 0);
    // One is missing: nothing yet.
    c.rig.run_ms(3);
    c.set(0);
    assert!(c.rig.sent(0x081).is_empty());
    c.rig.run_ms(3);
    assert!(c.rig.sent(0x081).is_empty());
    c.rig.run_ms(3);
    assert_eq!(c.rig.sent(0x081), [[0x50, 0x82, 0x10, 0, 0, 0, 0, 0]]);
    assert_eq!(c.rig.drive().status().nmt, Nmt::Operational);
    c.rig.run_ms(100);
    assert_eq!(c.rig.state(), State::Fault);
}

#[test]
fn without_a_period_nobody_waits_for_set_values() {
    let mut c = Cyclic::new(at(0.0), 8, TARGET, 4, 0);
    c.rig.write(0x60C2, 1, &[0]).unwrap();
    let state = c.rig.state();
    c.rig.run_ms(1000);
    assert_eq!((state, c.rig.state()), (c.rig.state(), state));
}

#[test]
fn a_jump_is_a_following_error() {
    let mut c = Cyclic::new(at(0.0), 8, TARGET, 2, 0);
    c.set(10_000);
    c.set(10_000);
    assert_eq!(c.rig.sent(0x081), [[0x11, 0x86, 0x80, 0, 0, 0, 0, 0]]);
    assert_eq!(c.rig.bits(BIT_13), BIT_13);
}

#[test]
fn the_position_wraps_at_32_bits_as_the_target_does() {
    let start = i32::MAX - 500;
    let mut c = Cyclic::new(at(f64::from(start)), 8, TARGET, 2, start);
    for n in 1..=100i32 {
        c.set(start.wrapping_add(n * 20));
    }
    for _ in 0..50 {
        c.set(start.wrapping_add(2000));
    }
    assert_eq!(c.rig.state(), State::OperationEnabled);
    let position = c.rig.position();
    assert!(position < 0);
    assert!(position.wrapping_sub(start.wrapping_add(2000)).abs() <= 1);
}

#[test]
fn an_old_target_moves_nothing_and_an_offset_does() {
    let mut c = Cyclic::new(at(0.0), 8, TARGET, 2, 0);
    c.rig.write32(0x60B0, 0, 0);
    assert_eq!(c.rig.state(), State::Fault, "the SDO took too long");
    let mut c = Cyclic::new(at(300.0), 8, TARGET, 100, 300);
    c.rig.write32(0x60B0, 0, 50);
    for _ in 0..5 {
        c.set(300);
    }
    assert!((c.rig.position() - 350).abs() <= 1);
}

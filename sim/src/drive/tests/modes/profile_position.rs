//! Profile position (CiA 402-2, 10).

use super::{BIT_12, BIT_13, LIMIT, REACHED, at};
use crate::drive::DriveFault;
use crate::drive::cia402::State;
use crate::drive::tests::rig::Rig;

fn enabled() -> Rig {
    let mut rig = Rig::booted(at(0.0));
    rig.enable_in(1);
    rig.run_ms(5);
    rig
}

/// Hands a set-point over: bit 4, and whatever else is in `bits`.
fn set_point(rig: &mut Rig, target: i32, bits: u16) {
    rig.write32(0x607A, 0, target.into());
    rig.controlword(0x1F | bits);
}

#[test]
fn the_handshake_of_bits_4_and_12() {
    let mut rig = enabled();
    assert_eq!(rig.bits(BIT_12 | REACHED), REACHED, "it rests");
    rig.write32(0x607A, 0, 20_000);
    rig.run_ms(100);
    assert_eq!(rig.position(), 0, "the target alone moves nothing");
    rig.controlword(0x1F);
    assert_eq!(rig.bits(BIT_12 | REACHED), BIT_12);
    rig.run_ms(50);
    assert_eq!(rig.bits(BIT_12), BIT_12, "as long as bit 4 is set");
    rig.controlword(0x0F);
    assert_eq!(rig.bits(BIT_12), 0);
    assert!(rig.position() > 100, "it moves on");
    rig.run_ms(1500);
    assert_eq!(rig.bits(BIT_12 | REACHED | BIT_13 | LIMIT), REACHED);
    assert!((rig.position() - 20_000).abs() <= 1, "{}", rig.position());
    // The same target once more is a set-point of its own.
    rig.controlword(0x1F);
    assert_eq!(rig.bits(BIT_12), BIT_12);
}

#[test]
fn speed_and_ramps_are_those_of_6081_6083_and_6084() {
    let mut rig = enabled();
    rig.write32(0x6081, 0, 600);
    rig.write32(0x6083, 0, 2000);
    rig.write32(0x6084, 0, 4000);
    rig.drives[0].keep_samples();
    set_point(&mut rig, -60_000, 0);
    rig.run_ms(4000);
    let samples = rig.drives[0].take_samples();
    let speeds: Vec<_> = samples.iter().map(|s| -s.plant.velocity_rpm).collect();
    let fastest = speeds.iter().fold(0.0, |a: f64, b| a.max(*b));
    assert!((595.0..610.0).contains(&fastest), "{fastest}");
    // When the speed passes `rpm`, upwards or downwards.
    let passes = |rpm: f64, upwards: bool| {
        let passed = |w: &[f64]| (w[0] < rpm, w[1] < rpm) == (upwards, !upwards);
        speeds.windows(2).position(passed).unwrap() as f64 * 0.0004
    };
    let time = |from: f64, to: f64| passes(to, to > from) - passes(from, to > from);
    assert!((time(100.0, 500.0) - 0.2).abs() < 0.01);
    assert!((time(500.0, 100.0) - 0.1).abs() < 0.01);
    let farthest = samples.iter().map(|s| s.plant.position_inc);
    let farthest = farthest.fold(0.0, f64::min);
    assert!(farthest > -60_003.0, "no overshoot: {farthest}");
    assert!((rig.position() + 60_000).abs() <= 1);
}

#[test]
fn a_set_point_waits_for_the_end_of_the_running_move() {
    let mut rig = enabled();
    set_point(&mut rig, 10_000, 0);
    rig.controlword(0x0F);
    set_point(&mut rig, -5000, 0);
    rig.controlword(0x0F);
    rig.run_ms(5);
    assert_eq!(rig.bits(BIT_12), BIT_12, "the buffer is full");
    set_point(&mut rig, 777, 0);
    rig.controlword(0x0F);
    let mut farthest = 0;
    for _ in 0..400 {
        rig.run_ms(5);
        farthest = farthest.max(rig.position());
    }
    assert!((farthest - 10_000).abs() <= 3, "{farthest}");
    assert!(
        (rig.position() + 5000).abs() <= 1,
        "the third was not taken"
    );
    assert_eq!(rig.bits(BIT_12 | REACHED), REACHED);
}

#[test]
fn change_immediately_replaces_the_running_move() {
    let mut rig = enabled();
    set_point(&mut rig, 100_000, 0);
    rig.run_ms(300);
    rig.controlword(0x0F);
    let seen = rig.position();
    assert!(seen > 3000);
    set_point(&mut rig, 1000, 1 << 5);
    rig.run_ms(1500);
    assert!((rig.position() - 1000).abs() <= 1, "{}", rig.position());
    assert_eq!(rig.bits(REACHED), REACHED);
}

#[test]
fn relative_targets_add_to_the_target_before() {
    let mut rig = enabled();
    for n in 1..=3 {
        set_point(&mut rig, 2000, 1 << 6);
        rig.controlword(0x0F);
        rig.run_ms(600);
        assert!((rig.position() - 2000 * n).abs() <= 1);
    }
    // Also to one that still waits, and at once.
    set_point(&mut rig, 5000, 1 << 6);
    rig.controlword(0x0F);
    set_point(&mut rig, -1000, 1 << 6 | 1 << 5);
    rig.run_ms(1500);
    assert!((rig.position() - 10_000).abs() <= 1, "{}", rig.position());
}

#[test]
fn halt_interrupts_the_move() {
    let mut rig = enabled();
    set_point(&mut rig, 50_000, 0);
    rig.run_ms(200);
    rig.controlword(0x010F);
    rig.run_ms(400);
    let halted = rig.position();
    assert_eq!(rig.bits(REACHED), REACHED, "stands");
    rig.run_ms(200);
    assert!((rig.position() - halted).abs() <= 1);
    rig.controlword(0x000F);
    rig.run_ms(2500);
    assert!((rig.position() - 50_000).abs() <= 1);
}

#[test]
fn endless_moves_on() {
    let mut rig = enabled();
    set_point(&mut rig, -1, 1 << 15);
    rig.run_ms(2000);
    assert!((rig.rpm() + 1000.0).abs() < 10.0);
    assert_eq!(rig.bits(REACHED), 0);
}

#[test]
fn a_set_point_counts_in_operation_enabled_only() {
    let mut rig = Rig::booted(at(0.0));
    rig.write(0x6060, 0, &[1]).unwrap();
    rig.write32(0x607A, 0, 5000);
    rig.nmt(0x01);
    for word in [0x16, 0x17, 0x1F] {
        rig.controlword(word);
    }
    rig.run_ms(200);
    assert_eq!((rig.position(), rig.bits(BIT_12)), (0, 0));
    rig.controlword(0x0F);
    rig.controlword(0x1F);
    rig.run_ms(600);
    assert!((rig.position() - 5000).abs() <= 1);
}

#[test]
fn software_limits_cut_the_target() {
    let mut rig = enabled();
    rig.write32(0x607D, 1, -3000);
    rig.write32(0x607D, 2, 4000);
    set_point(&mut rig, 9000, 0);
    rig.run_ms(800);
    assert!((rig.position() - 4000).abs() <= 1);
    assert_eq!(rig.bits(LIMIT | REACHED), LIMIT | REACHED);
    rig.controlword(0x0F);
    set_point(&mut rig, 1000, 0);
    rig.run_ms(800);
    assert_eq!(rig.bits(LIMIT), 0);
    assert_eq!(rig.state(), State::OperationEnabled);
}

#[test]
fn the_position_window_has_its_time() {
    let mut rig = enabled();
    rig.write32(0x6067, 0, 100);
    rig.write(0x6068, 0, &200u16.to_le_bytes()).unwrap();
    set_point(&mut rig, 10, 0);
    rig.run_ms(100);
    assert_eq!(rig.bits(REACHED), 0);
    rig.run_ms(150);
    assert_eq!(rig.bits(REACHED), REACHED);
}

#[test]
fn a_load_is_held_and_one_too_heavy_ends_in_8611() {
    let mut rig = enabled();
    let now = rig.now;
    rig.drives[0].inject(DriveFault::Load {
        at: now,
        permille: 400,
    });
    rig.run_ms(500);
    assert!(rig.position().abs() <= 1, "{}", rig.position());
    let torque = rig.read(0x6077, 0).unwrap() as i16;
    assert!((-460..-340).contains(&torque), "{torque}");
    rig.log.clear();
    let now = rig.now;
    rig.drives[0].inject(DriveFault::Load {
        at: now,
        permille: 2500,
    });
    rig.run_ms(200);
    assert_eq!(rig.sent(0x081), [[0x11, 0x86, 0x80, 0, 0, 0, 0, 0]]);
    assert_eq!(rig.bits(BIT_13), BIT_13);
    let window = rig.drive().status();
    assert!(window.position > 2000, "the window of 6065h");
    assert!(matches!(
        rig.state(),
        State::FaultReactionActive | State::Fault
    ));
}

#[test]
fn the_following_error_can_be_ignored() {
    let mut rig = enabled();
    rig.write32(0x6065, 0, u32::MAX.into());
    let now = rig.now;
    rig.drives[0].inject(DriveFault::Load {
        at: now,
        permille: 2500,
    });
    rig.run_ms(200);
    assert_eq!(rig.state(), State::OperationEnabled);
    assert!((rig.read(0x60F4, 0).unwrap() as i32) < -2000);
}

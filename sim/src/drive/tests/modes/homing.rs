//! Homing (CiA 402-2, 11; EPOS4 for the current threshold).

use super::{BIT_12, BIT_13, REACHED, REFERENCED, at, with};
use crate::drive::DriveConfig;
use crate::drive::cia402::State;
use crate::drive::tests::rig::Rig;
use crate::drive::travel::Travel;

/// Limit switches at both ends with hard stops behind them, a home switch in
/// between, index pulses at 700, 2700, ...
const TRAVEL: Travel = Travel {
    negative_stop: Some(-24_000.0),
    positive_stop: Some(24_000.0),
    negative_switch: Some(-20_000.0),
    positive_switch: Some(20_000.0),
    home_switch: Some((-1000.0, 1500.0)),
    index_at: 700.0,
};

fn start(config: DriveConfig, method: i8) -> Rig {
    let mut rig = Rig::booted(config);
    rig.write(0x6098, 0, &[method as u8]).unwrap();
    rig.write32(0x6099, 1, 300);
    rig.write32(0x6099, 2, 30);
    rig.enable_in(6);
    rig.run_ms(5);
    assert_eq!(rig.bits(REACHED | BIT_12 | BIT_13), REACHED, "not started");
    rig.controlword(0x1F);
    rig.run_ms(1);
    rig
}

/// Runs until bit 12 or 13, at most 30 s.
fn finish(rig: &mut Rig) {
    for _ in 0..3000 {
        if rig.bits(BIT_12 | BIT_13) != 0 || rig.state() != State::OperationEnabled {
            return;
        }
        rig.run_ms(10);
    }
    panic!("homing has no end");
}

/// Where the shaft is when the drive says that it is at zero.
fn zero(start_at: f64, method: i8) -> f64 {
    let mut rig = start(with(TRAVEL, start_at), method);
    finish(&mut rig);
    let bits = rig.bits(REACHED | BIT_12 | BIT_13 | REFERENCED);
    assert_eq!(bits, REACHED | BIT_12 | REFERENCED, "method {method}");
    rig.run_ms(200);
    let position = rig.position();
    assert!(position.abs() <= 1, "method {method}: {position}");
    rig.drive().truth().position_inc - f64::from(position)
}

#[test]
fn every_method_finds_its_zero() {
    for (method, from, expected) in [
        // Off the negative limit switch, then the index above it.
        (17, 5000.0, -20_000.0),
        (17, -20_500.0, -20_000.0),
        (1, 5000.0, -19_300.0),
        (18, 5000.0, 20_000.0),
        (2, 5000.0, 18_700.0),
        // The lower edge of the home switch; from above by way of the limit
        // switch; from on it.
        (23, -8000.0, -1000.0),
        (23, 300.0, -1000.0),
        (23, 9000.0, -1000.0),
        (7, -8000.0, -1300.0),
        // The upper edge.
        (27, 8000.0, 1500.0),
        (27, 300.0, 1500.0),
        (27, -9000.0, 1500.0),
        (11, 8000.0, 2700.0),
        // The next index.
        (33, 300.0, -1300.0),
        (34, 300.0, 700.0),
        // The hard stops, and the index off them.
        (-3, 5000.0, 24_000.0),
        (-4, 5000.0, -24_000.0),
        (-1, 5000.0, 22_700.0),
        (-2, 5000.0, -23_300.0),
        (37, 5000.0, 5000.0),
    ] {
        let found = zero(from, method);
        assert!(
            (found - expected).abs() <= 6.0,
            "method {method} from {from}: {found}, not {expected}"
        );
    }
}

#[test]
fn home_position_and_offset() {
    let mut rig = Rig::booted(with(TRAVEL, 300.0));
    rig.write32(0x30B0, 0, 12_345);
    rig.write32(0x30B1, 0, -400);
    rig.write(0x6098, 0, &[34]).unwrap();
    rig.enable_in(6);
    rig.run_ms(2);
    rig.controlword(0x1F);
    finish(&mut rig);
    rig.run_ms(200);
    assert!((rig.position() - 12_345).abs() <= 1);
    assert!((rig.drive().truth().position_inc - 300.0).abs() <= 2.0);
    // The position counts on from there in every mode.
    rig.write(0x6060, 0, &[1]).unwrap();
    rig.controlword(0x0F);
    rig.write32(0x607A, 0, 12_000);
    rig.controlword(0x1F);
    rig.run_ms(500);
    assert!((rig.position() - 12_000).abs() <= 1);
    assert_eq!(rig.bits(REFERENCED), REFERENCED);
}

#[test]
fn a_search_without_a_switch_ends_at_the_hard_stop() {
    let travel = Travel {
        positive_stop: Some(9000.0),
        ..Travel::default()
    };
    let mut rig = start(with(travel, 0.0), 18);
    finish(&mut rig);
    rig.run_ms(50);
    assert_eq!(rig.sent(0x081), [[0x11, 0x86, 0x80, 0, 0, 0, 0, 0]]);
    assert_eq!(rig.bits(REFERENCED), 0);
}

#[test]
fn a_search_without_any_end_goes_on() {
    let mut rig = start(at(0.0), 23);
    rig.run_ms(20_000);
    assert_eq!(rig.bits(REACHED | BIT_12 | BIT_13), 0);
    assert!((rig.rpm() - 300.0).abs() < 10.0);
    // Bit 4 lowered interrupts it.
    rig.controlword(0x0F);
    rig.run_ms(1000);
    assert_eq!(rig.bits(REACHED | BIT_12 | BIT_13), REACHED);
    assert!(rig.rpm().abs() < 1.0);
}

#[test]
fn two_limit_switches_and_no_home_switch_are_an_error() {
    let travel = Travel {
        home_switch: None,
        ..TRAVEL
    };
    let mut rig = start(with(travel, 0.0), 23);
    finish(&mut rig);
    rig.run_ms(1000);
    assert_eq!(rig.bits(REACHED | BIT_12 | BIT_13), REACHED | BIT_13);
    assert!(rig.rpm().abs() < 1.0);
    assert_eq!(rig.state(), State::OperationEnabled);
    // It can be tried again.
    rig.controlword(0x0F);
    rig.write(0x6098, 0, &[37]).unwrap();
    rig.controlword(0x1F);
    finish(&mut rig);
    assert_eq!(rig.bits(REACHED | BIT_12 | BIT_13), REACHED | BIT_12);
}

#[test]
fn halt_holds_the_search() {
    let mut rig = start(with(TRAVEL, 5000.0), 17);
    rig.run_ms(500);
    rig.controlword(0x011F);
    rig.run_ms(600);
    assert!(rig.rpm().abs() < 1.0);
    assert_eq!(rig.bits(REACHED | BIT_12 | BIT_13), REACHED);
    rig.controlword(0x001F);
    finish(&mut rig);
    assert_eq!(rig.bits(BIT_12), BIT_12);
}

#[test]
fn the_reference_is_lost_with_the_supply() {
    let mut rig = start(with(TRAVEL, 5000.0), 37);
    finish(&mut rig);
    assert_eq!(rig.bits(REFERENCED), REFERENCED);
    rig.controlword(0x00);
    rig.nmt(0x81);
    rig.run_ms(300);
    assert_eq!(rig.bits(REFERENCED), 0);
}

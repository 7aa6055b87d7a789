//! Software limits, limit switches, STO, and the change between modes.

use super::{BIT_12, Cyclic, REACHED, at, with};
use crate::drive::DriveFault;
use crate::drive::cia402::State;
use crate::drive::tests::rig::Rig;
use crate::drive::travel::Travel;

fn reset_and_enable(rig: &mut Rig) {
    for word in [0x00, 0x80, 0x06, 0x07, 0x0F] {
        rig.controlword(word);
    }
    assert_eq!(rig.state(), State::OperationEnabled);
}

#[test]
fn a_software_limit_is_8a82_and_the_way_back_is_free() {
    let mut c = Cyclic::new(at(0.0), 8, 0x607A_0020, 20, 0);
    c.rig.write32(0x607D, 1, -300);
    c.set(0);
    c.rig.write32(0x607D, 2, 300);
    for n in 1..=4 {
        c.set(n * 100);
    }
    assert_eq!(c.rig.sent(0x081), [[0x82, 0x8A, 0x80, 0, 0, 0, 0, 0]]);
    // Profile velocity looks at the actual position.
    let mut rig = Rig::booted(at(0.0));
    rig.write32(0x607D, 1, -5000);
    rig.write32(0x607D, 2, 5000);
    rig.enable();
    rig.target_velocity(300);
    rig.run_ms(1000);
    assert_eq!(rig.sent(0x081), [[0x82, 0x8A, 0x80, 0, 0, 0, 0, 0]]);
    assert_eq!((rig.state(), rig.rpm()), (State::Fault, 0.0));
    assert!((5000..5600).contains(&rig.position()));
    rig.log.clear();
    rig.target_velocity(-300);
    reset_and_enable(&mut rig);
    rig.run_ms(300);
    assert!(rig.position() < 5000);
    assert_eq!(rig.state(), State::OperationEnabled);
}

#[test]
fn limit_switches_are_8a80_and_8a81() {
    for (speed, code) in [(400, 0x81), (-400, 0x80)] {
        let travel = Travel {
            negative_switch: Some(-8000.0),
            positive_switch: Some(8000.0),
            ..Travel::default()
        };
        let mut rig = Rig::booted(with(travel, 0.0));
        rig.enable();
        rig.target_velocity(speed);
        rig.run_ms(400);
        assert!(rig.sent(0x081).is_empty());
        rig.run_ms(600);
        assert_eq!(rig.sent(0x081), [[code, 0x8A, 0x80, 0, 0, 0, 0, 0]]);
        assert_eq!((rig.state(), rig.rpm()), (State::Fault, 0.0));
        let expected = if speed < 0 { 0b01 } else { 0b10 };
        assert_eq!(rig.read(0x60FD, 0), Ok(expected));
        rig.target_velocity(-speed);
        reset_and_enable(&mut rig);
        rig.run_ms(500);
        assert_eq!(rig.state(), State::OperationEnabled);
        assert_eq!(rig.read(0x60FD, 0), Ok(0));
    }
}

#[test]
fn safe_torque_off_lets_the_axis_coast_until_it_is_released() {
    let mut rig = Rig::booted(at(0.0));
    rig.enable();
    rig.target_velocity(2000);
    rig.run_ms(400);
    let (now, until) = (rig.now, rig.now + crate::time::Time::from_ms(500));
    rig.drives[0].inject(DriveFault::Sto {
        at: now,
        until: Some(until),
    });
    rig.run_ms(20);
    assert_eq!(rig.sent(0x081), [[0x88, 0x8A, 0x01, 0, 0, 0, 0, 0]]);
    assert_eq!(rig.state(), State::Fault);
    assert!(rig.rpm() > 1500.0, "it coasts");
    rig.controlword(0x00);
    rig.controlword(0x80);
    assert_eq!(rig.state(), State::Fault, "not while it lasts");
    rig.run_ms(500);
    rig.target_velocity(0);
    reset_and_enable(&mut rig);
}

#[test]
fn an_axis_under_load_sinks_when_it_is_disabled() {
    let mut rig = Rig::booted(at(0.0).with(DriveFault::Load {
        at: crate::time::Time::ZERO,
        permille: -20,
    }));
    assert_eq!(rig.rpm(), 0.0, "friction holds it");
    let now = rig.now;
    rig.drives[0].inject(DriveFault::Load {
        at: now,
        permille: -300,
    });
    rig.run_ms(100);
    assert!(rig.rpm() < -100.0);
}

#[test]
fn the_mode_displayed_follows_the_mode_selected() {
    let mut rig = Rig::booted(at(0.0));
    for (mode, accepted) in [
        (1, true),
        (3, true),
        (6, true),
        (8, true),
        (9, true),
        (10, true),
        (0, false),
        (2, false),
        (4, false),
        (7, false),
        (11, false),
        (0xFF, false),
    ] {
        let before = rig.read(0x6061, 0);
        let answer = rig.write(0x6060, 0, &[mode]);
        let (expected, display) = if accepted {
            (Ok(()), Ok(mode.into()))
        } else {
            (Err(0x0609_0030), before)
        };
        assert_eq!(answer, expected, "{mode}");
        rig.run_ms(1);
        assert_eq!(rig.read(0x6061, 0), display, "{mode}");
    }
}

#[test]
fn a_mode_takes_over_an_axis_that_moves() {
    let mut rig = Rig::booted(at(0.0));
    rig.enable();
    rig.target_velocity(1000);
    rig.run_ms(300);
    // Into profile position without a set-point: to rest with 6084h.
    rig.write(0x6060, 0, &[1]).unwrap();
    rig.run_ms(30);
    assert!((300.0..990.0).contains(&rig.rpm()), "{}", rig.rpm());
    rig.run_ms(300);
    assert_eq!(rig.bits(REACHED | BIT_12), REACHED);
    let rest = rig.position();
    rig.run_ms(500);
    assert!((rig.position() - rest).abs() <= 1, "it holds its place");
    // Back: 60FFh still says 1000 rpm.
    rig.write(0x6060, 0, &[3]).unwrap();
    rig.run_ms(300);
    assert!((rig.rpm() - 1000.0).abs() < 10.0);
    assert_eq!(rig.state(), State::OperationEnabled);
    assert!(rig.sent(0x081).is_empty());
}

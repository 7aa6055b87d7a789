//! Profile velocity and the state machine, from the wire.

use super::rig::{Rig, config, quick};
use crate::drive::cia402::State;
use crate::time::Time;

fn statusword(rig: &Rig) -> u16 {
    rig.drive().status().statusword
}

#[test]
fn a_velocity_ramp_has_the_slope_of_6083() {
    let mut rig = Rig::booted(quick(1));
    rig.enable();
    rig.write(0x6083, 0, &5000u32.to_le_bytes()).unwrap();
    rig.write(0x6084, 0, &20_000u32.to_le_bytes()).unwrap();
    rig.run_ms(100);
    assert_ne!(statusword(&rig) & 1 << 12, 0, "speed is zero");
    rig.drives[0].keep_samples();
    rig.target_velocity(2000);
    rig.run_ms(600);
    let samples = rig.drives[0].take_samples();
    let crossing = |rpm: f64| {
        let found = samples.iter().find(|s| s.plant.velocity_rpm >= rpm);
        found.unwrap().at.as_us_f64()
    };
    // 500 to 1500 rpm at 5000 rpm/s: 200 ms.
    let took = crossing(1500.0) - crossing(500.0);
    assert!((198_000.0..202_000.0).contains(&took), "{took}");
    let peak = samples
        .iter()
        .map(|s| s.plant.velocity_rpm)
        .fold(0.0, f64::max);
    assert!(peak < 2020.0, "overshoot: {peak}");
    assert!((rig.rpm() - 2000.0).abs() < 5.0);
    assert_eq!(
        statusword(&rig) & 0x1600,
        0x0600,
        "reached, remote, not zero"
    );

    rig.target_velocity(0);
    rig.run_ms(300);
    assert_eq!(rig.rpm(), 0.0);
    assert_eq!(statusword(&rig) & 0x1400, 0x1400);
    assert_eq!(rig.state(), State::OperationEnabled);
    let moved_at = rig.drive().status().moved_at.unwrap();
    assert!(rig.now.since(moved_at) > Time::from_ms(150));
}

#[test]
fn standstill_after_a_move_is_one_for_every_drive() {
    for id in 1..=6 {
        let mut rig = Rig::booted(quick(id));
        rig.write_of(id, 0x6060, 0, &[3]).unwrap();
        rig.nmt(0x01);
        for word in [0x06, 0x0F] {
            rig.write_of(id, 0x6040, 0, &[word, 0]).unwrap();
        }
        rig.write_of(id, 0x60FF, 0, &3000i32.to_le_bytes()).unwrap();
        rig.run_ms(500);
        assert!((rig.rpm() - 3000.0).abs() < 5.0);
        rig.write_of(id, 0x60FF, 0, &[0; 4]).unwrap();
        rig.run_ms(600);
        let before = rig.drive().truth();
        rig.run_ms(10_000);
        let after = rig.drive().truth();
        assert!(after.travelled_inc - before.travelled_inc < 0.5);
        assert_eq!(after.velocity_rpm, 0.0);
    }
}

#[test]
fn limits_cap_speed_and_slope() {
    let mut rig = Rig::booted(quick(1));
    rig.enable();
    rig.write(0x607F, 0, &800u32.to_le_bytes()).unwrap();
    rig.target_velocity(5000);
    rig.run_ms(300);
    assert!((rig.rpm() - 800.0).abs() < 5.0);
    assert_ne!(statusword(&rig) & 1 << 11, 0, "internal limit");
    rig.write(0x6080, 0, &500u32.to_le_bytes()).unwrap();
    rig.run_ms(300);
    assert!((rig.rpm() - 500.0).abs() < 5.0);
    rig.write(0x60C5, 0, &1000u32.to_le_bytes()).unwrap();
    rig.target_velocity(0);
    rig.run_ms(230);
    assert!((200.0..300.0).contains(&rig.rpm()), "1000 rpm/s, not 10000");
}

#[test]
fn halt_stops_and_resumes_and_stays_enabled() {
    let mut rig = Rig::booted(quick(1));
    rig.enable();
    rig.target_velocity(1000);
    rig.run_ms(300);
    rig.controlword(0x010F);
    rig.run_ms(300);
    assert_eq!(rig.rpm(), 0.0);
    assert_eq!(rig.state(), State::OperationEnabled);
    assert_ne!(statusword(&rig) & 1 << 10, 0, "halted");
    rig.controlword(0x000F);
    rig.run_ms(300);
    assert!((rig.rpm() - 1000.0).abs() < 5.0);
}

#[test]
fn quick_stop_uses_6085_and_holds() {
    let mut rig = Rig::booted(quick(1));
    rig.enable();
    rig.write(0x6085, 0, &4000u32.to_le_bytes()).unwrap();
    rig.target_velocity(2000);
    rig.run_ms(400);
    rig.controlword(0x0002);
    assert_eq!(rig.state(), State::QuickStopActive);
    rig.run_ms(230);
    assert!((900.0..1100.0).contains(&rig.rpm()), "{}", rig.rpm());
    rig.run_ms(500);
    assert_eq!(rig.rpm(), 0.0);
    assert_eq!(rig.state(), State::QuickStopActive, "605Ah = 6: it stays");
    // Transition 16: on it goes with what 60FFh says.
    rig.controlword(0x000F);
    rig.run_ms(400);
    assert!((rig.rpm() - 2000.0).abs() < 5.0);
    rig.controlword(0x0000);
    assert_eq!(rig.state(), State::SwitchOnDisabled);
    rig.run_ms(20);
    assert!(rig.rpm() > 1000.0, "it coasts");
}

#[test]
fn leaving_operation_enabled_follows_the_option_codes() {
    // Command, option code, its value, state at the end; whether it slows down
    // on the ramp with its state unchanged until it stands.
    for (word, option, value, end, ramp) in [
        (0x07, 0x605C, 1, State::SwitchedOn, true),
        (0x07, 0x605C, 0, State::SwitchedOn, false),
        (0x06, 0x605B, 1, State::ReadyToSwitchOn, true),
        (0x06, 0x605B, 0, State::ReadyToSwitchOn, false),
    ] {
        let mut rig = Rig::booted(quick(1));
        rig.enable();
        rig.write(option, 0, &[value, 0]).unwrap();
        rig.target_velocity(1000);
        rig.run_ms(300);
        rig.controlword(word);
        rig.run_ms(10);
        let state = rig.state();
        if ramp {
            assert_eq!(state, State::OperationEnabled);
            rig.run_ms(300);
            assert_eq!((rig.state(), rig.rpm()), (end, 0.0));
        } else {
            assert_eq!(state, end);
            assert!(rig.rpm() > 900.0);
        }
    }
}

#[test]
fn every_transition_by_controlword() {
    use State::*;
    let steps = [
        (0x0006, ReadyToSwitchOn),  // 2
        (0x0007, SwitchedOn),       // 3
        (0x000F, OperationEnabled), // 4
        (0x0007, SwitchedOn),       // 5
        (0x0006, ReadyToSwitchOn),  // 6
        (0x0000, SwitchOnDisabled), // 7
        (0x0006, ReadyToSwitchOn),  // 2
        (0x000F, OperationEnabled), // 3 + 4
        (0x0006, ReadyToSwitchOn),  // 8
        (0x000F, OperationEnabled), // 3 + 4
        (0x0000, SwitchOnDisabled), // 9
        (0x0006, ReadyToSwitchOn),  // 2
        (0x0007, SwitchedOn),       // 3
        (0x0000, SwitchOnDisabled), // 10
        (0x0006, ReadyToSwitchOn),  // 2
        (0x0002, SwitchOnDisabled), // 7 by quick stop
        (0x0006, ReadyToSwitchOn),  // 2
        (0x000F, OperationEnabled), // 3 + 4
        (0x0002, QuickStopActive),  // 11
        (0x000F, OperationEnabled), // 16
        (0x0002, QuickStopActive),  // 11
        (0x0000, SwitchOnDisabled), // 12
    ];
    let mut rig = Rig::booted(quick(1));
    rig.write(0x6060, 0, &[3]).unwrap();
    rig.nmt(0x01);
    for (word, state) in steps {
        rig.controlword(word);
        assert_eq!(rig.state(), state, "{word:04X}");
    }
}

#[test]
fn a_controlword_by_sdo_counts_in_pre_operational() {
    let mut rig = Rig::booted(config(1));
    rig.controlword(0x0006);
    assert_eq!(rig.state(), State::ReadyToSwitchOn);
}

#[test]
fn the_old_target_acts_when_enabled_again() {
    let mut rig = Rig::booted(quick(1));
    rig.target_velocity(600);
    rig.enable();
    rig.run_ms(300);
    assert!((rig.rpm() - 600.0).abs() < 5.0);
}

#[test]
fn an_axis_that_turns_is_taken_over_without_a_jump() {
    let mut rig = Rig::booted(quick(1));
    rig.enable();
    rig.target_velocity(2000);
    rig.run_ms(400);
    rig.controlword(0x0000);
    rig.run_ms(50);
    let coasting = rig.rpm();
    rig.controlword(0x0006);
    rig.controlword(0x000F);
    assert!(rig.rpm() > coasting * 0.9);
    assert!(rig.drive().status().demand_rpm > coasting * 0.8);
}

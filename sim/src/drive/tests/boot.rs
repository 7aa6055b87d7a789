//! Power-on, NMT, heartbeat, determinism.

use super::rig::{Rig, config, node, quick};
use crate::drive::cia402::State;
use crate::drive::{DriveConfig, DriveFault};
use crate::time::Time;
use canmaster::nmt::State as Nmt;

#[test]
fn boot_up_comes_between_200_and_600_ms() {
    for seed in 0..20 {
        let mut rig = Rig::new([DriveConfig::new(node(5), seed)]);
        rig.run_ms(199);
        assert!(rig.log.is_empty());
        assert_eq!(rig.drive().timing(), None, "not on the bus yet");
        rig.run_ms(403);
        assert_eq!(rig.sent(0x705), [[0x00]]);
        assert_eq!(rig.drive().status().nmt, Nmt::PreOperational);
        assert_eq!(rig.state(), State::SwitchOnDisabled);
    }
}

#[test]
fn nothing_is_answered_before_the_boot_up() {
    let mut rig = Rig::new([quick(1)]);
    rig.run_ms(100);
    rig.send(0x601, &[0x40, 0x00, 0x10, 0, 0, 0, 0, 0]);
    rig.nmt(0x01);
    rig.run_ms(90);
    assert!(rig.log.is_empty());
    rig.run_ms(200);
    assert_eq!(rig.log.len(), 1, "the boot-up message alone");
    assert_eq!(rig.drive().status().nmt, Nmt::PreOperational);
}

#[test]
fn nmt_commands_change_the_state_and_stopped_has_no_sdo() {
    let mut rig = Rig::booted(quick(1));
    for (command, state) in [
        (0x01, Nmt::Operational),
        (0x02, Nmt::Stopped),
        (0x80, Nmt::PreOperational),
    ] {
        rig.nmt(command);
        assert_eq!(rig.drive().status().nmt, state);
        let answered = rig.sdo([0x40, 0x00, 0x10, 0, 0, 0, 0, 0]).is_some();
        assert_eq!(answered, state != Nmt::Stopped);
    }
    rig.send(0x000, &[0x01, 2]);
    assert_eq!(rig.drive().status().nmt, Nmt::PreOperational, "not for us");
}

#[test]
fn remote_bit_only_in_operational() {
    let mut rig = Rig::booted(quick(1));
    assert_eq!(rig.read(0x6041, 0).unwrap() & 1 << 9, 0);
    rig.nmt(0x01);
    rig.run_ms(1);
    assert_eq!(rig.read(0x6041, 0).unwrap() & 1 << 9, 1 << 9);
    rig.nmt(0x80);
    rig.run_ms(1);
    assert_eq!(rig.read(0x6041, 0).unwrap() & 1 << 9, 0);
}

#[test]
fn heartbeat_has_its_period_and_the_state() {
    let mut rig = Rig::booted(quick(1));
    rig.write(0x1017, 0, &50u16.to_le_bytes()).unwrap();
    rig.run_ms(30);
    rig.log.clear();
    rig.run_ms(1000);
    let beats: Vec<_> = rig.log.iter().map(|(at, _)| at.as_us()).collect();
    assert_eq!(beats.len(), 20);
    assert!(
        beats
            .windows(2)
            .all(|w| (49_950..50_050).contains(&(w[1] - w[0])))
    );
    rig.nmt(0x01);
    rig.log.clear();
    rig.run_ms(60);
    let beats = rig.sent(0x701);
    assert!(!beats.is_empty() && beats.iter().all(|beat| beat == &[0x05]));
}

#[test]
fn reset_communication_restores_the_communication_and_keeps_the_rest() {
    let mut rig = Rig::booted(quick(1));
    rig.write(0x1017, 0, &50u16.to_le_bytes()).unwrap();
    rig.write(0x6083, 0, &1234u32.to_le_bytes()).unwrap();
    rig.write(0x1400, 1, &0x8000_0201u32.to_le_bytes()).unwrap();
    rig.log.clear();
    rig.nmt(0x82);
    rig.run_ms(190);
    assert!(rig.log.is_empty());
    rig.run_ms(20);
    assert_eq!(rig.sent(0x701), [[0x00]]);
    assert_eq!(rig.read(0x1017, 0), Ok(0));
    assert_eq!(rig.read(0x1400, 1), Ok(0x201));
    assert_eq!(rig.read(0x6083, 0), Ok(1234));
}

#[test]
fn reset_node_loads_what_was_stored() {
    let mut rig = Rig::booted(quick(1));
    rig.write(0x6083, 0, &1234u32.to_le_bytes()).unwrap();
    rig.write(0x1010, 1, b"save").unwrap();
    rig.write(0x6083, 0, &999u32.to_le_bytes()).unwrap();
    rig.nmt(0x81);
    rig.run_ms(300);
    assert_eq!(rig.read(0x6083, 0), Ok(1234));
    rig.write(0x1011, 1, b"load").unwrap();
    assert_eq!(rig.read(0x6083, 0), Ok(1234), "not before the reset");
    rig.nmt(0x81);
    rig.run_ms(300);
    assert_eq!(rig.read(0x6083, 0), Ok(10_000));
}

#[test]
fn leaving_operational_while_enabled_ends_in_switch_on_disabled() {
    for command in [0x80, 0x02, 0x82, 0x81] {
        let mut rig = Rig::booted(quick(1));
        rig.enable();
        rig.target_velocity(1000);
        rig.run_ms(300);
        rig.nmt(command);
        rig.run_us(50);
        assert_eq!(rig.state(), State::QuickStopActive);
        rig.run_ms(50);
        assert!((300.0..700.0).contains(&rig.rpm()), "on its ramp");
        rig.run_ms(500);
        assert_eq!(rig.state(), State::SwitchOnDisabled, "{command:02X}");
        assert_eq!(rig.rpm(), 0.0);
        assert!(rig.sent(0x081).is_empty(), "no error");
    }
}

/// Everything that two drives do in 1.5 s, advanced in slices of `step`.
fn story(seed: u64, step: Time) -> Vec<String> {
    let configs = [1, 2].map(|id| DriveConfig::new(node(id), seed));
    let mut rig = Rig::new(configs);
    let run_until = |rig: &mut Rig, end: Time| {
        while rig.now < end {
            rig.run_until((rig.now + step).min(end));
        }
    };
    run_until(&mut rig, Time::from_ms(700));
    rig.enable();
    rig.target_velocity(-700);
    run_until(&mut rig, Time::from_ms(1500));
    let mut lines: Vec<_> = rig.log.iter().map(|entry| format!("{entry:?}")).collect();
    lines.push(format!("{:?}", rig.drive().truth()));
    lines
}

#[test]
fn one_seed_one_story_however_often_it_is_asked() {
    let reference = story(3, Time::from_ms(100));
    assert_eq!(reference, story(3, Time::from_us(37)));
    assert_ne!(reference, story(4, Time::from_ms(100)));
}

#[test]
fn drives_differ_within_what_is_stated() {
    let mut taus = Vec::new();
    for seed in 0..50 {
        let c = DriveConfig::new(node(3), seed);
        assert!(c.clock_ppm.abs() <= 100.0);
        assert!((0.003..=0.010).contains(&c.servo.time_constant_s));
        assert!((0.7..=1.3).contains(&c.plant.inertia_ratio));
        assert!((20.0..=50.0).contains(&c.plant.friction_permille));
        assert!(c.plant.disturbance_permille < c.plant.friction_permille);
        taus.push(c.servo.time_constant_s);
    }
    taus.sort_by(f64::total_cmp);
    assert!(taus[0] < 0.004 && taus[49] > 0.009);
    assert_ne!(config(1).clock_ppm, config(2).clock_ppm);
}

#[test]
fn two_drives_can_have_one_node_id() {
    let mut rig = Rig::new([quick(3), quick(4).with(DriveFault::NodeSwitches(node(3)))]);
    rig.run_ms(300);
    assert_eq!(rig.sent(0x703).len(), 2);
    rig.log.clear();
    rig.sdo_of(3, [0x40, 0x18, 0x10, 4, 0, 0, 0, 0]);
    let answers = rig.sent(0x583);
    assert_eq!(answers.len(), 2);
    assert_ne!(answers[0], answers[1], "two serial numbers");
}

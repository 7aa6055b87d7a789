//! Cyclic synchronous velocity and torque (CiA 402-2, 14 and 15).

use super::{BIT_12, Cyclic, LIMIT, at};
use crate::drive::cia402::State;

const VELOCITY: u32 = 0x60FF_0020;
const TORQUE: u32 = 0x6071_0010;

#[test]
fn the_speed_follows_without_the_profile_ramps() {
    let mut c = Cyclic::new(at(0.0), 9, VELOCITY, 30, 0);
    // 1 rpm/s: of no account here.
    c.rig.write32(0x60C5, 0, 1);
    for n in 1..=10 {
        c.set(n * 100);
    }
    c.set(1000);
    assert!((c.rig.rpm() - 1000.0).abs() < 10.0, "{}", c.rig.rpm());
    assert_eq!(c.rig.bits(BIT_12 | LIMIT), BIT_12);
}

#[test]
fn the_motor_speed_limits_every_mode() {
    let mut c = Cyclic::new(at(0.0), 9, VELOCITY, 100, 0);
    c.rig.write32(0x6080, 0, 700);
    for _ in 0..10 {
        c.set(900);
    }
    assert!((c.rig.rpm() - 700.0).abs() < 10.0);
    assert_eq!(c.rig.bits(BIT_12 | LIMIT), LIMIT);
}

#[test]
fn cyclic_velocity_waits_two_periods() {
    let mut c = Cyclic::new(at(0.0), 9, VELOCITY, 5, 0);
    for _ in 0..40 {
        c.set(500);
    }
    c.rig.run_ms(8);
    assert_eq!(c.rig.sent(0x081), [[0x50, 0x82, 0x10, 0, 0, 0, 0, 0]]);
    c.rig.run_ms(400);
    assert_eq!((c.rig.state(), c.rig.rpm()), (State::Fault, 0.0));
}

#[test]
fn torque_accelerates_the_inertia() {
    let mut c = Cyclic::new(at(0.0), 10, TORQUE, 2, 0);
    let plant = c.rig.drive().config().plant;
    for _ in 0..51 {
        c.set(200);
    }
    // 0.1 s; friction of Coulomb and of speed taken off.
    let net = (200.0 - plant.friction_permille) / 1000.0;
    let expected = net * plant.rated_acceleration / plant.inertia_ratio * 0.1;
    let share = c.rig.rpm() / expected;
    assert!((0.85..1.1).contains(&share), "{share}");
    let torque = c.rig.read(0x6077, 0).unwrap() as i16;
    assert!((190..210).contains(&torque), "{torque}");
    let current = c.rig.read(0x30D1, 2);
    assert!(current.is_ok());
}

#[test]
fn torque_below_the_friction_moves_nothing() {
    let mut c = Cyclic::new(at(0.0), 10, TORQUE, 2, 0);
    for _ in 0..200 {
        c.set(5);
    }
    assert_eq!(c.rig.rpm(), 0.0);
    assert_eq!(c.rig.bits(BIT_12), BIT_12);
}

#[test]
fn torque_stops_at_the_motor_speed() {
    let mut c = Cyclic::new(at(0.0), 10, TORQUE, 50, 0);
    c.rig.write32(0x6080, 0, 1500);
    for _ in 0..40 {
        c.set(-300);
    }
    assert!((c.rig.rpm() + 1500.0).abs() < 20.0, "{}", c.rig.rpm());
}

#[test]
fn a_quick_stop_out_of_torque_control_uses_its_ramp() {
    let mut c = Cyclic::new(at(0.0), 10, TORQUE, 2, 0);
    for _ in 0..100 {
        c.set(200);
    }
    let before = c.rig.rpm();
    assert!(before > 500.0);
    c.send(0x02, 200);
    assert_eq!(c.rig.state(), State::QuickStopActive);
    // 6085h: 10 000 rpm/s.
    c.rig.run_ms(before as u64 / 10 + 60);
    assert!(c.rig.rpm().abs() < 1.0);
}

//! Axes whose optional nodes are not there.

use canmaster::cia402::{Command, ControlWord};
use canmaster::motion::{Cause, GroupEvent, GroupState, Inputs, Order};

use crate::rig::{AXES, READY, Rig, far};

const AXIS: usize = 3;
const WITHOUT: Inputs = Inputs {
    absent: 1 << AXIS,
    ..READY
};

fn run(rig: &mut Rig, request: Inputs, to: GroupState, cycles: u32) {
    let came = (0..cycles).any(|_| {
        rig.step(request);
        rig.group.state() == to
    });
    assert!(came, "{to} is not reached: {}", rig.last());
}

/// In standby without the axis.
fn standby() -> Rig {
    let mut rig = Rig::new(1);
    rig.silent[AXIS] = true;
    run(&mut rig, WITHOUT, GroupState::Standby, 100);
    rig
}

fn release(rig: &mut Rig, inputs: Inputs) {
    rig.order(Order::Release);
    rig.step(inputs);
    assert_eq!(rig.group.state(), GroupState::Moving, "{}", rig.last());
    rig.go(far);
    rig.step(inputs);
}

#[test]
fn the_others_are_enabled_and_moved_without_it() {
    let mut rig = standby();
    release(&mut rig, WITHOUT);
    let mut turned = [false; AXES];
    for _ in 0..1500 {
        rig.step(WITHOUT);
        let command = rig.commands[AXIS];
        assert!(!ControlWord(command.controlword).gives(Command::EnableOperation));
        for (turned, command) in turned.iter_mut().zip(&rig.commands) {
            *turned |= command.target != 0;
        }
    }
    for (axis, turned) in turned.into_iter().enumerate() {
        assert_eq!(turned, axis != AXIS, "axis {axis}");
    }
    assert!(rig.group.all_arrived());
    let faults = rig.events.iter();
    let faults = faults.filter(|event| matches!(event, GroupEvent::Fault { .. }));
    assert_eq!(faults.count(), 0);
}

#[test]
fn one_that_goes_in_motion_stops_all_and_is_left_out_then() {
    let mut rig = Rig::moving(2, 100);
    rig.step(WITHOUT);
    assert_eq!(rig.group.state(), GroupState::FaultStop);
    let cause = Cause::LeftOperational.alone();
    let axis = Some(AXIS as u8);
    assert!(rig.events.contains(&GroupEvent::Fault { axis, cause }));
    rig.silent[AXIS] = true;
    run(&mut rig, WITHOUT, GroupState::Faulted, 300);
    assert!(rig.standing());
    run(&mut rig, WITHOUT, GroupState::Standby, 100);
    for _ in 0..500 {
        rig.step(WITHOUT);
        assert!(rig.commands.iter().all(|command| command.target == 0));
    }
    release(&mut rig, WITHOUT);
}

#[test]
fn one_that_comes_waits_for_standby_and_is_enabled_with_the_others() {
    let mut rig = standby();
    release(&mut rig, WITHOUT);
    rig.silent[AXIS] = false;
    rig.events.clear();
    for _ in 0..1500 {
        rig.step(READY);
        assert_eq!(rig.commands[AXIS].target, 0);
    }
    rig.order(Order::Finish);
    for _ in 0..50 {
        rig.step(READY);
    }
    let entered = rig.events.iter().filter_map(|event| match event {
        GroupEvent::State { to, .. } => Some(*to),
        _ => None,
    });
    let entered: Vec<GroupState> = entered.collect();
    let expected = [
        GroupState::Standby,
        GroupState::Enabling,
        GroupState::Standby,
    ];
    assert_eq!(entered, expected, "no stop in between");
    release(&mut rig, READY);
    for _ in 0..100 {
        rig.step(READY);
    }
    assert_ne!(rig.commands[AXIS].target, 0);
}

#[test]
fn a_fault_of_another_axis_is_not_forgiven_by_it() {
    let mut rig = Rig::moving(3, 100);
    rig.step(Inputs {
        fault: Some((AXIS + 1, Cause::HeartbeatLost.alone())),
        ..READY
    });
    run(&mut rig, READY, GroupState::Faulted, 300);
    for _ in 0..200 {
        rig.step(WITHOUT);
        assert_eq!(rig.group.state(), GroupState::Faulted);
    }
}

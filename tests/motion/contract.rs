//! The contract's sentences, each against drives.

use canmaster::cia402::{Command, ControlWord, State, StatusWord};
use canmaster::motion::experiment::{Motor, group};
use canmaster::motion::mode::Mode;
use canmaster::motion::{Cause, GroupEvent, GroupState, Reason, Refusal};
use canmaster::motion::{Director, Group, GroupConfig, Inputs, Order};
use canmaster::time::Duration;

use crate::rig::{ALL, AXES, READY, Rig, far};

use GroupState::*;

const AXIS: usize = 3;
/// Cycles into the move at which the axes are fast.
const FAST: u32 = 100;

/// Contract 1: whatever is wrong, no release, and nothing moves.
#[test]
fn a_release_is_refused_with_its_reason() {
    let mut rig = Rig::new(8);
    assert_eq!(rig.group.order(Order::Release), Err(Refusal::not_in(Idle)));
    rig.until(Standby, 100);
    rig.silent[AXIS] = true;
    rig.step(READY);
    let why = rig.group.order(Order::Release);
    assert_eq!(why, Err(Refusal::of(AXIS as u8, Reason::NotFresh, 0, 1)));
    rig.silent[AXIS] = false;
    rig.drives[AXIS].velocity = 20.0;
    rig.step(READY);
    let why = rig.group.order(Order::Release);
    assert!(
        matches!(
            why,
            Err(Refusal {
                reason: Reason::NotAtRest,
                axis: 3,
                ..
            })
        ),
        "{why:?}"
    );
    let parts = core::array::from_fn(far);
    let why = rig.director.go(&rig.group, ALL, &parts, 0);
    assert_eq!(why, Err(Refusal::not_in(Standby)));
    for _ in 0..50 {
        rig.step(READY);
        assert!(rig.commands.iter().all(|command| command.target == 0));
    }
    assert_eq!(rig.group.state(), Standby);
}

/// Contract 5: axis, value and limit, and nothing is sent.
#[test]
fn a_target_outside_the_limits_is_refused() {
    let mut rig = Rig::standby(1);
    rig.released();
    for (change, reason, allowed) in [
        (0, Reason::Velocity, 3000),
        (1, Reason::Acceleration, 20_000),
        (2, Reason::Deceleration, 20_000),
        (3, Reason::Target, -1_073_741_823),
    ] {
        let parts = core::array::from_fn(|n| {
            let mut part = far(n);
            if n == AXIS {
                match change {
                    0 => part.velocity = 3001,
                    1 => part.acceleration = 20_001,
                    2 => part.deceleration = 20_001,
                    _ => part.target = -1_073_741_824,
                }
            }
            part
        });
        let refused = rig.director.go(&rig.group, ALL, &parts, 0);
        let value = if allowed < 0 {
            allowed - 1
        } else {
            allowed + 1
        };
        let expected = Refusal {
            reason,
            axis: AXIS as u8,
            step: 0,
            value,
            allowed,
        };
        assert_eq!(refused, Err(expected));
    }
    for _ in 0..20 {
        rig.step(READY);
        assert!(rig.commands.iter().all(|command| command.target == 0));
    }
}

/// An axis that cannot brake before its target goes beyond it: not if that is
/// outside of its travel.
#[test]
fn turning_around_outside_of_the_travel_is_refused() {
    static NARROW: GroupConfig<AXES> = group(
        &[Motor {
            limits: (-2_000_500, 2_000_500),
            ..Motor::SAMPLE
        }; AXES],
        Duration::from_millis(10),
        3,
    );
    let mut rig = Rig::new(1);
    rig.group = Group::new(&NARROW);
    rig.director = Director::new(&NARROW);
    rig.until(Standby, 100);
    rig.released();
    let part = |target| {
        [canmaster::motion::AxisMove {
            target,
            velocity: 2000,
            acceleration: 4000,
            deceleration: 4000,
            set: 0,
        }; AXES]
    };
    rig.director.go(&rig.group, 1, &part(2_000_000), 0).unwrap();
    let home = rig.group.view(0).unwrap().home;
    while rig.group.view(0).unwrap().reference - home < 1_984_000 {
        rig.step(READY);
        assert!(rig.cycle < 4000, "{}", rig.last());
    }
    let mut slower = part(1_985_000);
    slower[0].deceleration = 100;
    rig.director.go(&rig.group, 1, &slower, 0).unwrap();
    rig.step(READY);
    assert!(
        matches!(
            rig.notices.last(),
            Some(GroupEvent::MoveRefused(Refusal {
                axis: 0,
                reason: Reason::Target,
                ..
            }))
        ),
        "{:?}",
        rig.notices
    );
    rig.arrive(1000);
    assert!((rig.drives[0].position - f64::from(home + 2_000_000)).abs() <= 3.0);
}

/// Contract 2: the step that detects carries the stop, the commands fall from
/// there on, and the axes that still obey come to rest in the same cycle.
#[test]
fn a_fault_stops_all_axes_together() {
    for mode in [
        Mode::ProfileVelocity,
        Mode::CyclicVelocity,
        Mode::CyclicPosition,
    ] {
        let mut rig = if mode == Mode::ProfileVelocity {
            Rig::standby(7)
        } else {
            Rig::in_mode(7, mode)
        };
        rig.released();
        rig.go(far);
        for _ in 0..FAST {
            rig.step(READY);
        }
        let mut targets = rig.commands.map(|command| command.target);
        rig.step(READY);
        let mut speeds: [i32; AXES] = core::array::from_fn(|n| {
            let now = rig.commands[n].target;
            let before = core::mem::replace(&mut targets[n], now);
            if mode == Mode::CyclicPosition {
                now - before
            } else {
                now
            }
        });
        let lost = Cause::HeartbeatLost.alone();
        rig.step(Inputs {
            fault: Some((AXIS, lost)),
            ..READY
        });
        assert_eq!(rig.group.state(), FaultStop);
        let axis = Some(AXIS as u8);
        assert!(
            rig.events
                .contains(&GroupEvent::Fault { axis, cause: lost })
        );
        let mut ended = [0; AXES];
        for cycle in 0..60 {
            for n in 0..AXES {
                let now = rig.commands[n].target;
                let before = core::mem::replace(&mut targets[n], now);
                let speed = if mode == Mode::CyclicPosition {
                    now - before
                } else {
                    now
                };
                assert!(
                    speed.abs() <= speeds[n].abs() + 1,
                    "{mode} {n} {cycle}: {speed}"
                );
                assert!(
                    speed != speeds[n] || speed.abs() <= 5 || cycle > 0,
                    "{mode} {n}"
                );
                speeds[n] = speed;
                if speed != 0 {
                    ended[n] = cycle;
                }
            }
            rig.step(READY);
        }
        let (first, last) = (ended.iter().min().unwrap(), ended.iter().max().unwrap());
        assert!(last - first <= 2, "{mode}: {ended:?}");
        for _ in 0..200 {
            rig.step(READY);
        }
        assert_eq!(rig.group.state(), Faulted);
        assert!(rig.all(State::SwitchOnDisabled) && rig.standing());
    }
}

/// An axis disabled by its own drive is left out: nothing that is sent to it could
/// enable it again, and the log says that it coasts.
#[test]
fn a_failed_axis_is_left_to_its_drive() {
    let mut rig = Rig::moving(5, FAST);
    rig.drives[AXIS].fail();
    for _ in 0..100 {
        rig.step(READY);
        let command = rig.commands[AXIS];
        let word = ControlWord(command.controlword);
        assert_eq!(command.target, 0);
        assert!(!word.gives(Command::EnableOperation) && !word.gives(Command::FaultReset));
    }
    let coasting = rig.events.iter().filter(
        |e| matches!(e, GroupEvent::Coasting { axis, state: State::Fault } if *axis == AXIS as u8),
    );
    assert_eq!(coasting.count(), 1);
}

/// Contract 3: a reset, or a network that went down and came up, leads to standby
/// and not to motion.
#[test]
fn recovery_leads_to_standby_and_not_to_motion() {
    for reset in [false, true] {
        let mut rig = Rig::moving(6, FAST);
        rig.drives[AXIS].fail();
        rig.until(Faulted, 300);
        for _ in 0..50 {
            rig.step(READY);
            assert_eq!(
                rig.group.order(Order::Release),
                Err(Refusal::not_in(Faulted))
            );
        }
        if reset {
            rig.order(Order::Reset);
        } else {
            rig.step(Inputs {
                network_ready: false,
                ..READY
            });
        }
        rig.step(READY);
        assert_eq!(rig.group.state(), Enabling);
        let gives =
            |rig: &Rig| ControlWord(rig.commands[AXIS].controlword).gives(Command::FaultReset);
        let (mut low, mut high) = (!gives(&rig), false);
        while rig.group.state() != Standby {
            rig.step(READY);
            high |= low && gives(&rig);
            low |= !gives(&rig);
            assert!(rig.commands.iter().all(|c| c.target == 0));
        }
        assert!(high, "bit 7 low, then high");
        let places = rig.drives.each_ref().map(|d| d.position);
        for _ in 0..200 {
            rig.step(READY);
            assert_eq!(rig.group.state(), Standby);
        }
        for (drive, place) in rig.drives.iter().zip(places) {
            assert!((drive.position - place).abs() < 1.0);
        }
        rig.released();
        rig.go(far);
        rig.arrive(1500);
    }
}

#[test]
fn a_reset_without_network_is_refused() {
    let mut rig = Rig::moving(6, FAST);
    let down = Inputs {
        network_ready: false,
        ..READY
    };
    for _ in 0..300 {
        rig.step(down);
    }
    assert_eq!(rig.group.state(), Faulted);
    assert_eq!(
        rig.group.order(Order::Reset),
        Err(Refusal::whole(Reason::Network, 0, 1))
    );
}

/// A stop in motion: the axes rest together, and the next release begins there.
#[test]
fn a_stop_is_coordinated_and_leads_to_standby() {
    let mut rig = Rig::moving(9, FAST);
    let before = rig.commands.map(|c| c.target.abs());
    rig.order(Order::Stop);
    rig.step(READY);
    assert_eq!(rig.group.state(), Stopping);
    for (command, before) in rig.commands.iter().zip(before) {
        assert!(command.target.abs() < before);
    }
    rig.until(Standby, 200);
    let stops = rig.observed.map(|o| o.stopped_ms);
    let first = stops.iter().copied().fold(f64::MAX, f64::min);
    let last = stops.iter().copied().fold(0.0, f64::max);
    assert!(last - first < 10.0, "{stops:?}");
    rig.released();
    rig.go(far);
    rig.arrive(1500);
}

#[test]
fn halt_waits_for_a_release_and_stop_ends_it() {
    let mut rig = Rig::moving(9, FAST);
    rig.order(Order::Halt);
    for _ in 0..300 {
        rig.step(READY);
        assert_eq!(rig.group.state(), Halt);
    }
    assert!(rig.standing());
    rig.released();
    rig.go(far);
    for _ in 0..50 {
        rig.step(READY);
    }
    rig.order(Order::Halt);
    rig.step(READY);
    rig.order(Order::Stop);
    rig.until(Standby, 200);
}

#[test]
fn disable_and_enable() {
    let mut rig = Rig::moving(2, FAST);
    rig.order(Order::Disable);
    rig.until(Idle, 300);
    assert_eq!(rig.states()[3..], [Stopping, Standby, Disabling, Idle]);
    assert!(rig.all(State::SwitchOnDisabled));
    for _ in 0..50 {
        rig.step(READY);
        assert_eq!(rig.group.state(), Idle);
    }
    rig.order(Order::Enable);
    rig.until(Standby, 100);
}

#[test]
fn a_quick_stop_is_made_by_the_drives_and_disables() {
    let mut rig = Rig::moving(2, FAST);
    rig.order(Order::QuickStop);
    rig.until(Idle, 300);
    assert!(rig.states().ends_with(&[QuickStop, Disabling, Idle]));
    assert!(rig.standing() && rig.all(State::SwitchOnDisabled));
    let faults = rig
        .events
        .iter()
        .filter(|e| matches!(e, GroupEvent::Fault { .. }));
    assert_eq!(faults.count(), 0);
}

/// In every state that waits for a drive, a drive that does not follow ends in the
/// state that the contract names.
#[test]
fn a_drive_that_does_not_follow_is_named() {
    for state in [
        State::NotReadyToSwitchOn,
        State::SwitchOnDisabled,
        State::ReadyToSwitchOn,
        State::SwitchedOn,
        State::Fault,
    ] {
        let mut rig = Rig::new(4);
        if state == State::Fault {
            rig.drives[AXIS].fail();
        }
        rig.drives[AXIS].stuck = Some(state);
        rig.until(FaultStop, 300);
        let named = rig.events.iter().any(|e| {
            matches!(e, GroupEvent::Fault { axis: Some(3), cause }
                if cause.cause == Cause::NotEnabled
                    && StatusWord(cause.detail as u16).state() == state)
        });
        assert!(named, "{state}: {}", rig.last());
        rig.until(Faulted, 400);
        rig.step(READY);
        rig.step(READY);
        let enabled = |d: &crate::plant::Drive| d.state == State::OperationEnabled;
        assert!(!rig.drives.iter().any(enabled));
    }
    let mut rig = Rig::standby(4);
    rig.drives[AXIS].stuck = Some(State::OperationEnabled);
    rig.order(Order::Disable);
    rig.until(FaultStop, 300);
    rig.until(Faulted, 400);
}

/// The planner starves: the group notices that a path ended at speed, and stops.
#[test]
fn a_path_that_runs_dry_is_a_fault() {
    let mut rig = Rig::standby(1);
    rig.released();
    let start = rig.group.count() + 1;
    rig.group.announce(start, 1).unwrap();
    let at = rig.group.predict(0, 0).unwrap();
    rig.group.push(
        0,
        &canmaster::motion::path::Knot {
            cycles: 50,
            position: at.position + (500 << 32),
            velocity: 20 << 32,
        },
    );
    rig.until(FaultStop, 60);
    let cause = Cause::PathDry.alone();
    assert!(rig.events.contains(&GroupEvent::Fault {
        axis: Some(0),
        cause
    }));
    rig.until(Faulted, 100);
}

#[test]
fn orders_are_refused_where_the_table_says() {
    let mut rig = Rig::standby(1);
    assert_eq!(rig.group.order(Order::Reset), Err(Refusal::not_in(Standby)));
    assert_eq!(rig.group.order(Order::Halt), Err(Refusal::not_in(Standby)));
    let home = Order::Home {
        axes: ALL,
        limit: 100,
    };
    assert_eq!(rig.group.order(home), Err(Refusal::not_in(Standby)));
    rig.released();
    let (mode, homing) = (Mode::ProfileVelocity as u32, Mode::Homing as u32);
    let wrong = Refusal::of(0, Reason::WrongMode, mode, homing);
    assert_eq!(rig.group.order(home), Err(wrong));
    let cyclic = Order::SetMode {
        axes: ALL,
        mode: Mode::CyclicPosition,
    };
    assert_eq!(rig.group.order(cyclic), Err(Refusal::not_in(Moving)));
}

/// A drive that was switched off in motion may be enabled again before its axis
/// stands: standby waits for that.
#[test]
fn standby_waits_until_the_axes_stand() {
    let mut rig = Rig::new(1);
    rig.drives[AXIS].velocity = 1500.0;
    rig.until(Standby, 200);
    assert!(rig.standing());
    for _ in 0..20 {
        rig.step(READY);
    }
    assert_eq!(rig.group.state(), Standby, "{}", rig.last());
}

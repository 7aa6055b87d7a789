//! Changes of mode, profile position, homing, torque.

use canmaster::cia402::{ControlWord, StatusWord};
use canmaster::motion::mode::Mode;
use canmaster::motion::{AxisCommand, AxisMove, Cause, GroupEvent, GroupState, Reason, Refusal};
use canmaster::motion::{Order, SetPoint};

use crate::rig::{ALL, AXES, READY, Rig, far};

use GroupState::*;

#[test]
fn every_mode_from_every_mode() {
    let mut rig = Rig::standby(1);
    for from in Mode::ALL {
        for to in Mode::ALL {
            for mode in [from, to] {
                rig.order(Order::SetMode { axes: ALL, mode });
                rig.step(READY);
                for _ in 0..50 {
                    rig.step(READY);
                }
                assert_eq!(rig.group.state(), Standby, "{from} to {to}: {}", rig.last());
            }
            let places = rig.drives.each_ref().map(|drive| drive.position);
            for _ in 0..30 {
                rig.step(READY);
                assert_eq!(rig.group.state(), Standby, "{from} to {to}: {}", rig.last());
            }
            for (n, place) in places.into_iter().enumerate() {
                assert!(
                    (rig.drives[n].position - place).abs() < 3.0,
                    "{from} to {to}"
                );
                assert_eq!(rig.commands[n].mode, to);
            }
        }
    }
}

/// The RPDO of the new mode, with the actual position, goes out before the mode is
/// written, and that of the old one in between: a drive in a cyclic mode gives up when
/// its target stays away.
#[test]
fn the_target_is_there_before_the_mode() {
    let mut rig = Rig::standby(2);
    rig.confirms = false;
    rig.order(Order::SetMode {
        axes: 0b10,
        mode: Mode::CyclicPosition,
    });
    rig.step(READY);
    assert_eq!(rig.group.state(), ModeChange);
    assert_eq!(rig.group.wanted(), None);
    let (mut new, mut old) = (0, 0);
    let mut wanted = None;
    for _ in 0..10 {
        let command = rig.commands[1];
        assert!(!ControlWord(command.controlword).halt());
        match command.mode {
            Mode::CyclicPosition => {
                assert_eq!(command.target, rig.feedback[1].position);
                new += 1;
            }
            mode => {
                assert_eq!((mode, command.target), (Mode::ProfileVelocity, 0));
                old += 1;
            }
        }
        assert!(u32::abs_diff(new, old) <= 1, "not by turns");
        assert_eq!(rig.commands[0].mode, Mode::ProfileVelocity);
        if let Some(mode) = rig.group.wanted() {
            wanted.get_or_insert((mode.axis, new));
        }
        rig.step(READY);
    }
    let (axis, sent) = wanted.unwrap();
    assert_eq!(axis, 1);
    assert!(
        sent >= 2,
        "the target was sent {sent} times before the mode"
    );
}

#[test]
fn a_mode_that_is_not_confirmed_is_a_fault_that_names_it() {
    let mut rig = Rig::standby(2);
    rig.confirms = false;
    let mode = Mode::CyclicTorque;
    rig.order(Order::SetMode { axes: 0b100, mode });
    rig.until(FaultStop, 300);
    let cause = Cause::ModeNotConfirmed.with(mode as i32);
    assert!(rig.events.contains(&GroupEvent::Fault {
        axis: Some(2),
        cause
    }));
    rig.until(Faulted, 400);
}

#[test]
fn profile_position_by_handshake() {
    let mut rig = Rig::in_mode(3, Mode::ProfilePosition);
    let homes: [i32; AXES] = core::array::from_fn(|n| rig.group.view(n).unwrap().home);
    rig.released();
    for sign in [1, -1] {
        rig.go(|n| AxisMove {
            target: sign * far(n).target / 10,
            ..far(n)
        });
        let mut raised = false;
        for _ in 0..45 {
            rig.step(READY);
            raised |= rig.commands[0].controlword & 1 << 4 != 0;
        }
        assert!(raised);
        assert_eq!(rig.commands[0].controlword & 1 << 4, 0, "lowered again");
        rig.arrive(2000);
        for (n, home) in homes.into_iter().enumerate() {
            let target = f64::from(home + sign * far(n).target / 10);
            assert!((rig.drives[n].position - target).abs() < 5.0, "axis {n}");
        }
    }
}

#[test]
fn a_set_point_replaces_the_running_one() {
    let mut rig = Rig::in_mode(3, Mode::ProfilePosition);
    let home = rig.group.view(0).unwrap().home;
    rig.released();
    let to = |way: i32| SetPoint {
        target: home + way,
        immediately: true,
        ..SetPoint::default()
    };
    assert!(!rig.group.ask(0, &to(60_000)), "it is told to stay first");
    rig.arrive(20);
    assert!(rig.group.ask(0, &to(60_000)));
    assert!(
        !rig.group.ask(0, &to(0)),
        "the drive has not taken the first yet"
    );
    for _ in 0..50 {
        rig.step(READY);
    }
    assert!(rig.group.ask(0, &to(1000)));
    rig.arrive(2000);
    assert!((rig.drives[0].position - f64::from(home + 1000)).abs() < 5.0);
}

/// Where the set-point is stays on the wire, also when the drive has taken it.
#[test]
fn a_set_point_that_is_taken_stays_the_target() {
    let mut rig = Rig::in_mode(3, Mode::ProfilePosition);
    rig.released();
    rig.arrive(20);
    let home = rig.group.view(0).unwrap().home;
    let set_point = SetPoint {
        target: home + 60_000,
        immediately: true,
        ..SetPoint::default()
    };
    assert!(rig.group.ask(0, &set_point));
    for cycle in 0..30 {
        rig.step(READY);
        assert_eq!(rig.commands[0].target, home + 60_000, "cycle {cycle}");
    }
}

#[test]
fn in_homing_nothing_follows_a_target() {
    let mut rig = Rig::in_mode(3, Mode::Homing);
    rig.released();
    let parts = core::array::from_fn(far);
    let refused = rig.director.go(&rig.group, ALL, &parts, 0).unwrap_err();
    assert_eq!((refused.reason, refused.axis), (Reason::WrongMode, 0));
    assert_eq!(refused.value, Mode::Homing as i32);
}

/// Of axes in several modes all are judged before the first is told anything, and
/// set-points are handed over in the SYNC in which the paths begin.
#[test]
fn modes_side_by_side_are_judged_and_begin_together() {
    const BEGIN: u16 = 1 << 4;
    let mut rig = Rig::in_mode(3, Mode::ProfilePosition);
    rig.order(Order::SetMode {
        axes: 0b111,
        mode: Mode::CyclicPosition,
    });
    rig.step(READY);
    rig.until(Standby, 50);
    rig.released();
    rig.arrive(20);
    // The last one takes too long.
    rig.go(|n| AxisMove {
        target: if n == 0 { 1 << 29 } else { 1000 },
        velocity: if n == 0 { 1 } else { 600 },
        ..far(n)
    });
    for _ in 0..50 {
        rig.step(READY);
        let told = |command: &AxisCommand| command.controlword & BEGIN != 0;
        assert!(!rig.commands.iter().any(told), "before it was judged");
    }
    let refused = rig.notices.iter().find_map(|notice| match notice {
        GroupEvent::MoveRefused(why) => Some((why.reason, why.axis)),
        _ => None,
    });
    assert_eq!(refused, Some((Reason::Time, 0)));
    assert!(rig.group.all_arrived());
    let places = rig.drives.each_ref().map(|drive| drive.position);
    let rest = rig.commands;
    rig.go(far);
    for (drive, place) in rig.drives.iter().zip(places) {
        assert!((drive.position - place).abs() < 3.0);
    }
    for _ in 0..20 {
        rig.step(READY);
        let begun: [bool; AXES] = core::array::from_fn(|n| match n {
            0..3 => rig.commands[n].target != rest[n].target,
            _ => rig.commands[n].controlword & BEGIN != 0,
        });
        if begun.contains(&true) {
            assert_eq!(begun, [true; AXES]);
            rig.arrive(3000);
            return;
        }
    }
    panic!("{}", rig.last());
}

/// A drive goes on with its set-point when halt is over (CiA 402-2, 10.3): what was
/// stopped or halted is replaced before, in standby, in the next release, and in
/// another mode and back.
#[test]
fn a_stopped_set_point_is_not_gone_on_with() {
    for order in [Order::Stop, Order::Halt] {
        for moment in (2..40).chain([60]) {
            let mut rig = Rig::in_mode(3, Mode::ProfilePosition);
            rig.released();
            rig.go(far);
            for _ in 0..moment {
                rig.step(READY);
            }
            rig.order(order);
            rig.step(READY);
            for _ in 0..200 {
                rig.step(READY);
                let word = ControlWord(rig.commands[0].controlword);
                assert!(!word.halt() || word.0 & 1 << 4 == 0, "no edge afterwards");
            }
            let rest = rig.drives.each_ref().map(|drive| drive.position);
            let stays = |rig: &mut Rig, cycles: u32| {
                for _ in 0..cycles {
                    rig.step(READY);
                }
                for (drive, rest) in rig.drives.iter().zip(rest) {
                    assert!((drive.position - rest).abs() < 3.0, "{order:?} {moment}");
                }
            };
            stays(&mut rig, 100);
            rig.released();
            stays(&mut rig, 100);
            rig.order(Order::Stop);
            rig.until(Standby, 100);
            for mode in [Mode::CyclicPosition, Mode::ProfilePosition] {
                rig.order(Order::SetMode { axes: ALL, mode });
                rig.step(READY);
                rig.until(Standby, 100);
                stays(&mut rig, 100);
            }
            rig.released();
            rig.go(|n| AxisMove {
                target: 1000,
                ..far(n)
            });
            stays(&mut rig, 1);
            rig.arrive(2000);
            let home = f64::from(rig.group.view(0).unwrap().home);
            assert!((rig.drives[0].position - home - 1000.0).abs() < 5.0);
        }
    }
}

/// Halt in profile position; after a fault quick stop.
#[test]
fn what_the_drive_leads_is_halted() {
    for fault in [false, true] {
        let mut rig = Rig::in_mode(3, Mode::ProfilePosition);
        rig.released();
        rig.go(far);
        for _ in 0..60 {
            rig.step(READY);
        }
        assert!(!rig.standing());
        if fault {
            rig.drives[0].fail();
            rig.until(Faulted, 500);
        } else {
            rig.order(Order::Stop);
            rig.step(READY);
            assert!(ControlWord(rig.commands[0].controlword).halt());
            rig.until(Standby, 500);
        }
        assert!(rig.standing());
    }
}

#[test]
fn a_deaf_drive_is_named_in_time() {
    let mut rig = Rig::in_mode(3, Mode::ProfilePosition);
    rig.released();
    rig.drives[4].deaf = true;
    rig.go(far);
    rig.until(FaultStop, 300);
    let mode = Mode::ProfilePosition;
    let cause = Cause::NotDone.with(mode as i32);
    assert!(rig.events.contains(&GroupEvent::Fault {
        axis: Some(4),
        cause
    }));
    rig.until(Faulted, 500);
}

#[test]
fn homing_ends_in_standby_and_targets_count_from_there() {
    let mut rig = Rig::in_mode(5, Mode::Homing);
    let home = Order::Home {
        axes: ALL,
        limit: 500,
    };
    assert_eq!(rig.group.order(home), Err(Refusal::not_in(Standby)));
    rig.released();
    // Every axis has to be heard and at rest.
    rig.silent[2] = true;
    rig.step(READY);
    let silent = Refusal::of(2, Reason::NotFresh, 0, 1);
    assert_eq!(rig.group.order(home), Err(silent));
    rig.silent[2] = false;
    rig.step(READY);
    rig.order(home);
    rig.step(READY);
    assert_eq!(rig.group.state(), Homing);
    rig.until(Standby, 50);
    assert!(rig.drives.iter().all(|drive| drive.position.abs() < 2.0));
    for n in 0..AXES {
        assert_eq!(rig.group.view(n).unwrap().home, 0);
    }
    rig.order(Order::SetMode {
        axes: ALL,
        mode: Mode::CyclicPosition,
    });
    rig.step(READY);
    rig.until(Standby, 50);
    rig.released();
    rig.go(far);
    rig.arrive(2000);
    assert!((rig.drives[0].position - 80_000.0).abs() < 5.0);
}

#[test]
fn homing_that_fails_or_takes_too_long_is_a_fault() {
    for (homeless, limit) in [(true, 500), (false, 30)] {
        let mut rig = Rig::in_mode(5, Mode::Homing);
        rig.drives[1].homeless = homeless;
        rig.drives[1].deaf = !homeless;
        rig.released();
        rig.order(Order::Home { axes: ALL, limit });
        rig.until(FaultStop, 100);
        let named = rig.events.iter().any(|event| match event {
            GroupEvent::Fault {
                axis: Some(1),
                cause,
            } => match cause.cause {
                Cause::DriveError => homeless && StatusWord(cause.detail as u16).mode_bit_13(),
                Cause::NotDone => !homeless && cause.detail == Mode::Homing as i32,
                _ => false,
            },
            _ => false,
        });
        assert!(named, "{}", rig.last());
        rig.until(Faulted, 500);
    }
}

#[test]
fn a_torque_is_ramped_and_stops() {
    let mut rig = Rig::in_mode(5, Mode::CyclicTorque);
    rig.released();
    rig.go(|n| AxisMove {
        target: 60 + 5 * n as i32,
        velocity: 1000,
        acceleration: 4000,
        deceleration: 4000,
        set: 0,
    });
    let mut last = [0; AXES];
    for _ in 0..60 {
        rig.step(READY);
        for (command, last) in rig.commands.iter().zip(&mut last) {
            // 1000 per mille a second.
            let more = command.target - *last;
            assert!((0..=11).contains(&more), "{more} from {last}");
            *last = command.target;
        }
    }
    assert_eq!(last, [60, 65, 70, 75, 80, 85]);
    rig.order(Order::Stop);
    rig.step(READY);
    for _ in 0..200 {
        rig.step(READY);
    }
    assert!(rig.commands.iter().all(|command| command.target == 0));
}

/// What the torque does to an axis is not the group's business: the move is done with its
/// path, though the axes turn faster and faster.
#[test]
fn a_torque_is_there_at_the_end_of_its_path() {
    let mut rig = Rig::in_mode(5, Mode::CyclicTorque);
    rig.released();
    rig.go(|_| AxisMove {
        target: 200,
        velocity: 1000,
        acceleration: 4000,
        deceleration: 4000,
        set: 0,
    });
    rig.arrive(400);
    for _ in 0..600 {
        rig.step(READY);
        assert_eq!(rig.group.state(), GroupState::Moving, "{}", rig.last());
    }
    assert!(rig.drives.iter().all(|drive| drive.velocity.abs() > 50.0));
    assert!(rig.group.order(Order::Finish).is_err(), "the axes turn");
}

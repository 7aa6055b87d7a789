//! The group's contract: every event in every state, and what follows.

use canmaster::cia402::{Command, ControlWord, State};
use canmaster::motion::experiment::GROUP;
use canmaster::motion::{
    AxisCommand, AxisFeedback, FaultCause, Group, GroupEvent, GroupState, Refusal, Request,
};

use crate::rig::{AXES, READY, Rig};

use GroupState::{Enabling, FaultStop, Faulted, Idle, Moving, Standby, Stopping};

/// Cycles into the move at which the axes are fast.
const FAST: u32 = 100;
/// The axis that things happen to.
const AXIS: usize = 3;

const STATES: [GroupState; 7] = [
    Idle, Enabling, Standby, Moving, Stopping, FaultStop, Faulted,
];

const HEARTBEAT_LOST: Request = Request {
    fault: Some((AXIS, FaultCause::HeartbeatLost)),
    ..READY
};
const DOWN: Request = Request {
    network_ready: false,
    ..READY
};
const RELEASE: Request = Request {
    release: true,
    ..READY
};
const STOP: Request = Request {
    stop: true,
    ..READY
};

/// A group that has just come to `state`.
fn in_state(state: GroupState) -> Rig {
    let mut rig = match state {
        Idle => Rig::new(1),
        Enabling => {
            let mut rig = Rig::new(1);
            for _ in 0..5 {
                rig.step(READY);
            }
            rig
        }
        Standby => Rig::standby(1),
        Moving => Rig::moving(1, FAST),
        Stopping => {
            let mut rig = Rig::moving(1, FAST);
            rig.step(STOP);
            rig
        }
        FaultStop | Faulted => {
            let mut rig = Rig::moving(1, FAST);
            rig.step(HEARTBEAT_LOST);
            if state == Faulted {
                assert!(rig.until(Faulted, 300) > 0);
            }
            rig
        }
    };
    assert_eq!(rig.group.state(), state);
    rig.events.clear();
    rig
}

/// What can happen, and in how many cycles the group has to notice.
type Happening = (&'static str, fn(&mut Rig, Request), u32);

const HAPPENINGS: [Happening; 10] = [
    ("network down", |rig, _| rig.step(DOWN), 1),
    (
        "release",
        |rig, calm| {
            rig.step(Request {
                release: true,
                ..calm
            })
        },
        1,
    ),
    (
        "stop",
        |rig, calm| rig.step(Request { stop: true, ..calm }),
        1,
    ),
    (
        "release and stop",
        |rig, calm| {
            rig.step(Request {
                release: true,
                stop: true,
                ..calm
            })
        },
        1,
    ),
    (
        "heartbeat lost",
        |rig, calm| {
            rig.step(Request {
                fault: HEARTBEAT_LOST.fault,
                ..calm
            })
        },
        1,
    ),
    (
        "emergency",
        |rig, calm| {
            let cause = FaultCause::Emergency { code: 0x2310 };
            rig.step(Request {
                fault: Some((AXIS, cause)),
                ..calm
            });
        },
        1,
    ),
    (
        "drive fault",
        |rig, calm| {
            rig.drives[AXIS].fail();
            rig.step(calm);
        },
        1,
    ),
    (
        "enable input lost",
        |rig, calm| {
            rig.drives[AXIS].state = State::SwitchOnDisabled;
            rig.step(calm);
        },
        1,
    ),
    (
        "TPDOs missing",
        |rig, calm| {
            rig.silent[AXIS] = true;
            rig.step(calm);
        },
        3,
    ),
    (
        "torn away",
        |rig, calm| {
            rig.drives[AXIS].position += 1000.0;
            rig.step(calm);
        },
        1,
    ),
];

/// The state after each happening, in the order of [`STATES`].
const TABLE: [[GroupState; 7]; 10] = [
    [
        Idle, FaultStop, FaultStop, FaultStop, FaultStop, FaultStop, Faulted,
    ],
    [Idle, Enabling, Moving, Moving, Stopping, FaultStop, Faulted],
    [
        Idle, Enabling, Standby, Stopping, Stopping, FaultStop, Faulted,
    ],
    [
        Idle, Enabling, Standby, Stopping, Stopping, FaultStop, Faulted,
    ],
    [
        Idle, FaultStop, FaultStop, FaultStop, FaultStop, FaultStop, Faulted,
    ],
    [
        Idle, FaultStop, FaultStop, FaultStop, FaultStop, FaultStop, Faulted,
    ],
    [
        Idle, FaultStop, FaultStop, FaultStop, FaultStop, FaultStop, Faulted,
    ],
    // While enabling, the axis is led up again.
    [
        Idle, Enabling, FaultStop, FaultStop, FaultStop, FaultStop, Faulted,
    ],
    [
        Idle, FaultStop, FaultStop, FaultStop, FaultStop, FaultStop, Faulted,
    ],
    // Before it is enabled an axis has no reference to be torn away from.
    [
        Idle, Enabling, FaultStop, FaultStop, FaultStop, FaultStop, Faulted,
    ],
];

/// The only transitions that lead to `Moving` and to `Stopping` are the release
/// in standby and the stop in motion; the state after a fault never leads back.
#[test]
fn every_event_in_every_state() {
    for ((name, happen, cycles), row) in HAPPENINGS.iter().zip(TABLE) {
        for (state, expected) in STATES.into_iter().zip(row) {
            let mut rig = in_state(state);
            let calm = if state == Idle { DOWN } else { READY };
            for cycle in 0..*cycles {
                let before = rig.group.state();
                let unnoticed = before == state || before == Enabling;
                assert!(unnoticed, "{name} in {state}: {before} after {cycle}");
                happen(&mut rig, calm);
            }
            assert_eq!(rig.group.state(), expected, "{name} in {state}");

            let refused = rig
                .events
                .iter()
                .any(|e| matches!(e, GroupEvent::ReleaseRefused(_)));
            let released = name.starts_with("release");
            let accepted = state == Standby && expected == Moving;
            assert_eq!(refused, released && !accepted, "{name} in {state}");

            // And whatever follows by itself ends in a state of rest.
            let last = match expected {
                Idle => Idle,
                // Down and up again: the way out.
                FaultStop | Faulted if *name == "network down" => Standby,
                FaultStop | Faulted => Faulted,
                Enabling | Standby | Moving | Stopping => Standby,
            };
            for _ in 0..1500 {
                rig.step(calm);
                if expected != Moving {
                    assert_ne!(rig.group.state(), Moving, "{name} in {state}");
                }
            }
            assert_eq!(
                rig.group.state(),
                last,
                "{name} in {state}: {:?}",
                rig.events
            );
            assert!(rig.standing(), "{name} in {state}");
        }
    }
}

/// Contract 2: the step that detects carries the stop, all commands fall from
/// there on, and the axes that still obey come to rest in the same cycle.
#[test]
fn a_fault_stops_all_axes_together() {
    for (name, happen, cycles) in HAPPENINGS {
        let mut rig = Rig::moving(7, FAST);
        for _ in 0..cycles {
            assert_eq!(rig.group.state(), Moving);
            happen(&mut rig, READY);
        }
        if rig.group.state() != FaultStop {
            continue;
        }
        // The way out of the fault would begin at once.
        let calm = if name == "network down" { DOWN } else { READY };
        let mut before = rig.commands.map(|c| c.velocity);
        let mut at_zero = [None; AXES];
        // A fifth of the fastest axis' speed per cycle would be 15 000 rpm/s.
        for cycle in 0..60 {
            for (n, (command, before)) in rig.commands.iter().zip(&before).enumerate() {
                let now = command.velocity;
                assert!(now.abs() <= before.abs() && now * before >= 0, "{name}");
                assert!(
                    now != *before || now.abs() <= 1 || cycle == 0,
                    "{name} axis {n}"
                );
                if now == 0 && at_zero[n].is_none() {
                    at_zero[n] = Some(cycle);
                }
            }
            before = rig.commands.map(|c| c.velocity);
            rig.step(calm);
        }
        let obeying: Vec<_> = (0..AXES)
            .filter(|n| rig.drives[*n].state == State::OperationEnabled || *n != AXIS)
            .filter_map(|n| at_zero[n])
            .collect();
        assert!(obeying.len() >= AXES - 1, "{name}");
        let first = obeying.iter().min().unwrap();
        let last = obeying.iter().max().unwrap();
        // Whole rpm: the slower axes round to 0 up to a cycle earlier.
        assert!(last - first <= 1, "{name}: {at_zero:?}");
        for _ in 0..200 {
            rig.step(calm);
        }
        assert_eq!(rig.group.state(), Faulted, "{name}");
        assert!(rig.all(State::SwitchOnDisabled) || rig.drives[AXIS].state == State::Fault);
    }
}

/// The very command of the detecting step is slower than the one before.
#[test]
fn the_detecting_step_carries_the_stop() {
    let mut rig = Rig::moving(3, FAST);
    let before = rig.commands.map(|c| c.velocity.abs());
    rig.step(HEARTBEAT_LOST);
    for (command, before) in rig.commands.iter().zip(before) {
        assert!(command.velocity.abs() < before);
    }
    assert!(rig.events.contains(&GroupEvent::Fault {
        axis: Some(AXIS as u8),
        cause: FaultCause::HeartbeatLost
    }));
}

/// An axis disabled by its own drive is left out: nothing that is sent to it
/// could enable it again, and the log says that it coasts.
#[test]
fn a_failed_axis_is_left_to_its_drive() {
    let mut rig = Rig::moving(5, FAST);
    rig.drives[AXIS].fail();
    for _ in 0..100 {
        rig.step(READY);
        let command = rig.commands[AXIS];
        let word = ControlWord(command.controlword);
        assert_eq!(command.velocity, 0);
        assert!(!word.gives(Command::EnableOperation) && !word.gives(Command::FaultReset));
    }
    let coasting = rig.events.iter().filter(
        |e| matches!(e, GroupEvent::Coasting { axis, state: State::Fault } if *axis == AXIS as u8),
    );
    assert_eq!(coasting.count(), 1);
}

/// Contract 3: out of a fault leads only a network that went down and came up;
/// it leads to standby, and the next release starts where the axes are.
#[test]
fn recovery_leads_to_standby_and_not_to_motion() {
    let mut rig = in_state(Faulted);
    for _ in 0..100 {
        rig.step(RELEASE);
        assert_eq!(rig.group.state(), Faulted);
    }
    rig.step(DOWN);
    assert_eq!(rig.group.state(), Faulted);
    rig.step(READY);
    assert_eq!(rig.group.state(), Enabling);
    while rig.group.state() != Standby {
        rig.step(READY);
        assert!(rig.commands.iter().all(|c| c.velocity == 0));
    }
    let places = rig.drives.each_ref().map(|d| d.position);
    for _ in 0..200 {
        rig.step(READY);
        assert_eq!(rig.group.state(), Standby);
    }
    for (drive, place) in rig.drives.iter().zip(places) {
        assert!((drive.position - place).abs() < 1.0);
    }
    rig.release();
    assert_eq!(rig.group.state(), Moving);
    assert!(rig.until(Standby, 1500) > 0, "{:?}", rig.events);
}

/// An axis that still turns when it is enabled is braked first: standby holds the
/// place where it has come to rest.
#[test]
fn standby_waits_until_every_axis_stands() {
    let mut rig = in_state(Idle);
    rig.drives[AXIS].velocity = 1500.0;
    assert!(rig.until(Standby, 300) > 0, "{:?}", rig.events);
    assert!(rig.drives[AXIS].velocity.abs() < 10.0);
    for _ in 0..200 {
        rig.step(READY);
        assert_eq!(rig.group.state(), Standby, "{:?}", rig.events);
    }
}

/// Faults of the past are reset on the way up.
#[test]
fn enabling_resets_old_faults() {
    let mut rig = Rig::new(2);
    rig.drives[AXIS].fail();
    assert!(rig.until(Standby, 100) > 0, "{:?}", rig.events);
}

/// A drive that stays in one state is named with it, and nothing was enabled
/// alone: all others wait below.
#[test]
fn a_drive_that_does_not_follow_is_named() {
    let stuck = [
        (State::NotReadyToSwitchOn, State::SwitchOnDisabled),
        (State::SwitchOnDisabled, State::ReadyToSwitchOn),
        (State::ReadyToSwitchOn, State::SwitchedOn),
        (State::SwitchedOn, State::OperationEnabled),
        (State::Fault, State::SwitchOnDisabled),
    ];
    for (state, others) in stuck {
        let mut rig = Rig::new(4);
        if state == State::Fault {
            rig.drives[AXIS].fail();
        }
        rig.drives[AXIS].stuck = Some(state);
        for _ in 0..GROUP.cycles(GROUP.enable_timeout) {
            rig.step(READY);
        }
        assert_eq!(rig.group.state(), Enabling, "{state}");
        for (n, drive) in rig.drives.iter().enumerate() {
            assert!(
                n == AXIS || drive.state == others,
                "{state}: axis {n} in {}",
                drive.state
            );
        }
        assert!(rig.until(FaultStop, 20) > 0);
        let named = rig.events.iter().any(|e| {
            let GroupEvent::Fault { axis, cause } = e else {
                return false;
            };
            let FaultCause::NotEnabled(timeout) = cause else {
                return false;
            };
            *axis == Some(AXIS as u8) && timeout.state == Some(state)
        });
        assert!(named, "{state}: {:?}", rig.events);
        assert!(rig.until(Faulted, 50) > 0);
        rig.step(READY);
        rig.step(READY);
        assert!(
            !rig.drives
                .iter()
                .any(|d| d.state == State::OperationEnabled)
        );
    }
}

/// A blocked shaft is a following error with its size.
#[test]
fn a_blocked_axis_stops_the_group() {
    let mut rig = Rig::moving(6, 20);
    rig.drives[AXIS].blocked = true;
    assert!(rig.until(FaultStop, 100) > 0);
    assert!(rig.events.iter().any(|e| matches!(
        e,
        GroupEvent::Fault {
            axis: Some(3),
            cause: FaultCause::FollowingError { allowed: 500, .. }
        }
    )));
}

/// Contract 1 and 5: a release is refused with the reason.
#[test]
fn a_release_is_refused_with_its_reason() {
    let mut rig = Rig::standby(8);
    rig.silent[AXIS] = true;
    rig.step(RELEASE);
    rig.silent[AXIS] = false;
    rig.drives[AXIS].velocity = 20.0;
    rig.step(RELEASE);
    let refusals: Vec<_> = rig
        .events
        .iter()
        .filter_map(|e| match e {
            GroupEvent::ReleaseRefused(why) => Some(*why),
            _ => None,
        })
        .collect();
    assert_eq!(refusals[0], Refusal::NotFresh { axis: AXIS as u8 });
    assert!(matches!(refusals[1], Refusal::NotAtRest { axis: 3, .. }));
    assert_eq!(rig.group.state(), Standby);
    assert!(rig.commands.iter().all(|c| c.velocity == 0));
}

/// A stop in motion: all references end in the same cycle, the axes rest
/// together, and the next release runs the whole program from there.
#[test]
fn a_stop_is_coordinated_and_leads_to_standby() {
    let mut rig = Rig::moving(9, FAST);
    let before = rig.commands.map(|c| c.velocity.abs());
    rig.step(STOP);
    assert!(
        rig.commands
            .iter()
            .zip(before)
            .all(|(c, b)| c.velocity.abs() < b)
    );
    assert!(rig.until(Standby, 200) > 0);
    let stops = rig.observed.map(|o| o.stopped_ms);
    let first = stops.iter().copied().fold(f64::MAX, f64::min);
    let last = stops.iter().copied().fold(0.0, f64::max);
    assert!(last - first < 10.0, "{stops:?}");
    rig.release();
    assert!(rig.until(Standby, 1500) > 0, "{:?}", rig.events);
}

/// Cycles in which no step was made have passed all the same.
#[test]
fn missed_cycles_count_for_the_time() {
    let steps = |passed| -> u32 {
        let mut group = Group::new(&GROUP);
        let mut commands = [AxisCommand::default(); AXES];
        let stuck = AxisFeedback {
            statusword: 0x0240,
            fresh: true,
            ..AxisFeedback::default()
        };
        let request = Request { passed, ..READY };
        let mut step = || {
            group.step(request, &[stuck; AXES], &mut commands);
            group.state() != FaultStop
        };
        (0..100_000).take_while(|_| step()).count() as u32
    };
    let each = steps(1);
    assert!(each > 100, "{each}");
    assert!(steps(10).abs_diff(each / 10) <= 2, "{}", steps(10));
}

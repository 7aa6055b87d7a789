//! Programs: checked against the limits before anything moves; the words of the
//! log.

use canmaster::cia402::{Goal, State, StatusWord, Timeout};
use canmaster::motion::experiment::GROUP;
use canmaster::motion::{
    AxisCommand, AxisFeedback, AxisMove, FaultCause, Group, GroupConfig, GroupEvent, GroupState,
    Limit, PlanError, Program, Refusal, Request, Step,
};
use std::fmt::Write;

const GOOD: AxisMove = AxisMove {
    target: 20_000,
    velocity: 1000,
    acceleration: 2000,
    deceleration: 2000,
    set: 0,
};

/// The experiment's axes with a program of one move of the last axis.
fn with(last: AxisMove) -> GroupConfig<6> {
    let moves = [None, None, None, None, None, Some(last)];
    let steps: &'static [Step<6>] = Box::leak(Box::new([Step::Move(moves)]));
    GroupConfig {
        program: Program { name: "one", steps },
        ..GROUP
    }
}

#[test]
fn duration_of_one_move() {
    let config = with(GOOD);
    // 10 turns at 1000 rpm are 0.6 s, two ramps of half a second at half the
    // speed cost half a second more, and the settling takes 12 cycles.
    let ms = config.program.duration(&config).unwrap().as_millis();
    assert_eq!(ms, 600 + 500 + 120);
}

#[test]
fn the_experiment_is_what_it_says() {
    let Some(Step::Move(there)) = GROUP.program.steps.first() else {
        panic!("the first step moves");
    };
    let there = there.map(|part| part.unwrap());
    assert_eq!(there[0], there[2]);
    assert_eq!(there[1], there[3]);
    assert_eq!(there[4], there[5]);
    for part in there {
        assert!(part.target.unsigned_abs() >= 10 * GROUP.axes[0].increments_per_turn);
    }
    let Some(Step::Move(back)) = GROUP.program.steps.last() else {
        panic!("the last step moves");
    };
    assert!(back.iter().all(|part| part.unwrap().target == 0));
}

#[test]
fn values_outside_the_limits_are_named() {
    let table = [
        (
            AxisMove {
                velocity: 2201,
                ..GOOD
            },
            Limit::Velocity,
            2201,
            2200,
        ),
        (
            AxisMove {
                velocity: 0,
                ..GOOD
            },
            Limit::Velocity,
            0,
            2200,
        ),
        (
            AxisMove {
                acceleration: 4001,
                ..GOOD
            },
            Limit::Acceleration,
            4001,
            4000,
        ),
        (
            AxisMove {
                deceleration: u32::MAX,
                ..GOOD
            },
            Limit::Deceleration,
            i32::MAX,
            4000,
        ),
        (
            AxisMove {
                target: -2_000_001,
                ..GOOD
            },
            Limit::Target,
            -2_000_001,
            2_000_000,
        ),
        (
            AxisMove {
                target: i32::MIN,
                ..GOOD
            },
            Limit::Target,
            i32::MIN,
            2_000_000,
        ),
    ];
    for (part, limit, value, allowed) in table {
        let config = with(part);
        let error = config.program.duration(&config).unwrap_err();
        let expected = PlanError::OutOfLimits {
            axis: 5,
            limit,
            value,
            allowed,
        };
        assert_eq!(error, expected);
    }
}

/// A program that breaks a limit is refused at its release, and nothing moves.
#[test]
fn a_bad_program_is_refused() {
    let config: &'static GroupConfig<6> = Box::leak(Box::new(with(AxisMove {
        velocity: 3000,
        ..GOOD
    })));
    let mut group = Group::new(config);
    let mut out = [AxisCommand::default(); 6];
    let statuswords = [
        0x0240, 0x0240, 0x0231, 0x0231, 0x0233, 0x0233, 0x0237, 0x0237,
    ];
    let mut step = |group: &mut Group<6>, statusword, release| {
        let feedback = [AxisFeedback {
            statusword,
            fresh: true,
            ..AxisFeedback::default()
        }; 6];
        let request = Request {
            network_ready: true,
            release,
            ..Request::default()
        };
        group.step(request, &feedback, &mut out);
        assert!(out.iter().all(|c| c.velocity == 0));
        std::iter::from_fn(|| group.take_event()).last()
    };
    for statusword in statuswords {
        step(&mut group, statusword, false);
    }
    assert_eq!(group.state(), GroupState::Standby);
    let last = step(&mut group, 0x0237, true);
    assert_eq!(group.state(), GroupState::Standby);
    let why = Refusal::Program(config.program.duration(config).unwrap_err());
    assert_eq!(last, Some(GroupEvent::ReleaseRefused(why)));
}

/// Events that nobody takes are counted, not forgotten.
#[test]
fn lost_events_are_counted() {
    let mut group = Group::new(&GROUP);
    let mut out = [AxisCommand::default(); 6];
    for _ in 0..30 {
        let request = Request {
            release: true,
            ..Request::default()
        };
        group.step(request, &[AxisFeedback::default(); 6], &mut out);
    }
    let last = std::iter::from_fn(|| group.take_event()).last();
    assert_eq!(last, Some(GroupEvent::Lost { count: 6 }));
}

#[test]
fn words_of_the_log() {
    let status = StatusWord(0x0208);
    let fault = |cause| GroupEvent::Fault {
        axis: Some(2),
        cause,
    };
    let events = [
        GroupEvent::State {
            from: GroupState::Enabling,
            to: GroupState::Standby,
        },
        GroupEvent::AxisState {
            axis: 0,
            state: State::Other(0x47),
        },
        GroupEvent::ReleaseRefused(Refusal::NotInStandby(GroupState::Faulted)),
        GroupEvent::ReleaseRefused(Refusal::NotFresh { axis: 1 }),
        GroupEvent::ReleaseRefused(Refusal::NotAtRest {
            axis: 1,
            velocity: -20,
        }),
        GroupEvent::ReleaseRefused(Refusal::StopRequested),
        GroupEvent::ReleaseRefused(Refusal::Program(PlanError::OutOfLimits {
            axis: 5,
            limit: Limit::Velocity,
            value: 3000,
            allowed: 2200,
        })),
        GroupEvent::StepStarted { step: 0 },
        GroupEvent::Arrived {
            axis: 3,
            target: -32_000,
            error: 1,
        },
        GroupEvent::ProgramDone,
        fault(FaultCause::DriveFault { status }),
        fault(FaultCause::LeftEnabled {
            status: StatusWord(0x0240),
        }),
        fault(FaultCause::NotEnabled(Timeout {
            state: Some(State::ReadyToSwitchOn),
            goal: Goal::SwitchedOn,
        })),
        fault(FaultCause::NotEnabled(Timeout {
            state: None,
            goal: Goal::Disabled,
        })),
        fault(FaultCause::TpdoMissing { cycles: 3 }),
        fault(FaultCause::FollowingError {
            error: -600,
            allowed: 500,
        }),
        fault(FaultCause::NotArrived { error: 4 }),
        fault(FaultCause::HeartbeatLost),
        fault(FaultCause::Emergency { code: 0x2310 }),
        fault(FaultCause::LeftOperational),
        GroupEvent::Fault {
            axis: None,
            cause: FaultCause::Program(PlanError::TooLong { axis: 2 }),
        },
        GroupEvent::Fault {
            axis: None,
            cause: FaultCause::NetworkLost,
        },
        GroupEvent::Coasting {
            axis: 2,
            state: State::Fault,
        },
        GroupEvent::NotAtRest {
            axis: 2,
            velocity: 700,
        },
        GroupEvent::Lost { count: 6 },
    ];
    let mut log = String::new();
    for event in events {
        writeln!(log, "{event}").unwrap();
    }
    insta::assert_snapshot!(log);
}

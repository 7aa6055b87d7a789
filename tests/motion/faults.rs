//! Random faults at random moments, in random modes: never motion without release,
//! and standstill in the time of the contract.

use canmaster::cia402::State;
use canmaster::motion::experiment::GROUP;
use canmaster::motion::mode::Mode;
use canmaster::motion::{AxisCommand, Group, Inputs, Order};
use canmaster::motion::{AxisFeedback, Cause, GroupEvent, GroupState};
use proptest::prelude::*;

use crate::plant::Random;
use crate::rig::{ALL, AXES, READY, Rig, far};

/// The ramp from the highest speed, the latest detection (a blocked axis needs its
/// following error), and the settling.
const STANDSTILL_CYCLES: u32 = 2200 * 100 / 3000 + 30 + 5;

#[test]
fn a_fault_at_any_moment_ends_at_rest() {
    for seed in 0..120 {
        let mut random = Random::new(seed);
        let modes = [
            Mode::ProfileVelocity,
            Mode::CyclicPosition,
            Mode::CyclicVelocity,
            Mode::ProfilePosition,
        ];
        let mode = modes[random.below(4) as usize];
        let mut rig = Rig::standby(seed);
        if mode != Mode::ProfileVelocity {
            rig.order(Order::SetMode { axes: ALL, mode });
            rig.step(READY);
            rig.until(GroupState::Standby, 50);
        }
        rig.released();
        rig.go(far);
        for _ in 0..random.below(400) {
            rig.step(READY);
        }
        let axis = random.below(AXES as u64) as usize;
        let what = random.below(6);
        let mut inputs = READY;
        match what {
            0 => rig.drives[axis].fail(),
            1 => rig.drives[axis].state = State::SwitchOnDisabled,
            2 => rig.silent[axis] = true,
            3 => inputs.fault = Some((axis, Cause::Emergency.with(0x2310))),
            4 => inputs.network_ready = false,
            _ => rig.drives[axis].position += 3000.0,
        }
        let moved = rig.group.state();
        for cycle in 0..STANDSTILL_CYCLES {
            rig.step(inputs);
            inputs.fault = None;
            if what == 4 {
                inputs.network_ready = false;
            }
            if cycle > 10 && rig.group.state() == GroupState::Moving {
                // Profile position has no reference to be torn away from.
                assert!(
                    what == 5 && mode == Mode::ProfilePosition,
                    "{seed} {what} {mode}"
                );
            }
        }
        if what == 5 && mode == Mode::ProfilePosition {
            continue;
        }
        assert_eq!(moved, GroupState::Moving);
        // One that its drive has let go coasts by friction alone.
        let standing = |(n, drive): (usize, &crate::plant::Drive)| {
            drive.velocity.abs() < 6.0 || (n == axis && matches!(what, 0 | 1))
        };
        assert!(
            rig.drives.iter().enumerate().all(standing),
            "{seed} {what} {mode}: {}",
            rig.last()
        );
        for _ in 0..300 {
            rig.step(inputs);
        }
        assert_eq!(
            rig.group.state(),
            GroupState::Faulted,
            "{seed} {what} {mode}"
        );
        let places = rig.drives.each_ref().map(|drive| drive.position);
        for _ in 0..100 {
            rig.step(inputs);
        }
        for (drive, place) in rig.drives.iter().zip(places) {
            assert!((drive.position - place).abs() < 1.0, "{seed} {what} {mode}");
        }
    }
}

fn feedback() -> impl Strategy<Value = AxisFeedback> {
    // States that lead upwards are as likely as any bits at all.
    let status = prop_oneof![
        any::<u16>(),
        prop::sample::select(vec![0x0240u16, 0x0231, 0x0233, 0x0237, 0x0208]),
    ];
    (
        status,
        any::<i32>(),
        any::<i32>(),
        any::<i16>(),
        prop::bool::weighted(0.9),
    )
        .prop_map(
            |(statusword, position, velocity, torque, fresh)| AxisFeedback {
                statusword,
                position,
                velocity,
                torque,
                fresh,
            },
        )
}

fn order() -> impl Strategy<Value = Option<Order>> {
    prop::sample::select(vec![
        None,
        None,
        None,
        Some(Order::Enable),
        Some(Order::Disable),
        Some(Order::Stop),
        Some(Order::Halt),
        Some(Order::QuickStop),
        Some(Order::Reset),
        Some(Order::Finish),
        Some(Order::SetMode {
            axes: ALL,
            mode: Mode::ProfilePosition,
        }),
    ])
}

proptest! {
    /// Arbitrary feedback and orders, but no release: every velocity is 0, no
    /// set-point is begun, and nothing panics.
    #[test]
    fn without_release_nothing_moves(
        steps in prop::collection::vec(
            (prop::array::uniform6(feedback()), prop::bool::weighted(0.9), order(), 0u8..50, prop::bits::u32::masked(0b10_0001)),
            1..120,
        ),
    ) {
        let mut group = Group::new(&GROUP);
        let mut out = [AxisCommand::default(); AXES];
        for (feedback, network_ready, order, fault, absent) in steps {
            let fault = (fault == 0).then_some((2, Cause::HeartbeatLost.alone()));
            if let Some(order) = order {
                let _ = group.order(order);
            }
            group.step(&Inputs { network_ready, absent, fault, passed: 1 }, &feedback, &mut out);
            for command in &out {
                prop_assert!(command.target == 0 || command.mode.rpdo() == 2);
                prop_assert_eq!(command.controlword & 1 << 4, 0);
                prop_assert!(command.acceleration > 0 && command.deceleration > 0);
            }
            prop_assert_ne!(group.state(), GroupState::Moving);
        }
    }
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
        let inputs = Inputs { passed, ..READY };
        let mut step = || {
            group.step(&inputs, &[stuck; AXES], &mut commands);
            group.state() != GroupState::FaultStop
        };
        (0..100_000).take_while(|_| step()).count() as u32
    };
    let each = steps(1);
    assert!(each > 100, "{each}");
    assert!(steps(10).abs_diff(each / 10) <= 2, "{}", steps(10));
}

/// And so they do for the references, also if a path begins in one of them.
#[test]
fn references_go_on_in_missed_cycles() {
    const MISSED: u32 = 3;
    for steps in 0..15 {
        let gone_on = |each: u32| {
            let mut rig = Rig::standby(7);
            rig.released();
            rig.go(far);
            for _ in 0..steps {
                rig.step(READY);
            }
            let inputs = Inputs {
                passed: each,
                ..READY
            };
            for _ in 0..MISSED / each {
                rig.group.step(&inputs, &rig.feedback, &mut rig.commands);
            }
            assert_eq!(rig.group.state(), GroupState::Moving);
            let references = [0, 1, 2, 3, 4, 5].map(|n| rig.group.view(n).unwrap().reference);
            (rig.group.count(), references)
        };
        assert_eq!(gone_on(1), gone_on(MISSED), "after {steps} steps");
    }
}

#[test]
fn cycles_that_are_late_stop_the_group() {
    let mut rig = Rig::moving(7, 100);
    let cause = Cause::CyclesLate.with(3);
    rig.step(Inputs {
        fault: Some((usize::MAX, cause)),
        ..READY
    });
    assert_eq!(rig.group.state(), GroupState::FaultStop);
    let told = GroupEvent::Fault { axis: None, cause };
    assert!(rig.events.contains(&told), "{}", rig.last());
    rig.until(GroupState::Faulted, 300);
}

//! Never motion without release, whatever comes in.

use canmaster::motion::experiment::GROUP;
use canmaster::motion::{AxisCommand, AxisFeedback, FaultCause, Group, GroupState, Request};
use proptest::prelude::*;

use crate::plant::Random;
use crate::rig::{AXES, Rig};

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

proptest! {
    /// Arbitrary feedback and requests, but no release: every velocity is 0.
    #[test]
    fn without_release_every_velocity_is_zero(
        steps in prop::collection::vec(
            (prop::array::uniform6(feedback()), prop::bool::weighted(0.9), any::<bool>(), 0u8..50, prop::bits::u32::masked(0b10_0001)),
            1..120,
        ),
    ) {
        let mut group = Group::new(&GROUP);
        let mut out = [AxisCommand::default(); AXES];
        for (feedback, network_ready, stop, fault, absent) in steps {
            let fault = (fault == 0).then_some((2, FaultCause::HeartbeatLost));
            let request = Request { network_ready, release: false, stop, fault, passed: 1, absent };
            group.step(request, &feedback, &mut out);
            prop_assert!(out.iter().all(|c| c.velocity == 0));
            prop_assert!(out.iter().all(|c| c.acceleration > 0 && c.deceleration > 0));
            prop_assert_ne!(group.state(), GroupState::Moving);
        }
    }
}

/// Random faults at random moments, with releases and stops: only a release in
/// standby starts motion, and only motion is followed by velocities.
#[test]
fn velocities_follow_releases_only() {
    let mut moved = 0;
    for seed in 0..150 {
        let mut random = Random::new(seed + 1_000_000);
        let mut rig = Rig::new(seed);
        let mut network_ready = false;
        let mut absent = 0;
        for _ in 0..600 {
            let axis = random.below(AXES as u64) as usize;
            match random.below(600) {
                0 => rig.drives[axis].fail(),
                1 | 2 => rig.silent[axis] = true,
                3..60 => rig.silent = [false; AXES],
                60 => network_ready = false,
                61..90 => network_ready = true,
                90 => absent = 1 << axis,
                91..110 => absent = 0,
                _ => {}
            }
            let request = Request {
                network_ready,
                release: random.below(40) == 0,
                stop: random.below(200) == 0,
                fault: (random.below(600) == 0).then_some((axis, FaultCause::HeartbeatLost)),
                passed: 1,
                absent,
            };
            let before = rig.group.state();
            rig.step(request);
            let state = rig.group.state();
            let commanded = rig.commands.iter().any(|c| c.velocity != 0);
            let moving = matches!(
                state,
                GroupState::Moving | GroupState::Stopping | GroupState::FaultStop
            );
            assert!(!commanded || moving, "seed {seed}: {state}");
            if state == GroupState::Moving && before != GroupState::Moving {
                assert!(
                    before == GroupState::Standby && request.release,
                    "seed {seed}"
                );
                moved += 1;
            }
        }
    }
    assert!(moved > 50, "the test has to move at all: {moved}");
}

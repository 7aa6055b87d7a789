//! Programs: their bytes, what is refused, and what they do.

use canmaster::motion::experiment::GROUP;
use canmaster::motion::format::{self, ProgramError, ProgramFault};
use canmaster::motion::mode::Mode;
use canmaster::motion::{GroupEvent, GroupState, Limit, PlanError};
use canmaster::sdo::Crc16;
use proptest::prelude::*;

use crate::rig::{AXES, READY, Rig};

/// Frame and checksum around steps.
fn program(steps: &[Vec<u8>]) -> Vec<u8> {
    let steps = steps.concat();
    let mut bytes = vec![format::VERSION, AXES as u8];
    bytes.extend((steps.len() as u16).to_le_bytes());
    bytes.extend(steps);
    let crc = Crc16::new().update(&bytes).get();
    bytes.extend(crc.to_le_bytes());
    bytes
}

fn go(flags: u8, jerk: u32, parts: &[(u16, i32, u32, u32, u32, u8)]) -> Vec<u8> {
    let axes = parts.iter().fold(0, |axes, part| axes | 1u16 << part.0);
    let mut bytes = vec![1, flags];
    bytes.extend(axes.to_le_bytes());
    bytes.extend(jerk.to_le_bytes());
    for (_, target, velocity, up, down, set) in parts {
        bytes.extend(target.to_le_bytes());
        for number in [velocity, up, down] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.push(*set);
    }
    bytes
}

fn wait(ms: u32) -> Vec<u8> {
    [vec![2], ms.to_le_bytes().to_vec()].concat()
}

fn times(times: u16) -> Vec<u8> {
    [vec![3], times.to_le_bytes().to_vec()].concat()
}

const END: &[u8] = &[4];

fn numbers(code: u8, fields: &[u16], numbers: &[i32]) -> Vec<u8> {
    let mut bytes = vec![code];
    bytes.extend(fields.iter().flat_map(|field| field.to_le_bytes()));
    bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    bytes
}

fn run(bytes: Vec<u8>, cycles: u32) -> Rig {
    assert_eq!(format::check(&bytes, &GROUP), Ok(()));
    let mut rig = Rig::standby(1);
    rig.program = bytes;
    rig.run();
    rig.step(READY);
    for _ in 0..cycles {
        rig.step(READY);
        if rig.notices.contains(&GroupEvent::ProgramDone) {
            assert_eq!(rig.group.state(), GroupState::Standby);
            return rig;
        }
    }
    panic!("{}", rig.last());
}

fn homes(rig: &Rig) -> [f64; AXES] {
    core::array::from_fn(|n| f64::from(rig.group.view(n).unwrap().home))
}

#[test]
fn moves_waits_and_loops() {
    let rig = run(
        program(&[
            times(3),
            go(
                1,
                0,
                &[(0, 1000, 600, 2000, 2000, 0), (1, -500, 600, 2000, 2000, 0)],
            ),
            wait(50),
            END.to_vec(),
            go(0, 5000, &[(2, 4000, 600, 2000, 2000, 0)]),
        ]),
        2000,
    );
    let homes = homes(&rig);
    for (n, way) in [3000.0, -1500.0, 4000.0, 0.0].into_iter().enumerate() {
        assert!(
            (rig.drives[n].position - homes[n] - way).abs() <= 3.0,
            "axis {n}"
        );
    }
    let steps: Vec<_> = rig
        .notices
        .iter()
        .filter_map(|notice| match notice {
            GroupEvent::StepStarted { step } => Some(*step + 1),
            _ => None,
        })
        .collect();
    assert!(steps.contains(&5) && steps.iter().filter(|step| **step == 2).count() == 3);
}

/// A sine ends where it began, has its amplitude, and its speed is a sine.
#[test]
fn a_sine() {
    for points in [36, 250, 1] {
        let cycles = if points == 1 { 200 } else { 2 };
        if points == 1 {
            continue;
        }
        let bytes = program(&[numbers(5, &[0b11, points, cycles, 3], &[1000, -700])]);
        assert_eq!(format::check(&bytes, &GROUP), Ok(()), "{points}");
        let mut rig = Rig::standby(1);
        let from: [f64; AXES] = core::array::from_fn(|n| rig.drives[n].position.round());
        rig.program = bytes;
        rig.run();
        let (mut high, mut low) = (f64::MIN, f64::MAX);
        for _ in 0..3000 {
            rig.step(READY);
            high = high.max(rig.drives[0].position - from[0]);
            low = low.min(rig.drives[1].position - from[1]);
        }
        assert!(
            rig.notices.contains(&GroupEvent::ProgramDone),
            "{}",
            rig.last()
        );
        assert!((high - 2000.0).abs() < 20.0, "{high}");
        assert!((low + 1400.0).abs() < 20.0, "{low}");
        for (n, from) in from.into_iter().enumerate() {
            assert!((rig.drives[n].position - from).abs() <= 3.0);
        }
    }
}

#[test]
fn a_table() {
    let numbers_of = [100, -100, 400, -300, 900, -600, 1000, -800, 400, 0];
    let rig = run(program(&[numbers(6, &[0b101, 20, 5], &numbers_of)]), 2000);
    let homes = homes(&rig);
    assert!((rig.drives[0].position - homes[0] - 400.0).abs() <= 3.0);
    assert!((rig.drives[2].position - homes[2]).abs() <= 3.0);
}

/// The speed does not fall to 0 at way-points in between.
#[test]
fn way_points_are_passed_with_blends() {
    let points = [
        1200, 3000, 1200, 3000, // velocity and acceleration of both
        10_000, 4000, 20_000, 8000, 30_000, -2000, 30_000, -9000,
    ];
    let bytes = program(&[numbers(7, &[0b11, 4], &points)]);
    assert_eq!(format::check(&bytes, &GROUP), Ok(()));
    let mut rig = Rig::standby(3);
    let homes = homes(&rig);
    rig.program = bytes;
    rig.run();
    let mut slowest = f64::MAX;
    for _ in 0..2000 {
        rig.step(READY);
        let at = rig.drives[0].position - homes[0];
        if (4000.0..16_000.0).contains(&at) {
            slowest = slowest.min(rig.drives[0].velocity.abs());
        }
    }
    assert!(
        rig.notices.contains(&GroupEvent::ProgramDone),
        "{}",
        rig.last()
    );
    assert!(slowest > 500.0, "{slowest}");
    assert!((rig.drives[0].position - homes[0] - 30_000.0).abs() <= 3.0);
    assert!((rig.drives[1].position - homes[1] + 9000.0).abs() <= 3.0);
}

/// Homing and modes inside of a program: one release counts for all of it.
#[test]
fn home_then_move_in_another_mode() {
    let mode = |mode: Mode| [vec![9, 0b11, 0], vec![mode.code() as u8]].concat();
    let home = [vec![8, 0b11, 0], 1000u32.to_le_bytes().to_vec()].concat();
    let rig = run(
        program(&[
            mode(Mode::Homing),
            home,
            mode(Mode::CyclicPosition),
            go(
                0,
                0,
                &[(0, 5000, 600, 2000, 2000, 0), (1, -500, 600, 2000, 2000, 0)],
            ),
        ]),
        2000,
    );
    assert!((rig.drives[0].position - 5000.0).abs() <= 5.0);
    assert!((rig.drives[1].position + 500.0).abs() <= 5.0);
}

#[test]
fn halt_goes_on_with_the_interrupted_step() {
    let bytes = program(&[
        go(0, 0, &[(0, 40_000, 1200, 2000, 2000, 0)]),
        go(0, 0, &[(0, 0, 1200, 2000, 2000, 0)]),
    ]);
    let mut rig = Rig::standby(1);
    rig.program = bytes;
    rig.run();
    for _ in 0..60 {
        rig.step(READY);
    }
    rig.order(canmaster::motion::Order::Halt);
    for _ in 0..200 {
        rig.step(READY);
    }
    assert!(rig.standing());
    rig.run();
    for _ in 0..1000 {
        rig.step(READY);
    }
    assert!(
        rig.notices.contains(&GroupEvent::ProgramDone),
        "{:?}",
        rig.notices
    );
    let steps: Vec<_> = rig.notices.clone();
    let expected = [
        GroupEvent::StepStarted { step: 0 },
        GroupEvent::StepStarted { step: 0 },
        GroupEvent::StepStarted { step: 1 },
        GroupEvent::ProgramDone,
    ];
    assert_eq!(steps, expected);
}

/// A stop ends the program: the next release begins it anew.
#[test]
fn a_stop_ends_the_program() {
    let bytes = program(&[go(0, 0, &[(0, 40_000, 1200, 2000, 2000, 0)])]);
    let mut rig = Rig::standby(1);
    rig.program = bytes;
    rig.run();
    for _ in 0..60 {
        rig.step(READY);
    }
    rig.order(canmaster::motion::Order::Stop);
    rig.until(GroupState::Standby, 300);
    for _ in 0..100 {
        rig.step(READY);
        assert_eq!(rig.commands[0].target, 0);
    }
    assert_eq!(rig.director.step(), 0);
    rig.run();
    for _ in 0..1000 {
        rig.step(READY);
    }
    assert!(rig.notices.contains(&GroupEvent::ProgramDone));
}

/// What depends on where the axes are is found when the step begins: the group
/// stops, and the step is named.
#[test]
fn a_relative_move_out_of_the_travel_fails_at_its_step() {
    let bytes = program(&[
        go(1, 0, &[(0, 1000, 1200, 2000, 2000, 0)]),
        go(1, 0, &[(0, 2_000_000, 1200, 2000, 2000, 0)]),
    ]);
    let mut rig = Rig::standby(1);
    rig.program = bytes;
    rig.run();
    for _ in 0..500 {
        rig.step(READY);
    }
    let failed = rig.notices.iter().find_map(|notice| match notice {
        GroupEvent::ProgramFailed(error) => Some(*error),
        _ => None,
    });
    let fault = ProgramFault::Limit(PlanError::OutOfLimits {
        axis: 0,
        limit: Limit::Target,
        value: 2_001_000,
        allowed: 2_000_000,
    });
    assert_eq!(failed, Some(ProgramError { step: 2, fault }));
    assert_eq!(rig.group.state(), GroupState::Standby);
}

#[test]
fn what_is_wrong_is_named() {
    let good = go(0, 0, &[(0, 1, 1, 1, 1, 0)]);
    let fault = |bytes: &[u8]| format::check(bytes, &GROUP).unwrap_err();
    let of = |steps: &[Vec<u8>]| fault(&program(steps));
    let whole = |fault| ProgramError { step: 0, fault };
    let at = |step, fault| ProgramError { step, fault };

    let bytes = program(std::slice::from_ref(&good));
    let mut version = bytes.clone();
    version[0] = 2;
    assert_eq!(fault(&version), whole(ProgramFault::Version(2)));
    let mut axes = bytes.clone();
    axes[1] = 5;
    assert_eq!(fault(&axes), whole(ProgramFault::Axes(5)));
    let mut longer = bytes.clone();
    longer.push(0);
    assert_eq!(fault(&longer), whole(ProgramFault::Length));
    for length in 0..bytes.len() {
        assert_eq!(fault(&bytes[..length]), whole(ProgramFault::Length));
    }
    for at in 4..bytes.len() {
        let mut broken = bytes.clone();
        broken[at] ^= 0x10;
        assert_eq!(fault(&broken), whole(ProgramFault::Checksum));
    }

    assert_eq!(
        of(&[good.clone(), vec![99]]),
        at(2, ProgramFault::UnknownStep(99))
    );
    assert_eq!(of(&[vec![0]]), at(1, ProgramFault::UnknownStep(0)));
    assert_eq!(of(&[vec![2, 0]]), at(1, ProgramFault::Length));
    let seventh = go(0, 0, &[(6, 1, 1, 1, 1, 0)]);
    assert_eq!(of(&[seventh]), at(1, ProgramFault::UnknownAxis(1 << 6)));
    assert_eq!(of(&[go(0, 0, &[])]), at(1, ProgramFault::UnknownAxis(0)));
    assert_eq!(of(&[END.to_vec()]), at(1, ProgramFault::Loop));
    assert_eq!(of(&[times(1)]), at(1, ProgramFault::Loop));
    let deep = vec![times(1); 5];
    assert_eq!(of(&deep), at(5, ProgramFault::Loop));
    assert_eq!(of(&[vec![9, 1, 0, 7]]), at(1, ProgramFault::NoSuchMode(7)));
    let nothing = numbers(5, &[1, 0, 1, 1], &[5]);
    assert_eq!(of(&[nothing]), at(1, ProgramFault::Nothing));

    let limit = |axis, limit, value, allowed| {
        ProgramFault::Limit(PlanError::OutOfLimits {
            axis,
            limit,
            value,
            allowed,
        })
    };
    let steep = go(0, 0, &[(3, 1, 1, 100_000, 1, 0)]);
    let expected = limit(3, Limit::Acceleration, 100_000, 4000);
    assert_eq!(of(&[good.clone(), steep]), at(2, expected));
    // 2 pi 1000 increments in 10 cycles: 1885 rpm, and far too steep.
    let sine = numbers(5, &[0b10, 10, 1, 1], &[1000]);
    assert!(matches!(
        of(&[sine]),
        ProgramError {
            step: 1,
            fault: ProgramFault::Limit(PlanError::OutOfLimits {
                axis: 1,
                limit: Limit::Acceleration,
                ..
            })
        }
    ));
    let table = numbers(6, &[1, 1, 2], &[10_000, 20_000]);
    assert!(matches!(of(&[table]).fault, ProgramFault::Limit(_)));
}

proptest! {
    /// Any bytes: an error or not, but no panic, neither in the check nor while
    /// they run.
    #[test]
    fn any_steps_are_checked(steps in prop::collection::vec(any::<u8>(), 0..80)) {
        let bytes = program(&[steps]);
        if format::check(&bytes, &GROUP).is_ok() {
            let mut rig = Rig::standby(1);
            rig.program = bytes;
            rig.run();
            for _ in 0..50 {
                rig.step(READY);
            }
        }
    }

    #[test]
    fn any_bytes_are_checked(bytes in prop::collection::vec(any::<u8>(), 0..80)) {
        let _ = format::check(&bytes, &GROUP);
    }
}

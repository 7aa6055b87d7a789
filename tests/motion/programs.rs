//! Programs: their bytes, what is refused, and what they do.

use canmaster::motion::experiment::GROUP;
use canmaster::motion::format;
use canmaster::motion::mode::Mode;
use canmaster::motion::{GroupEvent, GroupState, Reason, Refusal};
use canmaster::sdo::Crc16;
use canmaster_network::program::pairs;

use crate::compiled::{compiled, group};
use crate::rig::{AXES, CYCLE_MS, READY, Rig};

/// Frame and checksum around steps.
pub(crate) fn program(steps: &[Vec<u8>]) -> Vec<u8> {
    let steps = steps.concat();
    let mut bytes = vec![format::VERSION, AXES as u8];
    bytes.extend((steps.len() as u16).to_le_bytes());
    bytes.extend(10_000u32.to_le_bytes());
    bytes.extend(steps);
    let crc = Crc16::new().update(&bytes).get();
    bytes.extend(crc.to_le_bytes());
    bytes
}

fn head(kind: u8, flags: u8, axes: u16, value: u32) -> Vec<u8> {
    let mut bytes = vec![kind, flags];
    bytes.extend(axes.to_le_bytes());
    bytes.extend(value.to_le_bytes());
    bytes
}

/// A trapezoid of the axes with a part: axis, target, velocity and slope.
fn go(flags: u8, parts: &[(u16, i32, u32, u32)]) -> Vec<u8> {
    let axes = parts.iter().fold(0, |axes, part| axes | 1u16 << part.0);
    let mut bytes = head(format::MOVE, flags, axes, 0);
    for (_, target, velocity, slope) in parts {
        bytes.extend(target.to_le_bytes());
        for number in [velocity, slope, slope] {
            bytes.extend(number.to_le_bytes());
        }
    }
    bytes
}

/// A shape for axis 1: cycles, position and velocity of each point.
fn shape(flags: u8, value: u32, amplitude: i32, points: &[(u16, i32, i32)]) -> Vec<u8> {
    let mut bytes = head(format::PATH, flags, 1, value);
    bytes.extend(amplitude.to_le_bytes());
    bytes.extend([0; 4]);
    for (cycles, position, velocity) in points {
        bytes.extend(cycles.to_le_bytes());
        bytes.extend(position.to_le_bytes());
        bytes.extend(velocity.to_le_bytes());
    }
    bytes
}

pub(crate) fn wait(cycles: u32) -> Vec<u8> {
    head(format::WAIT, 0, 0, cycles)
}

fn times(times: u32) -> Vec<u8> {
    head(format::LOOP, 0, 0, times)
}

fn end() -> Vec<u8> {
    head(format::END_LOOP, 0, 0, 0)
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
            go(1, &[(0, 1000, 600, 2000), (1, -500, 600, 2000)]),
            wait(5),
            end(),
            go(0, &[(2, 4000, 600, 2000)]),
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

/// One release runs the experiment, as long as its course says.
#[test]
fn the_experiment_takes_as_long_as_it_says() {
    let program = pairs(&group());
    let start = Rig::standby(2).cycle;
    let rig = run(program.bytes(), 1500);
    let took = f64::from(rig.cycle - start) * CYCLE_MS;
    let expected = program.course(&group()).cycles as f64 * CYCLE_MS;
    assert!(
        (took - expected).abs() < 0.02 * expected,
        "{took} {expected}"
    );
    let steps = rig
        .notices
        .iter()
        .filter(|event| matches!(event, GroupEvent::StepStarted { .. }));
    assert_eq!(steps.count(), 3);
    assert!(rig.standing());
}

/// A sine ends where it began and has its amplitude.
#[test]
fn a_sine() {
    for (points, cycles) in [(36, 4), (250, 1), (40, 30)] {
        let text = format!(
            "[[step]]\n[step.sine]\naxes = [\"axis 1\", \"axis 2\"]\n\
             amplitude = [1000, -700]\npoints = {points}\ncycles = {cycles}\nperiods = 2"
        );
        let mut rig = Rig::standby(1);
        let from: [f64; AXES] = core::array::from_fn(|n| rig.drives[n].position.round());
        rig.program = compiled(&text).bytes();
        assert_eq!(format::check(&rig.program, &GROUP), Ok(()), "{points}");
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
fn a_table_and_a_trapezoid() {
    let text = "[[step]]\n[step.table]\naxes = [\"axis 1\", \"axis 3\"]\nevery_ms = 200\n\
        points = [[100, -100], [400, -300], [900, -600], [1000, -800], [400, 0]]\n\
        [[step]]\n[step.trapezoid]\naxes = [\"axis 2\"]\namplitude = 5000\nramp_ms = 300\n\
        speed_ms = 500\nrest_ms = 200\nperiods = 2";
    let rig = run(compiled(text).bytes(), 2000);
    let homes = homes(&rig);
    assert!((rig.drives[0].position - homes[0] - 400.0).abs() <= 3.0);
    assert!((rig.drives[2].position - homes[2]).abs() <= 3.0);
    assert!((rig.drives[1].position - homes[1]).abs() <= 3.0);
    assert!((rig.observed[1].highest - homes[1] - 5000.0).abs() <= 10.0);
}

/// The speed does not fall to 0 at way-points in between.
#[test]
fn way_points_are_passed_with_blends() {
    let text = "velocity = 1200\nacceleration = 3000\n[[step]]\n[[step.move]]\nto = 0\n[[step]]\n\
        [step.path]\naxes = [\"axis 1\", \"axis 2\"]\n\
        points = [[10_000, 4000], [20_000, 8000], [30_000, -2000], [30_000, -9000]]";
    let mut rig = Rig::standby(3);
    let homes = homes(&rig);
    rig.program = compiled(text).bytes();
    assert_eq!(format::check(&rig.program, &GROUP), Ok(()));
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

/// A step that does not wait is finished by its drive before it takes the next one,
/// whatever stands between the two; no other step keeps the next one waiting.
#[test]
fn what_a_drive_leads_is_finished_unless_it_was_waited_for() {
    const IMMEDIATELY: u16 = 1 << 5;
    let position = |flags, target| go(flags, &[(0, target, 600, 2000)]);
    let (out, back) = (position(2, 6000), position(0, 0));
    let of = |steps: &[Vec<u8>]| {
        let mut rig = Rig::in_mode(1, Mode::ProfilePosition);
        rig.program = program(steps);
        assert_eq!(format::check(&rig.program, &GROUP), Ok(()));
        rig.run();
        let (mut begun, mut before) = (Vec::new(), u16::MAX);
        while !rig.notices.contains(&GroupEvent::ProgramDone) {
            rig.step(READY);
            let word = rig.commands[0].controlword;
            let moving = rig.group.state() == GroupState::Moving;
            if moving && word & !before & 1 << 4 != 0 {
                begun.push(word & IMMEDIATELY != 0);
            }
            before = word;
            assert!(rig.cycle < 4000, "{}", rig.last());
        }
        begun
    };
    assert_eq!(of(&[out.clone(), back.clone()]), [true, false]);
    let repeated = [times(2), out.clone(), end(), back.clone()];
    assert_eq!(of(&repeated), [true, false, false]);
    let waited = [times(2), position(0, 6000), end(), back.clone()];
    assert_eq!(of(&waited), [true, true, true]);
    assert_eq!(of(&[out.clone(), wait(3), back.clone()]), [true, false]);
    // Mode 3 is no flag: nothing that does not wait.
    let modes = |mode| head(format::MODE, mode, 2, 0);
    assert_eq!(of(&[modes(3), back.clone()]), [true]);
    assert_eq!(of(&[out, modes(10), back]), [true, true]);
}

/// A distance is told to a drive in profile position mode as such (bit 6); it counts
/// from the set-point before, whatever was stopped in between.
#[test]
fn a_distance_is_told_to_the_drive() {
    const RELATIVE: u16 = 1 << 6;
    let by = |flags: u8, way| go(1 | flags, &[(0, way, 600, 2000)]);
    let mut rig = Rig::in_mode(1, Mode::ProfilePosition);
    rig.program = program(&[by(0, 40_000)]);
    rig.run();
    for _ in 0..100 {
        rig.step(READY);
    }
    rig.order(canmaster::motion::Order::Stop);
    rig.until(GroupState::Standby, 300);
    let from = rig.drives[0].position;
    rig.program = program(&[by(0, 3000), by(0, -1000), go(0, &[(1, 700, 600, 2000)])]);
    rig.run();
    let (mut told, mut before) = (Vec::new(), u16::MAX);
    while !rig.notices.contains(&GroupEvent::ProgramDone) {
        rig.step(READY);
        let command = rig.commands[0];
        let moving = rig.group.state() == GroupState::Moving;
        if moving && command.controlword & !before & 1 << 4 != 0 {
            told.push((command.controlword & RELATIVE != 0, command.target));
        }
        before = command.controlword;
        assert!(rig.cycle < 4000, "{}", rig.last());
    }
    assert_eq!(told, [(true, 3000), (true, -1000)]);
    assert!((rig.drives[0].position - from - 2000.0).abs() < 3.0);
    let end = rig.group.view(0).unwrap().end;
    assert!((rig.drives[0].position - f64::from(end)).abs() < 3.0);
    // In standby the target is where the axis is.
    assert_eq!(rig.commands[0].target, end);
}

/// In torque mode a move has the limits of torques, elsewhere those of positions; where
/// the axis is in another mode than its step is made for, nothing of it is done.
#[test]
fn a_torque_is_no_position() {
    let torque = |target, rate: u32| {
        let mut step = go(0, &[(0, target, 0, 1)]);
        step[12..16].copy_from_slice(&(rate | 1 << 31).to_le_bytes());
        step
    };
    let mut tight = GROUP;
    tight.axes[0].travel = (-10, 10);
    let check = |step| format::check(&program(&[step]), &tight);
    assert_eq!(check(torque(-600, 5000)), Ok(()));
    let why = check(torque(1001, 5000)).unwrap_err();
    let found = (why.reason, why.step, why.value, why.allowed);
    assert_eq!(found, (Reason::Torque, 1, 1001, 1000));
    let why = check(go(0, &[(0, 600, 100, 1)])).unwrap_err();
    assert_eq!(why.reason, Reason::Target);
    for (step, mode) in [
        (torque(60, 5000), Mode::ProfileVelocity),
        (go(0, &[(0, 60, 100, 1000)]), Mode::CyclicTorque),
    ] {
        let mut rig = Rig::in_mode(1, mode);
        rig.program = program(&[step]);
        rig.run();
        rig.until(GroupState::Standby, 300);
        let failed = rig.notices.iter().find_map(|notice| match notice {
            GroupEvent::ProgramFailed(why) => Some((why.reason, why.axis, why.step)),
            _ => None,
        });
        assert_eq!(failed, Some((Reason::WrongMode, 0, 1)));
    }
}

/// The compiler says which moves are of torques.
#[test]
fn a_torque_of_a_program_is_marked() {
    let text = "velocity = 3000\nacceleration = 20_000\n[[step]]\n[step.mode]\n\
        axes = [\"axis 1\"]\nis = \"cyclic synchronous torque\"\n[[step]]\nsettle = false\n\
        [[step.move]]\naxes = [\"axis 1\"]\nto = 50\nvelocity = 9000\n\
        acceleration = 900_000\n[[step.move]]\naxes = [\"axis 2\"]\nto = 500\n\
        [[step]]\nwait_ms = 100\n[[step]]\n[[step.move]]\naxes = [\"axis 1\"]\nto = 0";
    let rig = run(compiled(text).bytes(), 2000);
    let at = rig.drives[1].position - homes(&rig)[1];
    assert!((at - 500.0).abs() <= 3.0, "{at}");
}

/// Homing and modes inside of a program: one release counts for all of it.
#[test]
fn home_then_move_in_another_mode() {
    let axes = "axes = [\"axis 1\", \"axis 2\"]";
    let text = format!(
        "velocity = 600\nacceleration = 2000\n[[step]]\n[step.home]\n{axes}\n\
         [[step]]\n[step.mode]\n{axes}\nis = \"cyclic synchronous position\"\n\
         [[step]]\n[[step.move]]\n{axes}\nto = [5000, -500]"
    );
    let rig = run(compiled(&text).bytes(), 2000);
    assert_eq!(rig.drives[0].mode, Mode::CyclicPosition);
    assert!((rig.drives[0].position - 5000.0).abs() <= 5.0);
    assert!((rig.drives[1].position + 500.0).abs() <= 5.0);
}

#[test]
fn halt_goes_on_with_the_interrupted_step() {
    let bytes = program(&[
        go(0, &[(0, 40_000, 1200, 2000)]),
        go(0, &[(0, 0, 1200, 2000)]),
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
    let bytes = program(&[go(0, &[(0, 40_000, 1200, 2000)])]);
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
        go(1, &[(0, 1000, 1200, 2000)]),
        go(1, &[(0, 1_073_741_823, 1200, 2000)]),
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
    let expected = Refusal {
        reason: Reason::Target,
        axis: 0,
        step: 2,
        value: 1_073_742_823,
        allowed: 1_073_741_823,
    };
    assert_eq!(failed, Some(expected));
    assert_eq!(rig.group.state(), GroupState::Standby);
}

/// A path that counts from home begins where it says, or not at all.
#[test]
fn a_path_begins_where_it_says() {
    let path = shape(0, 1 << 16 | 1, 1 << 30, &[(100, 400, 0)]);
    let mut rig = Rig::standby(1);
    rig.program = program(&[go(0, &[(0, 50, 600, 2000)]), path]);
    assert_eq!(format::check(&rig.program, &GROUP), Ok(()));
    rig.run();
    for _ in 0..300 {
        rig.step(READY);
    }
    let failed = rig.notices.last();
    let Some(GroupEvent::ProgramFailed(error)) = failed else {
        panic!("{failed:?}");
    };
    let found = (error.reason, error.step, error.value, error.allowed);
    assert_eq!(found, (Reason::Begin, 2, 50, 0));
    assert_eq!(rig.group.state(), GroupState::Standby);
}

/// What is wrong with `bytes`: fault, axis, step, value, allowed.
fn wrong(bytes: &[u8]) -> (Reason, u8, u16, i32, i32) {
    let error = format::check(bytes, &GROUP).unwrap_err();
    let Refusal {
        reason,
        axis,
        step,
        value,
        allowed,
    } = error;
    (reason, axis, step, value, allowed)
}

const NONE: u8 = Refusal::NO_AXIS;

#[test]
fn a_frame_that_is_wrong_is_named() {
    let bytes = program(&[wait(1)]);
    let with = |at: usize, value: u8| {
        let mut bytes = bytes.clone();
        bytes[at] = value;
        wrong(&bytes)
    };
    assert_eq!(with(0, 1), (Reason::Version, NONE, 0, 1, 2));
    assert_eq!(with(1, 5), (Reason::Axes, NONE, 0, 5, 6));
    assert_eq!(with(4, 0), (Reason::Cycle, NONE, 0, 9984, 10_000));
    let longer = [&bytes[..], &[0]].concat();
    assert_eq!(wrong(&longer), (Reason::Length, NONE, 0, 19, 18));
    for length in 0..bytes.len() {
        assert!(format::check(&bytes[..length], &GROUP).is_err());
    }
    for (at, byte) in bytes.iter().enumerate().skip(8) {
        assert_eq!(with(at, byte ^ 0x10).0, Reason::Checksum, "{at}");
    }
    let error = format::check(&bytes[..8], &GROUP).unwrap_err();
    assert_eq!(error.to_string(), "length in bytes is 8, allowed is 18");
}

#[test]
fn a_step_that_is_wrong_is_named() {
    let good = go(0, &[(0, 1, 1, 1)]);
    let of = |steps: &[Vec<u8>]| wrong(&program(steps));
    let unknown = head(99, 0, 0, 0);
    assert_eq!(of(&[good, unknown]), (Reason::Step, NONE, 2, 99, 7));
    assert_eq!(of(&[vec![0]]).0, Reason::Length);
    assert_eq!(of(&[vec![1, 0, 1, 0]]).0, Reason::Length);
    let seventh = go(0, &[(6, 1, 1, 1)]);
    assert_eq!(of(&[seventh]), (Reason::Members, NONE, 1, 64, 63));
    assert_eq!(of(&[go(0, &[])]), (Reason::Members, NONE, 1, 0, 63));
    assert_eq!(of(&[end()]), (Reason::Loop, NONE, 1, 0, 4));
    assert_eq!(of(&[times(1)]), (Reason::Loop, NONE, 0, 1, 0));
    assert_eq!(of(&vec![times(1); 5]), (Reason::Loop, NONE, 5, 5, 4));
    let mode = head(format::MODE, 7, 1, 0);
    assert_eq!(of(&[mode]), (Reason::Mode, 0, 1, 7, 0x3A5));
    let steep = go(0, &[(3, 1, 1, 100_000)]);
    assert_eq!(of(&[steep]), (Reason::Acceleration, 3, 1, 100_000, 20_000));
    let fast = go(0, &[(4, 1, 3001, 1)]);
    assert_eq!(of(&[fast]), (Reason::Velocity, 4, 1, 3001, 3000));
    let none = go(0, &[(4, 1, 0, 1)]);
    assert_eq!(of(&[none]), (Reason::Velocity, 4, 1, 0, 3000));
    let far = go(0, &[(2, i32::MIN, 1, 1)]);
    let expected = (Reason::Target, 2, 1, i32::MIN, -1_073_741_823);
    assert_eq!(of(&[far]), expected);
}

/// What a step does not have is no part of it: flags, axes, and times without end.
#[test]
fn a_step_has_no_more_than_it_may() {
    let of = |steps: &[Vec<u8>]| wrong(&program(steps));
    let with = |kind, flags, axes, value| of(&[head(kind, flags, axes, value)]);
    let mut odd = go(0, &[(0, 1, 1, 1)]);
    odd[1] = 4;
    assert_eq!(of(&[odd]), (Reason::Step, NONE, 1, 4, 3));
    let mut odd = shape(1, 1 << 16 | 1, 1, &[(10, 0, 0)]);
    odd[1] = 8;
    assert_eq!(of(&[odd]), (Reason::Step, NONE, 1, 8, 7));
    for kind in [format::WAIT, format::LOOP, format::END_LOOP] {
        let steps = [times(1), wait(1), head(kind, 1, 0, 1)];
        assert_eq!(of(&steps), (Reason::Step, NONE, 3, 1, 0), "{kind}");
        let steps = [times(1), wait(1), head(kind, 0, 2, 1)];
        assert_eq!(of(&steps), (Reason::Members, NONE, 3, 2, 0), "{kind}");
    }
    assert_eq!(with(format::HOME, 6, 1, 1), (Reason::Step, NONE, 1, 6, 0));
    let most = i32::MAX;
    for (kind, axes) in [(format::WAIT, 0), (format::HOME, 1)] {
        for time in [0, 1 << 31, u32::MAX] {
            let expected = (Reason::Time, NONE, 1, time as i32, most);
            assert_eq!(with(kind, 0, axes, time), expected);
        }
        let longest = program(&[head(kind, 0, axes, most as u32)]);
        assert_eq!(format::check(&longest, &GROUP), Ok(()));
    }
    // Nothing, for ever.
    assert_eq!(of(&[times(0), end()]), (Reason::Loop, NONE, 1, 0, 4));
    let within = [times(0), wait(1), times(2), end(), end()];
    assert_eq!(of(&within), (Reason::Loop, NONE, 3, 0, 4));
}

#[test]
fn a_path_that_is_wrong_is_named() {
    const ONCE: u32 = 1 << 16;
    let of = |step: Vec<u8>| wrong(&program(&[step]));
    let nothing = shape(1, ONCE, 1, &[]);
    assert_eq!(of(nothing), (Reason::Points, NONE, 1, 1 << 16, 0));
    assert_eq!(of(shape(1, 1, 1, &[(1, 0, 0)])).0, Reason::Points);
    let no_time = shape(1, ONCE | 1, 1, &[(0, 0, 0)]);
    assert_eq!(of(no_time), (Reason::Points, 0, 1, 0, -1));
    // 1000 increments in one cycle: three times as fast in the middle.
    let fast = shape(1, ONCE | 1, 1 << 30, &[(1, 4000, 0)]);
    assert_eq!(of(fast), (Reason::Velocity, 0, 1, 9000, 3000));
    let steep = shape(1, ONCE | 1, 1 << 30, &[(3, 1200, 0)]);
    assert_eq!(of(steep).0, Reason::Acceleration);
    let goes_on = shape(1, ONCE | 1, 1 << 30, &[(10, 40, 8)]);
    assert_eq!(of(goes_on), (Reason::End, 0, 1, 0, 0));
    let climbs = shape(1, 2 << 16 | 1, 1 << 30, &[(10, 40, 0)]);
    assert_eq!(of(climbs), (Reason::End, 0, 1, 10, 0));
    // Slow, but far.
    let far = vec![(u16::MAX, i32::MAX / 2, 0), (u16::MAX, i32::MAX, 0)];
    let far = shape(0, ONCE | 2, i32::MAX, &far);
    assert_eq!(of(far).0, Reason::Velocity);
}

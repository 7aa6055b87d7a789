//! Motion in each mode: all axes start in one SYNC, arrive where they have to, and no
//! drive complains.

use canmaster::motion::mode::Mode;
use canmaster::motion::{GroupState, panel};
use canmaster_sim::judge::{STANDSTILL_RPM, coordination};
use canmaster_sim::time::Time;
use canmaster_sim::world::Client;

use crate::leader::{
    ALL, AXES, RELEASE, STOP, command, compiled, emergencies, fastest, fault, in_standby,
    positions, put_targets, run, set_modes, start, until, until_done,
};

/// Another way for each axis, increments.
const WAYS: [i32; AXES as usize] = [12_000, -9000, 15_000, -12_000, 6000, -15_000];

#[track_caller]
fn stand(client: &mut Client<'_>, expected: &[i32], mode: Mode) {
    let now = positions(client);
    for (n, (now, expected)) in now.iter().zip(expected).enumerate() {
        let off = now - expected;
        assert!(off.abs() <= 2, "{mode:?}, axis {}: {off}", n + 1);
    }
}

#[test]
fn axes_arrive_in_every_mode_that_has_a_position() {
    for (seed, mode) in [
        (91, Mode::ProfileVelocity),
        (92, Mode::CyclicVelocity),
        (93, Mode::CyclicPosition),
        (94, Mode::ProfilePosition),
    ] {
        let mut client = in_standby(seed);
        set_modes(&mut client, ALL, mode as u8);
        emergencies(&mut client);
        let from = positions(&mut client);
        put_targets(&mut client, 0);
        for (axis, way) in (1..).zip(WAYS) {
            client.put(panel::TARGET, axis, way as u32, 4).unwrap();
        }
        start(&mut client);
        client.listen(Time::from_ms(1800));
        let ends: Vec<i32> = from
            .iter()
            .zip(WAYS)
            .map(|(from, way)| from + way)
            .collect();
        stand(&mut client, &ends, mode);
        // A set-point of profile position says only where to.
        if mode != Mode::ProfilePosition {
            let wire = [client.world.wire()];
            let network = client.world.machine().network();
            let spans = coordination::spans(wire.into_iter(), network);
            let starts = spans.iter().map(|span| span.start.sync);
            let apart = starts.clone().max().unwrap() - starts.min().unwrap();
            assert!(apart <= 8, "{mode:?}: {apart}");
        }
        command(&mut client, STOP).unwrap();
        until(&mut client, GroupState::Standby);
        client.listen(Time::from_ms(300));
        stand(&mut client, &ends, mode);
        assert_eq!(emergencies(&mut client), [], "{mode:?}");
    }
}

/// The drive makes the motion by itself, with the velocity and the ramps of the move.
#[test]
fn in_profile_position_a_drive_moves_as_it_is_told() {
    const RAMP: f64 = 800.0;
    let velocity = |n: usize| 400.0 + 100.0 * n as f64;
    let mut client = in_standby(97);
    set_modes(&mut client, ALL, Mode::ProfilePosition as u8);
    emergencies(&mut client);
    put_targets(&mut client, 60_000);
    for (n, axis) in (1..=AXES).enumerate() {
        let put = |client: &mut Client<'_>, index, value: f64| {
            client.put(index, axis, value as u32, 4).unwrap();
        };
        put(&mut client, panel::VELOCITY, velocity(n));
        put(&mut client, panel::ACCELERATION, RAMP);
    }
    start(&mut client);
    let (mut fastest, mut steepest) = ([0.0f64; AXES as usize], [0.0f64; AXES as usize]);
    let mut before = [0.0; AXES as usize];
    for _ in 0..25 {
        client.listen(Time::from_ms(100));
        for (n, truth) in client.world.truths().flatten().enumerate() {
            let speed = truth.velocity_rpm;
            fastest[n] = fastest[n].max(speed);
            steepest[n] = steepest[n].max((speed - before[n]) / 0.1);
            before[n] = speed;
        }
    }
    for (n, (fastest, steepest)) in fastest.into_iter().zip(steepest).enumerate() {
        let off = fastest - velocity(n);
        assert!(off.abs() < 30.0, "axis {}: {off} rpm beside it", n + 1);
        let off = steepest - RAMP;
        assert!(off.abs() < 100.0, "axis {}: {off} rpm/s beside it", n + 1);
    }
    assert_eq!(emergencies(&mut client), []);
}

/// The axes stay where a stop has brought them to rest, in standby and when they are
/// released again.
#[test]
fn a_stop_on_the_way_ends_the_motion_for_good() {
    for (seed, mode) in [(95, Mode::CyclicVelocity), (96, Mode::CyclicPosition)] {
        let mut client = in_standby(seed);
        set_modes(&mut client, ALL, mode as u8);
        emergencies(&mut client);
        put_targets(&mut client, 60_000);
        start(&mut client);
        client.listen(Time::from_ms(900));
        assert!(fastest(&client.world) > 1000.0, "{mode:?}");
        command(&mut client, STOP).unwrap();
        until(&mut client, GroupState::Standby);
        let rest = positions(&mut client);
        client.listen(Time::from_ms(400));
        stand(&mut client, &rest, mode);
        command(&mut client, RELEASE).unwrap();
        until(&mut client, GroupState::Moving);
        client.listen(Time::from_ms(400));
        stand(&mut client, &rest, mode);
        assert_eq!(emergencies(&mut client), [], "{mode:?}");
        let record = client.world.finish();
        for axis in &record.axes {
            assert_eq!(axis.motion.unreleased(), None, "{mode:?}");
        }
    }
}

/// Per mille of the rated torque: the axes are driven, and without torque they come to
/// rest by themselves.
#[test]
fn torque_follows_its_path() {
    let mut client = in_standby(98);
    emergencies(&mut client);
    let from = positions(&mut client);
    let program = compiled(
        "[[step]]\n[step.mode]\nis = \"cyclic synchronous torque\"\n\
         [[step]]\nsettle = false\n[[step.move]]\nto = [90, -90, 90, -90, 90, -90]\n\
         velocity = 600\nacceleration = 6000\n\
         [[step]]\nwait_ms = 100\n\
         [[step]]\n[[step.move]]\nto = 0\nvelocity = 600\nacceleration = 6000\n",
    );
    run(&mut client, &program);
    until(&mut client, GroupState::Moving);
    let limit = client.world.now() + Time::from_ms(1000);
    assert!(client.world.run_to(limit, |world| fastest(world) > 300.0));
    let speeds: Vec<f64> = client
        .world
        .truths()
        .flatten()
        .map(|truth| truth.velocity_rpm)
        .collect();
    for (n, rpm) in speeds.iter().enumerate() {
        let way = if n % 2 == 0 { 1.0 } else { -1.0 };
        assert!(rpm * way > 100.0, "axis {}: {rpm} rpm", n + 1);
    }
    let of_first = client.number(panel::REFERENCE, 1).unwrap();
    assert!((1..=90).contains(&of_first), "{of_first} per mille");
    until_done(&mut client, Time::from_ms(6000));
    assert_eq!(client.number(panel::REFERENCE, 1), Ok(0));
    assert!(fastest(&client.world) <= STANDSTILL_RPM);
    for (n, (now, from)) in positions(&mut client).iter().zip(&from).enumerate() {
        let way = if n % 2 == 0 { now - from } else { from - now };
        assert!(way > 2000, "axis {}: {way}", n + 1);
    }
    assert_eq!(emergencies(&mut client), []);
    assert_eq!(fault(&mut client, 1), (0, 0));
}

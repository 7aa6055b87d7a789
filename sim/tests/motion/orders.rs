//! The commands of 2000h that `commands.rs` does not give, and what 200Eh tells.

use canmaster::NodeId;
use canmaster::motion::{Cause, GroupState, panel};
use canmaster::sdo::AbortCode;
use canmaster_sim::board::irqs;
use canmaster_sim::bus::BusFault;
use canmaster_sim::drive::{DriveFault, cia402};
use canmaster_sim::judge::STANDSTILL_RPM;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Client, Stimulus, World};

use crate::leader::{
    AXES, ENABLE, HALT, QUICK_STOP, RELEASE, RESET, RUN, RUN_RELEASED, START, STOP, all_enabled,
    arrived, command, compiled, emergencies, fastest, fault, in_standby, positions, put_targets,
    refused, run, set_modes, start, state, until, until_done,
};

const NODE: NodeId = NodeId::constant::<4>();
const AXIS: u8 = 4;

/// Two moves, all axes 20 turns there and 20 back.
fn there_and_back() -> Vec<u8> {
    compiled(
        "unit = \"turns\"\nvelocity = 1200\nacceleration = 2000\n\
         [[step]]\n[[step.move]]\nto = 20\n[[step]]\n[[step.move]]\nto = 0\n",
    )
}

#[track_caller]
fn not_in(client: &mut Client<'_>, order: u32, now: GroupState) {
    let done = command(client, order);
    let why = 0xFF01_0000 | now as u32;
    refused(client, done, AbortCode::DEVICE_STATE, why);
}

#[track_caller]
fn at_rest(client: &Client<'_>) {
    let rpm = fastest(&client.world);
    assert!(rpm <= STANDSTILL_RPM, "{rpm} rpm");
}

#[test]
fn a_halt_waits_for_a_release_and_goes_on() {
    let mut client = in_standby(71);
    let from = positions(&mut client);
    for halt in 0..2 {
        if halt == 0 {
            run(&mut client, &there_and_back());
            until(&mut client, GroupState::Moving);
        }
        client.listen(Time::from_ms(500));
        command(&mut client, HALT).unwrap();
        until(&mut client, GroupState::Halt);
        client.listen(Time::from_ms(900));
        at_rest(&client);
        let rest = positions(&mut client);
        assert!(rest.iter().zip(&from).all(|(now, from)| now - from > 5000));
        client.listen(Time::from_ms(300));
        arrived(&mut client, &rest, 0);
        assert_eq!(state(&mut client), GroupState::Halt as u32);
        assert!(all_enabled(&client.world));
        not_in(&mut client, START, GroupState::Halt);
        // The program goes on with the step that was interrupted.
        let go_on = if halt == 0 { RELEASE } else { RUN };
        command(&mut client, go_on).unwrap();
        until(&mut client, GroupState::Moving);
        assert_eq!(client.number(panel::STEP, 0), Ok(1));
    }
    let mut most = i32::MIN;
    while client.number(panel::STEP, 0) == Ok(1) {
        most = most.max(positions(&mut client)[0] - from[0]);
    }
    assert!((39_000..=40_005).contains(&most), "{most}");
    until_done(&mut client, Time::from_ms(8000));
    arrived(&mut client, &from, 0);
    assert_eq!(emergencies(&mut client), []);
}

#[test]
fn a_quick_stop_disables_and_only_enable_leads_back() {
    let mut client = in_standby(72);
    run(&mut client, &there_and_back());
    client.listen(Time::from_ms(700));
    assert!(fastest(&client.world) > 1000.0);
    let stopped = client.world.now();
    command(&mut client, QUICK_STOP).unwrap();
    assert!(client.world.run_to(stopped + Time::from_ms(400), |world| {
        fastest(world) <= STANDSTILL_RPM
    }));
    until(&mut client, GroupState::Idle);
    let off = |status: cia402::State| status == cia402::State::SwitchOnDisabled;
    assert!(client.world.statuses().flatten().all(|s| off(s.state)));
    client.listen(Time::from_ms(500));
    assert_eq!(state(&mut client), GroupState::Idle as u32);
    for order in [RELEASE, RUN, RUN_RELEASED, START] {
        not_in(&mut client, order, GroupState::Idle);
    }
    command(&mut client, ENABLE).unwrap();
    until(&mut client, GroupState::Standby);
    client.listen(Time::from_ms(300));
    at_rest(&client);
    // The program begins anew.
    let from = positions(&mut client);
    command(&mut client, RUN).unwrap();
    until(&mut client, GroupState::Moving);
    assert_eq!(client.number(panel::STEP, 0), Ok(1));
    client.listen(Time::from_ms(500));
    assert!(positions(&mut client)[0] - from[0] > 5000);
    assert_eq!(emergencies(&mut client), []);
}

#[test]
fn a_fault_names_its_axis_and_a_reset_leads_to_standby() {
    let mut client = in_standby(73);
    for order in [RESET, RUN_RELEASED, START] {
        not_in(&mut client, order, GroupState::Standby);
    }
    put_targets(&mut client, 40_000);
    start(&mut client);
    client.listen(Time::from_ms(600));
    let (at, code, until_then) = (client.world.now(), 0x2310, None);
    let error = DriveFault::Error {
        at,
        code,
        until: until_then,
    };
    let node = NODE;
    client.world.apply(Stimulus::Drive { node, fault: error });
    until(&mut client, GroupState::Faulted);
    at_rest_but(&client, AXIS);
    for axis in 1..=AXES {
        let expected = match axis {
            AXIS => (Cause::Emergency as u32, u32::from(code)),
            _ => (0, 0),
        };
        assert_eq!(fault(&mut client, axis), expected, "axis {axis}");
    }
    for order in [RELEASE, RUN, START] {
        not_in(&mut client, order, GroupState::Faulted);
    }
    command(&mut client, RESET).unwrap();
    until(&mut client, GroupState::Standby);
    let rest = positions(&mut client);
    client.listen(Time::from_ms(300));
    arrived(&mut client, &rest, 0);
    for axis in 1..=AXES {
        assert_eq!(fault(&mut client, axis), (0, 0), "axis {axis}");
    }
    // Targets count from where the axes were enabled.
    put_targets(&mut client, -4000);
    start(&mut client);
    client.listen(Time::from_ms(1500));
    arrived(&mut client, &rest, -4000);
}

/// Its drive may let it coast.
#[track_caller]
fn at_rest_but(client: &Client<'_>, axis: u8) {
    let truths = client.world.truths().flatten().enumerate();
    for (n, truth) in truths.filter(|(n, _)| n + 1 != usize::from(axis)) {
        assert!(truth.velocity_rpm.abs() <= STANDSTILL_RPM, "axis {}", n + 1);
    }
}

/// The program that was loaded before runs without another release.
#[test]
fn a_released_group_runs_its_program() {
    let mut client = in_standby(74);
    let from = positions(&mut client);
    run(&mut client, &there_and_back());
    until(&mut client, GroupState::Moving);
    command(&mut client, STOP).unwrap();
    until(&mut client, GroupState::Standby);
    command(&mut client, RELEASE).unwrap();
    until(&mut client, GroupState::Moving);
    not_in(&mut client, RUN, GroupState::Moving);
    command(&mut client, RUN_RELEASED).unwrap();
    client.listen(Time::from_ms(100));
    assert_eq!(client.number(panel::STEP, 0), Ok(1));
    // One after the other.
    assert!(command(&mut client, RUN_RELEASED).is_err());
    assert_eq!(client.number(panel::REFUSAL, 0).unwrap() >> 16, 0xFF07);
    until_done(&mut client, Time::from_ms(8000));
    arrived(&mut client, &from, 0);
}

/// Refused with axis, reason and value as soon as it is started; nothing moves.
#[test]
fn a_move_beyond_a_limit_is_refused() {
    const FARTHEST: u32 = 1 << 30;
    let mut client = in_standby(68);
    let from = positions(&mut client);
    command(&mut client, RELEASE).unwrap();
    until(&mut client, GroupState::Moving);
    for (axis, index, value, reason) in [
        (2, panel::VELOCITY, 3001, 28),
        (3, panel::ACCELERATION, 20_001, 29),
        (5, panel::TARGET, FARTHEST, 31),
        (6, panel::TARGET, FARTHEST.wrapping_neg(), 31),
    ] {
        put_targets(&mut client, 6000);
        client.put(index, axis, value, 4).unwrap();
        let done = command(&mut client, START);
        let why = u32::from(axis) << 24 | reason << 16 | value & 0xFFFF;
        refused(&mut client, done, AbortCode::VALUE_RANGE, why);
    }
    client.listen(Time::from_ms(300));
    arrived(&mut client, &from, 0);
    // What is within its limits is made.
    put_targets(&mut client, 6000);
    command(&mut client, START).unwrap();
    client.listen(Time::from_ms(1500));
    arrived(&mut client, &from, 6000);
}

/// With jerk `j` the acceleration `a` takes `a / j` to build up: until then the way is
/// `j t^3 / 6` instead of `a t^2 / 2`, and the move lasts so much longer.
#[test]
fn a_jerk_makes_a_move_softer_and_longer() {
    const ACCELERATION: f64 = 2000.0;
    const JERK: f64 = 8000.0;
    /// Increments for a minute of 1 rpm in seconds.
    const UNIT: f64 = 2000.0 / 60.0;
    let built_up = ACCELERATION / JERK;
    let stands = |world: &World<'_>| fastest(world) <= STANDSTILL_RPM;
    let mut client = in_standby(75);
    let mut took = Vec::new();
    for (jerk, target) in [(0.0, 20_000), (JERK, 0)] {
        client.put(panel::JERK, 0, jerk as u32, 4).unwrap();
        put_targets(&mut client, target);
        let from = positions(&mut client)[0];
        start(&mut client);
        assert!(client.world.run_to(Time::MAX, |world| !stands(world)));
        let begun = client.world.now();
        client
            .world
            .run_until(begun + Time::from_secs_f64(built_up));
        let way = client.world.truths().flatten().next().unwrap().position_inc - f64::from(from);
        assert!(client.world.run_to(Time::MAX, stands));
        took.push((client.world.now() - begun).as_secs_f64());
        // It was seen to move as soon as it was that fast.
        let expected = if jerk > 0.0 {
            let before = (2.0 * STANDSTILL_RPM / jerk).sqrt();
            jerk * (before + built_up).powi(3) / 6.0
        } else {
            let before = STANDSTILL_RPM / ACCELERATION;
            ACCELERATION * (before + built_up).powi(2) / 2.0
        };
        let expected = expected * UNIT;
        assert!(
            (way.abs() - expected).abs() < expected * 0.05,
            "{way}, {expected}"
        );
        client.listen(Time::from_ms(200));
        command(&mut client, STOP).unwrap();
        until(&mut client, GroupState::Standby);
    }
    let longer = took[1] - took[0];
    assert!((0.75..1.05).contains(&(longer / built_up)), "{longer} s");
}

/// Axes 1 and 3 of six.
#[test]
fn a_command_is_for_the_axes_of_2003h() {
    const TWO: u32 = 0b101;
    let mut client = in_standby(76);
    let from = positions(&mut client);
    put_targets(&mut client, 6000);
    client.put(panel::AXES, 0, TWO, 4).unwrap();
    start(&mut client);
    client.listen(Time::from_ms(1500));
    for (n, (now, from)) in positions(&mut client).iter().zip(&from).enumerate() {
        let way = if TWO >> n & 1 != 0 { 6000 } else { 0 };
        assert!((now - from - way).abs() <= 3, "axis {}", n + 1);
    }
    command(&mut client, STOP).unwrap();
    until(&mut client, GroupState::Standby);
    set_modes(&mut client, TWO, 8);
    for (n, status) in client.world.statuses().flatten().enumerate() {
        let mode = if TWO >> n & 1 != 0 { 8 } else { 3 };
        assert_eq!(status.mode, mode, "axis {}", n + 1);
    }
}

/// 200Eh has it in every axis.
#[track_caller]
fn all_have(client: &mut Client<'_>, cause: Cause) {
    for axis in 1..=AXES {
        let (told, _) = fault(client, axis);
        assert_eq!(told, cause as u32, "axis {axis}");
    }
}

#[test]
fn cycles_that_are_late_are_told_of_every_axis() {
    let mut client = in_standby(77);
    put_targets(&mut client, 40_000);
    start(&mut client);
    client.listen(Time::from_ms(600));
    let irq = irqs::TIM3;
    client.world.apply(Stimulus::Hang { irq });
    client
        .world
        .run_until(client.world.now() + Time::from_ms(20));
    client.world.apply(Stimulus::Resume { irq });
    until(&mut client, GroupState::Faulted);
    at_rest(&client);
    all_have(&mut client, Cause::CyclesLate);
    command(&mut client, RESET).unwrap();
    until(&mut client, GroupState::Standby);
    client.listen(Time::from_ms(300));
    at_rest(&client);
}

/// Disturbances until the board is off the bus: it knows before a TPDO is missed for
/// the third time.
#[test]
fn a_network_that_is_lost_is_told_of_every_axis() {
    let mut client = in_standby(78);
    put_targets(&mut client, 40_000);
    start(&mut client);
    client.listen(Time::from_ms(600));
    let from = client.world.now();
    let (rate, until_then) = (0.05, from + Time::from_ms(6));
    client.world.apply(Stimulus::Bus(BusFault::BitErrors {
        rate,
        from,
        until: until_then,
    }));
    // Bus-off for 100 ms, and silent for 600 ms.
    client.world.run_until(from + Time::from_ms(800));
    until(&mut client, GroupState::Faulted);
    at_rest(&client);
    all_have(&mut client, Cause::NetworkLost);
    // The way back leads to standby.
    until(&mut client, GroupState::Standby);
    client.listen(Time::from_ms(300));
    at_rest(&client);
}

//! Homing by every method that the drives have, and by none that ends: on the board,
//! as 2000h and a program order it.

use canmaster::NodeId;
use canmaster::id::Address;
use canmaster::motion::mode::Mode;
use canmaster::motion::{Cause, GroupState, panel};
use canmaster_sim::drive::travel::Travel;
use canmaster_sim::drive::{DriveConfig, cia402};
use canmaster_sim::judge::STANDSTILL_RPM;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Client, Scenario};

use crate::leader::{
    ALL, AXES, END, HALT, QUICK_STOP, RESET, STOP, all_enabled, command, compiled, emergencies,
    fastest, fault, home, positions, ready, run, set_modes, state, until,
};

const HOMING: u8 = Mode::Homing as u8;

/// Limit switches at both ends with hard stops behind them, a home switch in between,
/// index pulses at 700, 2700, ...
const TRAVEL: Travel = Travel {
    negative_stop: Some(-6000.0),
    positive_stop: Some(6000.0),
    negative_switch: Some(-5000.0),
    positive_switch: Some(5000.0),
    home_switch: Some((-1000.0, 1500.0)),
    index_at: 700.0,
};

fn with_switches(mut config: DriveConfig) -> DriveConfig {
    config.plant.travel = TRAVEL;
    config
}

/// No home switch between the limit switches.
fn without_home(config: DriveConfig) -> DriveConfig {
    let mut config = with_switches(config);
    config.plant.travel.home_switch = None;
    config
}

/// The shaft turns for ever.
fn without_switches(mut config: DriveConfig) -> DriveConfig {
    config.plant.travel = Travel::default();
    config
}

/// In standby, in homing mode.
fn searching(seed: u64, tuned: fn(DriveConfig) -> DriveConfig) -> Client<'static> {
    let mut client = ready(Scenario::new(seed, END).tuned(tuned));
    for axis in 1..=AXES {
        to_drive(&mut client, axis, (0x6099, 1), &300_u32.to_le_bytes());
        to_drive(&mut client, axis, (0x6099, 2), &60_u32.to_le_bytes());
    }
    set_modes(&mut client, ALL, HOMING);
    client
}

/// Writes to the drive itself.
fn to_drive(client: &mut Client<'_>, axis: u8, at: (u16, u8), bytes: &[u8]) {
    let node = NodeId::new(axis).unwrap();
    let at = Address::new(at.0, at.1);
    client.world.sdo_write(node, at, bytes).unwrap();
}

fn use_methods(client: &mut Client<'_>, methods: [i8; AXES as usize]) {
    for (axis, method) in (1..).zip(methods) {
        to_drive(client, axis, (0x6098, 0), &method.to_le_bytes());
    }
}

#[test]
fn the_board_finds_home_by_every_method() {
    let mut client = searching(81, with_switches);
    for (methods, zeros) in [
        // The hard stops, and the index off them; where it is; the home switch.
        (
            [-1, -2, -3, -4, 37, 7],
            [4700.0, -5300.0, 6000.0, -6000.0, 0.0, -1300.0],
        ),
        // Limit and home switches, with and without the index.
        (
            [1, 2, 11, 17, 18, 23],
            [-3300.0, 4700.0, 2700.0, -5000.0, 5000.0, -1000.0],
        ),
        // The other edge of the home switch, the next index; the others stay.
        (
            [27, 33, 34, 37, 37, 37],
            [1500.0, 2700.0, 4700.0, -5000.0, 5000.0, -1000.0],
        ),
    ] {
        use_methods(&mut client, methods);
        emergencies(&mut client);
        home(&mut client);
        until(&mut client, GroupState::Standby);
        assert_eq!(emergencies(&mut client), []);
        client.listen(Time::from_ms(200));
        let told = positions(&mut client);
        let truths = client.world.truths().flatten();
        for (n, truth) in truths.enumerate() {
            let method = methods[n];
            let zero = truth.position_inc - f64::from(told[n]);
            assert!(told[n].abs() <= 2, "method {method}: {}", told[n]);
            assert!((zero - zeros[n]).abs() <= 10.0, "method {method}: {zero}");
        }
    }
    let referenced = client.world.statuses().flatten();
    // Bit 15: position referenced to home position (EPOS4).
    assert!(
        referenced
            .map(|status| status.statusword)
            .all(|word| word & 0x8000 != 0)
    );
}

/// How a search is ended.
#[derive(Clone, Copy, Debug)]
enum By {
    Order(u32),
    /// The time limit of the program.
    Limit,
}

#[test]
fn a_search_that_finds_nothing_is_ended() {
    for (seed, by, ends) in [
        (82, By::Order(STOP), GroupState::Standby),
        (83, By::Order(HALT), GroupState::Standby),
        (84, By::Order(QUICK_STOP), GroupState::Idle),
        (85, By::Limit, GroupState::Faulted),
    ] {
        let mut client = searching(seed, without_switches);
        use_methods(&mut client, [23; 6]);
        match by {
            By::Order(_) => home(&mut client),
            By::Limit => {
                run(
                    &mut client,
                    &compiled("[[step]]\n[step.home]\nlimit_ms = 800\n"),
                );
                until(&mut client, GroupState::Homing);
            }
        }
        client.listen(Time::from_ms(600));
        assert!(fastest(&client.world) > 250.0, "{by:?}");
        assert_eq!(state(&mut client), GroupState::Homing as u32);
        if let By::Order(order) = by {
            command(&mut client, order).unwrap();
        }
        until(&mut client, ends);
        assert!(fastest(&client.world) <= STANDSTILL_RPM, "{by:?}");
        client.listen(Time::from_ms(300));
        assert!(fastest(&client.world) <= STANDSTILL_RPM, "{by:?}");
        assert_eq!(
            all_enabled(&client.world),
            ends == GroupState::Standby,
            "{by:?}"
        );
        let cause = match by {
            By::Limit => (Cause::NotDone as u32, HOMING.into()),
            By::Order(_) => (0, 0),
        };
        // One that is late stops all.
        assert_eq!(fault(&mut client, 1), cause, "{by:?}");
        assert_eq!(emergencies(&mut client), []);
    }
}

/// Both limit switches were met and no home switch: bit 13 of the statusword.
#[test]
fn a_homing_error_names_the_axis_and_can_be_tried_again() {
    let mut client = searching(86, without_home);
    use_methods(&mut client, [37, 37, 37, 23, 37, 37]);
    home(&mut client);
    until(&mut client, GroupState::Faulted);
    let (cause, statusword) = fault(&mut client, 4);
    assert_eq!(cause, Cause::DriveError as u32);
    assert_ne!(statusword & 1 << 13, 0);
    for axis in [1, 2, 3, 5, 6] {
        assert_eq!(fault(&mut client, axis), (0, 0), "axis {axis}");
    }
    let off = |status: cia402::State| status == cia402::State::SwitchOnDisabled;
    assert!(client.world.statuses().flatten().all(|s| off(s.state)));
    assert!(fastest(&client.world) <= STANDSTILL_RPM);
    to_drive(&mut client, 4, (0x6098, 0), &[37]);
    command(&mut client, RESET).unwrap();
    until(&mut client, GroupState::Standby);
    home(&mut client);
    until(&mut client, GroupState::Standby);
    assert!(positions(&mut client).iter().all(|at| at.abs() <= 2));
    assert_eq!(client.number(panel::MODE, 4), Ok(HOMING.into()));
}

/// Only the axes of 2003h search.
#[test]
fn who_is_not_asked_to_search_keeps_still() {
    let mut client = searching(87, with_switches);
    use_methods(&mut client, [37, 23, 37, 37, 37, 37]);
    let before = positions(&mut client);
    client.put(panel::AXES, 0, 0b10, 4).unwrap();
    home(&mut client);
    client
        .world
        .run_until(client.world.now() + Time::from_ms(300));
    for (n, truth) in client.world.truths().flatten().enumerate() {
        assert_eq!(truth.velocity_rpm.abs() > 30.0, n == 1, "axis {}", n + 1);
    }
    until(&mut client, GroupState::Standby);
    for (n, now) in positions(&mut client).iter().enumerate() {
        let expected = if n == 1 { 0 } else { before[n] };
        assert!((now - expected).abs() <= 2, "axis {}: {now}", n + 1);
    }
}

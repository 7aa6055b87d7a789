//! A drive that never confirms, confirms late or drops out, in each state of the
//! group: what comes of it is what `docs/motion.md` says, and the axis is named.

use canmaster::NodeId;
use canmaster::id::Address;
use canmaster::motion::mode::Mode;
use canmaster::motion::{Cause, GroupState, panel};
use canmaster_sim::drive::cia402::State;
use canmaster_sim::drive::{DriveConfig, DriveFault, DriveStatus, PlantState, Spread, Trouble};
use canmaster_sim::judge::STANDSTILL_RPM;
use canmaster_sim::log::{Level, LogLine};
use canmaster_sim::time::Time;
use canmaster_sim::world::{Client, Scenario, Stimulus, enabled};

use crate::leader::{
    ALL, AXES, DISABLE, ENABLE, END, HALT, QUICK_STOP, RELEASE, SET_MODES, START, STOP, command,
    compiled, fault, put_targets, ready, run, set_modes, start, state, until,
};

const NODE: NodeId = NodeId::constant::<4>();
const AXIS: u8 = 4;

/// The trouble begins in this state; or before the command that leads to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum In {
    Enabling,
    Standby,
    Moving,
    Stopping,
    Halt,
    Homing,
    ModeChange,
    QuickStop,
    Disabling,
    /// A set-point of profile position that is to be acknowledged.
    SetPoint,
    /// A stop in profile position.
    SetPointStop,
}

/// The shaft turns for ever, and no search for home ends.
fn endless(mut config: DriveConfig) -> DriveConfig {
    config.plant.travel = Default::default();
    config
}

fn trouble(client: &mut Client<'_>, fault: DriveFault) {
    let node = NODE;
    client.world.apply(Stimulus::Drive { node, fault });
}

/// Brings the group there, with what is wrong.
fn lead(client: &mut Client<'_>, to: In, fault: DriveFault) {
    match to {
        In::Enabling => {
            command(client, DISABLE).unwrap();
            until(client, GroupState::Idle);
            trouble(client, fault);
            command(client, ENABLE).unwrap();
        }
        In::Standby => trouble(client, fault),
        In::Disabling => {
            trouble(client, fault);
            command(client, DISABLE).unwrap();
        }
        In::ModeChange => {
            for axis in 1..=AXES {
                let mode = Mode::CyclicPosition as u32;
                client.put(panel::MODE, axis, mode, 1).unwrap();
            }
            trouble(client, fault);
            command(client, SET_MODES).unwrap();
        }
        In::Homing => {
            let limit = compiled("[[step]]\n[step.home]\nlimit_ms = 700\n");
            for axis in 1..=AXES {
                // Where it is; and what this one never finds.
                let method = if axis == AXIS { 23 } else { 37 };
                let node = NodeId::new(axis).unwrap();
                let at = Address::new(0x6098, 0);
                client.world.sdo_write(node, at, &[method]).unwrap();
            }
            run(client, &limit);
            until(client, GroupState::Homing);
            client.listen(Time::from_ms(200));
            trouble(client, fault);
        }
        In::SetPoint => {
            set_modes(client, ALL, Mode::ProfilePosition as u8);
            put_targets(client, 20_000);
            command(client, RELEASE).unwrap();
            until(client, GroupState::Moving);
            trouble(client, fault);
            command(client, START).unwrap();
        }
        In::Moving | In::Stopping | In::Halt | In::QuickStop | In::SetPointStop => {
            if to == In::SetPointStop {
                set_modes(client, ALL, Mode::ProfilePosition as u8);
            }
            // So far that none arrives.
            put_targets(client, 400_000);
            start(client);
            client.listen(Time::from_ms(600));
            if to == In::SetPointStop {
                trouble(client, fault);
            }
            let (order, state) = match to {
                In::Moving => return trouble(client, fault),
                In::Halt => (HALT, GroupState::Halt),
                In::QuickStop => (QUICK_STOP, GroupState::QuickStop),
                _ => (STOP, GroupState::Stopping),
            };
            command(client, order).unwrap();
            until(client, state);
            match to {
                In::SetPointStop => return,
                In::Halt => client.listen(Time::from_ms(900)),
                _ => {}
            }
            trouble(client, fault);
        }
    }
}

/// It ends like this, with that cause in 200Eh of the axis; of the others with none.
/// All of them are at rest then, or all but the one that obeys no more.
fn ends(seed: u64, to: In, fault_is: DriveFault, end: GroupState, cause: Option<Cause>) {
    // It hears nothing and goes on by itself; it has no supply and coasts.
    let deaf = fault_is == DEAF && matches!(to, In::Homing | In::SetPointStop);
    let gone_wild = deaf || cause == Some(Cause::TpdoMissing);
    let scenario = Scenario::new(seed, END).tuned(endless);
    let mut client = ready(scenario);
    lead(&mut client, to, fault_is);
    let what = format!("{to:?} {fault_is:?}");
    // Where it ends as it has begun something comes in between.
    let begun = if end == GroupState::Standby { 20 } else { 0 };
    client.listen(Time::from_ms(begun));
    until(&mut client, end);
    let watched = if cause.is_some() { 200 } else { 1800 };
    client.listen(Time::from_ms(watched));
    assert_eq!(state(&mut client), end as u32, "{what}");
    for axis in 1..=AXES {
        let (told, _) = fault(&mut client, axis);
        let expected = cause
            .filter(|_| axis == AXIS)
            .map_or(0, |cause| cause as u32);
        assert_eq!(told, expected, "{what}: axis {axis}");
    }
    for (axis, (truth, status)) in (1..).zip(both(&client)) {
        let wild = gone_wild && axis == AXIS;
        let rpm = truth.velocity_rpm.abs();
        assert!(
            rpm <= STANDSTILL_RPM || wild,
            "{what}: axis {axis}: {rpm} rpm"
        );
        let off = matches!(end, GroupState::Idle | GroupState::Faulted);
        let hears = cause.is_none() || axis != AXIS;
        assert!(!(hears && off && enabled(&status)), "{what}: axis {axis}");
    }
    let record = client.world.finish();
    for (n, axis) in record.axes.iter().enumerate() {
        let free = gone_wild && n + 1 == usize::from(AXIS);
        assert!(
            free || axis.motion.unreleased().is_none(),
            "{what}: axis {}",
            n + 1
        );
    }
    let named = format!("axis {AXIS}");
    let said = |line: &LogLine| line.level == Some(Level::Error) && line.message.contains(&named);
    let named = record.log.iter().any(|(_, line)| said(line));
    assert_eq!(named, cause.is_some(), "{what}");
    let turns = format!("axis {AXIS}: not seen at rest");
    let told = |line: &LogLine| line.message.contains(&turns);
    let told = record.log.iter().any(|(_, line)| told(line));
    assert_eq!(told, deaf, "{what}");
}

fn both(client: &Client<'_>) -> Vec<(PlantState, DriveStatus)> {
    let truths = client.world.truths().flatten();
    truths.zip(client.world.statuses().flatten()).collect()
}

const DEAF: DriveFault = DriveFault::InState {
    state: State::OperationEnabled,
    what: Trouble::Deaf,
};
const DROPS_OUT: DriveFault = DriveFault::InState {
    state: State::OperationEnabled,
    what: Trouble::DropsOut { after_us: 100 },
};

const fn late(state: State, ms: u64) -> DriveFault {
    let what = Trouble::Slow(Spread::fixed(ms * 1000));
    DriveFault::InState { state, what }
}

const fn in_state(state: State, what: Trouble) -> DriveFault {
    DriveFault::InState { state, what }
}

/// As soon as it is asked for.
const NOW: Time = Time::ZERO;

#[test]
fn a_drive_that_never_confirms_ends_every_state_in_faulted() {
    let deaf = in_state(State::SwitchedOn, Trouble::Deaf);
    // It comes to rest, but is never seen to be off.
    let held = in_state(State::QuickStopActive, Trouble::Deaf);
    for (seed, to, fault, cause) in [
        (101, In::Enabling, deaf, Cause::NotEnabled),
        (102, In::Homing, DEAF, Cause::NotDone),
        (103, In::QuickStop, held, Cause::NotEnabled),
        (104, In::Disabling, DEAF, Cause::NotEnabled),
    ] {
        ends(seed, to, fault, GroupState::Faulted, Some(cause));
    }
}

#[test]
fn a_set_point_or_its_end_that_is_never_confirmed_ends_in_faulted() {
    for (seed, to, cause) in [
        (105, In::SetPoint, Cause::NotDone),
        (106, In::SetPointStop, Cause::NotArrived),
    ] {
        ends(seed, to, DEAF, GroupState::Faulted, Some(cause));
    }
}

#[test]
fn a_mode_that_is_never_confirmed_ends_in_faulted() {
    for (seed, fault) in [
        (107, DriveFault::ModeStuck { at: NOW }),
        (108, DriveFault::SdoDead { at: NOW }),
    ] {
        let cause = Some(Cause::ModeNotConfirmed);
        ends(seed, In::ModeChange, fault, GroupState::Faulted, cause);
    }
}

#[test]
fn a_drive_that_does_not_follow_ends_in_faulted() {
    let blocked = DriveFault::Blocked {
        at: NOW,
        until: None,
    };
    for (seed, to) in [(111, In::Moving), (112, In::Stopping)] {
        let cause = Some(Cause::FollowingError);
        ends(seed, to, blocked, GroupState::Faulted, cause);
    }
}

#[test]
fn a_drive_that_confirms_late_is_waited_for_in_every_state() {
    let slow = DriveFault::SdoLatency(Spread::fixed(60_000));
    for (seed, to, fault, end) in [
        (
            121,
            In::Enabling,
            late(State::SwitchedOn, 300),
            GroupState::Standby,
        ),
        (
            122,
            In::SetPoint,
            late(State::OperationEnabled, 100),
            GroupState::Moving,
        ),
        (123, In::ModeChange, slow, GroupState::Standby),
        (
            124,
            In::QuickStop,
            late(State::QuickStopActive, 100),
            GroupState::Idle,
        ),
        (
            125,
            In::Disabling,
            late(State::OperationEnabled, 300),
            GroupState::Idle,
        ),
    ] {
        ends(seed, to, fault, end, None);
    }
}

#[test]
fn a_drive_that_drops_out_ends_every_state_in_faulted() {
    let too_early = in_state(State::SwitchedOn, Trouble::DropsOut { after_us: 1500 });
    for (seed, to, fault, cause) in [
        (131, In::Enabling, too_early, Cause::NotEnabled),
        (132, In::Standby, DROPS_OUT, Cause::LeftEnabled),
        (133, In::Moving, DROPS_OUT, Cause::LeftEnabled),
        (134, In::Stopping, DROPS_OUT, Cause::LeftEnabled),
        (135, In::Halt, DROPS_OUT, Cause::LeftEnabled),
        (136, In::Homing, DROPS_OUT, Cause::LeftEnabled),
        (137, In::ModeChange, DROPS_OUT, Cause::LeftEnabled),
        (138, In::SetPoint, DROPS_OUT, Cause::LeftEnabled),
    ] {
        ends(seed, to, fault, GroupState::Faulted, Some(cause));
    }
    // It was to be disabled in the end.
    ends(139, In::QuickStop, DROPS_OUT, GroupState::Idle, None);
}

#[test]
fn a_drive_without_supply_ends_every_state_in_faulted() {
    let lost = DriveFault::PowerLoss { at: NOW };
    for (seed, to) in [
        (141, In::Enabling),
        (142, In::Stopping),
        (143, In::Halt),
        (144, In::Homing),
        (145, In::ModeChange),
        (146, In::QuickStop),
        (147, In::Disabling),
    ] {
        let cause = Some(Cause::TpdoMissing);
        ends(seed, to, lost, GroupState::Faulted, cause);
    }
}

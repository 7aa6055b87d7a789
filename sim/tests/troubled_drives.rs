//! A drive that never confirms, confirms late, or drops out, in each state of
//! CiA 402 on the way to operation enabled: it is named, nothing moves, and the
//! others are not enabled without it.

mod common;

use canmaster::NodeId;
use canmaster_sim::drive::cia402::State;
use canmaster_sim::drive::{DriveFault, Spread, Trouble};
use canmaster_sim::judge::Outcome;
use canmaster_sim::log::Level;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Scenario, World};

use common::image;

const NODE: NodeId = NodeId::constant::<4>();
/// The states that are entered on the way up.
const WAY_UP: [State; 3] = [
    State::SwitchOnDisabled,
    State::ReadyToSwitchOn,
    State::SwitchedOn,
];
/// All drives are enabled by then, or never; the firmware waits for 2 s.
const READY_BY: Time = Time::from_ms(5500);
/// How long nothing must move, whatever the button says.
const WATCHED: Time = Time::from_ms(300);

/// Starts the machine with a drive that has this trouble. Whether it became
/// ready, and the log.
fn start(state: State, what: Trouble) -> (bool, String) {
    let faults = [(NODE, vec![DriveFault::InState { state, what }])];
    let mut scenario = Scenario::new(11, Time::MAX).unattended();
    scenario.faults.extend(faults);
    let mut world = World::new(image(), scenario).unwrap();
    let complains = |world: &World<'_>| {
        let mut levels = world.log().iter().map(|(_, line)| line.level);
        levels.any(|level| level == Some(Level::Error))
    };
    let in_standby = |world: &World<'_>| {
        let last = world.log().last();
        last.is_some_and(|(_, line)| line.message.contains("-> standby"))
    };
    world.run_to(READY_BY, |world| complains(world) || in_standby(world));
    // What is wrong comes a little later.
    world.run_until(world.now() + WATCHED);
    let ready = world.ready() && !complains(&world);
    if !ready {
        world.press();
        world.run_until(world.now() + WATCHED);
    }
    let record = world.finish();
    for axis in &record.axes {
        let node = axis.node.get();
        assert!(axis.motion.movements().is_empty(), "{what:?}: node {node}");
    }
    if !ready {
        assert_eq!(
            record.verdict.outcome,
            Outcome::Failed,
            "{state:?} {what:?}"
        );
    }
    let lines = record.log.iter().map(|(_, line)| line.to_string());
    (ready, lines.collect::<Vec<_>>().join("\n"))
}

#[track_caller]
fn fails(state: State, what: Trouble, words: &[&str]) {
    let (ready, log) = start(state, what);
    assert!(!ready, "{state:?} {what:?}");
    for word in words {
        assert!(log.contains(word), "{state:?} {what:?}: `{word}`\n{log}");
    }
}

#[test]
fn one_that_never_confirms_is_named_with_its_state() {
    for (state, words) in WAY_UP.into_iter().zip([
        "stayed in \"switch on disabled\"",
        "stayed in \"ready to switch on\"",
        "stayed in \"switched on\"",
    ]) {
        fails(state, Trouble::Deaf, &["node 4", words]);
    }
}

#[test]
fn one_that_confirms_late_is_waited_for() {
    for state in WAY_UP {
        let late = Trouble::Slow(Spread::new(100_000, 400_000));
        let (ready, log) = start(state, late);
        assert!(ready, "{state:?}\n{log}");
    }
}

#[test]
fn one_that_confirms_too_late_is_named() {
    for state in WAY_UP {
        let too_late = Trouble::Slow(Spread::fixed(2_500_000));
        fails(state, too_late, &["node 4", "stayed in"]);
    }
}

#[test]
fn one_that_drops_out_is_named() {
    for state in [
        State::ReadyToSwitchOn,
        State::SwitchedOn,
        State::OperationEnabled,
    ] {
        fails(
            state,
            Trouble::DropsOut { after_us: 1500 },
            &["ERROR node 4"],
        );
    }
}

#[test]
fn one_that_fails_is_named_with_its_error() {
    for state in [
        State::ReadyToSwitchOn,
        State::SwitchedOn,
        State::OperationEnabled,
    ] {
        let (after_us, code) = (4000, 0x3210);
        fails(
            state,
            Trouble::Error { after_us, code },
            &["node 4: emergency 3210h", "ERROR"],
        );
    }
}

#[test]
fn one_that_loses_its_supply_is_named() {
    for state in [
        State::ReadyToSwitchOn,
        State::SwitchedOn,
        State::OperationEnabled,
    ] {
        let lost = Trouble::PowerLoss { after_us: 4000 };
        fails(state, lost, &["ERROR node 4", "no TPDO"]);
    }
}

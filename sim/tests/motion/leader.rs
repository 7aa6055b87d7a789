//! Somebody who leads the group by SDO, and what he expects.

use std::path::Path;

use canmaster::emcy::Emcy;
use canmaster::id::Address;
use canmaster::motion::{GroupState, panel};
use canmaster::sdo::{AbortCode, Protocol, SdoError};
use canmaster::{Frame, NodeId};
use canmaster_network::program::{self, Group, Program};
use canmaster_network::{Source, model};
use canmaster_sim::time::Time;
use canmaster_sim::world::{Client, Scenario, World, enabled};

use crate::common::image;

pub(crate) const MASTER: NodeId = NodeId::constant::<127>();
pub(crate) const END: Time = Time::from_ms(90_000);
pub(crate) const AXES: u8 = 6;
/// For 2003h.
pub(crate) const ALL: u32 = (1 << AXES) - 1;

pub(crate) const ENABLE: u32 = 1;
pub(crate) const DISABLE: u32 = 2;
pub(crate) const RELEASE: u32 = 3;
pub(crate) const STOP: u32 = 4;
pub(crate) const HALT: u32 = 5;
pub(crate) const QUICK_STOP: u32 = 6;
pub(crate) const RESET: u32 = 7;
pub(crate) const HOME: u32 = 8;
pub(crate) const SET_MODES: u32 = 9;
pub(crate) const START: u32 = 10;
pub(crate) const RUN_RELEASED: u32 = 11;
pub(crate) const RUN: u32 = 12;

/// A client of the board in a machine where nobody presses the button.
pub(crate) fn client(scenario: Scenario) -> Client<'static> {
    let world = World::new(image(), scenario.unattended()).unwrap();
    Client::new(world, MASTER)
}

/// The same as soon as the group stands by.
pub(crate) fn in_standby(seed: u64) -> Client<'static> {
    ready(Scenario::new(seed, END))
}

/// The same for any scenario.
pub(crate) fn ready(scenario: Scenario) -> Client<'static> {
    let mut client = client(scenario);
    assert!(client.world.run_to(Time::from_ms(4000), all_enabled));
    until(&mut client, GroupState::Standby);
    client
}

pub(crate) fn all_enabled(world: &World<'_>) -> bool {
    world.statuses().flatten().all(|status| enabled(&status))
}

pub(crate) fn command(client: &mut Client<'_>, command: u32) -> Result<(), SdoError> {
    client.put(panel::COMMAND, 0, command, 2)
}

pub(crate) fn state(client: &mut Client<'_>) -> u32 {
    client.number(panel::STATE, 0).unwrap()
}

#[track_caller]
pub(crate) fn until(client: &mut Client<'_>, wanted: GroupState) {
    for _ in 0..4000 {
        if state(client) == wanted as u32 {
            return;
        }
        client.listen(Time::from_ms(1));
    }
    panic!("{wanted} is not reached: {}", state(client));
}

/// Runs until the group has been in standby for a while: it is not between two steps
/// of a program.
#[track_caller]
pub(crate) fn until_done(client: &mut Client<'_>, limit: Time) {
    const WHILE: usize = 20;
    let end = client.world.now() + limit;
    let mut standby = 0;
    while standby < WHILE {
        let now = state(client);
        assert!(client.world.now() < end, "it is still in state {now}");
        standby = match now == GroupState::Standby as u32 {
            true => standby + 1,
            false => 0,
        };
        client.listen(Time::from_ms(10));
    }
}

/// Refused, and why: 2002h.
#[track_caller]
pub(crate) fn refused(
    client: &mut Client<'_>,
    done: Result<(), SdoError>,
    code: AbortCode,
    why: u32,
) {
    match done {
        Err(SdoError::Aborted { code: told, .. }) => assert_eq!(told, code),
        other => panic!("{other:?}"),
    }
    let told = client.number(panel::REFUSAL, 0).unwrap();
    assert_eq!(format!("{told:08X}"), format!("{why:08X}"));
}

pub(crate) fn positions(client: &mut Client<'_>) -> Vec<i32> {
    let mut all = Vec::new();
    for axis in 1..=AXES {
        all.push(client.number(panel::POSITION, axis).unwrap() as i32);
    }
    all
}

pub(crate) fn put_targets(client: &mut Client<'_>, target: i32) {
    for axis in 1..=AXES {
        client.put(panel::TARGET, axis, target as u32, 4).unwrap();
        client.put(panel::VELOCITY, axis, 1200, 4).unwrap();
        client.put(panel::ACCELERATION, axis, 2000, 4).unwrap();
    }
}

/// Changes the mode of these axes (bit n: axis n + 1), and stands by again.
#[track_caller]
pub(crate) fn set_modes(client: &mut Client<'_>, axes: u32, mode: u8) {
    for axis in 1..=AXES {
        client.put(panel::MODE, axis, mode.into(), 1).unwrap();
    }
    client.put(panel::AXES, 0, axes, 4).unwrap();
    command(client, SET_MODES).unwrap();
    client.listen(Time::from_ms(50));
    until(client, GroupState::Standby);
    for (axis, status) in client.world.statuses().flatten().enumerate() {
        let changed = axes >> axis & 1 == 0 || status.mode == mode as i8;
        assert!(changed, "axis {}: mode {}", axis + 1, status.mode);
    }
}

/// Releases the group and has the axes that were chosen search for their homes.
#[track_caller]
pub(crate) fn home(client: &mut Client<'_>) {
    command(client, RELEASE).unwrap();
    until(client, GroupState::Moving);
    command(client, HOME).unwrap();
    until(client, GroupState::Homing);
}

/// Releases the group and starts the move that was set.
#[track_caller]
pub(crate) fn start(client: &mut Client<'_>) {
    command(client, RELEASE).unwrap();
    until(client, GroupState::Moving);
    command(client, START).unwrap();
}

/// What stopped an axis, counted from 1, and its detail: 200Eh.
pub(crate) fn fault(client: &mut Client<'_>, axis: u8) -> (u32, u32) {
    let fault = client.number(panel::FAULT, axis).unwrap();
    (fault >> 16, fault & 0xFFFF)
}

/// Speeds of the shafts, rpm.
pub(crate) fn fastest(world: &World<'_>) -> f64 {
    let speeds = world
        .truths()
        .flatten()
        .map(|truth| truth.velocity_rpm.abs());
    speeds.fold(0.0, f64::max)
}

#[track_caller]
pub(crate) fn arrived(client: &mut Client<'_>, from: &[i32], way: i32) {
    for (now, from) in positions(client).iter().zip(from) {
        assert!((now - from - way).abs() <= 3, "{now} from {from}");
    }
}

/// Emergencies of the drives since it was asked last.
pub(crate) fn emergencies(client: &mut Client<'_>) -> Vec<Emcy> {
    let heard = client.take_heard();
    let frames = heard.iter().map(|(_, frame): &(Time, Frame)| frame);
    frames
        .filter(|frame| frame.id().get() != 0x080 + u16::from(MASTER.get()))
        .filter_map(|frame| Emcy::decode(frame).map(|(_, emcy)| emcy))
        .collect()
}

/// The machine as `network.toml` has it.
pub(crate) fn described() -> model::Machine {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../network.toml");
    canmaster_network::load(file.as_ref()).machine.unwrap()
}

/// Its axes as programs have them.
pub(crate) fn axes() -> Group {
    Group::of(&described()).unwrap()
}

fn checked(outcome: program::Outcome) -> Program {
    let problems: Vec<String> = outcome.problems.iter().map(ToString::to_string).collect();
    let program = outcome.program;
    program.unwrap_or_else(|| panic!("{}", problems.join("\n")))
}

/// A program of `programs/`.
pub(crate) fn program(file: &Path) -> Program {
    checked(program::load(file, &described()))
}

/// A program in TOML for the sample.
pub(crate) fn written(text: &str) -> Program {
    let source = Source::new("one.toml", text.as_bytes());
    checked(program::read(&source, &described()))
}

/// Its bytes.
pub(crate) fn compiled(text: &str) -> Vec<u8> {
    written(text).bytes()
}

/// Writes a program to the board.
pub(crate) fn load(client: &mut Client<'_>, program: &[u8]) {
    let at = Address::new(panel::PROGRAM, 0);
    client.write(at, program, Protocol::Block).unwrap();
}

/// The same, and lets it run.
pub(crate) fn run(client: &mut Client<'_>, program: &[u8]) {
    load(client, program);
    command(client, RUN).unwrap();
}

//! What must not be lost: a stop while a program changes modes or homes, and in which mode
//! a drive is when something comes in between of a change.

mod common;

use canmaster::id::Address;
use canmaster::motion::{GroupState, panel};
use canmaster::sdo::Protocol;
use canmaster::{CobId, NodeId};
use canmaster_network::Source;
use canmaster_sim::drive::DriveFault;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Client, Scenario, Stimulus, World, enabled};

use common::image;

const MASTER: NodeId = NodeId::constant::<127>();
const NODE: NodeId = NodeId::constant::<4>();
const END: Time = Time::from_ms(90_000);
const AXES: u8 = 6;
/// Emergencies of the board: an axis has failed, and all errors have gone.
const EMCY: u16 = 0x0FF;
const AXIS_FAULT: [u8; 2] = [0x41, 0xFF];
const OVERCURRENT: u16 = 0x2310;

const ENABLE: u32 = 1;
const STOP: u32 = 4;
const QUICK_STOP: u32 = 6;
const RESET: u32 = 7;
const SET_MODES: u32 = 9;
const RUN: u32 = 12;

const CSP: u32 = 8;

fn in_standby(seed: u64) -> Client<'static> {
    let world = World::new(image(), Scenario::new(seed, END).unattended()).unwrap();
    let mut client = Client::new(world, MASTER);
    let all_enabled = |world: &World<'_>| world.statuses().flatten().all(|drive| enabled(&drive));
    assert!(client.world.run_to(Time::from_ms(4000), all_enabled));
    until(&mut client, GroupState::Standby);
    client
}

fn command(client: &mut Client<'_>, command: u32) {
    let done = client.put(panel::COMMAND, 0, command, 2);
    assert_eq!(done, Ok(()), "{command}");
}

fn state(client: &mut Client<'_>) -> u32 {
    client.number(panel::STATE, 0).unwrap()
}

#[track_caller]
fn until(client: &mut Client<'_>, wanted: GroupState) {
    for _ in 0..4000 {
        if state(client) == wanted as u32 {
            return;
        }
        client.listen(Time::from_ms(1));
    }
    panic!("{wanted} is not reached: {}", state(client));
}

fn truths(client: &Client<'_>) -> Vec<i32> {
    let positions = client.world.statuses().flatten();
    positions.map(|status| status.position).collect()
}

/// Modes, homing and a move.
fn program() -> Vec<u8> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../network.toml");
    let machine = canmaster_network::load(file.as_ref()).machine.unwrap();
    let text = "unit = \"turns\"\nvelocity = 1000\nacceleration = 2000\n\
        [[step]]\n[step.mode]\nis = \"cyclic synchronous position\"\n\
        [[step]]\n[step.home]\n\
        [[step]]\n[step.mode]\nis = \"cyclic synchronous velocity\"\n\
        [[step]]\n[[step.move]]\nby = 20\n";
    let source = Source::new("stops.toml", text.as_bytes());
    let outcome = canmaster_network::program::read(&source, &machine);
    outcome.program.unwrap().bytes()
}

/// Standby, no program, and nothing moves for a while.
#[track_caller]
fn it_is_over(client: &mut Client<'_>) {
    until(client, GroupState::Standby);
    assert_eq!(client.number(panel::STEP, 0), Ok(0));
    let rest = truths(client);
    client.listen(Time::from_ms(1500));
    assert_eq!(state(client), GroupState::Standby as u32);
    for (now, rest) in truths(client).into_iter().zip(rest) {
        assert!((now - rest).abs() <= 3, "{now} from {rest}");
    }
}

#[test]
fn a_stop_while_a_program_changes_modes_or_homes_ends_it() {
    let bytes = program();
    let mut client = in_standby(71);
    let at = Address::new(panel::PROGRAM, 0);
    client.write(at, &bytes, Protocol::Normal).unwrap();
    for button in [false, true] {
        for (state, later) in [
            (GroupState::ModeChange, 0),
            // In one of the next states, standby in between among them.
            (GroupState::ModeChange, 60),
            (GroupState::ModeChange, 110),
            (GroupState::Homing, 0),
            (GroupState::Homing, 100),
        ] {
            command(&mut client, RUN);
            until(&mut client, state);
            client.listen(Time::from_ms(later));
            if button {
                client.world.press();
                client.listen(Time::from_ms(200));
            } else {
                command(&mut client, STOP);
                client.listen(Time::from_ms(50));
            }
            it_is_over(&mut client);
        }
    }
}

/// Six drives are being brought to another mode.
fn changing(seed: u64) -> Client<'static> {
    let mut client = in_standby(seed);
    for axis in 1..=AXES {
        client.put(panel::MODE, axis, CSP, 1).unwrap();
    }
    command(&mut client, SET_MODES);
    until(&mut client, GroupState::ModeChange);
    client.listen(Time::from_ms(seed % 4 * 7));
    client
}

/// In standby in the new mode: one RPDO in each cycle, and 6061h is what the master
/// takes it for.
#[track_caller]
fn nothing_is_in_doubt(client: &mut Client<'_>, before: &[i32]) {
    until(client, GroupState::Standby);
    for (now, before) in truths(client).into_iter().zip(before) {
        assert!((now - before).abs() <= 5, "{now} from {before}");
    }
    for axis in 1..=AXES {
        assert_eq!(client.number(panel::MODE, axis), Ok(CSP));
    }
    let shown: Vec<i8> = client.world.statuses().flatten().map(|s| s.mode).collect();
    assert_eq!(shown, [CSP as i8; AXES as usize]);
    client.take_heard();
    client.listen(Time::from_ms(100));
    let heard = client.take_heard();
    let count = |id: u16| {
        let id = CobId::new(id).unwrap();
        heard.iter().filter(|(_, frame)| frame.id() == id).count()
    };
    let syncs = count(0x080);
    for node in 1..=u16::from(AXES) {
        assert!(count(0x400 + node).abs_diff(syncs) <= 1, "node {node}");
        assert_eq!(count(0x200 + node), 0, "node {node}");
    }
    assert_eq!(state(client), GroupState::Standby as u32);
}

#[test]
fn a_fault_or_a_quick_stop_while_modes_change_leaves_no_doubt() {
    for seed in [81, 82, 83] {
        let mut client = changing(seed);
        let before = truths(&client);
        let at = client.world.now();
        let until_then = Some(at + Time::from_ms(20));
        let fault = DriveFault::Error {
            at,
            code: OVERCURRENT,
            until: until_then,
        };
        client.world.apply(Stimulus::Drive { node: NODE, fault });
        until(&mut client, GroupState::Faulted);
        command(&mut client, RESET);
        nothing_is_in_doubt(&mut client, &before);

        let mut client = changing(seed);
        let before = truths(&client);
        command(&mut client, QUICK_STOP);
        until(&mut client, GroupState::Idle);
        command(&mut client, ENABLE);
        nothing_is_in_doubt(&mut client, &before);
    }
}

/// FF41h is told when the group faults, and stands until it is enabled again.
#[test]
fn the_error_of_an_axis_stands_until_it_is_enabled_again() {
    let mut client = in_standby(86);
    client.take_heard();
    let at = client.world.now();
    let fault = DriveFault::Error {
        at,
        code: OVERCURRENT,
        until: Some(at + Time::from_ms(20)),
    };
    client.world.apply(Stimulus::Drive { node: NODE, fault });
    until(&mut client, GroupState::Faulted);
    client.listen(Time::from_ms(300));
    let told = client.heard_from(EMCY);
    let came = told.iter().filter(|data| data[..2] == AXIS_FAULT).count();
    let gone = told.iter().filter(|data| data[..2] == [0; 2]).count();
    assert_eq!((came, gone), (1, 0), "{told:02X?}");
    command(&mut client, RESET);
    until(&mut client, GroupState::Standby);
    client.listen(Time::from_ms(300));
    let told = client.heard_from(EMCY);
    assert!(told.iter().any(|data| data[..2] == [0; 2]), "{told:02X?}");
}

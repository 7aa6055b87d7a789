//! What must not be lost: a stop while a program changes modes or homes, and in which mode
//! a drive is when something comes in between of a change.

use canmaster::motion::mode::Mode;
use canmaster::motion::{GroupState, panel};
use canmaster::{CobId, NodeId};
use canmaster_sim::drive::DriveFault;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Client, Stimulus};

use crate::leader::{
    AXES, ENABLE, QUICK_STOP, RESET, RUN, SET_MODES, STOP, command, compiled, in_standby, load,
    state, until,
};

const NODE: NodeId = NodeId::constant::<4>();
/// Emergencies of the board: an axis has failed, and all errors have gone.
const EMCY: u16 = 0x0FF;
const AXIS_FAULT: [u8; 2] = [0x41, 0xFF];
const OVERCURRENT: u16 = 0x2310;
const CSP: u32 = Mode::CyclicPosition as u32;

fn truths(client: &Client<'_>) -> Vec<i32> {
    let positions = client.world.statuses().flatten();
    positions.map(|status| status.position).collect()
}

/// Modes, homing and a move.
fn program() -> Vec<u8> {
    compiled(
        "unit = \"turns\"\nvelocity = 1000\nacceleration = 2000\n\
         [[step]]\n[step.mode]\nis = \"cyclic synchronous position\"\n\
         [[step]]\n[step.home]\n\
         [[step]]\n[step.mode]\nis = \"cyclic synchronous velocity\"\n\
         [[step]]\n[[step.move]]\nby = 20\n",
    )
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
    let mut client = in_standby(71);
    load(&mut client, &program());
    for button in [false, true] {
        for (state, later) in [
            (GroupState::ModeChange, 0),
            // In one of the next states, standby in between among them.
            (GroupState::ModeChange, 60),
            (GroupState::ModeChange, 110),
            (GroupState::Homing, 0),
            (GroupState::Homing, 100),
        ] {
            command(&mut client, RUN).unwrap();
            until(&mut client, state);
            client.listen(Time::from_ms(later));
            if button {
                client.world.press();
                client.listen(Time::from_ms(200));
            } else {
                command(&mut client, STOP).unwrap();
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
    command(&mut client, SET_MODES).unwrap();
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
        command(&mut client, RESET).unwrap();
        nothing_is_in_doubt(&mut client, &before);

        let mut client = changing(seed);
        let before = truths(&client);
        command(&mut client, QUICK_STOP).unwrap();
        until(&mut client, GroupState::Idle);
        command(&mut client, ENABLE).unwrap();
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
    command(&mut client, RESET).unwrap();
    until(&mut client, GroupState::Standby);
    client.listen(Time::from_ms(300));
    let told = client.heard_from(EMCY);
    assert!(told.iter().any(|data| data[..2] == [0; 2]), "{told:02X?}");
}

//! A drive that never confirms, confirms late or drops out, in each state of the
//! group: what comes of it is what `docs/motion.md` says, and the axis is named.

use canmaster::NodeId;
use canmaster::id::Address;
use canmaster::motion::mode::Mode;
use canmaster::motion::{Cause, GroupState, panel};
use canmaster_sim::drive::cia402::State;
use canmaster_sim::drive::{DriveConfig, DriveFault, Spread, Trouble};
use canmaster_sim::judge::STANDSTILL_RPM;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Client, Scenario, Stimulus};

use crate::leader::{
    AXES, DISABLE, ENABLE, END, HALT, QUICK_STOP, RELEASE, SET_MODES, START, STOP, command,
    compiled, fastest, fault, put_targets, ready, run, set_modes, start, state, until,
};

const ALL: u32 = (1 << AXES) - 1;
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
    let home = compiled("[[step]]\n[step.home]\nlimit_ms = 700\n");
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
                client.put(panel::MODE, axis, Mode::CyclicPosition as u32, 1).unwrap();
            }
            trouble(client, fault);
            command(client, SET_MODES).unwrap();
        }
        In::Homing => {
            for axis in 1..=AXES {
                let node = NodeId::new(axis).unwrap();
                let at = Address::new(0x6098, 0);
                client.world.sdo_write(node, at, &[23]).unwrap();
            }
            set_modes(client, ALL, Mode::Homing as u8);
            run(client, &home);
            until(client, GroupState::Homing);
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
            put_targets(client, 60_000);
            start(client);
            client.listen(Time::from_ms(600));
            let order = match to {
                In::Moving => return trouble(client, fault),
                In::Halt => HALT,
                In::QuickStop => QUICK_STOP,
                In::SetPointStop => {
                    trouble(client, fault);
                    return command(client, STOP).unwrap();
                }
                _ => STOP,
            };
            command(client, order).unwrap();
            if to == In::Halt {
                client.listen(Time::from_ms(900));
            }
            trouble(client, fault);
        }
    }
}

/// What came of it: the state, and the cause that 200Eh has of the axis.
fn struck(seed: u64, to: In, fault_is: DriveFault) -> (u32, u32, Vec<String>) {
    let scenario = Scenario::new(seed, END).tuned(endless);
    let mut client = ready(scenario);
    lead(&mut client, to, fault_is);
    let mut seen = Vec::new();
    let mut last = u32::MAX;
    let begun = client.world.now();
    let mut at = begun;
    while client.world.now() < at + Time::from_ms(3000) {
        let now = state(&mut client);
        if now != last {
            seen.push(format!("{} {now}", client.world.now() - begun));
            last = now;
            at = client.world.now();
        }
        client.listen(Time::from_ms(10));
    }
    let mut causes = Vec::new();
    for axis in 1..=AXES {
        causes.push(fault(&mut client, axis));
    }
    seen.push(format!("{causes:X?} rpm {}", fastest(&client.world)));
    let (cause, _) = causes[usize::from(AXIS) - 1];
    let record = client.world.finish();
    for axis in &record.axes {
        if axis.motion.unreleased().is_some() { seen.push(format!("unreleased {:?}", axis.motion.unreleased())); }
    }
    for (at, line) in &record.log {
        if at > &begun && line.level >= Some(canmaster_sim::log::Level::Warn) { seen.push(format!("{at} {line}")); }
    }
    (last, cause, seen)
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

#[test]
fn explore() {
    let now = Time::ZERO;
    let cases = [
        (In::Enabling, in_state(State::SwitchedOn, Trouble::Deaf)),
        (In::Enabling, late(State::SwitchedOn, 300)),
        (In::Enabling, in_state(State::SwitchedOn, Trouble::DropsOut { after_us: 1500 })),
        (In::Enabling, DriveFault::PowerLoss { at: now }),
        (In::Standby, DROPS_OUT),
        (In::Moving, DROPS_OUT),
        (In::Moving, DriveFault::Blocked { at: now, until: None }),
        (In::Stopping, DROPS_OUT),
        (In::Stopping, DriveFault::Blocked { at: now, until: None }),
        (In::SetPointStop, DEAF),
        (In::Halt, DROPS_OUT),
        (In::Homing, DEAF),
        (In::Homing, DROPS_OUT),
        (In::Homing, DriveFault::PowerLoss { at: now }),
        (In::ModeChange, DriveFault::ModeStuck { at: now }),
        (In::ModeChange, DriveFault::SdoDead { at: now }),
        (In::ModeChange, DriveFault::SdoLatency(Spread::fixed(60_000))),
        (In::ModeChange, DROPS_OUT),
        (In::ModeChange, DriveFault::PowerLoss { at: now }),
        (In::QuickStop, DEAF),
        (In::QuickStop, DROPS_OUT),
        (In::QuickStop, DriveFault::PowerLoss { at: now }),
        (In::Disabling, DEAF),
        (In::Disabling, late(State::OperationEnabled, 300)),
        (In::Disabling, DROPS_OUT),
        (In::SetPoint, DEAF),
        (In::SetPoint, late(State::OperationEnabled, 100)),
    ];
    for (n, (to, fault)) in (100..).zip(cases) {
        let (state, cause, seen) = struck(n, to, fault);
        println!("== {to:?} {fault:?}: {state} {cause}\n{}", seen.join("\n"));
    }
    let _ = STANDSTILL_RPM;
}

//! The table of the contract, stated a second time.

use canmaster::cia402::State;
use canmaster::motion::GroupState::{self, *};
use canmaster::motion::contract::{Cell, Event, cell};
use canmaster::motion::mode::Mode;
use canmaster::motion::{Cause, Inputs, Order, Reason, Refusal};

use crate::rig::{ALL, READY, Rig};

/// Where an event leads, if it leads away.
fn leads(state: GroupState, event: Event) -> Option<GroupState> {
    let moves = matches!(state, Moving | Halt | Homing);
    let obeys = !matches!(state, Idle | FaultStop | Faulted);
    match event {
        Event::Ready => matches!(state, Idle | Faulted).then_some(Enabling),
        Event::NotReady | Event::Fault => obeys.then_some(FaultStop),
        Event::AxesChanged => (state == Standby).then_some(Enabling),
        Event::Disable if moves => Some(Stopping),
        Event::Disable => matches!(state, Enabling | Standby).then_some(Disabling),
        Event::Release => matches!(state, Standby | Halt).then_some(Moving),
        Event::Stop => moves.then_some(Stopping),
        Event::Halt => match state {
            Moving => Some(Halt),
            Homing => Some(Stopping),
            _ => None,
        },
        Event::QuickStop if state == Enabling => Some(Disabling),
        Event::QuickStop => (obeys && !matches!(state, QuickStop | Disabling)).then_some(QuickStop),
        Event::Reset => (state == Faulted).then_some(Enabling),
        Event::Home => (state == Moving).then_some(Homing),
        Event::Mode => (state == Standby).then_some(ModeChange),
        Event::Done => match state {
            Enabling | Moving | Stopping | Homing | ModeChange => Some(Standby),
            QuickStop => Some(Disabling),
            Disabling => Some(Idle),
            FaultStop => Some(Faulted),
            _ => None,
        },
        Event::Late if state == FaultStop => Some(Faulted),
        Event::Late => (obeys && state != Standby).then_some(FaultStop),
    }
}

/// Whether an event that changes nothing is refused: only what somebody asks for,
/// and only where it would mean motion or another state than that which it is in.
fn refused(state: GroupState, event: Event) -> bool {
    match event {
        Event::Release | Event::Reset | Event::Home | Event::Mode => true,
        Event::Halt => state != Halt,
        Event::QuickStop => matches!(state, Idle | FaultStop | Faulted),
        _ => false,
    }
}

#[test]
fn every_cell_of_the_table() {
    for state in GroupState::ALL {
        for event in Event::ALL {
            let expected = match leads(state, event) {
                Some(to) => Cell::Go(to),
                None if refused(state, event) => Cell::Refuse,
                None => Cell::Stay,
            };
            assert_eq!(cell(state, event), expected, "{event:?} in {state}");
        }
    }
}

/// Contract 1 and 3: into motion leads an order alone, and from a fault no other
/// way than through enabling.
#[test]
fn only_orders_lead_to_motion() {
    for state in GroupState::ALL {
        for event in Event::ALL {
            let Cell::Go(to) = cell(state, event) else {
                continue;
            };
            if to == Moving {
                assert!(matches!(state, Standby | Halt), "{event:?} in {state}");
                assert_eq!(event, Event::Release);
            }
            // Released before.
            if to == Homing {
                assert_eq!((state, event), (Moving, Event::Home));
            }
            if state == Faulted {
                assert_eq!(to, Enabling);
            }
            if state == FaultStop {
                assert_eq!(to, Faulted);
            }
        }
    }
}

const DOWN: Inputs = Inputs {
    network_ready: false,
    ..READY
};
/// Cycles that a search for home may take.
const LIMIT: u32 = 300;
/// Nothing takes longer.
const LONG: u32 = 4_000;

/// A group in a state, at its begin, and what its network is like there.
fn group_in(state: GroupState) -> (Rig, Inputs) {
    let after = |mut rig: Rig, order| {
        rig.order(order);
        rig.step(READY);
        rig
    };
    let moving = || Rig::moving(1, 60);
    let stopped = || {
        let mut rig = moving();
        rig.step(FAULT);
        rig
    };
    let change = Order::SetMode {
        axes: ALL,
        mode: Mode::CyclicPosition,
    };
    let rig = match state {
        Idle => Rig::new(1),
        Enabling => {
            let mut rig = Rig::new(1);
            rig.step(READY);
            rig
        }
        Standby => Rig::standby(1),
        Moving => moving(),
        Stopping => after(moving(), Order::Stop),
        Halt => after(moving(), Order::Halt),
        Homing => after(ready_to_home(), HOME),
        ModeChange => {
            let mut rig = Rig::standby(1);
            rig.confirms = false;
            after(rig, change)
        }
        QuickStop => after(moving(), Order::QuickStop),
        Disabling => after(Rig::standby(1), Order::Disable),
        FaultStop => stopped(),
        Faulted => {
            let mut rig = stopped();
            rig.until(Faulted, 1000);
            rig
        }
    };
    assert_eq!(rig.group.state(), state, "{}", rig.last());
    // An idle group becomes no other as long as its network is down.
    (rig, if state == Idle { DOWN } else { READY })
}

const HOME: Order = Order::Home {
    axes: ALL,
    limit: LIMIT,
};
/// Released in homing mode.
fn ready_to_home() -> Rig {
    let mut rig = Rig::in_mode(1, Mode::Homing);
    rig.released();
    rig
}

const FAULT: Inputs = Inputs {
    fault: Some((0, Cause::HeartbeatLost.with(0))),
    ..READY
};

/// The last axis.
const LAST: u32 = 1 << 5;

/// In standby without the last axis, which then comes.
fn without_the_last() -> Rig {
    let mut rig = Rig::new(1);
    rig.silent[5] = true;
    let absent = Inputs {
        absent: LAST,
        ..READY
    };
    (0..100).for_each(|_| rig.step(absent));
    assert_eq!(rig.group.state(), Standby, "{}", rig.last());
    rig.silent[5] = false;
    rig
}

/// The group itself does at the next step what the table says, in every state.
#[test]
fn the_group_does_what_every_cell_says() {
    for state in GroupState::ALL {
        for event in Event::ALL {
            let (mut rig, quiet) = group_in(state);
            if event == Event::Home && state == Moving {
                rig = ready_to_home();
            }
            if event == Event::Release && state == Halt {
                (0..LIMIT).for_each(|_| rig.step(READY));
            }
            if event == Event::AxesChanged && state == Standby {
                rig = without_the_last();
            }
            let mode = Order::SetMode {
                axes: ALL,
                mode: Mode::CyclicVelocity,
            };
            let (order, inputs) = match event {
                Event::Ready if state == Faulted => {
                    rig.step(DOWN);
                    (None, READY)
                }
                Event::Ready => (None, READY),
                Event::NotReady => (None, DOWN),
                Event::Fault => (
                    None,
                    Inputs {
                        network_ready: quiet.network_ready,
                        ..FAULT
                    },
                ),
                // It comes.
                Event::AxesChanged if state == Standby => (None, READY),
                Event::AxesChanged if matches!(state, Idle | Faulted) => (
                    None,
                    Inputs {
                        absent: LAST,
                        ..quiet
                    },
                ),
                // It waits, or is a fault of the axis.
                Event::AxesChanged => continue,
                Event::Disable => (Some(Order::Disable), quiet),
                Event::Release => (Some(Order::Release), quiet),
                Event::Stop => (Some(Order::Stop), quiet),
                Event::Halt => (Some(Order::Halt), quiet),
                Event::QuickStop => (Some(Order::QuickStop), quiet),
                Event::Reset => (Some(Order::Reset), quiet),
                Event::Home => (Some(HOME), quiet),
                Event::Mode => (Some(mode), quiet),
                // What every other test waits for.
                Event::Done | Event::Late => continue,
            };
            let expected = cell(state, event);
            if let Some(order) = order {
                let refused = rig.group.order(order) == Err(Refusal::not_in(state));
                assert_eq!(refused, expected == Cell::Refuse, "{event:?} in {state}");
            }
            let before = rig.states().len();
            rig.step(inputs);
            // At rest the next event follows at once.
            let to = rig.states().get(before).copied();
            let wanted = match expected {
                Cell::Go(to) => Some(to),
                Cell::Stay | Cell::Refuse => None,
            };
            assert_eq!(to, wanted, "{event:?} in {state}: {}", rig.last());
        }
    }
}

/// What the state waits for does not come.
fn spoil(rig: &mut Rig, state: GroupState) {
    for drive in &mut rig.drives {
        match state {
            Enabling => drive.stuck = Some(State::SwitchOnDisabled),
            Disabling => drive.stuck = Some(State::OperationEnabled),
            Homing => drive.deaf = true,
            ModeChange => {}
            _ => drive.pushed = Some(300.0),
        }
    }
}

/// What each state waits for comes, or does not.
#[test]
fn every_state_that_waits_ends() {
    for state in GroupState::ALL {
        for event in [Event::Done, Event::Late] {
            let Cell::Go(to) = cell(state, event) else {
                continue;
            };
            let (mut rig, _) = group_in(state);
            match (event, state) {
                (Event::Done, Moving) => {
                    rig.arrive(4000);
                    rig.order(Order::Finish);
                }
                (Event::Done, ModeChange) => rig.confirms = true,
                (Event::Late, _) => spoil(&mut rig, state),
                _ => {}
            }
            let left = (0..LONG).find(|_| {
                rig.step(READY);
                rig.group.state() != state
            });
            assert!(left.is_some(), "{event:?} in {state}: {}", rig.last());
            assert_eq!(
                rig.group.state(),
                to,
                "{event:?} in {state}: {}",
                rig.last()
            );
        }
    }
}

/// While an axis that the network cannot do without is missing, orders are refused
/// with its name.
#[test]
fn a_missing_axis_is_named() {
    let mut rig = Rig::new(1);
    rig.step(Inputs {
        absent: 1 << 2,
        ..DOWN
    });
    let missing = Refusal::of(2, Reason::Network, 0, 1);
    assert_eq!(rig.group.order(Order::Release), Err(missing));
    assert_eq!(rig.director.run(&mut rig.group), Err(missing));
    rig.step(DOWN);
    assert_eq!(rig.group.order(Order::Release), Err(Refusal::not_in(Idle)));
}

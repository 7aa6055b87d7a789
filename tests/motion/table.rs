//! The table of the contract, stated a second time.

use canmaster::motion::GroupState::{self, *};
use canmaster::motion::contract::{Cell, Event, cell};

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
        Event::Home => (state == Standby).then_some(Homing),
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
            if matches!(to, Moving | Homing) {
                assert!(matches!(state, Standby | Halt), "{event:?} in {state}");
                assert!(matches!(event, Event::Release | Event::Home));
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

//! 1F80h and 1F82h.

use crate::networks::{network, optional};
use crate::rig::{OPERATIONAL, Rig, STOPPED, id, ms};
use canmaster::boot::{Assignment, Event, Refusal, Startup};
use canmaster::nmt::{Command, NodeControl};
use canmaster::sdo::AbortCode;

fn rig(bits: u32) -> Rig {
    let mut rig = Rig::with(network(3, optional), |settings| {
        settings.startup = Startup(Startup::MASTER | bits);
    });
    rig.run_for(ms(2000));
    rig
}

#[test]
fn one_by_one_without_bit_1() {
    let rig = rig(0);
    assert!(rig.boot.is_ready());
    assert_eq!(rig.nmt()[4..], [[0x01, 1], [0x01, 2], [0x01, 3]]);
}

#[test]
fn a_device_that_is_not_the_master_does_nothing() {
    let mut rig = Rig::with(network(3, |_, _| {}), |settings| {
        settings.startup = Startup(0)
    });
    rig.error_control(1, 0);
    rig.run_for(ms(5000));
    assert_eq!((rig.sent.len(), rig.events.len()), (0, 0));
    // But for the controller, which has to come back.
    rig.boot.bus_off(rig.now);
    rig.run_for(ms(5000));
    assert_eq!((rig.sent.len(), rig.restarts.len()), (0, 1));
    assert!(!rig.boot.is_silent());
}

#[test]
fn bit_2_leaves_the_start_to_the_application() {
    let all = NodeControl::all(Command::Start);
    let master = NodeControl::node(Command::Start, id(127));
    for order in [all, master] {
        let mut rig = rig(Startup::START_ALL | Startup::NOT_BY_ITSELF);
        assert_eq!(rig.events.last(), Some(&Event::StartAwaited));
        assert!(!rig.sync);
        let one = NodeControl::node(Command::Start, id(1));
        assert_eq!(rig.boot.request(one, rig.now), Err(Refusal::Booting));
        assert_eq!(rig.boot.request(order, rig.now), Ok(()));
        rig.run_for(ms(500));
        assert!(rig.sync && rig.boot.is_ready());
        assert_eq!(rig.nmt().last(), Some(&[0x01, 0]));
    }
}

#[test]
fn with_bit_3_the_master_starts_nobody() {
    let mut rig = rig(Startup::START_ALL | Startup::NO_START);
    assert_eq!(rig.events.last(), Some(&Event::StartLeft));
    assert!(rig.sync && !rig.boot.is_ready());
    for node in [1, 3] {
        let start = NodeControl::node(Command::Start, id(node));
        assert_eq!(rig.boot.request(start, rig.now), Ok(()));
    }
    rig.run_for(ms(500));
    assert!(rig.boot.is_ready());
    assert_eq!(rig.nmt()[4..], [[0x01, 1], [0x01, 3]]);
}

#[test]
fn a_node_that_is_stopped_by_request_stays_so_until_it_is_started() {
    let mut rig = rig(Startup::START_ALL);
    rig.forget();
    let stop = NodeControl::node(Command::Stop, id(3));
    assert_eq!(rig.boot.request(stop, rig.now), Ok(()));
    rig.run_for(ms(2000));
    assert_eq!(rig.fakes[2].state, STOPPED);
    assert_eq!(rig.events, [Event::NetworkDown]);
    let start = NodeControl::node(Command::Start, id(3));
    assert_eq!(rig.boot.request(start, rig.now), Ok(()));
    rig.run_for(ms(500));
    assert_eq!(rig.nmt(), [[0x02, 3], [0x01, 3]]);
    assert!(rig.boot.is_ready());
}

#[test]
fn all_are_sent_to_pre_operational_and_back_by_request() {
    let mut rig = rig(Startup::START_ALL);
    rig.forget();
    let pause = NodeControl::all(Command::EnterPreOperational);
    assert_eq!(rig.boot.request(pause, rig.now), Ok(()));
    rig.run_for(ms(500));
    let start = NodeControl::all(Command::Start);
    assert_eq!(rig.boot.request(start, rig.now), Ok(()));
    rig.run_for(ms(500));
    assert_eq!(rig.nmt(), [[0x80, 0], [0x01, 1], [0x01, 2], [0x01, 3]]);
    assert!(rig.boot.is_ready());
}

#[test]
fn a_node_that_is_reset_by_request_is_booted_again() {
    for (command, code) in [
        (Command::ResetNode, 0x81),
        (Command::ResetCommunication, 0x82),
    ] {
        let mut rig = rig(Startup::START_ALL);
        rig.forget();
        let reset = NodeControl::node(command, id(1));
        assert_eq!(rig.boot.request(reset, rig.now), Ok(()));
        rig.run_for(ms(1000));
        assert_eq!(rig.nmt(), [[code, 1], [0x80, 1], [0x01, 1]]);
        assert!(rig.boot.is_ready());
    }
}

#[test]
fn a_halted_start_is_begun_anew_by_a_reset_of_all() {
    let mut rig = Rig::new(network(3, |_, _| {}));
    rig.fakes[1].missing = true;
    rig.run_for(ms(3000));
    rig.assert_nothing_was_started();
    let now = rig.now;
    let start = NodeControl::all(Command::Start);
    assert_eq!(rig.boot.request(start, now), Err(Refusal::Halted));
    rig.fakes[1].missing = false;
    let reset = NodeControl::all(Command::ResetNode);
    assert_eq!(rig.boot.request(reset, now), Ok(()));
    rig.run_for(ms(1000));
    assert!(rig.boot.is_ready());
    assert!(rig.fakes.iter().all(|fake| fake.state == OPERATIONAL));
}

#[test]
fn what_cannot_be_is_refused_with_a_reason() {
    let mut rig = rig(Startup::START_ALL);
    let now = rig.now;
    rig.fakes[0].missing = true;
    rig.boot.node_lost(id(1));
    rig.run_for(ms(100));
    rig.forget();
    for (control, refusal) in [
        (NodeControl::all(Command::Start), Refusal::MandatoryMissing),
        (
            NodeControl::node(Command::Start, id(3)),
            Refusal::MandatoryMissing,
        ),
        (NodeControl::node(Command::Stop, id(1)), Refusal::NotBooted),
        (
            NodeControl::node(Command::Stop, id(9)),
            Refusal::UnknownNode,
        ),
        (NodeControl::all(Command::Other(3)), Refusal::UnknownCommand),
        (NodeControl::all(Command::Stop), Refusal::Booting),
    ] {
        assert_eq!(rig.boot.request(control, now), Err(refusal));
    }
    rig.run();
    assert_eq!(rig.sent, []);
}

#[test]
fn bits_that_are_not_offered_are_refused() {
    for bit in 0..32 {
        let (startup, assignment) = (Startup::new(1 << bit), Assignment::new(1 << bit));
        let startup_offered = matches!(bit, 0..=4 | 6);
        let assignment_offered = matches!(bit, 0 | 2..=4 | 7..);
        assert_eq!(startup.is_ok(), startup_offered, "1F80h, bit {bit}");
        assert_eq!(assignment.is_ok(), assignment_offered, "1F81h, bit {bit}");
        if !startup_offered {
            assert_eq!(startup, Err(AbortCode(0x0609_0030)));
        }
        if !assignment_offered {
            assert_eq!(assignment, Err(AbortCode(0x0609_0030)));
        }
    }
    let assignment = Assignment(0x1234_0501);
    assert_eq!(assignment.guard_time(), ms(0x1234));
    assert_eq!(assignment.guard_retries(), 5);
}

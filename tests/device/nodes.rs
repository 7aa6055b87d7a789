//! What the dictionary says of the nodes: boot-up, NMT state, emergencies.

use crate::rig::{Bench, node};
use canmaster::boot::{Cause, Event, Failure, Status};
use canmaster::emcy::{Emcy, EmcyCode, ErrorRegister};
use canmaster::id::Address;
use canmaster::nmt::State;
use canmaster::sdo::AbortCode;

#[test]
fn the_boot_up_in_words() {
    let mut b = Bench::new();
    assert_eq!(b.text(0x2F01, 2), "axis 2: not started yet");
    let steps = [
        (Event::ResetSent, "boot-up frame awaited"),
        (Event::BootUp(node(2)), "identity is checked"),
        (Event::Identified(node(2)), "configuring, 0 writes"),
        (
            Event::Configuring {
                node: node(2),
                done: 16,
                total: 57,
            },
            "configuring, 16 of 57 writes",
        ),
        (Event::Configured(node(2)), "configured, heartbeat awaited"),
        (Event::Ready(node(2)), "ready to be started"),
        (Event::StartSent, "ready to be started"),
        (Event::Operational(node(2)), "operational"),
        (Event::NodeLost(node(2)), "lost, to be booted again"),
        (Event::NodeBack(node(2)), "operational"),
    ];
    for (step, words) in steps {
        b.boot(step);
        assert_eq!(b.text(0x2F01, 2), std::format!("axis 2: {words}"));
        assert_eq!(b.number(0x2F00, 2), Ok(0));
    }
    assert_eq!(b.text(0x2F01, 1), "axis 1: boot-up frame awaited");
    assert_eq!(b.text(0x2F01, 7), "not in the network");
    assert_eq!(b.number(0x2F00, 7), Ok(0));
}

#[test]
fn letters_that_are_no_failures() {
    let mut b = Bench::new();
    b.boot(Event::LeftRunning(node(3)));
    assert_eq!(b.number(0x2F00, 3), Ok(u64::from(b'L')));
    b.boot(Event::NotListed(node(4)));
    assert_eq!(b.number(0x2F00, 4), Ok(u64::from(b'A')));
    assert_eq!(b.number(0x2F00, 2), Ok(0));
}

#[test]
fn a_failure_with_its_letter() {
    let mut b = Bench::new();
    let cause = Cause::Refused {
        at: Address::new(0x60C2, 1),
        code: AbortCode::VALUE_RANGE,
    };
    let failure = Failure {
        status: Status::J,
        cause,
    };
    b.boot(Event::Failed(node(5), failure));
    assert_eq!(b.number(0x2F00, 5), Ok(u64::from(b'J')));
    assert_eq!(
        b.text(0x2F01, 5),
        "axis 5: an access was refused (boot status J)"
    );
}

#[test]
fn the_nmt_state_is_what_error_control_says() {
    let mut b = Bench::new();
    assert_eq!(b.number(0x1F82, 1), Ok(0));
    for (state, code) in [
        (Some(State::PreOperational), 0x7F),
        (Some(State::Operational), 5),
        (Some(State::Stopped), 4),
        (None, 1),
    ] {
        b.device.on_node_state(node(1), state);
        assert_eq!(b.number(0x1F82, 1), Ok(code));
    }
    // A node that the network does not name is not followed.
    b.device.on_node_state(node(9), Some(State::Operational));
    assert_eq!(b.number(0x1F82, 9), Ok(0));
}

#[test]
fn a_node_never_seen_counts_as_lost_after_its_boot_time() {
    let mut b = Bench::new();
    let failure = |cause| Failure {
        status: Status::B,
        cause,
    };
    b.boot(Event::Failed(node(1), failure(Cause::Restarts)));
    assert_eq!(b.number(0x1F82, 1), Ok(0));
    b.boot(Event::Failed(node(1), failure(Cause::NoBootUp)));
    assert_eq!(b.number(0x1F82, 1), Ok(1));
    // What error control says goes before that.
    b.device.on_node_state(node(1), Some(State::Stopped));
    b.boot(Event::Failed(node(1), failure(Cause::NoBootUp)));
    assert_eq!(b.number(0x1F82, 1), Ok(4));
}

#[test]
fn the_emergencies_of_a_node() {
    let mut b = Bench::new();
    assert_eq!(b.text(0x2F02, 4), "no emergency");
    assert_eq!(b.number(0x2F84, 1), Err(AbortCode::NO_DATA));
    for n in 0..6 {
        let code = EmcyCode(0x8610 + n);
        let emcy = Emcy {
            manufacturer: [1, 2, 3, 4, n as u8],
            ..Emcy::new(code, ErrorRegister::MANUFACTURER)
        };
        b.device.on_emcy(node(4), emcy);
        b.device.on_emcy(node(9), emcy);
    }
    assert_eq!(b.number(0x2F84, 0), Ok(4));
    assert_eq!(b.read(0x2F84, 1), Ok(vec![0x15, 0x86, 0x80, 1, 2, 3, 4, 5]));
    assert_eq!(b.read(0x2F84, 4), Ok(vec![0x12, 0x86, 0x80, 1, 2, 3, 4, 2]));
    b.device.on_emcy(
        node(4),
        Emcy::new(EmcyCode::FOLLOWING_ERROR, ErrorRegister::MANUFACTURER),
    );
    assert_eq!(b.text(0x2F02, 4), "8611h (following error)");
    assert_eq!(b.write_u8(0x2F84, 0, 3), Err(AbortCode::VALUE_RANGE));
    assert_eq!(b.write_u8(0x2F84, 0, 0), Ok(()));
    assert_eq!(b.number(0x2F84, 0), Ok(0));
    assert_eq!(b.text(0x2F02, 4), "no emergency");
    assert_eq!(b.text(0x2F02, 9), "not in the network");
}

//! NMT: golden frames, the node's state machine, heartbeats
//! (CiA 301, 7.2.8, 7.3.2).

use canmaster::nmt::{
    Command, Consumer, ErrorControl, Heard, Lost, Node, NodeControl, NodeEvent, Producer, Service,
    State, Target,
};
use canmaster::{CobId, Duration, Frame, Instant, NodeId};
use proptest::prelude::*;

const NODE: NodeId = NodeId::constant::<3>();

fn frame(id: u16, data: &[u8]) -> Frame {
    Frame::data_frame(CobId::new(id).unwrap(), data).unwrap()
}

fn ms(ms: u64) -> Instant {
    Instant::from_micros(ms * 1000)
}

#[test]
fn commands_on_the_wire() {
    for (command, code) in [
        (Command::Start, 0x01),
        (Command::Stop, 0x02),
        (Command::EnterPreOperational, 0x80),
        (Command::ResetNode, 0x81),
        (Command::ResetCommunication, 0x82),
        (Command::Other(0x55), 0x55),
    ] {
        let one = NodeControl::node(command, NODE);
        assert_eq!(one.frame(), frame(0, &[code, 3]));
        assert_eq!(NodeControl::decode(&frame(0, &[code, 3])), Some(one));
        let all = NodeControl::all(command);
        assert_eq!(all.frame(), frame(0, &[code, 0]));
        assert_eq!(NodeControl::decode(&frame(0, &[code, 0])), Some(all));
    }
}

#[test]
fn what_is_not_a_command_is_not_decoded() {
    assert_eq!(NodeControl::decode(&frame(0, &[1])), None);
    assert_eq!(NodeControl::decode(&frame(0, &[1, 0, 0])), None);
    assert_eq!(NodeControl::decode(&frame(0, &[1, 128])), None);
    assert_eq!(NodeControl::decode(&frame(0x80, &[1, 0])), None);
    let remote = Frame::remote_frame(CobId::NMT, 2).unwrap();
    assert_eq!(NodeControl::decode(&remote), None);
}

#[test]
fn error_control_on_the_wire() {
    for (state, code) in [
        (State::Initialising, 0x00),
        (State::Stopped, 0x04),
        (State::Operational, 0x05),
        (State::PreOperational, 0x7F),
        (State::Other(0x12), 0x12),
    ] {
        let control = ErrorControl::heartbeat(NODE, state);
        assert_eq!(control.frame(), frame(0x703, &[code]));
        assert_eq!(ErrorControl::decode(&frame(0x703, &[code])), Some(control));
        let guarded = ErrorControl {
            toggle: true,
            ..control
        };
        assert_eq!(guarded.frame(), frame(0x703, &[code | 0x80]));
        assert_eq!(ErrorControl::decode(&guarded.frame()), Some(guarded));
    }
    assert_eq!(ErrorControl::decode(&frame(0x703, &[])), None);
    assert_eq!(ErrorControl::decode(&frame(0x703, &[5, 5])), None);
    assert_eq!(ErrorControl::decode(&frame(0x583, &[5])), None);
    assert_eq!(ErrorControl::decode(&frame(0x700, &[5])), None);
    let guard = Frame::remote_frame(CobId::new(0x703).unwrap(), 1).unwrap();
    assert_eq!(ErrorControl::decode(&guard), None);
}

#[test]
fn a_node_boots_into_pre_operational() {
    let mut node = Node::new(NODE);
    assert_eq!(node.state(), State::Initialising);
    assert_eq!(node.command(Command::Start), None);
    assert_eq!(node.boot(), Some(frame(0x703, &[0])));
    assert_eq!(node.state(), State::PreOperational);
    assert_eq!(node.boot(), None);
}

#[test]
fn every_command_in_every_state() {
    use State::{Operational, PreOperational, Stopped};
    for start in [Stopped, Operational, PreOperational] {
        for (command, end) in [
            (Command::Start, Operational),
            (Command::Stop, Stopped),
            (Command::EnterPreOperational, PreOperational),
        ] {
            let mut node = in_state(start);
            let event = (start != end).then_some(NodeEvent::Changed {
                from: start,
                to: end,
            });
            assert_eq!(node.command(command), event);
            assert_eq!(node.state(), end);
        }
        for (command, event) in [
            (Command::ResetNode, NodeEvent::ResetNode),
            (Command::ResetCommunication, NodeEvent::ResetCommunication),
        ] {
            let mut node = in_state(start);
            assert_eq!(node.command(command), Some(event));
            assert_eq!(node.state(), State::Initialising);
            assert!(node.boot().is_some());
        }
        let mut node = in_state(start);
        assert_eq!(node.command(Command::Other(7)), None);
        assert_eq!(node.state(), start);
    }
}

fn in_state(state: State) -> Node {
    let mut node = Node::new(NODE);
    node.boot();
    match state {
        State::Operational => node.command(Command::Start),
        State::Stopped => node.command(Command::Stop),
        _ => None,
    };
    assert_eq!(node.state(), state);
    node
}

#[test]
fn a_node_hears_its_own_commands_and_broadcasts() {
    let mut node = in_state(State::PreOperational);
    assert_eq!(node.on_frame(&frame(0, &[1, 4])), None);
    assert!(node.on_frame(&frame(0, &[1, 3])).is_some());
    assert!(node.on_frame(&frame(0, &[2, 0])).is_some());
    assert_eq!(node.state(), State::Stopped);
    assert!(Target::All.includes(NODE));
}

#[test]
fn services_by_state() {
    use Service::{Emergency, ErrorControl, Lss, NodeControl, Pdo, Sdo, Sync, Time};
    let all = [
        Pdo,
        Sdo,
        Sync,
        Time,
        Emergency,
        NodeControl,
        ErrorControl,
        Lss,
    ];
    for (state, allowed) in [
        (State::Initialising, &[][..]),
        (State::Other(9), &[]),
        (State::Stopped, &[NodeControl, ErrorControl, Lss]),
        (
            State::PreOperational,
            &[Sdo, Sync, Time, Emergency, NodeControl, ErrorControl],
        ),
        (
            State::Operational,
            &[Pdo, Sdo, Sync, Time, Emergency, NodeControl, ErrorControl],
        ),
    ] {
        for service in all {
            assert_eq!(
                state.allows(service),
                allowed.contains(&service),
                "{state} {service:?}"
            );
        }
    }
}

#[test]
fn the_producer_keeps_to_its_grid() {
    let mut producer = Producer::new(NODE);
    assert_eq!(producer.poll(ms(0), State::Operational), None);
    producer.set_period(Duration::from_millis(50), ms(0));
    let beat = Some(frame(0x703, &[5]));
    assert_eq!(producer.poll(ms(0), State::Operational), beat);
    assert_eq!(producer.poll(ms(49), State::Operational), None);
    assert_eq!(producer.next_deadline(), Some(ms(50)));
    // A late call does not shift the grid, a very late one makes up nothing.
    assert_eq!(producer.poll(ms(58), State::Operational), beat);
    assert_eq!(producer.next_deadline(), Some(ms(100)));
    assert_eq!(producer.poll(ms(260), State::Operational), beat);
    assert_eq!(producer.poll(ms(261), State::Operational), None);
    assert_eq!(producer.next_deadline(), Some(ms(310)));
    producer.start(ms(300));
    assert_eq!(producer.next_deadline(), Some(ms(350)));
    assert_eq!(producer.poll(ms(350), State::Initialising), None);
    producer.set_period(Duration::ZERO, ms(351));
    assert_eq!(producer.next_deadline(), None);
}

#[test]
fn the_consumer_is_armed_by_the_first_heartbeat() {
    let mut consumer = Consumer::new(NODE, Duration::from_millis(100));
    assert_eq!(consumer.poll(ms(5000)), None);
    assert_eq!(
        consumer.on_frame(&frame(0x703, &[0]), ms(5000)),
        Some(Heard::BootUp {
            was_monitored: false
        })
    );
    assert_eq!(consumer.poll(ms(9000)), None);
    assert_eq!(
        consumer.on_frame(&frame(0x703, &[0x7F]), ms(9000)),
        Some(Heard::First(State::PreOperational))
    );
    assert_eq!(consumer.next_deadline(), Some(ms(9100)));
    assert_eq!(consumer.on_frame(&frame(0x704, &[5]), ms(9050)), None);
    assert_eq!(
        consumer.on_frame(&frame(0x703, &[5]), ms(9050)),
        Some(Heard::Changed {
            from: State::PreOperational,
            to: State::Operational
        })
    );
    assert_eq!(
        consumer.on_frame(&frame(0x703, &[5]), ms(9100)),
        Some(Heard::Same(State::Operational))
    );
}

#[test]
fn the_consumer_reports_a_loss_once_and_a_return() {
    let mut consumer = Consumer::new(NODE, Duration::from_millis(100));
    consumer.heard(State::Operational, ms(0));
    assert_eq!(consumer.poll(ms(99)), None);
    let lost = Lost {
        node: NODE,
        last: State::Operational,
    };
    assert_eq!(consumer.poll(ms(100)), Some(lost));
    assert_eq!(consumer.poll(ms(101)), None);
    assert!(consumer.is_lost());
    assert_eq!(consumer.state(), None);
    assert_eq!(
        consumer.heard(State::Operational, ms(200)),
        Heard::First(State::Operational)
    );
    assert!(consumer.is_monitoring());
    // A reset of the node ends monitoring and is told apart from a loss.
    assert_eq!(
        consumer.heard(State::Initialising, ms(210)),
        Heard::BootUp {
            was_monitored: true
        }
    );
    assert_eq!(consumer.poll(ms(900)), None);
    assert!(!consumer.is_lost());
    // Consumer heartbeat time zero: followed, not monitored.
    consumer.set_time(Duration::ZERO);
    consumer.heard(State::Operational, ms(900));
    assert_eq!(consumer.poll(ms(99_999)), None);
}

proptest! {
    #[test]
    fn codes_survive(code: u8) {
        prop_assert_eq!(Command::from_code(code).code(), code);
        prop_assert_eq!(State::from_code(code).code(), code & 0x7F);
    }

    #[test]
    fn any_frame_is_taken(id in 0u16..0x800, data in prop::collection::vec(any::<u8>(), 0..=8)) {
        let frame = frame(id, &data);
        if let Some(control) = NodeControl::decode(&frame) {
            prop_assert_eq!(control.frame(), frame);
        }
        if let Some(control) = ErrorControl::decode(&frame) {
            prop_assert_eq!(control.frame(), frame);
        }
    }
}

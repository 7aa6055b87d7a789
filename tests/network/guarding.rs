//! Node guarding, both sides, and error behaviour (CiA 301, 7.2.8.3.2.1,
//! 7.5.2.32).

use canmaster::nmt::{
    Command, ErrorBehaviour, Guard, Guarded, Guardian, Heard, LifeGuarding, Lost, State,
};
use canmaster::{CobId, Duration, Frame, Instant, NodeId};
use proptest::prelude::*;

const NODE: NodeId = NodeId::constant::<3>();
const TIME: Duration = Duration::from_millis(100);

fn ms(ms: u64) -> Instant {
    Instant::from_micros(ms * 1000)
}

fn answer(byte: u8) -> Frame {
    Frame::data_frame(CobId::new(0x703).unwrap(), &[byte]).unwrap()
}

fn request() -> Frame {
    Frame::remote_frame(CobId::new(0x703).unwrap(), 1).unwrap()
}

fn started() -> Guardian {
    let mut guardian = Guardian::new(NODE, TIME, 2);
    guardian.start(ms(0));
    guardian
}

#[test]
fn the_state_is_asked_for_every_guard_time() {
    let mut g = started();
    assert_eq!(g.poll(ms(0)), Some(Guard::Ask(request())));
    assert_eq!(g.poll(ms(0)), None);
    let first = g.on_frame(&answer(0x7F), ms(1));
    assert_eq!(first, Some(Heard::First(State::PreOperational)));
    assert_eq!(g.next_deadline(), Some(ms(100)));
    assert_eq!(g.poll(ms(99)), None);
    assert_eq!(g.poll(ms(100)), Some(Guard::Ask(request())));
    let (from, to) = (State::PreOperational, State::Operational);
    assert_eq!(
        g.on_frame(&answer(0x85), ms(101)),
        Some(Heard::Changed { from, to })
    );
    assert_eq!(
        g.on_frame(&answer(0x05), ms(102)),
        Some(Heard::Same(State::Operational))
    );
    assert_eq!(g.state(), Some(State::Operational));
}

#[test]
fn an_answer_whose_toggle_bit_does_not_alternate_counts_as_none() {
    let mut g = started();
    assert_eq!(g.on_frame(&answer(0xFF), ms(1)), None);
    assert!(g.on_frame(&answer(0x7F), ms(1)).is_some());
    assert_eq!(g.on_frame(&answer(0x7F), ms(2)), None);
    assert!(g.on_frame(&answer(0xFF), ms(2)).is_some());
    // Another node, another length.
    let other = Frame::data_frame(CobId::new(0x704).unwrap(), &[0x7F]).unwrap();
    assert_eq!(g.on_frame(&other, ms(3)), None);
    let long = Frame::data_frame(CobId::new(0x703).unwrap(), &[0x7F, 0]).unwrap();
    assert_eq!(g.on_frame(&long, ms(3)), None);
    assert_eq!(g.on_frame(&request(), ms(3)), None);
}

#[test]
fn the_retries_are_asked_before_it_is_lost_once() {
    let mut g = started();
    g.poll(ms(0));
    g.on_frame(&answer(0x05), ms(1));
    for t in [100, 200, 300] {
        assert_eq!(g.poll(ms(t)), Some(Guard::Ask(request())));
        assert_eq!(g.poll(ms(t)), None);
    }
    let lost = Lost {
        node: NODE,
        last: State::Operational,
    };
    assert_eq!(g.poll(ms(400)), Some(Guard::Lost(lost)));
    assert!(g.is_lost());
    assert_eq!(g.state(), None);
    // It is still asked, and may come back.
    assert_eq!(g.poll(ms(400)), Some(Guard::Ask(request())));
    assert_eq!(g.poll(ms(500)), Some(Guard::Ask(request())));
    assert_eq!(
        g.on_frame(&answer(0x85), ms(501)),
        Some(Heard::First(State::Operational))
    );
    assert!(!g.is_lost());
}

#[test]
fn a_node_never_heard_is_not_lost_here() {
    let mut g = started();
    for n in 0..20 {
        assert_eq!(g.poll(ms(n * 100)), Some(Guard::Ask(request())));
    }
    assert!(!g.is_lost());
}

#[test]
fn a_boot_up_message_starts_the_toggle_bit_anew() {
    let mut g = started();
    g.on_frame(&answer(0x05), ms(1));
    assert_eq!(
        g.on_frame(&answer(0x00), ms(50)),
        Some(Heard::BootUp {
            was_monitored: true
        })
    );
    assert_eq!(g.poll(ms(50)), Some(Guard::Ask(request())));
    assert!(g.on_frame(&answer(0x7F), ms(51)).is_some());
}

#[test]
fn without_a_guard_time_nothing_is_asked() {
    let mut g = Guardian::new(NODE, Duration::ZERO, 3);
    g.start(ms(0));
    assert_eq!(g.next_deadline(), None);
    assert_eq!(g.poll(ms(1000)), None);
    assert_eq!(g.on_frame(&answer(0x05), ms(1)), None);
}

#[test]
fn the_node_answers_with_an_alternating_toggle_bit() {
    let mut node = Guarded::new(NODE, Duration::ZERO);
    let mut ask = |state| node.on_frame(&request(), state, ms(0)).map(|(f, _)| f);
    assert_eq!(ask(State::Initialising), None);
    assert_eq!(ask(State::PreOperational), Some(answer(0x7F)));
    assert_eq!(ask(State::Operational), Some(answer(0x85)));
    assert_eq!(ask(State::Stopped), Some(answer(0x04)));
    node.reset();
    let again = node.on_frame(&request(), State::PreOperational, ms(0));
    assert_eq!(again, Some((answer(0x7F), None)));
    assert_eq!(node.next_deadline(), None);
    for other in [answer(0x7F), Frame::empty(CobId::SYNC)] {
        assert_eq!(node.on_frame(&other, State::Operational, ms(0)), None);
    }
}

#[test]
fn the_node_watches_the_master_from_its_first_request_on() {
    let mut node = Guarded::new(NODE, Duration::from_millis(300));
    assert_eq!(node.poll(ms(10_000)), None);
    node.on_frame(&request(), State::Operational, ms(1000));
    assert_eq!(node.next_deadline(), Some(ms(1300)));
    assert_eq!(node.poll(ms(1299)), None);
    assert_eq!(node.poll(ms(1300)), Some(LifeGuarding::Occurred));
    assert_eq!(node.poll(ms(9999)), None);
    let back = node.on_frame(&request(), State::Operational, ms(2000));
    assert_eq!(back.unwrap().1, Some(LifeGuarding::Resolved));
    node.set_life_time(Duration::ZERO);
    assert_eq!(node.next_deadline(), None);
}

#[test]
fn what_a_communication_error_does() {
    use State::{Operational, PreOperational, Stopped};
    for code in 0..=255 {
        let behaviour = ErrorBehaviour::from_code(code);
        assert_eq!(behaviour.is_some(), code <= ErrorBehaviour::MAX);
        let Some(behaviour) = behaviour else { continue };
        assert_eq!(behaviour.code(), code);
        let expected = match code {
            0 => [Some(Command::EnterPreOperational), None, None],
            1 => [None, None, None],
            _ => [Some(Command::Stop), Some(Command::Stop), None],
        };
        let got = [Operational, PreOperational, Stopped].map(|state| behaviour.reaction(state));
        assert_eq!(got, expected);
        assert_eq!(behaviour.reaction(State::Initialising), None);
    }
}

proptest! {
    /// Master and node together, frames lost on the way: with three answers
    /// between two losses the node is not lost; it is when it dies.
    /// A lost answer counts double: the toggle bits of the two sides do not match
    /// any more, so that the next one is not taken either.
    #[test]
    fn single_losses_are_survived(lost in prop::collection::vec(0usize..3, 1..40)) {
        let mut g = Guardian::new(NODE, TIME, 2);
        let mut node = Guarded::new(NODE, Duration::ZERO);
        g.start(ms(0));
        let mut now = ms(0);
        let mut kept = 0;
        for fate in lost {
            while let Some(guard) = g.poll(now) {
                let Guard::Ask(frame) = guard else {
                    prop_assert!(false, "lost");
                    break;
                };
                let may = kept >= 2;
                kept = if may && fate > 0 { 0 } else { kept + 1 };
                if may && fate == 1 {
                    continue;
                }
                let (reply, _) = node.on_frame(&frame, State::Operational, now).unwrap();
                if may && fate == 2 {
                    continue;
                }
                g.on_frame(&reply, now);
            }
            now += TIME;
        }
        prop_assert!(!g.is_lost());
        let mut reported = 0;
        for _ in 0..10 {
            while let Some(guard) = g.poll(now) {
                reported += u32::from(matches!(guard, Guard::Lost(_)));
            }
            now += TIME;
        }
        prop_assert_eq!(reported, 1);
    }
}

//! Nodes that have node guarding instead of a heartbeat.

use crate::networks::{assign, network};
use crate::rig::{OPERATIONAL, Rig, id, ms};
use canmaster::boot::Event;

/// 1F81h: every 100 ms, asked twice again.
const GUARDING: u32 = 100 << 16 | 2 << 8;

/// Node 2 is guarded and operational.
fn running() -> Rig {
    let network = network(2, |_, kind| kind.heartbeat_ms = 0);
    let mut rig = Rig::with(network, assign(2, GUARDING));
    rig.fakes[1].toggle = Some(false);
    rig.run_for(ms(2000));
    assert!(rig.boot.is_ready());
    rig.forget();
    rig
}

fn asked(rig: &Rig) -> usize {
    let sent = rig.sent.iter();
    sent.filter(|(_, frame)| frame.is_remote()).count()
}

#[test]
fn it_is_asked_for_as_long_as_it_runs() {
    let mut rig = running();
    rig.run_for(ms(1000));
    assert_eq!(asked(&rig), 10);
    assert!(rig.boot.is_ready() && rig.events.is_empty());
}

#[test]
fn one_that_does_not_answer_any_more_is_booted_again() {
    let mut rig = running();
    let toggle = rig.fakes[1].toggle.take();
    rig.run_for(ms(250));
    assert!(
        rig.boot.is_ready(),
        "one answer may be missing, and a second"
    );
    rig.run_for(ms(150));
    let node = id(2);
    assert_eq!(rig.events, [Event::NodeLost(node), Event::NetworkDown]);
    assert_eq!(rig.nmt(), [[0x82, 2]]);
    rig.fakes[1].toggle = toggle.map(|_| false);
    rig.run_for(ms(1000));
    assert!(rig.events.contains(&Event::NodeBack(node)));
    assert!(rig.boot.is_ready());
    assert_eq!(rig.fakes[1].state, OPERATIONAL);
}

#[test]
fn an_answer_whose_toggle_bit_stands_still_is_none() {
    let mut rig = running();
    for _ in 0..5 {
        rig.fakes[1].toggle = Some(false);
        rig.run_for(ms(100));
    }
    assert!(rig.events.contains(&Event::NodeLost(id(2))));
}

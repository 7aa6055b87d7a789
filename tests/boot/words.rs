//! What people read.

use crate::networks::{network, optional};
use crate::rig::{Rig, id, ms};
use canmaster::boot::{BootResult, Event};

#[test]
fn results_are_told_in_words() {
    let mut rig = Rig::new(network(2, optional));
    assert_eq!(rig.boot.result(id(2)), Some(BootResult::Pending));
    assert_eq!(rig.boot.result(id(9)), None);
    rig.fakes[1].missing = true;
    rig.run_for(ms(3000));
    let words = |node| rig.boot.result(id(node)).unwrap().to_string();
    assert_eq!(words(1), "booted");
    assert_eq!(
        words(2),
        "boot status B: no boot-up frame; check its power supply, the bus wiring and \
         termination, its node-ID and its bit rate"
    );
}

#[test]
fn events_are_told_in_words() {
    for (event, words) in [
        (
            Event::Configuring {
                node: id(4),
                done: 16,
                total: 48,
            },
            "node 4: configuring, 16 of 48 writes",
        ),
        (
            Event::BusOff { pause_ms: 200 },
            "bus-off: restarting the controller in 200 ms",
        ),
        (Event::NodeBack(id(2)), "node 2: is back"),
    ] {
        assert_eq!(event.to_string(), words);
    }
}

//! Bus-off.

use crate::networks::network;
use crate::rig::{OPERATIONAL, Rig, ms};
use canmaster::boot::Event;
use canmaster::network::sample::SIX_EPOS4;

#[test]
fn after_a_pause_and_silence_all_nodes_are_booted_again() {
    let mut rig = Rig::new(&SIX_EPOS4);
    rig.run_for(ms(2000));
    assert!(rig.boot.is_ready());
    rig.forget();
    let at = rig.now;
    rig.boot.bus_off(at);
    rig.run();
    let bus_off = Event::BusOff { pause_ms: 100 };
    assert_eq!(rig.events, [bus_off, Event::NetworkDown]);
    assert!(rig.boot.is_silent());
    assert!(!rig.boot.is_ready());
    rig.run_for(ms(100));
    assert_eq!(rig.restarts, [at + ms(100)]);
    rig.run_for(ms(599));
    assert_eq!(rig.sent, []);
    assert!(rig.boot.is_silent());
    rig.run_for(ms(1300));
    assert_eq!(rig.nmt().first(), Some(&[0x82, 0]));
    assert_eq!(rig.nmt().last(), Some(&[0x01, 0]));
    assert!(rig.boot.is_ready());
    assert_eq!(rig.events.last(), Some(&Event::NetworkReady));
    assert!(rig.fakes.iter().all(|fake| fake.state == OPERATIONAL));
}

#[test]
fn the_pause_grows_while_the_bus_stays_bad() {
    let mut rig = Rig::new(&SIX_EPOS4);
    let mut pauses = Vec::new();
    for _ in 0..8 {
        let at = rig.now;
        rig.boot.bus_off(at);
        rig.run_for(ms(6_500));
        pauses.push((*rig.restarts.last().unwrap() - at).as_millis());
    }
    assert_eq!(pauses, [100, 200, 400, 800, 1600, 3200, 6400, 6400]);
}

#[test]
fn a_node_that_is_missing_after_bus_off_is_waited_for() {
    let mut rig = Rig::new(network(3, |_, _| {}));
    rig.run_for(ms(2000));
    rig.fakes[1].missing = true;
    rig.boot.bus_off(rig.now);
    rig.run_for(ms(10_000));
    assert!(!rig.boot.is_failed());
    assert!(!rig.boot.is_ready());
    assert_eq!(rig.letter(2), Some('B'));
    rig.forget();
    rig.fakes[1].missing = false;
    rig.error_control(2, 0x7F);
    rig.run_for(ms(2000));
    assert!(rig.boot.is_ready());
    assert_eq!(rig.nmt(), [[0x82, 2], [0x80, 2], [0x01, 0]]);
}

#[test]
fn bus_off_in_the_start_does_not_excuse_a_missing_node() {
    let mut rig = Rig::new(network(3, |_, _| {}));
    rig.fakes[1].missing = true;
    rig.run_for(ms(1000));
    rig.boot.bus_off(rig.now);
    rig.run_for(ms(3000));
    rig.assert_nothing_was_started();
    // What is halted stays so.
    rig.forget();
    rig.boot.bus_off(rig.now);
    rig.run_for(ms(3000));
    assert_eq!(rig.restarts.len(), 2);
    assert!(rig.boot.is_failed());
    assert_eq!(rig.sent, []);
}

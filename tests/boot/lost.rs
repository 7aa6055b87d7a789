//! Nodes that are lost, late, or come back.

use crate::networks::{network, optional};
use crate::rig::{OPERATIONAL, PRE_OPERATIONAL, Rig, id, ms};
use canmaster::boot::{Cause, Event, Startup, Status};
use canmaster::network::Network;

fn running(network: &'static Network) -> Rig {
    let mut rig = Rig::new(network);
    rig.run_for(ms(2000));
    assert!(rig.boot.is_ready());
    rig.forget();
    rig
}

/// Reset by its own supply: the boot-up frame comes unasked.
fn restart(rig: &mut Rig, n: usize) {
    let now = rig.now;
    let fake = &mut rig.fakes[n];
    (fake.state, fake.period, fake.beat) = (0, None, None);
    fake.boots_at = Some(now + ms(300));
}

#[test]
fn a_node_that_restarts_while_the_network_runs_is_booted_again_and_started_alone() {
    let mut rig = running(network(3, |_, _| {}));
    restart(&mut rig, 1);
    rig.run_for(ms(1000));
    assert_eq!(rig.nmt(), [[0x80, 2], [0x01, 2]]);
    assert!(rig.requests(2).len() > 4);
    // The rest runs on.
    assert_eq!(rig.requests(1), [[0; 8]; 0]);
    assert_eq!(rig.fakes[0].state, OPERATIONAL);
    let node = id(2);
    assert_eq!(
        rig.events,
        [
            Event::NodeLost(node),
            Event::NetworkDown,
            Event::BootUp(node),
            Event::Identified(node),
            Event::Configured(node),
            Event::Ready(node),
            Event::NodeBack(node),
            Event::NetworkReady,
        ]
    );
}

#[test]
fn a_node_that_fell_silent_is_reset_and_booted_again() {
    let mut rig = running(network(3, |_, _| {}));
    rig.fakes[1].missing = true;
    rig.boot.node_lost(id(2));
    rig.run();
    assert_eq!(rig.nmt(), [[0x82, 2]]);
    assert!(!rig.boot.is_ready());
    assert_eq!(rig.events, [Event::NodeLost(id(2)), Event::NetworkDown]);
    rig.run_for(ms(5000));
    assert_eq!(rig.failure(2), (Status::B, Cause::NoBootUp));
    assert!(!rig.boot.is_failed());
    // Its cable is back; it was running all the time.
    rig.forget();
    rig.fakes[1].missing = false;
    rig.fakes[1].state = OPERATIONAL;
    rig.run_for(ms(2000));
    assert_eq!(rig.nmt(), [[0x82, 2], [0x80, 2], [0x01, 2]]);
    assert_eq!(rig.events.last(), Some(&Event::NetworkReady));
}

/// It boots while its cable is cut, sends in vain, and says so when it is heard.
#[test]
fn a_node_that_was_cut_off_while_it_booted_is_reset() {
    let mut rig = Rig::new(network(3, |_, _| {}));
    while rig.requests(2).is_empty() {
        rig.run_for(ms(1));
    }
    rig.forget();
    rig.boot.node_cut_off(id(2), rig.now);
    rig.run_for(ms(2000));
    assert_eq!(rig.nmt(), [[0x82, 2], [0x80, 2], [0x01, 0]]);
    let boots = rig.events.iter().filter(|e| **e == Event::BootUp(id(2)));
    assert_eq!(boots.count(), 1);
    assert!(rig.boot.is_ready());
}

#[test]
fn a_master_that_is_silent_resets_nobody() {
    let mut rig = Rig::new(network(3, |_, _| {}));
    rig.boot.node_cut_off(id(2), rig.now);
    rig.run();
    assert_eq!(rig.nmt(), [[0; 2]; 0]);
}

#[test]
fn a_node_that_leaves_operational_by_itself_is_booted_again() {
    let mut rig = running(network(3, |_, _| {}));
    rig.fakes[1].state = PRE_OPERATIONAL;
    rig.run_for(ms(1000));
    assert_eq!(rig.nmt(), [[0x82, 2], [0x80, 2], [0x01, 2]]);
    assert!(rig.boot.is_ready());
}

#[test]
fn nobody_is_started_while_a_mandatory_node_is_missing() {
    let mut rig = running(network(3, |_, _| {}));
    rig.fakes[0].missing = true;
    rig.boot.node_lost(id(1));
    restart(&mut rig, 1);
    rig.run_for(ms(3000));
    assert!(rig.nmt().iter().all(|[command, _]| *command != 0x01));
    rig.fakes[0].missing = false;
    restart(&mut rig, 0);
    rig.run_for(ms(2000));
    assert!(rig.boot.is_ready());
}

#[test]
fn an_optional_node_holds_nobody_up_and_is_tried_for_ever() {
    let mut rig = Rig::new(network(3, optional));
    rig.fakes[1].missing = true;
    rig.run_for(ms(3000));
    assert!(rig.boot.is_ready());
    assert_eq!(rig.nmt().last(), Some(&[0x01, 3]));
    assert_eq!(rig.failure(2), (Status::B, Cause::NoBootUp));
    rig.run_for(ms(1000));
    rig.forget();
    rig.run_for(ms(60_000));
    // 1000h three times, each with its timeout and its quarantine, and a second
    // of pause; told once.
    let asked = rig.requests(2).into_iter().filter(|data| data[0] == 0x40);
    let asked: Vec<_> = asked.collect();
    assert!((80..=130).contains(&asked.len()), "{}", asked.len());
    assert!(asked.iter().all(|data| data[1..4] == [0x00, 0x10, 0x00]));
    assert_eq!(rig.events, []);
    assert!(rig.boot.is_ready());
    // At last it is switched on.
    rig.fakes[1].missing = false;
    restart(&mut rig, 1);
    rig.run_for(ms(2000));
    assert_eq!(rig.nmt(), [[0x80, 2], [0x01, 2]]);
    assert_eq!(rig.letter(2), None);
    assert_eq!(rig.events.last(), Some(&Event::Operational(id(2))));
}

#[test]
fn the_loss_of_an_optional_node_leaves_the_network_ready() {
    let mut rig = running(network(3, optional));
    rig.fakes[1].missing = true;
    rig.boot.node_lost(id(2));
    rig.run_for(ms(5000));
    assert!(rig.boot.is_ready());
    assert!(rig.events.contains(&Event::NodeLost(id(2))));
    assert!(!rig.events.contains(&Event::NetworkDown));
}

#[test]
fn a_boot_time_of_zero_waits_for_ever() {
    let mut rig = Rig::with(network(2, |_, _| {}), |settings| {
        settings.boot_time = canmaster::Duration::ZERO;
    });
    rig.fakes[1].missing = true;
    rig.run_for(ms(60_000));
    assert!(!rig.boot.is_failed());
    assert_eq!(rig.letter(2), None);
    rig.fakes[1].missing = false;
    restart(&mut rig, 1);
    rig.run_for(ms(2000));
    assert!(rig.boot.is_ready());
}

#[test]
fn the_error_of_a_mandatory_node_stops_all_before_it_resets_all() {
    for (bits, expected) in [
        (Startup::STOP_ALL | Startup::RESET_ALL, [0x02, 0]),
        (Startup::STOP_ALL, [0x02, 0]),
        (Startup::RESET_ALL, [0x82, 0]),
    ] {
        let mut rig = Rig::with(network(3, optional), |settings| settings.startup.0 |= bits);
        rig.run_for(ms(2000));
        rig.forget();
        // The optional one changes nothing for the others.
        rig.boot.node_lost(id(2));
        rig.run_for(ms(2000));
        assert_eq!(rig.nmt(), [[0x82, 2], [0x80, 2], [0x01, 2]]);
        rig.forget();
        rig.boot.node_lost(id(3));
        rig.run_for(ms(3000));
        assert_eq!(rig.nmt()[0], expected);
        let stopped = bits & Startup::STOP_ALL != 0;
        assert_eq!(rig.boot.is_ready(), !stopped);
        assert_eq!(rig.nmt().len() == 1, stopped);
        assert_eq!(rig.events.contains(&Event::NetworkStopped), stopped);
    }
}

#[test]
fn a_node_that_restarts_after_every_start_is_given_up() {
    let mut rig = Rig::new(network(2, |_, _| {}));
    rig.run_for(ms(500));
    // Ready 100 ms after its boot-up frame, started 20 ms later.
    rig.run_for(ms(300));
    for _ in 0..10 {
        rig.run_for(ms(150));
        restart(&mut rig, 1);
        rig.fakes[1].boots_at = Some(rig.now);
    }
    rig.run();
    assert!(rig.boot.is_failed());
    assert_eq!(rig.failure(2), (Status::B, Cause::Restarts));
}

#[test]
fn a_node_that_resets_when_it_was_configured_is_configured_anew() {
    let mut rig = Rig::new(network(3, |_, _| {}));
    // Node 3 holds the start up.
    rig.fakes[2].no_heartbeat = true;
    rig.run_for(ms(950));
    let once = rig.fakes[1].written.len();
    restart(&mut rig, 1);
    rig.fakes[1].boots_at = Some(rig.now);
    rig.run_for(ms(10));
    assert_eq!(rig.fakes[1].written.len(), 2 * once);
    assert!(rig.events.contains(&Event::NodeLost(id(2))));
}

#[test]
fn a_node_that_resets_while_the_network_starts_holds_it_up() {
    let mut rig = Rig::new(network(3, |_, _| {}));
    // Started at 0.92 s, operational at 1 s.
    rig.run_for(ms(950));
    restart(&mut rig, 1);
    rig.fakes[1].boots_at = Some(rig.now);
    rig.run_for(ms(100));
    assert!(!rig.boot.is_ready());
    assert_eq!(rig.fakes[0].state, OPERATIONAL);
    rig.run_for(ms(500));
    assert!(rig.boot.is_ready());
    assert_eq!(rig.nmt().last(), Some(&[0x01, 2]));
}

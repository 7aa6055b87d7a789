//! Every letter of CiA 302-2 that this master can reach.

use crate::networks::network;
use crate::rig::{Fake, OPERATIONAL, PRE_OPERATIONAL, Rig, ms};
use canmaster::boot::{Assignment, Cause, Event, NodeSettings};
use canmaster::network::{Kind, Node};

struct Case {
    letter: Option<char>,
    node: fn(&mut Node, &mut Kind),
    settings: fn(&mut NodeSettings),
    fake: fn(&mut Fake),
    started: bool,
}

const KEEP_ALIVE: u32 = Assignment::KEEP_ALIVE;
const GUARD_TIME: u32 = 50 << 16;
const PLAIN: Case = Case {
    letter: None,
    node: |_, _| {},
    settings: |_| {},
    fake: |_| {},
    started: true,
};
const FAILS: Case = Case {
    started: false,
    ..PLAIN
};

#[test]
fn each_letter_is_reached() {
    let cases = [
        PLAIN,
        Case {
            letter: Some('A'),
            settings: |node| node.assignment = Assignment(0),
            ..PLAIN
        },
        Case {
            letter: Some('B'),
            fake: |fake| fake.missing = true,
            ..FAILS
        },
        Case {
            letter: Some('C'),
            fake: |fake| fake.set((0x1000, 0), 0x0001_0192),
            ..FAILS
        },
        Case {
            letter: Some('D'),
            fake: |fake| fake.set((0x1018, 1), 1),
            ..FAILS
        },
        Case {
            letter: Some('E'),
            settings: |node| node.assignment.0 |= KEEP_ALIVE,
            fake: |fake| fake.runs(OPERATIONAL, None),
            ..FAILS
        },
        Case {
            letter: Some('F'),
            node: |_, kind| kind.heartbeat_ms = 0,
            settings: |node| node.assignment.0 |= KEEP_ALIVE | GUARD_TIME,
            fake: |fake| fake.runs(OPERATIONAL, None),
            ..FAILS
        },
        Case {
            letter: Some('J'),
            fake: |fake| fake.refuses = Some(((0x6060, 0), 0x0609_0030)),
            ..FAILS
        },
        Case {
            letter: Some('K'),
            fake: |fake| fake.no_heartbeat = true,
            ..FAILS
        },
        Case {
            letter: Some('L'),
            settings: |node| node.assignment.0 |= KEEP_ALIVE,
            fake: |fake| fake.runs(OPERATIONAL, Some(ms(100))),
            ..PLAIN
        },
        Case {
            letter: Some('M'),
            fake: |fake| fake.set((0x1018, 2), 0),
            ..FAILS
        },
        Case {
            letter: Some('N'),
            fake: |fake| fake.set((0x1018, 3), 0x0171_0000),
            ..FAILS
        },
        Case {
            letter: Some('O'),
            node: |node, _| node.serial = Some(7),
            fake: |fake| fake.set((0x1018, 4), 8),
            ..FAILS
        },
    ];
    for case in cases {
        let network = network(3, case.node);
        let mut rig = Rig::with(network, |settings| (case.settings)(&mut settings.nodes[1]));
        (case.fake)(&mut rig.fakes[1]);
        rig.run_for(ms(4000));
        let letter = case.letter;
        assert_eq!(rig.letter(2), letter);
        assert_eq!(rig.letter(1), None, "beside {letter:?}");
        assert_eq!(rig.boot.is_ready(), case.started, "{letter:?}");
        assert_eq!(rig.boot.is_failed(), !case.started, "{letter:?}");
        let started = rig.nmt().iter().any(|[command, _]| *command == 0x01);
        assert_eq!(started, case.started, "{letter:?}");
    }
}

#[test]
fn a_node_that_is_not_listed_is_left_alone() {
    let mut rig = Rig::with(network(2, |_, _| {}), |settings| {
        settings.nodes[1].assignment = Assignment(0);
    });
    rig.run_for(ms(2000));
    assert!(rig.boot.is_ready());
    assert_eq!(rig.requests(2), [[0; 8]; 0]);
    // Not by broadcast, which would start it.
    assert_eq!(rig.nmt(), [[0x82, 0], [0x80, 1], [0x01, 1]]);
    assert!(rig.events.contains(&Event::NotListed(crate::rig::id(2))));
}

#[test]
fn a_node_that_may_not_be_started_is_only_watched() {
    let mut rig = Rig::with(network(2, |_, _| {}), |settings| {
        settings.nodes[1].assignment.0 &= !Assignment::MAY_START;
    });
    rig.run_for(ms(850));
    // Somebody else configures its heartbeat.
    rig.fakes[1].runs(PRE_OPERATIONAL, Some(ms(100)));
    rig.run_for(ms(2000));
    assert!(rig.boot.is_ready());
    assert_eq!(rig.requests(2), [[0; 8]; 0]);
    assert_eq!(rig.nmt(), [[0x82, 0], [0x80, 1], [0x01, 1]]);
}

#[test]
fn a_node_to_be_kept_alive_that_runs_is_neither_reset_nor_configured() {
    let mut rig = Rig::with(
        network(2, |_, _| {}),
        crate::networks::assign(2, KEEP_ALIVE),
    );
    rig.fakes[1].runs(OPERATIONAL, Some(ms(100)));
    rig.run_for(ms(2000));
    assert!(rig.boot.is_ready());
    assert_eq!(rig.fakes[1].written, []);
    // Node 1 is reset and started by itself.
    assert_eq!(rig.nmt(), [[0x82, 1], [0x80, 1], [0x01, 1]]);
}

#[test]
fn a_node_to_be_kept_alive_that_does_not_run_is_reset_and_configured() {
    let mut rig = Rig::with(
        network(2, |_, _| {}),
        crate::networks::assign(2, KEEP_ALIVE),
    );
    rig.fakes[1].runs(PRE_OPERATIONAL, Some(ms(100)));
    rig.run_for(ms(2000));
    assert!(rig.boot.is_ready());
    assert_eq!(rig.letter(2), None);
    assert!(rig.fakes[1].written.len() > 2);
    let to_node_2: Vec<_> = rig
        .nmt()
        .into_iter()
        .filter(|[_, node]| *node == 2)
        .collect();
    assert_eq!(to_node_2, [[0x82, 2], [0x80, 2]]);
    assert_eq!(rig.nmt().last(), Some(&[0x01, 0]));
}

#[test]
fn a_guarded_node_is_asked_by_remote_frames() {
    let network = network(2, |_, kind| kind.heartbeat_ms = 0);
    let mut rig = Rig::with(network, crate::networks::assign(2, GUARD_TIME));
    rig.fakes[1].toggle = Some(false);
    rig.run_for(ms(2000));
    assert!(rig.boot.is_ready());
    let asked = rig.sent.iter().find(|(_, frame)| frame.is_remote());
    let (_, frame) = asked.unwrap();
    assert_eq!((frame.id().get(), frame.dlc()), (0x702, 1));
}

#[test]
fn an_unanswered_guarding_is_told_from_a_missing_heartbeat_in_words() {
    let network = network(2, |_, kind| kind.heartbeat_ms = 0);
    let mut rig = Rig::with(
        network,
        crate::networks::assign(2, KEEP_ALIVE | GUARD_TIME | 2 << 8),
    );
    rig.fakes[1].runs(OPERATIONAL, None);
    rig.run_for(ms(3000));
    assert_eq!(rig.failure(2).1, Cause::NoState);
    // Once, and twice again.
    let asked = rig.sent.iter().filter(|(_, frame)| frame.is_remote());
    assert_eq!(asked.count(), 3);
}

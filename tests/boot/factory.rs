//! Drives without node-ID.

use crate::networks::{network, unconfigured};
use crate::rig::{Rig, id, ms};
use canmaster::boot::Event;
use canmaster::lss::{LssAddress, LssSlave};
use canmaster::network::Network;
use canmaster::network::sample::SIX_EPOS4;

/// Node 2 is named by its serial number.
fn serials() -> &'static Network {
    network(3, |node, _| node.serial = Some(0x0000_4711))
}

#[test]
fn a_missing_node_is_found_by_its_serial_number_and_given_its_node_id() {
    let mut rig = Rig::new(serials());
    unconfigured(&mut rig.fakes[1], 0x4711);
    rig.run_for(ms(5000));
    assert!(rig.boot.is_ready());
    assert_eq!(rig.fakes[1].id, 2);
    let given = Event::IdGiven {
        node: id(2),
        stored: true,
    };
    assert!(rig.events.contains(&given));
    let failed = |event: &&Event| matches!(event, Event::Failed(..));
    assert_eq!(rig.events.iter().find(failed), None, "it was found in time");
    let lss: Vec<_> = rig
        .sent
        .iter()
        .filter(|(_, frame)| frame.id().get() == 0x7E5)
        .map(|(_, frame)| frame.padded())
        .collect();
    assert_eq!(
        lss,
        [
            [0x04, 0, 0, 0, 0, 0, 0, 0],
            [0x51, 0, 0, 0, 0, 0x80, 0, 0],
            [0x51, 0xFB, 0, 0, 0, 0, 0, 1],
            [0x51, 0, 0, 0x50, 0x61, 0, 1, 2],
            [0x51, 0, 0, 0x70, 0x01, 0, 2, 3],
            [0x51, 0x11, 0x47, 0, 0, 0, 3, 0],
            [0x11, 2, 0, 0, 0, 0, 0, 0],
            [0x17, 0, 0, 0, 0, 0, 0, 0],
            [0x04, 0, 0, 0, 0, 0, 0, 0],
            // Is there anybody else?
            [0x51, 0, 0, 0, 0, 0x80, 0, 0],
        ]
    );
    // It boots by itself; the others need not boot again.
    let resets = rig.nmt().into_iter().filter(|data| *data == [0x82, 0]);
    assert_eq!(resets.count(), 1);
}

#[test]
fn a_drive_that_the_network_does_not_name_gets_no_node_id_and_is_told_of() {
    let mut rig = Rig::new(serials());
    unconfigured(&mut rig.fakes[1], 0x4712);
    rig.run_for(ms(20_000));
    rig.assert_nothing_was_started();
    assert_eq!(rig.letter(2), Some('B'));
    let stranger = LssAddress {
        vendor: 0xFB,
        product: 0x6150_0000,
        revision: 0x0170_0000,
        serial: 0x4712,
    };
    // It is named before what follows from its absence.
    let told: Vec<_> = rig.events.iter().rev().take(3).rev().collect();
    assert!(matches!(
        told[..],
        [Event::Stranger(found), Event::Failed(..), Event::NetworkFailed] if *found == stranger
    ));
    assert!(rig.fakes[1].lss.is_some());
}

#[test]
fn a_stranger_of_another_kind_is_named_too() {
    let mut rig = Rig::new(serials());
    let stranger = LssAddress {
        vendor: 0x15A,
        product: 2,
        revision: 3,
        serial: 4,
    };
    rig.fakes[1].lss = Some(LssSlave::new(stranger, None));
    rig.run_for(ms(20_000));
    rig.assert_nothing_was_started();
    assert!(rig.events.contains(&Event::Stranger(stranger)));
}

#[test]
fn several_nodes_without_node_id_each_get_their_own_and_one_that_refuses_is_named() {
    let mut rig = Rig::new(&SIX_EPOS4);
    for (n, fake) in rig.fakes.iter_mut().enumerate() {
        unconfigured(fake, 0x2600_0001 + n as u32);
    }
    rig.refuses_node_id = Some(4);
    rig.run_for(ms(10_000));
    rig.assert_nothing_was_started();
    for node in [1, 2, 3, 5, 6] {
        let given = Event::IdGiven {
            node: id(node),
            stored: true,
        };
        assert!(rig.events.contains(&given), "node {node}");
        assert_eq!(rig.letter(node), None);
    }
    let refused = Event::IdRefused {
        node: id(4),
        error: 1,
        specific: 0,
    };
    assert!(rig.events.contains(&refused));
    assert_eq!(rig.letter(4), Some('B'));
}

#[test]
fn a_node_that_boots_late_is_booted_while_others_are_looked_for() {
    let mut rig = Rig::new(serials());
    rig.fakes[1].missing = true;
    rig.run_for(ms(2110));
    assert_eq!(rig.events.last(), Some(&Event::Scanning));
    rig.fakes[1].missing = false;
    rig.fakes[1].set((0x1018, 4), 0x4711);
    rig.fakes[1].boots_at = Some(rig.now);
    rig.run_for(ms(1000));
    assert!(rig.boot.is_ready());
}

#[test]
fn where_nobody_is_without_node_id_a_missing_node_costs_one_question_more() {
    let mut rig = Rig::new(serials());
    rig.fakes[1].missing = true;
    rig.run_for(ms(2200));
    rig.assert_nothing_was_started();
}

#[test]
fn where_no_serial_number_is_named_nobody_is_looked_for() {
    let mut rig = Rig::new(network(3, |_, _| {}));
    unconfigured(&mut rig.fakes[1], 0x4711);
    rig.run_for(ms(2101));
    rig.assert_nothing_was_started();
    assert!(!rig.events.contains(&Event::Scanning));
}

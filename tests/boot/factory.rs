//! Drives without node-ID.

use crate::networks::{network, unconfigured};
use crate::rig::{Rig, id, ms};
use canmaster::boot::Event;
use canmaster::lss::LssAddress;
use canmaster::network::Network;

/// Node 2 is named by its serial number.
fn serials() -> &'static Network {
    network(3, |node| node.identity.serial = Some(0x0000_4711))
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
    assert!(rig.events.contains(&Event::Stranger(stranger)));
    assert!(rig.fakes[1].lss.is_some());
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
    let mut rig = Rig::new(network(3, |_| {}));
    unconfigured(&mut rig.fakes[1], 0x4711);
    rig.run_for(ms(2101));
    rig.assert_nothing_was_started();
    assert!(!rig.events.contains(&Event::Scanning));
}

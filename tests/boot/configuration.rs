//! 1020h, 1011h and what is written.

use crate::networks::{assign, network};
use crate::rig::{Rig, ms};
use canmaster::boot::{Assignment, Event};
use canmaster::network::Network;

const DATE: u32 = 15_000;
const TIME: u32 = 43_200_000;

fn dated() -> &'static Network {
    network(2, |_, kind| kind.configured = [DATE, TIME])
}

#[test]
fn a_node_with_the_expected_configuration_is_not_written_to() {
    let mut rig = Rig::with(dated(), |_| {});
    rig.fakes[1].set((0x1020, 1), DATE);
    rig.fakes[1].set((0x1020, 2), TIME);
    rig.run_for(ms(700));
    rig.fakes[1].period = Some(ms(100));
    rig.fakes[1].beat = Some(rig.now + ms(150));
    rig.run_for(ms(2000));
    assert!(rig.boot.is_ready());
    assert_eq!(rig.fakes[1].written, []);
    let requests = rig.requests(2);
    assert_eq!(
        requests[4..],
        [
            [0x40, 0x20, 0x10, 0x01, 0, 0, 0, 0],
            [0x40, 0x20, 0x10, 0x02, 0, 0, 0, 0]
        ]
    );
    assert!(rig.events.contains(&Event::Configured(crate::rig::id(2))));
}

#[test]
fn another_configuration_is_written_with_its_date_and_time_last() {
    for (date, time, refuses) in [
        (DATE - 1, TIME, None),
        (DATE, TIME + 1, None),
        (DATE, TIME, Some(((0x1020, 1), 0x0602_0000))),
    ] {
        let mut rig = Rig::with(dated(), |_| {});
        rig.fakes[1].set((0x1020, 1), date);
        rig.fakes[1].set((0x1020, 2), time);
        rig.fakes[1].refuses = refuses;
        rig.run_for(ms(2000));
        let written = &rig.fakes[1].written;
        if refuses.is_some() {
            // A node without 1020h refuses to be dated as well.
            assert_eq!(rig.letter(2), Some('J'));
            continue;
        }
        assert!(rig.boot.is_ready());
        assert_eq!(
            written[written.len() - 2..],
            [((0x1020, 1), DATE), ((0x1020, 2), TIME)]
        );
    }
}

#[test]
fn parameters_are_restored_by_a_reset_before_they_are_written() {
    let mut rig = Rig::with(network(2, |_, _| {}), |settings| {
        assign(2, Assignment::RESTORE)(settings);
        settings.nodes[1].restore = 1;
    });
    rig.run_for(ms(2500));
    assert!(rig.boot.is_ready());
    let to_node_2: Vec<_> = rig
        .nmt()
        .into_iter()
        .filter(|[_, node]| *node == 2)
        .collect();
    assert_eq!(to_node_2, [[0x80, 2], [0x81, 2], [0x80, 2]]);
    let requests = rig.requests(2);
    assert_eq!(
        requests[4],
        [0x23, 0x11, 0x10, 0x01, b'l', b'o', b'a', b'd']
    );
    assert_eq!(rig.fakes[1].written[0].0, (0x1011, 1));
    assert!(rig.fakes[1].written.len() > 8);
}

#[test]
fn a_node_that_cannot_be_restored_is_given_up() {
    let mut rig = Rig::with(network(2, |_, _| {}), |settings| {
        assign(2, Assignment::RESTORE)(settings);
        settings.nodes[1].restore = 4;
    });
    rig.fakes[1].refuses = Some(((0x1011, 4), 0x0800_0020));
    rig.run_for(ms(2500));
    rig.assert_nothing_was_started();
    assert_eq!(rig.letter(2), Some('J'));
}

#[test]
fn each_node_has_its_own_sdo_timeout() {
    let slow = network(2, |_, kind| kind.sdo_timeout = ms(300));
    let mut rig = Rig::new(slow);
    for fake in &mut rig.fakes {
        fake.mute = Some((0x1018, 2));
    }
    rig.run_for(ms(4000));
    for (node, timeout) in [(1, ms(100)), (2, ms(300))] {
        let times = |command| {
            let to_node = rig.sent.iter().filter(move |(_, frame)| {
                frame.id().get() == 0x600 + node && frame.data()[..4] == [command, 0x18, 0x10, 0x02]
            });
            to_node.map(|(at, _)| *at).next()
        };
        let (asked, aborted) = (times(0x40).unwrap(), times(0x80).unwrap());
        assert_eq!(aborted, asked + timeout, "node {node}");
    }
}

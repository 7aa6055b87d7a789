//! The start of the sample network.

use crate::rig::{NODES, OPERATIONAL, Rig, ms};
use canmaster::boot::{Cause, Event, Status};
use canmaster::network::plan;
use canmaster::network::sample::SIX_EPOS4;
use canmaster::sdo::AbortCode;
use canmaster::{CobId, Frame, Instant};

fn rig() -> Rig {
    Rig::new(&SIX_EPOS4)
}

/// The whole start, as far as it goes.
fn start(rig: &mut Rig) {
    rig.run_for(ms(3000));
}

#[test]
fn nothing_is_sent_in_the_silent_phase() {
    let mut rig = rig();
    rig.run();
    rig.now = Instant::from_micros(599_999);
    for node in 1..=NODES as u8 {
        rig.error_control(node, 0);
    }
    rig.run();
    assert_eq!(rig.sent, []);
    assert_eq!(
        rig.boot.next_deadline(),
        Some(Instant::from_micros(600_000))
    );
    assert!(rig.boot.is_silent());
    rig.now = Instant::from_micros(600_000);
    rig.run();
    let reset = Frame::data_frame(CobId::NMT, &[0x82, 0x00]).unwrap();
    assert_eq!(rig.sent, [(rig.now, reset)]);
    assert!(!rig.boot.is_silent());
}

#[test]
fn a_node_is_identified_before_anything_is_written() {
    let mut rig = rig();
    start(&mut rig);
    let to_node_4 = rig.requests(4);
    let reads = [
        [0x40, 0x00, 0x10, 0x00, 0, 0, 0, 0],
        [0x40, 0x18, 0x10, 0x01, 0, 0, 0, 0],
        [0x40, 0x18, 0x10, 0x02, 0, 0, 0, 0],
        [0x40, 0x18, 0x10, 0x03, 0, 0, 0, 0],
        [0x40, 0x18, 0x10, 0x04, 0, 0, 0, 0],
    ];
    assert_eq!(to_node_4[..reads.len()], reads);
    let writes = plan(&SIX_EPOS4, &SIX_EPOS4.nodes[3]).count();
    assert_eq!(to_node_4.len(), reads.len() + writes);
    let is_write = |data: &[u8; 8]| data[0] & 0xE0 == 0x20;
    assert!(to_node_4[reads.len()..].iter().all(is_write));
}

#[test]
fn all_nodes_are_configured_in_parallel() {
    let mut rig = rig();
    start(&mut rig);
    // No node waits for another: all answers are instant here, so all requests
    // go out at the moment of the boot-up frames.
    let requests = rig
        .sent
        .iter()
        .filter(|(_, frame)| frame.id().get() > 0x600);
    assert!(requests.clone().count() > 100);
    for (at, _) in requests {
        assert_eq!(*at, Instant::from_micros(800_000));
    }
}

#[test]
fn all_nodes_are_started_by_one_broadcast_once_all_are_ready() {
    let mut rig = rig();
    start(&mut rig);
    assert!(rig.boot.is_ready());
    let mut expected = vec![[0x82, 0]];
    expected.extend((1..=6).map(|node| [0x80, node]));
    expected.push([0x01, 0]);
    assert_eq!(rig.nmt(), expected);
    assert_eq!(rig.events.last(), Some(&Event::NetworkReady));
    assert!(rig.sync);
    assert!(rig.fakes.iter().all(|fake| fake.state == OPERATIONAL));
    assert_eq!((1..=6).find_map(|node| rig.letter(node)), None);
}

#[test]
fn a_missing_node_is_named_and_nothing_is_started() {
    let mut rig = rig();
    rig.fakes[2].missing = true;
    start(&mut rig);
    rig.assert_nothing_was_started();
    assert_eq!(rig.failure(3), (Status::B, Cause::NoBootUp));
    // The silent phase and the boot time, one question whether anybody is without
    // node-ID, and nothing more.
    let (last, question) = rig.sent.last().unwrap();
    assert_eq!(*last, Instant::from_micros(2_100_000));
    assert_eq!(question.padded(), [0x51, 0, 0, 0, 0, 0x80, 0, 0]);
    assert_eq!(rig.boot.next_deadline(), None);
}

#[test]
fn another_device_is_refused_before_anything_is_written() {
    let mut rig = rig();
    rig.fakes[4].set((0x1018, 2), 0x6350_0000);
    start(&mut rig);
    rig.assert_nothing_was_started();
    let (status, cause) = rig.failure(5);
    assert_eq!(status, Status::M);
    assert_eq!(
        cause.to_string(),
        "1018h:02 is 63500000h, expected 61500000h; connect the drive that the network names, \
         or name this one in the network"
    );
    assert_eq!(rig.fakes[4].written, []);
}

#[test]
fn a_refused_write_is_named_with_its_abort_code() {
    let mut rig = rig();
    rig.fakes[0].refuses = Some(((0x1601, 2), 0x0604_0041));
    start(&mut rig);
    rig.assert_nothing_was_started();
    let (status, cause) = rig.failure(1);
    assert_eq!(status, Status::J);
    let Cause::Refused { at, code } = cause else {
        panic!("{cause:?}");
    };
    assert_eq!((at.index.0, at.sub.0), (0x1601, 2));
    assert_eq!(code, AbortCode(0x0604_0041));
}

#[test]
fn a_mute_entry_is_asked_for_again_and_then_given_up() {
    let mut rig = rig();
    rig.fakes[5].mute = Some((0x1018, 2));
    start(&mut rig);
    rig.assert_nothing_was_started();
    let (status, cause) = rig.failure(6);
    assert_eq!(status, Status::M);
    assert!(matches!(cause, Cause::NoAnswer { at } if at.index.0 == 0x1018 && at.sub.0 == 2));
    let asked = |data: &&[u8; 8]| data[..4] == [0x40, 0x18, 0x10, 0x02];
    assert_eq!(rig.requests(6).iter().filter(asked).count(), 3);
}

#[test]
fn a_mandatory_node_that_does_not_answer_is_tried_until_the_boot_time_is_over() {
    let mut rig = rig();
    rig.fakes[5].mute = Some((0x1000, 0));
    start(&mut rig);
    rig.assert_nothing_was_started();
    assert!(matches!(
        rig.failure(6),
        (Status::B, Cause::NoAnswer { .. })
    ));
    // Reset at 0.6 s, boot-up frame at 0.8 s, three times 0.1 s and as long a
    // quarantine, then 1 s of pause, of which the boot time ends at 2.1 s.
    let asked: Vec<u64> = rig
        .sent
        .iter()
        .filter(|(_, frame)| frame.id().get() == 0x606 && frame.padded()[0] == 0x40)
        .map(|(at, _)| at.as_micros() / 1000)
        .collect();
    assert_eq!(asked, [800, 1000, 1200]);
}

#[test]
fn a_node_without_heartbeat_is_not_started() {
    let mut rig = rig();
    rig.fakes[1].no_heartbeat = true;
    start(&mut rig);
    rig.assert_nothing_was_started();
    assert_eq!(rig.failure(2), (Status::K, Cause::NoHeartbeat));
}

#[test]
fn a_node_that_does_not_become_operational_fails_the_network() {
    let mut rig = rig();
    rig.fakes[3].never_operational = true;
    start(&mut rig);
    assert!(rig.boot.is_failed());
    assert_eq!(rig.failure(4), (Status::K, Cause::NotOperational));
}

#[test]
fn a_node_that_keeps_restarting_is_given_up() {
    let mut rig = rig();
    rig.fakes[0].restarts_at = Some((0x1600, 1));
    start(&mut rig);
    rig.assert_nothing_was_started();
    assert_eq!(rig.failure(1), (Status::B, Cause::Restarts));
}

#[test]
fn two_missing_nodes_are_both_named() {
    let mut rig = rig();
    rig.fakes[0].missing = true;
    rig.fakes[5].missing = true;
    start(&mut rig);
    rig.assert_nothing_was_started();
    assert_eq!(rig.failure(1), (Status::B, Cause::NoBootUp));
    assert_eq!(rig.failure(6), (Status::B, Cause::NoBootUp));
}

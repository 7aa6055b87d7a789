//! Drives without node-ID: the image finds them by their serial numbers, gives
//! them the node-IDs that the network names, and goes on as ever.

mod common;

use canmaster::NodeId;
use canmaster_sim::judge::Outcome;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Ailment, Scenario, World, enabled, sample};

use common::image;

/// Silence, the boot time that passes in vain, six drives found, and the start.
const READY_BY: Time = Time::from_ms(7500);
/// A stranger is asked for each bit of its serial number.
const STRANGER: Time = Time::from_ms(2500);

#[track_caller]
fn assert_said(world: &World<'_>, words: &str) {
    let said = |(_, line): &(Time, canmaster_sim::log::LogLine)| line.message.contains(words);
    assert!(world.log().iter().any(said), "not said: {words}");
}

fn all_enabled(world: &World<'_>) -> bool {
    world.statuses().flatten().all(|status| enabled(&status))
}

#[test]
fn six_drives_from_the_factory_get_their_node_ids_and_move() {
    let end = READY_BY + sample().round_trip().unwrap() + Time::from_ms(500);
    let scenario = Scenario::new(11, end).from_factory();
    let mut world = World::new(image(), scenario).unwrap();
    assert!(world.run_to(READY_BY, all_enabled));
    for (node, status) in sample().network().nodes.iter().zip(world.statuses()) {
        // Each drive's serial number goes with its place in the machine.
        assert_eq!(status.unwrap().node_id, Some(node.id));
        let words = format!("node {}: found by its serial number", node.id.get());
        assert_said(&world, &words);
    }
    world.run_until(end);
    let record = world.finish();
    assert_eq!(
        record.verdict.outcome,
        Outcome::Ok,
        "{}",
        record.verdict.reason
    );
    let lss = record.lss.unwrap();
    assert_eq!(lss.node_ids, sample().network().nodes.len());
    // Global; anybody and the four numbers of each, its node-ID, store, global;
    // anybody else?
    assert_eq!(lss.requests, 1 + 6 * (5 + 3) + 1);
    assert!(lss.to < lss.from + Time::from_ms(2500));
}

#[test]
fn a_stranger_is_named_and_left_alone_and_who_cannot_store_is_told_of() {
    const FORGETFUL: NodeId = NodeId::constant::<5>();
    let limit = READY_BY + STRANGER;
    let scenario = Scenario::new(12, limit)
        .from_factory()
        .with_stranger()
        .ailing(FORGETFUL, Ailment::Forgetful)
        .unattended();
    let mut world = World::new(image(), scenario).unwrap();
    // Nobody waits for the stranger.
    assert!(world.run_to(READY_BY, all_enabled));
    world.run_until(limit);
    assert!(all_enabled(&world));
    assert_said(
        &world,
        "stays without node-ID, since the network does not name it or it refused: vendor 000000FBh, product 61500000h, \
         revision 01700000h, serial 2600007Eh",
    );
    assert_eq!(world.stranger().unwrap().node_id, None);
    assert_said(
        &world,
        "node 5: found by its serial number, node-ID given, but",
    );
    assert_eq!(
        world.finish().lss.unwrap().node_ids,
        sample().network().nodes.len()
    );
}

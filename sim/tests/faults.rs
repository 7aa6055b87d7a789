//! Bad input: the log and the reason name the node, the object, the abort code
//! in words, and what to do; nothing moves, or everything stops.

mod common;

use canmaster::NodeId;
use canmaster_sim::judge::Outcome;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Ailment, Record, Scenario, World};

use common::image;

const NODE: NodeId = NodeId::constant::<4>();

fn run(scenario: Scenario) -> Record {
    World::new(image(), scenario).unwrap().run(&mut ())
}

fn failing(ailment: Ailment) -> Record {
    run(Scenario::new(1, Time::from_s(20)).ailing(NODE, ailment))
}

#[track_caller]
fn assert_failed(record: &Record, words: &[&str]) {
    assert_eq!(
        record.verdict.outcome,
        Outcome::Failed,
        "{}",
        record.verdict.reason
    );
    let reason = record.verdict.reason.to_lowercase();
    for word in words {
        assert!(reason.contains(word), "`{word}` is missing in: {reason}");
    }
}

#[track_caller]
fn assert_nothing_moved(record: &Record) {
    for axis in &record.axes {
        assert!(
            axis.motion.movements().is_empty(),
            "node {} moved",
            axis.node.get()
        );
        assert_eq!(axis.motion.unreleased(), None);
    }
}

#[test]
fn a_missing_drive_ends_the_run_within_three_seconds() {
    let record = run(Scenario::new(1, Time::from_s(20)).without(NODE));
    assert_failed(&record, &["node 4"]);
    assert_nothing_moved(&record);
    assert!(record.simulated <= Time::from_s(3), "{}", record.simulated);
    // Had it no node-ID, it would have been found: all to waiting, anybody?
    let lss = record.lss.unwrap();
    assert_eq!((lss.requests, lss.answers), (2, 0));
}

#[test]
fn a_drive_of_another_product_is_refused_before_anything_is_written() {
    let record = failing(Ailment::WrongIdentity);
    assert_failed(&record, &["node 4", "1018", "60500000", "61500000"]);
    assert_nothing_moved(&record);
}

#[test]
fn a_refused_write_names_object_and_abort_code() {
    let record = failing(Ailment::RefusesWrite {
        index: 0x60C5,
        sub: 0,
    });
    assert_failed(
        &record,
        &["node 4", "60c5", "value range of parameter exceeded"],
    );
    assert_nothing_moved(&record);
}

#[test]
fn a_drive_that_falls_silent_in_motion_stops_all() {
    let record = failing(Ailment::SilentInMotion);
    assert_failed(&record, &["node 4"]);
    let fell_silent = record.releases[0].at;
    for axis in &record.axes {
        let stopped = axis.motion.stopped().expect("it was in motion");
        assert!(
            stopped < fell_silent + Time::from_ms(3000),
            "node {}",
            axis.node.get()
        );
        assert_eq!(axis.motion.unreleased(), None);
        assert_eq!(
            axis.motion.movements().len(),
            1,
            "node {} moved again",
            axis.node.get()
        );
    }
}

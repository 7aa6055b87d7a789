//! Programs as `cargo xtask run --program` has them: downloaded, released with the
//! button, and judged.

use std::path::Path;

use canmaster::id::Address;
use canmaster::motion::{GroupState, panel};
use canmaster::sdo::Protocol;
use canmaster_network::program::Program;
use canmaster_sim::judge::Outcome;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Client, Image, Machine, Record, Scenario, World};

use crate::common::image;
use crate::leader::{MASTER, described, until, written};

/// All drives are enabled by then.
const READY_BY: Time = Time::from_ms(4000);
/// What is seen beside the time that the program says.
const MARGIN: Time = Time::from_ms(1000);
/// What is seen after its end.
const AFTER: Time = Time::from_ms(500);

fn folder() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/programs"))
}

fn of_folder(name: &str) -> Program {
    written(&text_of(name))
}

fn text_of(name: &str) -> String {
    std::fs::read_to_string(folder().join(name).with_extension("toml")).unwrap()
}

/// What the judge says of a program that does something else than it should.
#[track_caller]
fn is_told(name: &str, seed: u64, should: &str, does: &str) -> String {
    let text = text_of(name);
    assert_eq!(text.matches(should).count(), 1, "{should}");
    let done = written(&text.replace(should, does));
    let verdict = judged(seed, &written(&text), &done).verdict;
    assert_ne!(verdict.outcome, Outcome::Ok, "{does}");
    verdict.reason
}

/// The machine of the project with this program for what it is to do.
fn image_for(program: &Program) -> Image {
    let mut described = described();
    described.program = Some(program.clone());
    let image = Image::new(image().elf().to_vec()).unwrap();
    image.built_for(Machine::new(&described).unwrap())
}

/// Runs `done` while the judge expects what `told` does.
fn judged(seed: u64, told: &Program, done: &Program) -> Record {
    let image = image_for(told);
    let takes = image.machine().round_trip().unwrap();
    let end = READY_BY + takes + MARGIN;
    let mut world = World::new(&image, Scenario::new(seed, end).unattended()).unwrap();
    assert!(world.run_to(READY_BY, World::ready));
    let mut client = Client::new(world, MASTER);
    until(&mut client, GroupState::Standby);
    let at = Address::new(panel::PROGRAM, 0);
    client.write(at, &done.bytes(), Protocol::Normal).unwrap();
    let mut world = client.world;
    world.press();
    world.run_to(end, |world| world.round_trips().0 > 0 || says_done(world));
    world.run_until(end.min(world.now() + AFTER));
    world.finish()
}

/// The firmware says that the program is done.
fn says_done(world: &World<'_>) -> bool {
    let last = world.log().last();
    last.is_some_and(|(_, line)| line.message == "program done")
}

#[track_caller]
fn is_right(name: &str, seed: u64) {
    let program = of_folder(name);
    let record = judged(seed, &program, &program);
    let (outcome, reason) = (record.verdict.outcome, &record.verdict.reason);
    let arrivals = &record.arrivals;
    assert_eq!(outcome, Outcome::Ok, "{reason}: {arrivals:?}");
}

#[test]
fn a_torque_is_motion_and_no_move() {
    is_right("torque", 101);
}

#[test]
fn from_where_a_torque_has_left_it_an_axis_arrives() {
    is_right("torque_and_moves", 102);
}

#[test]
fn what_follows_a_torque_at_once_is_a_move_of_its_own() {
    is_right("torque_and_modes", 107);
}

#[test]
fn drives_that_go_from_set_point_to_set_point_arrive() {
    is_right("set_points", 103);
}

#[test]
fn drives_on_their_way_during_other_steps_arrive() {
    is_right("set_points_meanwhile", 104);
}

#[test]
fn a_loop_that_comes_to_the_same_places_is_followed_to_its_end() {
    for seed in 111..114 {
        is_right("there_and_back", seed);
    }
}

#[test]
fn a_rest_between_two_modes_is_short() {
    is_right("modes_at_once", 108);
    is_right("modes_at_once", 109);
}

#[test]
fn an_axis_that_does_not_arrive_before_another_mode_is_told() {
    let should = "[[step.move]]\nto = 0\n";
    let does = should.replace('0', "[0, 0, 0, 50, 0, 0]");
    let reason = is_told("modes_at_once", 110, should, &does);
    assert!(reason.contains("node 4: stopped"), "{reason}");
}

#[test]
fn an_axis_that_does_not_arrive_after_a_torque_is_told() {
    let told = |should: &str, does: &str| is_told("torque_and_moves", 105, should, does);
    let by = told("by = [7000, 7000]", "by = [7100, 7000]");
    assert!(by.contains("node 1: stopped"), "{by}");
    let end = "[[step.move]]\nto = 0\n# The end.";
    let beside = told(end, &end.replace("to = 0", "to = [0, 70, 0, 0, 0, 0]"));
    assert!(beside.contains("node 2: stopped"), "{beside}");
    let other = told("to = [-3000, -3000]", "to = [-3000, -3100]");
    assert!(other.contains("node 5: stopped"), "{other}");
}

#[test]
fn a_drive_that_does_not_get_to_its_set_point_is_told() {
    let last = "to = [18_000, 20_000, 12_000, 12_000, 8000, 11_000]";
    let reason = is_told("set_points", 106, last, &last.replace("8000", "8020"));
    assert!(reason.contains("node 5: stopped 20"), "{reason}");
}

//! Something goes wrong while all axes move: every axis comes to rest, judged
//! in the plant, and nothing moves afterwards, not even if the button is
//! pressed; the reason names who and what.

mod common;
#[path = "common/ten_ms.rs"]
mod ten_ms;

use canmaster::emcy::{Emcy, EmcyCode, ErrorRegister};
use canmaster::nmt::{Command, NodeControl};
use canmaster::{Frame, NodeId};
use canmaster_sim::board::irqs;
use canmaster_sim::bus::BusFault;
use canmaster_sim::drive::{DriveFault, cia402};
use canmaster_sim::judge::bus::syncs;
use canmaster_sim::judge::{Outcome, STANDSTILL_RPM};
use canmaster_sim::time::Time;
use canmaster_sim::world::trials::{moving, spin_in_motion};
use canmaster_sim::world::{Image, Record, Stimulus, World, enabled, sample};

use common::image;

const NODE: NodeId = NodeId::constant::<4>();
const OVERCURRENT: u16 = 0x2310;
const NO_ERROR: u16 = 0;
/// Every axis stands by then.
const STOPPED_BY: Time = Time::from_ms(2000);
/// How long nothing must move after that.
const WATCHED: Time = Time::from_ms(700);

/// Does `harm` while all axes move and watches what comes of it. Every axis but
/// that of `spared`, which may coast, is at rest in time; all are in the end.
fn struck(seed: u64, spared: Option<NodeId>, harm: impl FnOnce(&mut World<'_>)) -> Record {
    struck_of(image(), seed, spared, harm)
}

/// The same on the machine that `image` is for.
fn struck_of(
    image: &Image,
    seed: u64,
    spared: Option<NodeId>,
    harm: impl FnOnce(&mut World<'_>),
) -> Record {
    let mut world = moving(image, seed).unwrap().with_guest();
    let struck = world.now();
    harm(&mut world);
    world.run_to(struck + STOPPED_BY, World::at_rest);
    world.press();
    world.run_until(world.now() + WATCHED);
    let record = world.finish();
    for axis in &record.axes {
        let node = axis.node.get();
        let stopped = axis.motion.stopped().expect("it was in motion");
        let in_time = stopped < struck + STOPPED_BY;
        assert!(
            in_time || spared == Some(axis.node),
            "node {node}: {stopped}"
        );
        assert!(axis.motion.at_rest(), "node {node} turns");
        let last = axis.motion.last().unwrap();
        assert!(last.velocity.abs() <= STANDSTILL_RPM, "node {node}");
        let movements = axis.motion.movements().len();
        assert_eq!(movements, 1, "node {node} moved again");
        assert_eq!(axis.motion.unreleased(), None, "node {node}");
    }
    assert_eq!(record.releases.len(), 1, "it was ready again");
    record
}

#[track_caller]
fn assert_failed(record: &Record, words: &[&str]) {
    let verdict = &record.verdict;
    assert_eq!(verdict.outcome, Outcome::Failed, "{}", verdict.reason);
    let reason = verdict.reason.to_lowercase();
    for word in words {
        assert!(reason.contains(word), "`{word}` is missing in: {reason}");
    }
}

#[track_caller]
fn assert_logged(record: &Record, words: &str) {
    let lines = record.log.iter().map(|(_, line)| line.to_string());
    let lines: Vec<String> = lines.collect();
    let found = lines.iter().any(|line| line.contains(words));
    assert!(found, "`{words}` is missing in:\n{}", lines.join("\n"));
}

fn state(record: &Record, node: NodeId) -> cia402::State {
    let axis = record.axes.iter().find(|axis| axis.node == node);
    axis.and_then(|axis| axis.status.as_ref()).unwrap().state
}

fn last_emcy(record: &Record, node: NodeId) -> Option<u16> {
    let axis = record.axes.iter().find(|axis| axis.node == node);
    axis.and_then(|axis| axis.status.as_ref())?.last_emcy
}

/// A frame of somebody whom the network does not know.
fn say(world: &mut World<'_>, frame: Frame) {
    assert!(world.say(frame.into()));
}

#[test]
fn an_error_of_one_drive_stops_all() {
    let record = struck(31, Some(NODE), |world| {
        let (at, code) = (world.now(), OVERCURRENT);
        let until = None;
        let fault = DriveFault::Error { at, code, until };
        world.apply(Stimulus::Drive { node: NODE, fault });
    });
    assert_failed(&record, &["node 4"]);
    assert_logged(&record, "node 4: emergency 2310h (overcurrent)");
    assert_eq!(state(&record, NODE), cia402::State::Fault);
}

#[test]
fn a_warning_and_its_end_stop_nobody() {
    let mut world = moving(image(), 32).unwrap();
    let at = world.now();
    let until = Some(at + Time::from_ms(100));
    let code = EmcyCode::EPOS4_OVERLOAD.0;
    let fault = DriveFault::Error { at, code, until };
    world.apply(Stimulus::Drive { node: NODE, fault });
    let limit = at + sample().round_trip().unwrap() + Time::from_ms(1000);
    let done = world.run_to(limit, |world| world.round_trips() == (1, false));
    assert!(done, "the round trip does not end");
    let record = world.finish();
    assert_eq!(
        record.verdict.outcome,
        Outcome::Ok,
        "{}",
        record.verdict.reason
    );
    assert_logged(&record, "node 4: emergency FF01h (system overloaded)");
    assert_logged(&record, "node 4: emergency 0000h");
    assert_eq!(last_emcy(&record, NODE), Some(NO_ERROR));
}

#[test]
fn an_emergency_of_unknown_meaning_is_a_fault() {
    /// Of no range that a standard or the drive's manual names.
    const UNKNOWN: EmcyCode = EmcyCode(0x1234);
    // The drive itself knows nothing of it: the master has to stop it too.
    let record = struck(33, None, |world| {
        let emcy = Emcy::new(UNKNOWN, ErrorRegister::GENERIC);
        say(world, emcy.frame(NODE));
    });
    assert_failed(&record, &["node 4", "1234h", "unknown"]);
    for axis in &record.axes {
        assert_eq!(last_emcy(&record, axis.node), None);
    }
}

#[test]
fn a_lost_heartbeat_stops_all_although_process_data_go_on() {
    let record = struck_of(ten_ms::image(), 34, None, |world| {
        let at = world.now();
        let fault = DriveFault::HeartbeatLost { at };
        world.apply(Stimulus::Drive { node: NODE, fault });
    });
    assert_failed(&record, &["node 4", "heartbeat lost"]);
    assert_eq!(last_emcy(&record, NODE), None);
}

#[test]
fn after_a_power_cycle_of_a_drive_nothing_moves_by_itself() {
    let record = struck(35, Some(NODE), |world| {
        let off = world.now();
        let on = off + Time::from_ms(20);
        let fault = DriveFault::PowerCycle { off, on };
        world.apply(Stimulus::Drive { node: NODE, fault });
    });
    assert_failed(&record, &["node 4"]);
    assert_logged(&record, "node 4: lost, to be booted again");
}

#[test]
fn another_master_that_stops_a_node_stops_all() {
    // Its heartbeat says so; without one its TPDOs are missing.
    for (image, words) in [
        (ten_ms::image(), "node 2: went to NMT"),
        (image(), "node 2 (axis 2): no TPDO"),
    ] {
        let record = struck_of(image, 36, None, |world| {
            let node = NodeId::constant::<2>();
            say(world, NodeControl::node(Command::Stop, node).frame());
        });
        assert_failed(&record, &["node 2"]);
        assert_logged(&record, words);
    }
}

#[test]
fn a_cut_cable_stops_all_for_good() {
    // The board alone, one drive alone.
    let cuts = [
        |world: &World<'_>| Some(world.board_port()),
        |world: &World<'_>| world.drive_port(NODE),
    ];
    for (seed, isolated) in (38..).zip(cuts) {
        let record = struck(seed, None, |world| {
            let isolated = isolated(world);
            let from = world.now();
            let until = from + Time::from_ms(400);
            world.apply(Stimulus::Bus(BusFault::Cut {
                isolated,
                from,
                until,
            }));
        });
        assert_failed(&record, &[]);
    }
}

#[test]
fn a_short_circuit_of_the_bus_stops_all_for_good() {
    let record = struck(41, None, |world| {
        let from = world.now();
        let until = from + Time::from_ms(50);
        world.apply(Stimulus::Bus(BusFault::StuckDominant { from, until }));
    });
    assert_failed(&record, &[]);
}

#[test]
fn cycles_that_do_not_finish_in_time_stop_all() {
    const STUCK: Time = Time::from_ms(20);
    let record = struck(45, None, |world| {
        let irq = irqs::TIM3;
        world.apply(Stimulus::Hang { irq });
        world.run_until(world.now() + STUCK);
        world.apply(Stimulus::Resume { irq });
    });
    assert_failed(&record, &["cycles in a row did not finish in time"]);
    // And they are counted.
    assert_logged(&record, "so far: 0 SYNC not sent");
}

/// In three of each four cycles the axes are not stepped before the next SYNC, for two
/// seconds.
fn overloaded(world: &mut World<'_>) {
    const CYCLES: u64 = 1000;
    const OF: u64 = 4;
    let irq = irqs::TIM3;
    let cycle = Time::from(sample().network().cycle);
    let mut next = syncs(world.wire()).last().copied().unwrap();
    while next <= world.now() {
        next += cycle;
    }
    for n in 0..CYCLES {
        world.apply(Stimulus::Hang { irq });
        if n % OF == OF - 1 {
            world.apply(Stimulus::Resume { irq });
        }
        world.run_until(next - Time::from_us(10));
        next += cycle;
    }
    world.apply(Stimulus::Resume { irq });
}

fn assert_no_panic(words: &[String]) {
    let panicked = |line: &&String| line.to_lowercase().contains("panicked at");
    assert_eq!(words.iter().find(panicked), None);
}

/// Every fourth cycle gets out: the group stops by it, and the watchdog does not bite.
#[test]
fn an_overload_that_does_not_end_stops_all() {
    let record = struck(46, None, overloaded);
    assert_failed(&record, &["cycles in a row did not finish in time"]);
    assert_eq!(record.board.resets.len(), 1, "the board was switched on");
    let words: Vec<String> = record
        .log
        .iter()
        .map(|(_, line)| line.to_string())
        .collect();
    assert_no_panic(&words);
}

/// The axes are stepped in every cycle, but so late that no RPDO gets out, and so no stop:
/// the watchdog resets the board, and the drives stop without their master.
#[test]
fn an_overload_of_every_cycle_is_found_by_the_watchdog() {
    const CYCLES: u64 = 100;
    let irq = irqs::TIM3;
    let cycle = Time::from(sample().network().cycle);
    let mut world = moving(image(), 47).unwrap();
    let runs = |world: &World<'_>| world.board().stats().irq(irq).map_or(0, |irq| irq.count);
    let before = runs(&world);
    let mut next = syncs(world.wire()).last().copied().unwrap();
    while next <= world.now() {
        next += cycle;
    }
    for _ in 0..CYCLES {
        world.apply(Stimulus::Hang { irq });
        world.run_until(next - Time::from_us(150));
        world.apply(Stimulus::Resume { irq });
        world.run_until(next - Time::from_us(10));
        if world.board().stats().resets.len() > 1 {
            break;
        }
        next += cycle;
    }
    assert_eq!(world.board().stats().resets.len(), 2);
    assert!(runs(&world) > before + 20, "{}", runs(&world) - before);
    assert!(world.run_to(world.now() + Time::from_ms(1000), World::at_rest));
    let words: Vec<String> = world
        .log()
        .iter()
        .map(|(_, line)| line.to_string())
        .collect();
    assert_no_panic(&words);
}

#[test]
fn a_task_that_never_ends_is_found_by_the_watchdog() {
    // Nothing interrupts that of the SYNC.
    spin_in_motion(image(), 42, irqs::TIM2).unwrap_or_else(|error| panic!("{error}"));
}

/// A panic ends in a hard fault: the drives miss their master and stop by themselves, and
/// after its reset nothing moves.
#[test]
fn a_panic_in_motion_stops_all() {
    let mut world = moving(image(), 48).unwrap();
    assert!(!world.at_rest());
    let irq = irqs::TIM3;
    world.apply(Stimulus::Crash { irq });
    // Watchdog, consumer time of the drives, their ramp.
    assert!(world.run_to(world.now() + Time::from_ms(700), World::at_rest));
    assert_eq!(world.board().stats().resets.len(), 2);
    let later = world.now() + Time::from_ms(4000);
    assert!(!world.run_to(later, |world| !world.at_rest()));
    assert!(world.statuses().flatten().all(|status| enabled(&status)));
}

//! Nodes that are lost and come back, bus-off, and the start by request
//! (CiA 302-2), with the firmware image: to standby, never to motion.

mod common;
#[path = "common/ten_ms.rs"]
mod ten_ms;

use canmaster::id::Address;
use canmaster::sdo::Protocol;
use canmaster::{NodeId, nmt};
use canmaster_sim::bus::{BusFault, RecordKind};
use canmaster_sim::drive::DriveFault;
use canmaster_sim::frame::{WireFrame, WireId};
use canmaster_sim::judge::STANDSTILL_RPM;
use canmaster_sim::time::Time;
use canmaster_sim::world::trials::moving;
use canmaster_sim::world::{Client, Image, Scenario, Stimulus, World, enabled, operational};

use common::image;

const NODE: NodeId = NodeId::constant::<4>();
const AXIS: usize = 3;
const MASTER: NodeId = NodeId::constant::<127>();
const NMT: u16 = 0x000;
const SYNC: u16 = 0x080;
const NMT_STARTUP: u16 = 0x1F80;
const SLAVE_ASSIGNMENT: u16 = 0x1F81;
const REQUEST_NMT: u16 = 0x1F82;
/// Values of 1F82h.
const START: u8 = 5;
const RESET_COMMUNICATION: u8 = 7;
/// 1F81h: listed and may be started; without bit 3 it is optional.
const OPTIONAL: u32 = 0b101;
const MANDATORY: u32 = 0b1101;
const KEEP_ALIVE: u32 = 1 << 4;
/// 1F80h: this device is the master; start all at once.
const IS_MASTER: u32 = 1;
const START_ALL: u32 = 1 << 1;
const NOT_BY_ITSELF: u32 = 1 << 2;
const NO_START: u32 = 1 << 3;

const READY_BY: Time = Time::from_ms(5000);
/// From a lost node to standby: its boot and its configuration, or the silence
/// after bus-off with a boot of all.
const BACK_BY: Time = Time::from_ms(3500);
/// How long nothing must move in standby.
const WATCHED: Time = Time::from_ms(300);

fn standby(seed: u64) -> World<'static> {
    let scenario = Scenario::new(seed, Time::MAX).unattended();
    let mut world = World::new(image(), scenario).unwrap();
    assert!(world.run_to(READY_BY, World::ready), "{}", last(&world));
    world
}

fn last(world: &World<'_>) -> String {
    let log = world.log().iter();
    let lines: Vec<String> = log.map(|(_, line)| line.to_string()).collect();
    lines.join("\n")
}

fn logged(world: &World<'_>, words: &str) -> bool {
    let mut log = world.log().iter();
    log.any(|(_, line)| line.to_string().contains(words))
}

#[track_caller]
fn assert_logged(world: &World<'_>, words: &str) {
    assert!(logged(world, words), "`{words}` in:\n{}", last(world));
}

#[track_caller]
fn comes_to(world: &mut World<'_>, within: Time, what: impl Fn(&World<'_>) -> bool) {
    let limit = world.now() + within;
    let came = world.run_to(limit, what);
    assert!(came, "at {}:\n{}", world.now(), last(world));
}

fn others(world: &World<'_>, test: fn(&canmaster_sim::drive::DriveStatus) -> bool) -> bool {
    let others = world.statuses().flatten();
    others
        .filter(|status| status.node != NODE)
        .all(|status| test(&status))
}

fn standing(world: &World<'_>) -> bool {
    let mut truths = world.truths().flatten();
    truths.all(|truth| truth.velocity_rpm.abs() <= STANDSTILL_RPM)
}

/// Standby again, nothing moves by itself, and the next release moves.
#[track_caller]
fn comes_back_and_waits(world: &mut World<'_>) {
    comes_to(world, Time::from_ms(500), |world| !world.ready());
    comes_to(world, BACK_BY, |world| world.ready());
    let until = world.now() + WATCHED;
    while world.now() < until {
        world.run_until(world.now() + Time::from_ms(5));
        assert!(standing(world), "moved without a release:\n{}", last(world));
    }
    world.press();
    comes_to(world, Time::from_ms(1000), |world| world.in_full_motion());
}

fn power_cycle(world: &mut World<'_>, pause_ms: u64) {
    let off = world.now();
    let on = off + Time::from_ms(pause_ms);
    let fault = DriveFault::PowerCycle { off, on };
    world.apply(Stimulus::Drive { node: NODE, fault });
}

/// The board sees a wrong bit in each of its next frames with this identifier, as
/// often as it takes for bus-off: 32 errors of 8 counts each.
fn spoil(world: &mut World<'_>, identifier: u16) {
    const ERRORS: usize = 32;
    /// Beyond the arbitration.
    const BIT: u32 = 25;
    let seen_by = Some(world.board_port());
    for _ in 0..ERRORS {
        let id = WireId::Standard(identifier);
        let bit = BIT;
        world.apply(Stimulus::Bus(BusFault::FlipBit { id, bit, seen_by }));
    }
}

/// A client of the board, which is in pre-operational and awaits the boot-up
/// frames.
fn awake(scenario: Scenario) -> Client<'static> {
    awake_of(image(), scenario)
}

fn awake_of(image: &'static Image, scenario: Scenario) -> Client<'static> {
    let world = World::new(image, scenario.unattended()).unwrap();
    let mut client = Client::new(world, MASTER);
    client.listen(Time::from_ms(700));
    client
}

/// A client of the board in standby.
fn in_standby(seed: u64) -> Client<'static> {
    let mut client = awake(Scenario::new(seed, Time::MAX));
    comes_to(&mut client.world, READY_BY, |world| world.ready());
    client
}

fn request(client: &mut Client<'_>, node: NodeId, state: u8) {
    let state = u32::from(state);
    client.put(REQUEST_NMT, node.get(), state, 1).unwrap();
}

/// The NMT commands since `from`, with their nodes.
fn commands(world: &World<'_>, from: Time) -> Vec<[u8; 2]> {
    let frames = sent(world, NMT, from).into_iter();
    frames
        .map(|(_, frame)| [frame.data[0], frame.data[1]])
        .collect()
}

/// The frames with this identifier that were on the wire since `from`.
fn sent(world: &World<'_>, identifier: u16, from: Time) -> Vec<(Time, WireFrame)> {
    let mut frames = Vec::new();
    for record in world.wire().iter().filter(|record| record.sof >= from) {
        if let RecordKind::Frame(frame) = &record.kind
            && frame.id == WireId::Standard(identifier)
        {
            frames.push((record.sof, *frame));
        }
    }
    frames
}

#[test]
fn a_drive_that_power_cycles_in_standby_is_booted_again_while_the_rest_runs_on() {
    let mut world = standby(51);
    let from = world.now();
    power_cycle(&mut world, 50);
    let until = from + Time::from_ms(400);
    while world.now() < until {
        world.run_until(world.now() + Time::from_ms(10));
        assert!(others(&world, operational), "{}", last(&world));
    }
    comes_back_and_waits(&mut world);
    assert_logged(&world, "node 4: is back");
    // Nobody else was spoken to.
    let commands = commands(&world, from);
    assert!(commands.iter().all(|[_, node]| *node == NODE.get()));
}

#[test]
fn a_drive_that_power_cycles_in_motion_stops_all_and_they_come_back_to_standby() {
    let mut world = moving(image(), 52).unwrap();
    power_cycle(&mut world, 20);
    comes_to(&mut world, Time::from_ms(1000), |world| {
        others_stand(world) && others(world, operational)
    });
    comes_back_and_waits(&mut world);
}

fn others_stand(world: &World<'_>) -> bool {
    let truths = world.truths().enumerate();
    let mut others = truths.filter(|(axis, _)| *axis != AXIS);
    others.all(|(_, truth)| truth.unwrap().velocity_rpm.abs() <= STANDSTILL_RPM)
}

#[test]
fn a_drive_whose_process_data_stay_away_is_booted_again() {
    let mut world = moving(image(), 53).unwrap();
    let at = world.now();
    let fault = DriveFault::TpdosLost { at };
    world.apply(Stimulus::Drive { node: NODE, fault });
    comes_to(&mut world, Time::from_ms(1500), |world| {
        standing(world) && logged(world, "node 4: lost, to be booted again")
    });
    assert_logged(&world, "no TPDO in 3 cycles");
    assert!(others(&world, operational));
}

#[test]
fn a_lost_optional_drive_is_left_out_until_it_is_back() {
    let mut client = in_standby(54);
    client
        .put(SLAVE_ASSIGNMENT, NODE.get(), OPTIONAL, 4)
        .unwrap();
    let mut world = client.world;
    world.press();
    comes_to(&mut world, Time::from_ms(1000), |world| {
        world.in_full_motion()
    });
    power_cycle(&mut world, 6000);
    // In motion its loss stops all; then the others are enabled without it.
    comes_to(&mut world, Time::from_ms(1000), standing);
    comes_to(&mut world, BACK_BY, |world| others(world, enabled));
    world.run_until(world.now() + WATCHED);
    assert!(standing(&world), "{}", last(&world));
    world.press();
    comes_to(&mut world, Time::from_ms(1000), |world| {
        let mut truths = world.truths().flatten().enumerate();
        truths.all(|(axis, truth)| (axis == AXIS) == (truth.velocity_rpm.abs() <= STANDSTILL_RPM))
    });
    // Back it is taken in at the next standby.
    comes_to(&mut world, Time::from_ms(9000), |world| {
        world.statuses().flatten().all(|status| enabled(&status))
    });
    assert!(standing(&world));
    assert_logged(&world, "program done");
}

#[test]
fn a_missing_optional_drive_holds_nobody_up() {
    let mut client = awake(Scenario::new(55, Time::MAX).without(NODE));
    client
        .put(SLAVE_ASSIGNMENT, NODE.get(), OPTIONAL, 4)
        .unwrap();
    let mut world = client.world;
    // Its boot time is 1.5 s.
    comes_to(&mut world, BACK_BY, |world| others(world, enabled));
    assert_logged(&world, "node 4: boot status B: no boot-up frame");
    assert_logged(&world, "network ready");
}

#[test]
fn after_bus_off_the_master_is_silent_and_boots_the_nodes_to_standby() {
    let mut world = standby(56);
    spoil(&mut world, SYNC);
    comes_to(&mut world, Time::from_ms(200), |world| {
        logged(world, "bus-off: restarting the controller")
    });
    let off = world.now();
    comes_back_and_waits(&mut world);
    assert_logged(&world, "controller restarted");
    let reset = sent(&world, NMT, off)[0].0;
    // A pause of 100 ms and a silence of 600 ms.
    assert!(reset >= off + Time::from_ms(690), "{reset}");
    for identifier in [SYNC, 0x77F, 0x201, 0x206] {
        let sent = sent(&world, identifier, off);
        let first = sent[0].0;
        assert!(first > reset, "{identifier:03X}h at {first}");
    }
    assert_eq!(world.board().diagnostics().len(), 0);
}

#[test]
fn coming_back_from_bus_off_is_told() {
    let mut client = in_standby(62);
    client.take_heard();
    spoil(&mut client.world, SYNC);
    client.listen(Time::from_ms(2500));
    // 8140h: communication and generic.
    let told = client.heard_from(0x0FF);
    let recovered = |data: &Vec<u8>| data.starts_with(&[0x40, 0x81, 0x11]);
    assert!(told.iter().any(recovered), "{told:02X?}");
    let field: Vec<u32> = (1..=8)
        .filter_map(|sub| client.number(0x1003, sub).ok())
        .collect();
    assert!(field.contains(&0x8140), "{field:08X?}");
}

#[test]
fn bus_off_in_motion_ends_in_standby() {
    let mut world = moving(image(), 57).unwrap();
    spoil(&mut world, SYNC);
    comes_to(&mut world, Time::from_ms(1000), standing);
    comes_back_and_waits(&mut world);
}

#[test]
fn while_the_bus_stays_bad_the_pauses_grow() {
    let mut world = standby(58);
    spoil(&mut world, SYNC);
    // And twice when it speaks again.
    spoil(&mut world, NMT);
    spoil(&mut world, NMT);
    comes_to(&mut world, Time::from_ms(4500), |world| {
        logged(world, "restarting the controller in 400 ms")
    });
    assert_logged(&world, "restarting the controller in 100 ms");
    assert_logged(&world, "restarting the controller in 200 ms");
    comes_back_and_waits(&mut world);
}

#[test]
fn the_start_waits_for_a_request_if_1f80h_says_so() {
    let mut client = awake(Scenario::new(59, Time::MAX));
    let bits = IS_MASTER | START_ALL | NOT_BY_ITSELF;
    client.put(NMT_STARTUP, 0, bits, 4).unwrap();
    comes_to(&mut client.world, BACK_BY, |world| {
        logged(world, "the start has to be requested")
    });
    client.listen(WATCHED);
    for status in client.world.statuses().flatten() {
        assert_eq!(status.nmt, nmt::State::PreOperational);
    }
    let from = client.world.now();
    request(&mut client, MASTER, START);
    comes_back_and_waits(&mut client.world);
    let commands = commands(&client.world, from);
    assert_eq!(commands, [[0x01, 0]]);
}

#[test]
fn nodes_that_the_master_does_not_start_are_started_by_request() {
    let mut client = awake(Scenario::new(60, Time::MAX));
    let bits = IS_MASTER | START_ALL | NO_START;
    client.put(NMT_STARTUP, 0, bits, 4).unwrap();
    comes_to(&mut client.world, BACK_BY, |world| {
        logged(world, "the nodes are to be started by request")
    });
    let from = client.world.now();
    for node in 1..=6 {
        request(&mut client, NodeId::new(node).unwrap(), START);
    }
    comes_back_and_waits(&mut client.world);
    let commands = commands(&client.world, from);
    assert_eq!(commands, [1, 2, 3, 4, 5, 6].map(|node| [0x01, node]));
}

#[test]
fn without_bit_1_of_1f80h_nodes_are_started_one_by_one() {
    let mut client = awake(Scenario::new(61, Time::MAX));
    client.put(NMT_STARTUP, 0, IS_MASTER, 4).unwrap();
    comes_to(&mut client.world, BACK_BY, |world| world.ready());
    let mut commands = commands(&client.world, Time::ZERO);
    commands.retain(|[command, _]| *command == 0x01);
    assert_eq!(commands, [1, 2, 3, 4, 5, 6].map(|node| [0x01, node]));
}

#[test]
fn a_drive_to_be_kept_alive_is_left_running_by_a_reset_of_the_board() {
    // Nobody but its heartbeat tells that it is operational already.
    let mut client = awake_of(ten_ms::image(), Scenario::new(62, Time::MAX));
    let bits = MANDATORY | KEEP_ALIVE;
    client.put(SLAVE_ASSIGNMENT, NODE.get(), bits, 4).unwrap();
    let save = Address::new(0x1010, 1);
    client.write(save, b"save", Protocol::Normal).unwrap();
    let mut world = client.world;
    comes_to(&mut world, BACK_BY, |world| world.ready());
    // It does not watch the master (1016h): an EPOS4 that misses it can only go on
    // after a reset of its communication.
    let write = [0x23, 0x16, 0x10, 1, 0, 0, 0, 0];
    let own = u16::from(NODE.get());
    assert!(world.say(WireFrame::standard(0x600 + own, &write)));
    world.run_until(world.now() + Time::from_ms(10));
    let from = world.now();
    world.apply(Stimulus::Reset(true));
    world.schedule(from + Time::from_ms(1), Stimulus::Reset(false));
    comes_to(&mut world, BACK_BY, |world| {
        logged(world, "node 4: was operational already and is left running")
    });
    comes_back_and_waits(&mut world);
    // Neither a reset of all nor one of this node, and no boot-up message of it.
    let mut commands = commands(&world, from);
    commands.retain(|[command, _]| *command == 0x82);
    assert_eq!(commands, [1, 2, 3, 5, 6].map(|node| [0x82, node]));
    let own = sent(&world, 0x700 + own, from);
    assert!(own.iter().all(|(_, frame)| frame.data[0] != 0));
}

#[test]
fn a_drive_that_is_reset_by_request_comes_back_alone() {
    let mut client = in_standby(63);
    request(&mut client, NODE, RESET_COMMUNICATION);
    let mut world = client.world;
    comes_back_and_waits(&mut world);
    assert_logged(&world, "node 4: lost, to be booted again");
    assert_logged(&world, "node 4: is back");
}

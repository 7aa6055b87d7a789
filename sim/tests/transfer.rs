//! 2F12h in the image: test data to and from a drive, and all that refuses them.

mod common;

use canmaster::NodeId;
use canmaster::id::Address;
use canmaster::sdo::AbortCode;
use canmaster_sim::drive::DriveConfig;
use canmaster_sim::drive::test_data::{INDEX, TestData};
use canmaster_sim::time::Time;
use canmaster_sim::world::{Scenario, World, enabled};

use common::image;

const MASTER: NodeId = NodeId::constant::<127>();
const DRIVE: NodeId = NodeId::constant::<10>();
const SIZE: u32 = 3_000;
const SEED: u32 = 0x1234_5678;
const END: Time = Time::from_ms(20_000);
const UNDER_WAY: u32 = 0xFFFF_FFFF;

fn at(sub: u8) -> Address {
    Address::new(0x2F12, sub)
}

fn target(node: NodeId) -> u32 {
    u32::from(INDEX) << 16 | u32::from(node.get())
}

fn write(world: &mut World<'_>, sub: u8, word: u32) -> Result<(), AbortCode> {
    let written = world.sdo_write(MASTER, at(sub), &word.to_le_bytes());
    written.map_err(|error| error.code())
}

fn read(world: &mut World<'_>, sub: u8) -> u32 {
    world.sdo_read(MASTER, at(sub)).unwrap().as_u32().unwrap()
}

/// The board beside one drive that the network does not name, and nobody else.
fn alone(block_size: u8) -> World<'static> {
    let drive = DriveConfig {
        sdo_block_size: block_size,
        test_data: Some(TestData::new(SEED, SIZE)),
        ..DriveConfig::new(DRIVE, 41)
    };
    let scenario = Scenario::new(41, END).unattended().without_drives();
    let scenario = scenario.stranger(drive);
    let mut world = World::new(image(), scenario).unwrap().with_guest();
    world.run_until(Time::from_ms(2500));
    for (sub, word) in [(1, target(DRIVE)), (2, SIZE), (3, SEED)] {
        write(&mut world, sub, word).unwrap();
    }
    world
}

/// Starts a transfer and waits for its end: bytes, microseconds, code.
fn transfer(world: &mut World<'_>, command: u32) -> [u32; 3] {
    write(world, 4, command).unwrap();
    for _ in 0..100 {
        let later = world.now() + Time::from_ms(20);
        world.run_until(later);
        let code = read(world, 7);
        if code != UNDER_WAY {
            return [read(world, 5), read(world, 6), code];
        }
    }
    panic!("it does not end");
}

#[test]
fn data_go_both_ways_in_segments_and_in_blocks() {
    let mut world = alone(127);
    assert_eq!(read(&mut world, 7), 0x0800_0024);
    for command in 1..=4 {
        let [bytes, us, code] = transfer(&mut world, command);
        assert_eq!((bytes, code), (SIZE, 0), "command {command}");
        assert!(us > 50_000, "{us} us: faster than the bus");
        let drive = world.stranger_of(DRIVE).unwrap();
        // What an upload leaves is what the download before it brought.
        assert!(drive.test_data().unwrap().is_sound(), "command {command}");
    }
}

#[test]
fn a_drive_without_block_transfer_is_served_in_segments() {
    let mut world = alone(0);
    for command in [3, 4] {
        let [bytes, _, code] = transfer(&mut world, command);
        assert_eq!((bytes, code), (SIZE, 0), "command {command}");
    }
}

#[test]
fn other_data_and_other_sizes_are_told() {
    let mut world = alone(127);
    write(&mut world, 3, SEED + 1).unwrap();
    for command in [2, 4] {
        let [bytes, _, code] = transfer(&mut world, command);
        assert_eq!((bytes, code), (0, 0x0609_0030), "command {command}");
    }
    assert_eq!(transfer(&mut world, 3)[2], 0, "the drive takes anything");
    let drive = world.stranger_of(DRIVE).unwrap();
    assert_eq!(drive.test_data().unwrap().first_wrong(), Some(0));
    write(&mut world, 3, SEED).unwrap();
    write(&mut world, 2, SIZE + 1).unwrap();
    for command in 1..=4 {
        let [_, _, code] = transfer(&mut world, command);
        assert_eq!(code, 0x0607_0010, "command {command}");
    }
}

#[test]
fn a_drive_that_is_not_there_is_told() {
    let mut world = alone(127);
    write(&mut world, 1, target(NodeId::constant::<11>())).unwrap();
    let [bytes, us, code] = transfer(&mut world, 3);
    assert_eq!((bytes, code), (0, 0x0504_0000));
    // Timeout and quarantine.
    assert!((200_000..220_000).contains(&us), "{us} us");
    // It may be started again at once, and only once at a time.
    write(&mut world, 4, 3).unwrap();
    assert_eq!(write(&mut world, 4, 3), Err(AbortCode::DEVICE_STATE));
}

#[test]
fn not_while_the_axes_are_enabled() {
    let scenario = Scenario::new(42, END).unattended();
    let mut world = World::new(image(), scenario).unwrap().with_guest();
    let standby = |world: &World<'_>| world.statuses().flatten().all(|status| enabled(&status));
    assert!(world.run_to(Time::from_ms(4000), standby));
    write(&mut world, 1, target(NodeId::constant::<1>())).unwrap();
    assert_eq!(write(&mut world, 4, 3), Err(AbortCode::DEVICE_STATE));
    assert!(world.statuses().flatten().all(|status| enabled(&status)));
}

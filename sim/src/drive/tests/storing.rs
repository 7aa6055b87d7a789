//! 1010h and 1011h: what is remembered, and what is not.

use super::rig::{Rig, quick};
use crate::drive::cia402::State;
use crate::drive::{DriveConfig, DriveFault, Spread};

fn drive() -> DriveConfig {
    DriveConfig {
        store_time: Spread::fixed(50_000),
        ..quick(1)
    }
}

fn power_cycle(rig: &mut Rig) {
    rig.drives[0].inject(DriveFault::PowerCycle {
        off: rig.now,
        on: rig.now,
    });
    rig.run_ms(300);
}

/// Saving takes its time.
fn store(rig: &mut Rig, index: u16, word: &[u8; 4]) -> Vec<u8> {
    let [low, high] = index.to_le_bytes();
    rig.log.clear();
    let [a, b, c, d] = *word;
    rig.send(0x601, &[0x23, low, high, 1, a, b, c, d]);
    rig.run_ms(40);
    assert!(rig.sent(0x581).is_empty(), "not done yet");
    rig.run_ms(30);
    rig.sent(0x581).remove(0)
}

#[test]
fn the_saved_set_survives_a_power_cycle_and_the_rest_does_not() {
    let mut rig = Rig::booted(drive());
    rig.write(0x6083, 0, &1234u32.to_le_bytes()).unwrap();
    rig.write(0x1017, 0, &500u16.to_le_bytes()).unwrap();
    rig.write(0x1400, 1, &0x8000_0201u32.to_le_bytes()).unwrap();
    assert_eq!(store(&mut rig, 0x1010, b"save")[0], 0x60);
    rig.write(0x6084, 0, &999u32.to_le_bytes()).unwrap();
    power_cycle(&mut rig);
    assert_eq!(rig.read(0x6083, 0), Ok(1234));
    assert_eq!(rig.read(0x1017, 0), Ok(500));
    assert_eq!(rig.read(0x1400, 1), Ok(0x8000_0201));
    assert_eq!(rig.read(0x6084, 0), Ok(10_000));
    assert_eq!(store(&mut rig, 0x1011, b"load")[0], 0x60);
    assert_eq!(rig.read(0x6083, 0), Ok(1234), "with the next reset");
    power_cycle(&mut rig);
    assert_eq!(rig.read(0x6083, 0), Ok(10_000));
    assert_eq!(rig.read(0x1017, 0), Ok(0));
    assert_eq!(rig.read(0x1400, 1), Ok(0x201));
}

#[test]
fn commands_and_set_values_are_not_saved() {
    let mut rig = Rig::booted(drive());
    rig.enable();
    rig.target_velocity(700);
    assert_eq!(store(&mut rig, 0x1010, b"save")[0], 0x60);
    power_cycle(&mut rig);
    assert_eq!(rig.state(), State::SwitchOnDisabled);
    assert_eq!(rig.read(0x60FF, 0), Ok(0));
    assert_eq!(rig.read(0x6040, 0), Ok(0));
    assert_eq!(rig.read(0x6060, 0), Ok(3), "the mode is a parameter");
}

#[test]
fn a_broken_memory_and_a_wrong_signature() {
    let mut rig = Rig::booted(drive().with(DriveFault::StoreFails));
    assert_eq!(store(&mut rig, 0x1010, b"save")[4..], [0, 0, 0x06, 0x06]);
    assert_eq!(store(&mut rig, 0x1010, b"SAVE")[4..], [0x20, 0, 0, 0x08]);
    assert_eq!(rig.read(0x1010, 1), Ok(1));
}

#[test]
fn a_node_id_by_sdo_counts_once_it_is_saved_and_loaded() {
    let mut rig = Rig::booted(drive());
    rig.write(0x2000, 0, &[4]).unwrap();
    assert_eq!(store(&mut rig, 0x1010, b"save")[0], 0x60);
    rig.log.clear();
    power_cycle(&mut rig);
    assert_eq!((rig.sent(0x704).len(), rig.sent(0x701).len()), (1, 0));
    assert_eq!(
        rig.sdo_of(4, [0x40, 0x14, 0x10, 0, 0, 0, 0, 0]),
        Some([0x43, 0x14, 0x10, 0, 0x84, 0, 0, 0])
    );
}

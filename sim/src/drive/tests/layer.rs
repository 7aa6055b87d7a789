//! Layer setting services as CiA 305 has them, byte by byte.

use super::rig::{Rig, node, quick};
use crate::drive::{DriveConfig, DriveFault};
use canmaster::nmt::State as Nmt;

const SERIAL: u32 = 0x2600_0001;

fn fresh(id: u8) -> DriveConfig {
    DriveConfig {
        unconfigured: true,
        ..quick(id)
    }
}

/// A frame of the LSS master, and what the slaves answer.
fn lss(rig: &mut Rig, data: &[u8]) -> Vec<Vec<u8>> {
    let mut frame = [0; 8];
    frame[..data.len()].copy_from_slice(data);
    let before = rig.log.len();
    rig.send(0x7E5, &frame);
    rig.run_ms(5);
    let answers = rig.log[before..].iter();
    let answers = answers.filter(|(_, frame)| frame.id().get() == 0x7E4);
    answers.map(|(_, frame)| frame.data().to_vec()).collect()
}

fn power_cycle(rig: &mut Rig) {
    rig.drives[0].inject(DriveFault::PowerCycle {
        off: rig.now,
        on: rig.now,
    });
    rig.run_ms(300);
}

#[test]
fn a_drive_without_node_id_has_no_nmt_state_and_answers_lss_alone() {
    let mut rig = Rig::new([fresh(1)]);
    rig.run_ms(199);
    assert!(lss(&mut rig, &[0x04, 0x01])[..].is_empty());
    rig.run_ms(500);
    rig.nmt(0x01);
    rig.send(0x601, &[0x40, 0, 0x10, 0, 0, 0, 0, 0]);
    rig.run_ms(20);
    assert!(rig.log.is_empty(), "neither boot-up nor SDO");
    let status = rig.drive().status();
    assert_eq!((status.nmt, status.node_id), (Nmt::Initialising, None));
    assert!(lss(&mut rig, &[0x5E]).is_empty(), "it waits");
    assert!(lss(&mut rig, &[0x04, 0x01]).is_empty());
    assert_eq!(lss(&mut rig, &[0x5E]), [[0x5E, 0xFF, 0, 0, 0, 0, 0, 0]]);
    assert_eq!(lss(&mut rig, &[0x5A]), [[0x5A, 0xFB, 0, 0, 0, 0, 0, 0]]);
    assert_eq!(lss(&mut rig, &[0x5B]), [[0x5B, 0, 0, 0x50, 0x61, 0, 0, 0]]);
    assert_eq!(lss(&mut rig, &[0x5C]), [[0x5C, 0, 0, 0x70, 0x01, 0, 0, 0]]);
    assert_eq!(lss(&mut rig, &[0x5D]), [[0x5D, 1, 0, 0, 0x26, 0, 0, 0]]);
}

#[test]
fn it_is_selected_by_its_address_and_boots_with_the_node_id_it_is_given() {
    let mut rig = Rig::booted(fresh(1));
    let select = |rig: &mut Rig, serial: u32| {
        assert!(lss(rig, &[0x40, 0xFB, 0, 0, 0]).is_empty());
        assert!(lss(rig, &[0x41, 0, 0, 0x50, 0x61]).is_empty());
        assert!(lss(rig, &[0x42, 0, 0, 0x70, 0x01]).is_empty());
        let [a, b, c, d] = serial.to_le_bytes();
        lss(rig, &[0x43, a, b, c, d])
    };
    assert!(select(&mut rig, SERIAL + 1).is_empty());
    assert!(lss(&mut rig, &[0x11, 5]).is_empty(), "not selected");
    assert_eq!(select(&mut rig, SERIAL), [[0x44, 0, 0, 0, 0, 0, 0, 0]]);
    for bad in [0, 128, 200, 254] {
        let answer = lss(&mut rig, &[0x11, bad]);
        assert_eq!(answer, [[0x11, 1, 0, 0, 0, 0, 0, 0]], "{bad}");
    }
    assert_eq!(
        lss(&mut rig, &[0x11, 5]),
        [[0x11, 0, 0, 0, 0, 0, 0, 0]],
        "accepted"
    );
    rig.run_ms(500);
    assert!(rig.sent(0x705).is_empty(), "not before it waits again");
    lss(&mut rig, &[0x04, 0x00]);
    rig.run_ms(300);
    assert_eq!(rig.sent(0x705), [[0]]);
    assert_eq!(rig.drive().status().node_id, Some(node(5)));
    let answer = rig.sdo_of(5, [0x40, 0x00, 0x14, 1, 0, 0, 0, 0]);
    assert_eq!(answer, Some([0x43, 0x00, 0x14, 1, 0x05, 0x02, 0, 0]));
    let answer = rig.sdo_of(5, [0x40, 0x01, 0x18, 1, 0, 0, 0, 0]);
    assert_eq!(answer, Some([0x43, 0x01, 0x18, 1, 0x85, 0x02, 0, 0xC0]));
    rig.send(0x000, &[0x01, 5]);
    assert_eq!(rig.drive().status().nmt, Nmt::Operational);
}

#[test]
fn fastscan_finds_it_bit_by_bit() {
    let mut rig = Rig::new([fresh(1), quick(2), fresh(3)]);
    rig.run_ms(400);
    let scan = |rig: &mut Rig, id: u32, bit: u8, sub: u8, next: u8| {
        let [a, b, c, d] = id.to_le_bytes();
        let answers = lss(rig, &[0x51, a, b, c, d, bit, sub, next]);
        assert!(answers.iter().all(|a| a == &[0x4F, 0, 0, 0, 0, 0, 0, 0]));
        answers.len()
    };
    for serial in [SERIAL, SERIAL + 2] {
        let left = if serial == SERIAL { 2 } else { 1 };
        assert_eq!(scan(&mut rig, 0, 0x80, 0, 0), left, "node 2 has a node-ID");
        let mut found = [0u32; 4];
        for sub in 0..4u8 {
            let number = &mut found[usize::from(sub)];
            for bit in (0..32).rev() {
                if scan(&mut rig, *number, bit, sub, sub) == 0 {
                    *number |= 1 << bit;
                }
            }
            assert!(scan(&mut rig, *number, 0, sub, (sub + 1) % 4) > 0);
        }
        assert_eq!(found, [0xFB, 0x6150_0000, 0x0170_0000, serial]);
        let answer = lss(&mut rig, &[0x11, (serial - SERIAL) as u8 + 10]);
        assert_eq!(answer, [[0x11, 0, 0, 0, 0, 0, 0, 0]], "one of them alone");
        lss(&mut rig, &[0x04, 0x00]);
    }
    rig.run_ms(300);
    assert_eq!((rig.sent(0x70A).len(), rig.sent(0x70C).len()), (1, 1));
    assert_eq!(scan(&mut rig, 0, 0x80, 0, 0), 0, "nobody left");
}

#[test]
fn with_a_node_id_lss_works_in_stopped_only_and_takes_effect_with_a_reset() {
    let mut rig = Rig::booted(quick(1));
    for command in [0x80, 0x01] {
        rig.nmt(command);
        lss(&mut rig, &[0x04, 0x01]);
        assert!(lss(&mut rig, &[0x5E]).is_empty());
    }
    rig.nmt(0x02);
    lss(&mut rig, &[0x04, 0x01]);
    assert_eq!(lss(&mut rig, &[0x5E]), [[0x5E, 1, 0, 0, 0, 0, 0, 0]]);
    assert_eq!(lss(&mut rig, &[0x11, 9]).len(), 1);
    lss(&mut rig, &[0x04, 0x00]);
    rig.nmt(0x80);
    assert!(rig.read(0x1000, 0).is_ok(), "still node 1");
    rig.log.clear();
    rig.nmt(0x82);
    rig.run_ms(300);
    assert_eq!(rig.sent(0x709), [[0]]);
    // Its node-ID is taken away again.
    rig.nmt(0x02);
    lss(&mut rig, &[0x04, 0x01]);
    assert_eq!(lss(&mut rig, &[0x11, 0xFF]).len(), 1);
    lss(&mut rig, &[0x04, 0x00]);
    rig.log.clear();
    rig.nmt(0x82);
    rig.run_ms(300);
    assert!(rig.log.is_empty());
    assert_eq!(rig.drive().status().node_id, None);
}

#[test]
fn a_node_id_survives_a_power_cycle_once_it_is_stored() {
    for stored in [false, true] {
        let mut rig = Rig::booted(fresh(1));
        lss(&mut rig, &[0x04, 0x01]);
        lss(&mut rig, &[0x11, 7]);
        if stored {
            assert_eq!(lss(&mut rig, &[0x17]), [[0x17, 0, 0, 0, 0, 0, 0, 0]]);
        }
        lss(&mut rig, &[0x04, 0x00]);
        rig.run_ms(300);
        assert_eq!(rig.sent(0x707).len(), 1);
        rig.log.clear();
        power_cycle(&mut rig);
        assert_eq!(rig.sent(0x707).len(), usize::from(stored));
        // Restoring the factory's values leaves node-ID and bit rate alone.
        if stored {
            assert_eq!(rig.write_of(7, 0x1011, 1, b"load"), Ok(()));
            rig.log.clear();
            power_cycle(&mut rig);
            assert_eq!(rig.sent(0x707).len(), 1);
        }
    }
}

#[test]
fn a_broken_memory_says_so() {
    let mut rig = Rig::booted(fresh(1).with(DriveFault::StoreFails));
    lss(&mut rig, &[0x04, 0x01]);
    lss(&mut rig, &[0x11, 7]);
    assert_eq!(lss(&mut rig, &[0x17]), [[0x17, 2, 0, 0, 0, 0, 0, 0]]);
}

#[test]
fn a_bit_rate_is_activated_between_two_silences() {
    let mut rig = Rig::booted(fresh(1));
    lss(&mut rig, &[0x04, 0x01]);
    for (table, index, error) in [(0, 5, 1), (0, 8, 1), (1, 0, 1), (0, 10, 1), (0, 2, 0)] {
        let answer = lss(&mut rig, &[0x13, table, index]);
        assert_eq!(answer, [[0x13, error, 0, 0, 0, 0, 0, 0]]);
    }
    let bit_time = |rig: &Rig| rig.drive().timing().unwrap().bit_time_ps;
    let before = bit_time(&rig);
    assert!((999_000..1_001_000).contains(&before));
    lss(&mut rig, &[0x15, 100, 0]);
    rig.run_ms(90);
    assert_eq!(bit_time(&rig), before);
    assert!(lss(&mut rig, &[0x5E]).is_empty());
    rig.run_ms(10);
    assert!((1_998_000..2_002_000).contains(&bit_time(&rig)));
    assert!(lss(&mut rig, &[0x5E]).is_empty(), "still silent");
    rig.run_ms(100);
    assert_eq!(lss(&mut rig, &[0x5E]).len(), 1);
}

#[test]
fn frames_that_are_none_of_lss_change_nothing() {
    let mut rig = Rig::booted(fresh(1));
    for len in 0..8 {
        rig.send(0x7E5, &[0x04, 0x01, 0, 0, 0, 0, 0][..len.min(7)]);
    }
    rig.send_remote(0x7E5);
    for command in (0..=255u8).filter(|c| !matches!(c, 0x04 | 0x51)) {
        lss(&mut rig, &[command, 0xAA, 0x55, 1, 2, 3, 4, 5]);
    }
    lss(&mut rig, &[0x04, 0x02]);
    assert!(rig.log.is_empty());
    assert!(lss(&mut rig, &[0x5E]).is_empty(), "still waiting");
}

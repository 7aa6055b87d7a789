//! The object dictionary through SDO.

use super::rig::{Rig, abort_code, quick};
use crate::drive::{DriveConfig, DriveFault};

#[test]
fn identity_and_defaults() {
    let mut rig = Rig::booted(quick(3));
    // Golden frames: 1000h and 1018h:1 of node 3.
    assert_eq!(
        rig.sdo_of(3, [0x40, 0x00, 0x10, 0, 0, 0, 0, 0]),
        Some([0x43, 0x00, 0x10, 0, 0x92, 0x01, 0x02, 0x00])
    );
    assert_eq!(
        rig.sdo_of(3, [0x40, 0x18, 0x10, 1, 0, 0, 0, 0]),
        Some([0x43, 0x18, 0x10, 1, 0xFB, 0, 0, 0])
    );
    let mut rig = Rig::booted(quick(1));
    for (index, sub, value) in [
        (0x1005, 0, 0x80),
        (0x1014, 0, 0x81),
        (0x1018, 3, 0x0170_0000),
        (0x1200, 1, 0x601),
        (0x1400, 1, 0x201),
        (0x1403, 1, 0x501),
        (0x1403, 2, 255),
        (0x1603, 0, 2),
        (0x1603, 2, 0x60FF_0020),
        (0x1800, 1, 0x4000_0181),
        (0x1801, 1, 0xC000_0281),
        (0x1803, 3, 10),
        (0x1A03, 2, 0x606C_0020),
        (0x6007, 0, 3),
        (0x605A, 0, 6),
        (0x6083, 0, 10_000),
        (0x60A9, 0, 0x00B4_4700),
        (0x60C5, 0, u32::MAX),
        (0x6502, 0, 0x3A5),
    ] {
        assert_eq!(rig.read(index, sub), Ok(value), "{index:04X}h:{sub}");
    }
}

#[test]
fn the_name_is_a_segmented_upload() {
    let mut rig = Rig::booted(quick(1));
    assert_eq!(
        rig.sdo([0x40, 0x08, 0x10, 0, 0, 0, 0, 0]),
        Some([0x41, 0x08, 0x10, 0, 5, 0, 0, 0])
    );
    assert_eq!(
        rig.sdo([0x60, 0, 0, 0, 0, 0, 0, 0]),
        Some([0x05, b'E', b'P', b'O', b'S', b'4', 0, 0])
    );
}

#[test]
fn abort_codes() {
    let mut rig = Rig::booted(quick(1));
    let u8s = |v: u8| vec![v];
    let u16s = |v: u16| v.to_le_bytes().to_vec();
    let u32s = |v: u32| v.to_le_bytes().to_vec();
    for (index, sub, data, code) in [
        (0x1006, 0, u32s(10_000), 0x0602_0000),
        (0x1019, 0, u8s(0), 0x0602_0000),
        (0x1020, 1, u32s(0), 0x0602_0000),
        (0x605D, 0, u16s(1), 0x0602_0000),
        (0x1018, 5, u32s(0), 0x0609_0011),
        (0x1800, 5, u16s(0), 0x0609_0011),
        (0x1000, 0, u32s(0), 0x0601_0002),
        (0x1005, 0, u32s(0x80), 0x0601_0002),
        (0x6041, 0, u16s(0), 0x0601_0002),
        (0x6083, 0, u16s(10), 0x0607_0013),
        (0x6040, 0, u32s(6), 0x0607_0010),
        (0x6083, 0, u32s(0), 0x0609_0030),
        (0x607F, 0, u32s(50_001), 0x0609_0030),
        (0x6007, 0, u16s(1), 0x0609_0030),
        (0x605A, 0, u16s(2), 0x0609_0030),
        (0x605E, 0, u16s(3), 0x0609_0030),
        (0x6060, 0, u8s(2), 0x0609_0030),
        (0x60C2, 1, u8s(101), 0x0609_0030),
        (0x60C2, 2, u8s(0xFE), 0x0609_0030),
        (0x1010, 1, u32s(1), 0x0800_0020),
        (0x1011, 1, u32s(0x6576_6173), 0x0800_0020),
        (0x1003, 0, u8s(1), 0x0609_0030),
        (0x2001, 0, u8s(5), 0x0609_0030),
        (0x2000, 0, u8s(128), 0x0609_0030),
    ] {
        let answer = rig.write(index, sub, &data);
        assert_eq!(answer, Err(code), "{index:04X}h:{sub}");
    }
    // Block transfer is not understood.
    let answer = rig.sdo([0xC2, 0x40, 0x60, 0, 2, 0, 0, 0]).unwrap();
    assert_eq!((answer[0], abort_code(answer)), (0x80, 0x0504_0001));
    // Nor is a segment without a transfer.
    let answer = rig.sdo([0x60, 0, 0, 0, 0, 0, 0, 0]).unwrap();
    assert_eq!(answer[0], 0x80);
}

#[test]
fn transmission_types_other_than_1_255_and_253_are_refused() {
    let mut rig = Rig::booted(quick(1));
    for kind in 0..=255u8 {
        let rpdo = matches!(kind, 1 | 255);
        let tpdo = rpdo || kind == 253;
        for (index, accepted) in [(0x1400, rpdo), (0x1800, tpdo)] {
            let expected = if accepted { Ok(()) } else { Err(0x0609_0030) };
            assert_eq!(rig.write(index, 2, &[kind]), expected, "{kind}");
        }
    }
}

#[test]
fn mapping_rules() {
    let mut rig = Rig::booted(quick(1));
    let entry = |raw: u32| raw.to_le_bytes();
    let (velocity, control, status) = (0x60FF_0020, 0x6040_0010, 0x6041_0010);
    assert_eq!(rig.write(0x1600, 1, &entry(velocity)), Err(0x0601_0003));
    assert_eq!(rig.write(0x1600, 0, &[0]), Ok(()), "bit 31 is not demanded");
    for (raw, expected) in [
        (status, Err(0x0604_0041)),
        (0x60FF_0010, Err(0x0604_0041)),
        (0x60A9_0020, Err(0x0604_0041)),
        (0x6081_0020, Ok(())),
        (control, Ok(())),
    ] {
        assert_eq!(rig.write(0x1600, 1, &entry(raw)), expected, "{raw:08X}");
    }
    assert_eq!(rig.write(0x1600, 2, &entry(velocity)), Ok(()));
    assert_eq!(rig.write(0x1600, 3, &entry(velocity)), Ok(()));
    assert_eq!(rig.write(0x1600, 0, &[3]), Err(0x0604_0042), "80 bits");
    assert_eq!(
        rig.write(0x1600, 0, &[4]),
        Err(0x0604_0041),
        "an empty entry"
    );
    assert_eq!(rig.write(0x1600, 0, &[13]), Err(0x0609_0030));
    assert_eq!(rig.write(0x1600, 0, &[2]), Ok(()));
    // Also into a TPDO: set values can be read back there.
    assert_eq!(rig.write(0x1A00, 0, &[0]), Ok(()));
    assert_eq!(rig.write(0x1A00, 1, &entry(velocity)), Ok(()));

    rig.nmt(0x01);
    assert_eq!(rig.write(0x1600, 0, &[0]), Err(0x0800_0022));
    assert_eq!(rig.write(0x1601, 1, &entry(control)), Err(0x0800_0022));
}

#[test]
fn identifiers_of_pdos() {
    let mut rig = Rig::booted(quick(1));
    for (raw, expected) in [
        (0x0000_0301u32, Err(0x0609_0030)),
        (0x8000_0201, Ok(())),
        (0x0000_0301, Ok(())),
        (0x8000_0201, Ok(())),
        (0x0000_0201, Ok(())),
        (0x8000_0202, Err(0x0604_0041)),
        (0x2000_0201, Err(0x0609_0030)),
        (0x0000_0101, Err(0x0609_0030)),
        (0x0000_0581, Err(0x0609_0030)),
        (0x0000_0701, Err(0x0609_0030)),
    ] {
        assert_eq!(
            rig.write(0x1400, 1, &raw.to_le_bytes()),
            expected,
            "{raw:X}"
        );
    }
}

#[test]
fn a_node_is_watched_once() {
    let mut rig = Rig::booted(quick(1));
    let entry = 127u32 << 16 | 200;
    assert_eq!(rig.write(0x1016, 1, &entry.to_le_bytes()), Ok(()));
    assert_eq!(rig.write(0x1016, 2, &entry.to_le_bytes()), Err(0x0604_0043));
}

#[test]
fn one_write_can_be_refused_on_order() {
    let mut rig = Rig::booted(quick(1).with(DriveFault::RefuseWrite {
        index: 0x6085,
        sub: 0,
        abort: 0x0800_0020,
    }));
    assert_eq!(rig.write(0x6084, 0, &[1, 0, 0, 0]), Ok(()));
    assert_eq!(rig.write(0x6085, 0, &[1, 0, 0, 0]), Err(0x0800_0020));
}

#[test]
fn velocity_units() {
    let mut rig = Rig::booted(quick(1));
    let tenths = 0xFFB4_4700u32;
    assert_eq!(rig.write(0x60A9, 0, &tenths.to_le_bytes()), Ok(()));
    assert_eq!(
        rig.write(0x60A9, 0, &[0, 0x47, 0xB4, 0xF0]),
        Err(0x0609_0030)
    );
    rig.enable();
    rig.target_velocity(10_000);
    rig.run_ms(500);
    assert!((rig.rpm() - 1000.0).abs() < 5.0);
    let seen = rig.read(0x606C, 0).unwrap() as i32;
    assert!((9_900..10_100).contains(&seen), "{seen}");
}

/// Every speed of the dictionary has the unit of 60A9h; accelerations do not
/// (60AAh).
#[test]
fn speeds_of_other_modes_have_the_unit_too() {
    let hundredths = 0xFEB4_4700_u32;
    let start = |mode| {
        let mut rig = Rig::booted(quick(1));
        rig.write32(0x60A9, 0, hundredths.into());
        rig.enable_in(mode);
        rig
    };
    let mut position = start(1);
    position.write32(0x6081, 0, 30_000);
    position.write32(0x607A, 0, 1_000_000);
    position.controlword(0x1F);
    let mut limited = start(3);
    limited.write32(0x607F, 0, 30_000);
    limited.target_velocity(100_000);
    let mut homing = start(6);
    homing.write(0x6098, 0, &[23]).unwrap();
    homing.write32(0x6099, 1, 30_000);
    homing.controlword(0x1F);
    let mut cyclic = start(9);
    cyclic.target_velocity(30_000);
    for mut rig in [position, limited, homing, cyclic] {
        rig.run_ms(800);
        assert!((rig.rpm() - 300.0).abs() < 5.0, "{}", rig.rpm());
    }
}

#[test]
fn block_transfer_where_the_drive_is_said_to_have_it() {
    let mut rig = Rig::booted(DriveConfig {
        sdo_block_size: 127,
        ..quick(1)
    });
    // Download of 6083h, without CRC.
    let answer = rig.sdo([0xC2, 0x83, 0x60, 0, 4, 0, 0, 0]).unwrap();
    assert_eq!(answer, [0xA4, 0x83, 0x60, 0, 127, 0, 0, 0]);
    let answer = rig.sdo([0x81, 0xD2, 0x04, 0, 0, 0, 0, 0]).unwrap();
    assert_eq!(answer, [0xA2, 1, 127, 0, 0, 0, 0, 0]);
    let answer = rig.sdo([0xCD, 0, 0, 0, 0, 0, 0, 0]).unwrap();
    assert_eq!(answer, [0xA1, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(rig.read(0x6083, 0), Ok(1234));
    // Upload of the name: start, one segment, end.
    let answer = rig.sdo([0xA0, 0x08, 0x10, 0, 127, 0, 0, 0]).unwrap();
    assert_eq!(answer[..5], [0xC6, 0x08, 0x10, 0, 5]);
    let answer = rig.sdo([0xA3, 0, 0, 0, 0, 0, 0, 0]).unwrap();
    assert_eq!(answer, [0x81, b'E', b'P', b'O', b'S', b'4', 0, 0]);
    let answer = rig.sdo([0xA2, 1, 127, 0, 0, 0, 0, 0]).unwrap();
    assert_eq!(answer[0], 0xC9);
    assert_eq!(rig.sdo([0xA1, 0, 0, 0, 0, 0, 0, 0]), None);
    assert_eq!(rig.read(0x1018, 1), Ok(0xFB));
}

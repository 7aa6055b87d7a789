//! Wrong answers and drives that do not do what they are told, on order.

use super::rig::{Rig, quick};
use crate::drive::cia402::State;
use crate::drive::{DriveConfig, DriveFault, SdoWrong, Spread};
use crate::time::Time;

fn wrong(how: SdoWrong) -> Rig {
    let config = DriveConfig {
        sdo_block_size: 127,
        ..quick(1)
    };
    Rig::booted(config.with(DriveFault::SdoWrong(how)))
}

#[test]
fn each_answer_is_wrong_in_its_way() {
    let name = [0x40, 0x08, 0x10, 0, 0, 0, 0, 0];
    let segment = [0x60, 0, 0, 0, 0, 0, 0, 0];
    let mut rig = wrong(SdoWrong::Toggle);
    assert_eq!(rig.sdo(name), Some([0x41, 0x08, 0x10, 0, 5, 0, 0, 0]));
    assert_eq!(rig.sdo(segment).unwrap()[0], 0x15);

    let mut rig = wrong(SdoWrong::Object);
    assert_eq!(rig.sdo(name).unwrap()[..3], [0x41, 0x09, 0x10]);

    let mut rig = wrong(SdoWrong::Size);
    assert_eq!(rig.sdo(name).unwrap()[4], 6);
    assert_eq!(rig.sdo(segment).unwrap()[0], 0x05);

    let mut rig = wrong(SdoWrong::Command);
    assert_eq!(rig.sdo(name).unwrap()[0] & 0xE0, 0xE0);

    let mut rig = wrong(SdoWrong::Cut);
    assert!(rig.sdo(name).is_some());
    assert_eq!(rig.sdo(segment), None);

    let mut rig = wrong(SdoWrong::Short);
    rig.sdo(name);
    assert_eq!(rig.sent(0x581)[0].len(), 7);
}

#[test]
fn block_transfers_are_wrong_in_their_way() {
    let begin = [0xA4, 0x08, 0x10, 0, 127, 0, 0, 0];
    let start = [0xA3, 0, 0, 0, 0, 0, 0, 0];
    let done = [0xA2, 1, 127, 0, 0, 0, 0, 0];
    let upload = |how| {
        let mut rig = wrong(how);
        let size = rig.sdo(begin).unwrap()[4];
        let sequence = rig.sdo(start).unwrap()[0];
        let end = rig.sdo(done).unwrap();
        (size, sequence, u16::from_le_bytes([end[1], end[2]]))
    };
    // Toggle bits do not exist here: nothing is wrong.
    let (size, sequence, crc) = upload(SdoWrong::Toggle);
    assert_eq!((size, sequence), (5, 0x81));
    assert_eq!(upload(SdoWrong::Size), (6, 0x81, crc));
    assert_eq!(upload(SdoWrong::Sequence), (5, 0x82, crc));
    assert_eq!(upload(SdoWrong::Crc), (5, 0x81, crc ^ 1));

    let mut rig = wrong(SdoWrong::Sequence);
    rig.sdo([0xC2, 0x83, 0x60, 0, 4, 0, 0, 0]).unwrap();
    let answer = rig.sdo([0x81, 0xD2, 0x04, 0, 0, 0, 0, 0]).unwrap();
    assert_eq!(answer[..2], [0xA2, 2]);
}

#[test]
fn a_drive_that_ignores_controlwords() {
    let mut rig = Rig::booted(quick(1));
    rig.controlword(0x06);
    rig.drives[0].inject(DriveFault::ControlwordIgnored { at: Time::ZERO });
    rig.controlword(0x0F);
    rig.run_ms(100);
    assert_eq!(rig.state(), State::ReadyToSwitchOn);
    assert_eq!(rig.read(0x6040, 0), Ok(0x0F));
}

#[test]
fn a_drive_that_confirms_late() {
    let mut rig = Rig::booted(quick(1));
    rig.drives[0].inject(DriveFault::ControlwordLate(Spread::fixed(300_000)));
    rig.controlword(0x06);
    rig.run_ms(270);
    assert_eq!(rig.state(), State::SwitchOnDisabled);
    rig.run_ms(20);
    assert_eq!(rig.state(), State::ReadyToSwitchOn);
    // Each acts after its time, an edge among them is not lost.
    rig.drives[0].inject(DriveFault::Error {
        at: rig.now,
        code: 0x2310,
        until: None,
    });
    rig.run_ms(1);
    rig.controlword(0x80);
    rig.controlword(0x00);
    rig.run_ms(100);
    assert_eq!(rig.state(), State::Fault);
    rig.run_ms(200);
    assert_eq!(rig.state(), State::SwitchOnDisabled);
}

#[test]
fn a_drive_whose_mode_does_not_change() {
    let mut rig = Rig::booted(quick(1).with(DriveFault::ModeStuck { at: Time::ZERO }));
    rig.write(0x6060, 0, &[3]).unwrap();
    rig.run_ms(50);
    assert_eq!((rig.read(0x6060, 0), rig.read(0x6061, 0)), (Ok(3), Ok(1)));
}

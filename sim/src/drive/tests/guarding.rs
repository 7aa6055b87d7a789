//! Node guarding and life guarding (CiA 301, 7.2.8.3.2.1).

use super::rig::{Rig, quick};
use crate::drive::DriveConfig;
use canmaster::nmt::State as Nmt;

fn guarded() -> Rig {
    Rig::booted(DriveConfig {
        node_guarding: true,
        ..quick(1)
    })
}

fn ask(rig: &mut Rig) -> Vec<Vec<u8>> {
    rig.log.clear();
    rig.send_remote(0x701);
    rig.run_ms(5);
    rig.sent(0x701)
}

#[test]
fn the_epos4_has_no_node_guarding() {
    let mut rig = Rig::booted(quick(1));
    assert_eq!(rig.read(0x100C, 0), Err(0x0602_0000));
    assert_eq!(rig.write(0x100D, 0, &[3]), Err(0x0602_0000));
    assert!(ask(&mut rig).is_empty());
}

#[test]
fn the_toggle_bit_alternates_and_begins_with_0() {
    let mut rig = guarded();
    assert_eq!(ask(&mut rig), [[0x7F]]);
    assert_eq!(ask(&mut rig), [[0xFF]]);
    rig.nmt(0x01);
    assert_eq!(ask(&mut rig), [[0x05]]);
    rig.nmt(0x02);
    assert_eq!(ask(&mut rig), [[0x84]]);
    assert_eq!(ask(&mut rig), [[0x04]]);
    rig.nmt(0x82);
    rig.run_ms(300);
    assert_eq!(ask(&mut rig), [[0x7F]]);
}

#[test]
fn a_heartbeat_producer_is_not_guarded() {
    let mut rig = guarded();
    rig.write(0x1017, 0, &5000u16.to_le_bytes()).unwrap();
    rig.run_ms(10);
    assert!(ask(&mut rig).is_empty());
}

#[test]
fn a_master_that_stops_asking_is_lost() {
    let mut rig = guarded();
    rig.write(0x100C, 0, &20u16.to_le_bytes()).unwrap();
    rig.write(0x100D, 0, &[3]).unwrap();
    rig.enable();
    rig.target_velocity(1000);
    rig.run_ms(500);
    assert!(
        rig.sent(0x081).is_empty(),
        "it begins with the first question"
    );
    for _ in 0..20 {
        assert_eq!(ask(&mut rig).len(), 1);
        rig.run_ms(40);
    }
    rig.log.clear();
    rig.run_ms(30);
    assert_eq!(rig.sent(0x081), [[0x30, 0x81, 0x10, 0, 0, 0, 0, 0]]);
    assert_eq!(rig.drive().status().nmt, Nmt::PreOperational);
    rig.run_ms(300);
    assert_eq!(rig.rpm(), 0.0);
}

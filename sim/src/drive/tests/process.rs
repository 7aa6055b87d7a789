//! SYNC and PDOs.

use super::rig::{Rig, config, quick};
use crate::drive::cia402::State;
use crate::time::Time;

/// RPDO1 = 6040h + 60FFh, RPDO2 = 6083h + 6084h, TPDO1 = 6041h + 6064h,
/// TPDO2 = 606Ch + 6077h, all with every SYNC, the others off.
fn configure(rig: &mut Rig) {
    let set = |rig: &mut Rig, com: u16, map: u16, cob_id: u32, entries: &[u32]| {
        let off = cob_id | 1 << 31;
        rig.write(com, 1, &off.to_le_bytes()).unwrap();
        rig.write(map, 0, &[0]).unwrap();
        for (sub, entry) in (1..).zip(entries) {
            rig.write(map, sub, &entry.to_le_bytes()).unwrap();
        }
        rig.write(map, 0, &[entries.len() as u8]).unwrap();
        rig.write(com, 2, &[1]).unwrap();
        rig.write(com, 1, &cob_id.to_le_bytes()).unwrap();
    };
    set(rig, 0x1400, 0x1600, 0x201, &[0x6040_0010, 0x60FF_0020]);
    set(rig, 0x1401, 0x1601, 0x301, &[0x6083_0020, 0x6084_0020]);
    set(
        rig,
        0x1800,
        0x1A00,
        0x4000_0181,
        &[0x6041_0010, 0x6064_0020],
    );
    set(
        rig,
        0x1801,
        0x1A01,
        0x4000_0281,
        &[0x606C_0020, 0x6077_0010],
    );
    for (com, cob_id) in [(0x1402, 0x401u32), (0x1403, 0x501)] {
        let off = cob_id | 1 << 31;
        rig.write(com, 1, &off.to_le_bytes()).unwrap();
    }
    rig.write(0x6060, 0, &[3]).unwrap();
    rig.nmt(0x01);
    rig.log.clear();
}

fn configured() -> Rig {
    let mut rig = Rig::booted(quick(1));
    configure(&mut rig);
    rig
}

fn rpdo1(rig: &mut Rig, word: u16, rpm: i32) {
    let mut data = word.to_le_bytes().to_vec();
    data.extend(rpm.to_le_bytes());
    rig.send(0x201, &data);
}

fn cycle(rig: &mut Rig) {
    rig.send(0x080, &[]);
    rig.run_ms(10);
}

#[test]
fn commands_act_at_the_sync() {
    let mut rig = configured();
    for word in [0x06, 0x0F] {
        rpdo1(&mut rig, word, 0);
        cycle(&mut rig);
    }
    assert_eq!(rig.state(), State::OperationEnabled);
    rpdo1(&mut rig, 0x0F, 1000);
    rig.send(0x301, &[0xA0, 0x0F, 0, 0, 0xA0, 0x0F, 0, 0]);
    rig.run_ms(50);
    assert_eq!(rig.rpm(), 0.0, "no SYNC yet");
    cycle(&mut rig);
    rig.run_ms(90);
    assert!(
        (355.0..400.0).contains(&rig.rpm()),
        "100 ms at 4000 rpm/s less the lag"
    );
    assert_eq!(rig.read(0x6083, 0), Ok(4000));
    // The next SYNC without new data changes nothing.
    rig.target_velocity(0);
    cycle(&mut rig);
    assert_eq!(rig.read(0x60FF, 0), Ok(0));
}

#[test]
fn the_last_data_before_the_sync_counts() {
    let mut rig = configured();
    rpdo1(&mut rig, 0x06, 500);
    rpdo1(&mut rig, 0x06, 700);
    cycle(&mut rig);
    assert_eq!(rig.read(0x60FF, 0), Ok(700));
}

#[test]
fn tpdos_answer_every_sync_once() {
    let mut rig = configured();
    for _ in 0..50 {
        cycle(&mut rig);
    }
    for id in [0x181, 0x281] {
        let sent = rig.sent(id);
        assert_eq!(sent.len(), 50);
        assert!(sent.iter().all(|data| data.len() == 6));
    }
    let data = &rig.sent(0x181)[49];
    assert_eq!(data[..2], rig.drive().status().statusword.to_le_bytes());
    assert_eq!(data[2..], rig.drive().status().position.to_le_bytes());
}

#[test]
fn a_tpdo_reports_the_moment_of_the_sync_not_of_its_sending() {
    let mut rig = configured();
    rpdo1(&mut rig, 0x06, 0);
    cycle(&mut rig);
    let first = &rig.sent(0x181)[0];
    assert_eq!(first[0] & 0x6F, 0x40, "still switch on disabled");
    cycle(&mut rig);
    assert_eq!(rig.sent(0x181)[1][0] & 0x6F, 0x21);
}

#[test]
fn tpdos_come_50_to_250_us_after_the_sync() {
    let mut rig = Rig::booted(quick(1));
    configure(&mut rig);
    let mut delays = Vec::new();
    for _ in 0..200 {
        rig.log.clear();
        let sync = rig.now;
        cycle(&mut rig);
        // The wire takes 100 us, the request 2 us.
        delays.push(rig.log[0].0.since(sync + Time::from_us(102)).as_us());
    }
    let (min, max) = (delays.iter().min().unwrap(), delays.iter().max().unwrap());
    assert!(*min >= 49 && *min < 70, "{min}");
    assert!(*max <= 250 && *max > 230, "{max}");
}

#[test]
fn a_remote_frame_is_no_sync() {
    let mut rig = configured();
    rpdo1(&mut rig, 0x06, 700);
    rig.send_remote(0x080);
    rig.run_ms(10);
    assert!(rig.log.is_empty());
    assert_eq!(rig.read(0x60FF, 0), Ok(0));
}

#[test]
fn there_are_no_pdos_outside_operational() {
    let mut rig = configured();
    rpdo1(&mut rig, 0x06, 700);
    rig.nmt(0x80);
    cycle(&mut rig);
    rpdo1(&mut rig, 0x06, 800);
    cycle(&mut rig);
    rig.nmt(0x01);
    cycle(&mut rig);
    assert_eq!(rig.sent(0x181).len(), 1);
    assert_eq!(rig.read(0x60FF, 0), Ok(0), "old data is gone");
}

#[test]
fn tpdos_under_way_are_dropped_when_operational_ends() {
    let mut rig = configured();
    rig.send(0x080, &[]);
    rig.nmt(0x80);
    rig.run_ms(10);
    assert!(rig.log.is_empty());
}

#[test]
fn a_short_rpdo_is_discarded_with_8210_and_a_long_one_is_taken() {
    let mut rig = configured();
    rig.send(0x201, &[6, 0, 0xBC, 2, 0, 0, 9, 9]);
    cycle(&mut rig);
    assert_eq!(rig.read(0x60FF, 0), Ok(700));
    rig.send(0x201, &[6, 0, 1, 0, 0]);
    cycle(&mut rig);
    assert_eq!(rig.read(0x60FF, 0), Ok(700));
    assert_eq!(rig.sent(0x081), [[0x10, 0x82, 0x10, 0, 0, 0, 0, 0]]);
    assert_eq!(rig.state(), State::Fault);
    assert_eq!(rig.read(0x1001, 0), Ok(0x10));
    assert_eq!(rig.read(0x1003, 1), Ok(0x8210));
}

#[test]
fn values_out_of_range_in_an_rpdo_are_passed_over() {
    let mut rig = configured();
    rig.send(0x301, &[0, 0, 0, 0, 0x88, 0x13, 0, 0]);
    cycle(&mut rig);
    assert_eq!(rig.read(0x6083, 0), Ok(10_000));
    assert_eq!(rig.read(0x6084, 0), Ok(5000));
}

#[test]
fn by_default_the_statusword_is_sent_on_change() {
    let mut rig = Rig::booted(quick(1));
    rig.nmt(0x01);
    rig.run_ms(5);
    assert_eq!(rig.sent(0x181).len(), 1, "once at the start");
    // RPDO1 by default: the controlword, acting at once.
    rig.send(0x201, &[0x06, 0]);
    rig.run_ms(5);
    let sent = rig.sent(0x181);
    assert_eq!(sent.len(), 2);
    assert_eq!(sent[1][0] & 0x6F, 0x21);
    rig.run_ms(100);
    assert_eq!(rig.sent(0x181).len(), 2);
    assert!(rig.sent(0x281).is_empty(), "off by default");
}

#[test]
fn a_foreign_frame_on_an_own_tpdo_is_8150() {
    let mut rig = configured();
    rig.send(0x181, &[0; 6]);
    rig.run_ms(5);
    assert_eq!(rig.sent(0x081), [[0x50, 0x81, 0x10, 0, 0, 0, 0, 0]]);
}

#[test]
fn sdo_answers_take_their_latency() {
    let mut rig = Rig::booted(config(1));
    let mut delays = Vec::new();
    for _ in 0..200 {
        rig.log.clear();
        let at = rig.now;
        rig.sdo([0x40, 0x00, 0x10, 0, 0, 0, 0, 0]).unwrap();
        delays.push(rig.log[0].0.since(at + Time::from_us(102)).as_us());
    }
    let (min, max) = (delays.iter().min().unwrap(), delays.iter().max().unwrap());
    assert!(*min >= 199 && *min < 230, "{min}");
    assert!(*max <= 1001 && *max > 950, "{max}");
}

#[test]
fn requests_wait_for_their_turn() {
    let mut rig = Rig::booted(config(1));
    for sub in 1..=4 {
        rig.send(0x601, &[0x40, 0x18, 0x10, sub, 0, 0, 0, 0]);
    }
    rig.run_ms(10);
    let subs: Vec<_> = rig.sent(0x581).iter().map(|data| data[3]).collect();
    assert_eq!(subs, [1, 2, 3, 4]);
}

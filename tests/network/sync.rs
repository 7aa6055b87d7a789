//! SYNC on the wire (CiA 301, 7.2.5).

use canmaster::sdo::AbortCode;
use canmaster::sync::{Sync, SyncCobId, SyncCounter};
use canmaster::{CobId, Frame};

#[test]
fn without_a_counter_a_sync_has_no_data_and_is_no_remote_frame() {
    let mut counter = SyncCounter::NONE;
    for _ in 0..3 {
        let frame = counter.frame(CobId::SYNC);
        assert_eq!(
            frame,
            Frame::data_frame(CobId::new(0x80).unwrap(), &[]).unwrap()
        );
        assert!(!frame.is_remote());
        assert_eq!(Sync::decode(&frame, CobId::SYNC), Some(Sync::Plain));
    }
}

#[test]
fn the_counter_runs_from_1_to_its_overflow_value() {
    let mut counter = SyncCounter::new(3, 0).unwrap();
    let mut next = || counter.frame(CobId::SYNC).data().to_vec();
    for expected in [1, 2, 3, 1, 2] {
        assert_eq!(next(), [expected]);
    }
    counter.reset();
    let frame = counter.frame(CobId::SYNC);
    assert_eq!(frame.data(), [1]);
    let sync = Sync::decode(&frame, CobId::SYNC).unwrap();
    assert_eq!((sync, sync.counter()), (Sync::Counted(1), Some(1)));
}

#[test]
fn overflow_values() {
    for overflow in 0..=u8::MAX {
        let legal = overflow == 0 || (2..=240).contains(&overflow);
        match SyncCounter::new(overflow, 0) {
            Ok(counter) => {
                assert!(legal);
                assert_eq!(counter.overflow(), overflow);
            }
            Err(code) => assert!(!legal && code == AbortCode::VALUE_RANGE),
        }
        assert_eq!(
            SyncCounter::new(overflow, 10_000),
            Err(AbortCode::DEVICE_STATE)
        );
    }
}

#[test]
fn the_cob_id_word() {
    let word = SyncCobId(0x4000_0080);
    assert!(word.is_producer());
    assert_eq!(word.id(), Some(CobId::SYNC));
    assert_eq!(word.producer(false), SyncCobId::DEFAULT);
    assert_eq!(SyncCobId::DEFAULT.producer(true), word);
    assert_eq!(SyncCobId(0x2000_0080).id(), None);
}

#[test]
fn what_is_no_sync() {
    let other = Frame::empty(CobId::TIME);
    assert_eq!(Sync::decode(&other, CobId::SYNC), None);
    let remote = Frame::remote_frame(CobId::SYNC, 0).unwrap();
    assert_eq!(Sync::decode(&remote, CobId::SYNC), None);
    let long = Frame::data_frame(CobId::SYNC, &[1, 2]).unwrap();
    assert_eq!(Sync::decode(&long, CobId::SYNC), Some(Sync::WrongLength(2)));
}

//! TIME: 1012h, the clock, and the wire (CiA 301, 7.2.6).

use crate::rig::{Bench, ms};
use canmaster::nmt::State;
use canmaster::sdo::AbortCode;
use canmaster::time_of_day::{Clock, TimeCobId, TimeOfDay};
use canmaster::{CobId, Frame, Instant};
use proptest::prelude::*;

/// 2026-11-22, 12:00: day 15 666.
const NOON: [u8; 6] = [0x00, 0x2E, 0x93, 0x02, 0x32, 0x3D];

fn time(data: &[u8]) -> Frame {
    Frame::data_frame(CobId::TIME, data).unwrap()
}

#[test]
fn the_clock_has_to_be_set() {
    let mut b = Bench::new();
    assert_eq!(b.read(0x2F10, 0), Err(AbortCode::NO_DATA));
    assert_eq!(b.write(0x2F10, 0, &NOON), Ok(()));
    b.now = ms(1500);
    let later = TimeOfDay::new(15_666, 43_201_500).unwrap();
    assert_eq!(b.read(0x2F10, 0), Ok(later.encode().to_vec()));
    // No such time of day.
    let late = [0x00, 0x5C, 0x26, 0x05, 0, 0];
    assert_eq!(b.write(0x2F10, 0, &late), Err(AbortCode::VALUE_RANGE));
}

#[test]
fn it_is_produced_once_it_is_known() {
    let mut b = Bench::new();
    b.write_u32(0x1012, 0, 0x4000_0100).unwrap();
    assert_eq!(b.poll(), None);
    b.write(0x2F10, 0, &NOON).unwrap();
    b.now = ms(1000);
    let sent = b.poll().unwrap();
    assert_eq!(sent, time(&[0xE8, 0x31, 0x93, 0x02, 0x32, 0x3D]));
    assert_eq!(b.poll(), None);
    assert_eq!(b.device.next_deadline(), Some(ms(2000)));
    b.write_u16(0x2F11, 0, 0).unwrap();
    assert_eq!(b.device.next_deadline(), None);
    b.write_u16(0x2F11, 0, 10).unwrap();
    assert!(b.poll().is_some());
    b.enter(State::Stopped);
    b.now = ms(3000);
    assert_eq!(b.poll(), None);
}

#[test]
fn it_is_consumed_if_1012h_says_so() {
    let mut b = Bench::new();
    assert_eq!(b.frame(&time(&NOON)), None);
    assert_eq!(b.read(0x2F10, 0), Err(AbortCode::NO_DATA));
    b.write_u32(0x1012, 0, 0x8000_0100).unwrap();
    for wrong in [&NOON[..5], &[0xFF; 6], &[0; 8]] {
        b.frame(&time(wrong));
        assert_eq!(b.read(0x2F10, 0), Err(AbortCode::NO_DATA));
    }
    b.enter(State::Stopped);
    b.frame(&time(&NOON));
    b.enter(State::Operational);
    assert_eq!(b.read(0x2F10, 0), Err(AbortCode::NO_DATA));
    b.frame(&time(&NOON));
    assert_eq!(b.read(0x2F10, 0), Ok(NOON.to_vec()));
}

#[test]
fn the_identifier_stays_while_it_is_in_use() {
    let off = TimeCobId::DEFAULT;
    let on = TimeCobId(0x4000_0100);
    let other = TimeCobId(0x4000_0090);
    assert_eq!(on.may_replace(off), Ok(()));
    assert_eq!(other.may_replace(off), Ok(()));
    assert_eq!(other.may_replace(on), Err(AbortCode::VALUE_RANGE));
    assert_eq!(off.may_replace(on), Ok(()));
}

#[test]
fn midnight() {
    let mut clock = Clock::new();
    assert_eq!(clock.time(ms(5)), None);
    clock.set(TimeOfDay::new(9, 86_399_999).unwrap(), ms(10));
    assert_eq!(clock.time(ms(10)), TimeOfDay::new(9, 86_399_999));
    assert_eq!(clock.time(ms(11)), TimeOfDay::new(10, 0));
    for hour in 1..=72 {
        clock.advance(ms(11 + hour * 3_600_000));
    }
    assert_eq!(clock.time(ms(11 + 3 * 86_400_000)), TimeOfDay::new(13, 0));
    clock.advance(Instant::from_micros(u64::MAX));
    assert!(clock.time(Instant::from_micros(u64::MAX)).is_some());
}

proptest! {
    #[test]
    fn what_is_encoded_is_decoded(days: u16, ms in 0u32..86_400_000) {
        let time = TimeOfDay::new(days, ms).unwrap();
        prop_assert_eq!(TimeOfDay::decode(time.encode()), Some(time));
        prop_assert_eq!(TimeOfDay::from_frame(&time.frame(CobId::TIME), CobId::TIME), Some(time));
    }

    #[test]
    fn anything_decodes_or_not(bytes: [u8; 6]) {
        if let Some(time) = TimeOfDay::decode(bytes) {
            prop_assert!(time.ms < 86_400_000);
        }
    }
}

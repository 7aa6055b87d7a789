//! The master's own emergencies: 1001h, 1003h, 1014h, 1015h (CiA 301, 7.2.7).

use crate::rig::{Bench, ms, node};
use canmaster::device::MasterError;
use canmaster::emcy::EmcyCode;
use canmaster::nmt::State;
use canmaster::sdo::AbortCode;
use canmaster::{CobId, Frame};

const LOST_3: MasterError = MasterError::NodeLost {
    node: canmaster::NodeId::constant::<3>(),
};

fn emcy(data: [u8; 8]) -> Option<Frame> {
    Some(Frame::full(CobId::new(0x0FF).unwrap(), data))
}

#[test]
fn an_error_comes_and_goes() {
    let mut b = Bench::new();
    assert_eq!(b.poll(), None);
    b.device.raise(LOST_3);
    // 8130h, communication and generic, node 3.
    assert_eq!(b.poll(), emcy([0x30, 0x81, 0x11, 3, 0, 0, 0, 0]));
    assert_eq!(b.poll(), None);
    assert_eq!(b.number(0x1001, 0), Ok(0x11));
    assert_eq!(b.number(0x1003, 0), Ok(1));
    assert_eq!(b.number(0x1003, 1), Ok(0x0003_8130));
    b.device.clear(LOST_3);
    assert_eq!(b.poll(), emcy([0; 8]));
    assert_eq!(b.number(0x1001, 0), Ok(0));
    // The field keeps it until 0 is written.
    assert_eq!(b.number(0x1003, 1), Ok(0x0003_8130));
    assert_eq!(b.write_u8(0x1003, 0, 0), Ok(()));
    assert_eq!(b.number(0x1003, 0), Ok(0));
    assert_eq!(b.number(0x1003, 1), Err(AbortCode::NO_DATA));
}

#[test]
fn an_error_that_is_there_is_not_told_twice() {
    let mut b = Bench::new();
    b.device.raise(LOST_3);
    b.device.raise(LOST_3);
    assert!(b.poll().is_some());
    assert_eq!(b.poll(), None);
    assert_eq!(b.number(0x1003, 0), Ok(1));
    // Of another node it is another error.
    b.device.raise(MasterError::NodeLost { node: node(4) });
    assert_eq!(b.poll(), emcy([0x30, 0x81, 0x11, 4, 0, 0, 0, 0]));
    // One of two has gone: the register still says so.
    b.device.clear(LOST_3);
    assert_eq!(b.poll(), emcy([0, 0, 0x11, 0, 0, 0, 0, 0]));
    b.device.clear(LOST_3);
    assert_eq!(b.poll(), None);
}

#[test]
fn the_field_holds_the_newest_eight_newest_first() {
    let mut b = Bench::new();
    for n in 1..=10 {
        b.device.raise(MasterError::NodeLost { node: node(n) });
    }
    assert_eq!(b.number(0x1003, 0), Ok(8));
    for sub in 1..=8 {
        let n = u64::from(11 - sub);
        assert_eq!(b.number(0x1003, sub), Ok(n << 16 | 0x8130));
    }
    // The queue keeps the newest too.
    assert_eq!(b.poll(), emcy([0x30, 0x81, 0x11, 3, 0, 0, 0, 0]));
}

#[test]
fn every_error_on_the_wire() {
    let code = EmcyCode(0x3210);
    for (error, data) in [
        (MasterError::Overrun, [0x10, 0x81, 0x11, 0, 0, 0, 0, 0]),
        (MasterError::ErrorPassive, [0x20, 0x81, 0x11, 0, 0, 0, 0, 0]),
        (
            MasterError::BusOffRecovered,
            [0x40, 0x81, 0x11, 0, 0, 0, 0, 0],
        ),
        (
            MasterError::PdoLength {
                node: node(2),
                tpdo: 1,
                short: true,
            },
            [0x10, 0x82, 0x11, 2, 1, 0, 0, 0],
        ),
        (
            MasterError::PdoLength {
                node: node(2),
                tpdo: 1,
                short: false,
            },
            [0x20, 0x82, 0x11, 2, 1, 0, 0, 0],
        ),
        (
            MasterError::PdoMissing {
                node: node(2),
                tpdo: 2,
            },
            [0x50, 0x82, 0x11, 2, 2, 0, 0, 0],
        ),
        (MasterError::Watchdog, [0x10, 0x60, 0x01, 0, 0, 0, 0, 0]),
        (MasterError::Storage, [0x30, 0x55, 0x01, 0, 0, 0, 0, 0]),
        (
            MasterError::BootFailed {
                node: node(6),
                letter: b'K',
            },
            [0x40, 0xFF, 0x81, 6, b'K', 0, 0, 0],
        ),
        (
            MasterError::AxisFault {
                node: node(5),
                code,
            },
            [0x41, 0xFF, 0x81, 5, 0x10, 0x32, 0, 0],
        ),
    ] {
        let mut b = Bench::new();
        b.device.raise(error);
        assert_eq!(b.poll(), emcy(data), "{error:?}");
        b.device.clear(error);
        assert_eq!(b.poll(), emcy([0; 8]));
    }
}

#[test]
fn the_inhibit_time_is_kept() {
    let mut b = Bench::new();
    // 100 us each: 20 ms.
    b.write_u16(0x1015, 0, 200).unwrap();
    b.now = ms(5);
    b.device.raise(LOST_3);
    b.device.raise(MasterError::Overrun);
    assert!(b.poll().is_some());
    assert_eq!(b.poll(), None);
    assert_eq!(b.device.next_deadline(), Some(ms(25)));
    b.now = ms(24);
    assert_eq!(b.poll(), None);
    b.now = ms(25);
    assert!(b.poll().is_some());
    assert_eq!(b.device.next_deadline(), None);
}

#[test]
fn emergencies_wait_for_a_state_that_allows_them() {
    let mut b = Bench::new();
    for state in [State::Initialising, State::Stopped] {
        b.enter(state);
        b.device.raise(LOST_3);
        assert_eq!(b.poll(), None);
        assert_eq!(b.device.next_deadline(), None);
    }
    b.enter(State::Operational);
    assert_eq!(b.poll(), emcy([0x30, 0x81, 0x11, 3, 0, 0, 0, 0]));
}

#[test]
fn the_identifier_is_1014h() {
    let mut b = Bench::new();
    b.write_u32(0x1014, 0, 0x8000_00FF).unwrap();
    b.device.raise(LOST_3);
    assert_eq!(b.poll(), None);
    b.write_u32(0x1014, 0, 0x0000_0091).unwrap();
    b.device.raise(MasterError::Overrun);
    assert_eq!(b.poll().unwrap().id(), CobId::new(0x91).unwrap());
    // What came while it was switched off is not sent later.
    assert_eq!(b.poll(), None);
}

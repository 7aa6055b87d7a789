//! 2F12h: a transfer of test data by SDO.

use crate::rig::{Bench, node};
use canmaster::boot::Event;
use canmaster::id::Address;
use canmaster::sdo::{AbortCode, Protocol};

const TEST: u16 = 0x2F12;
/// 2FF0h:05 of node 3.
const TARGET: u32 = 0x2FF0_0503;

/// Everything is set but the command.
fn described() -> Bench {
    let mut b = Bench::new();
    for (sub, word) in [(1, TARGET), (2, 100_000), (3, 0xDEAD_BEEF)] {
        b.write(TEST, sub, &word.to_le_bytes()).unwrap();
    }
    b
}

fn start(b: &mut Bench, command: u32) -> Result<(), AbortCode> {
    b.write(TEST, 4, &command.to_le_bytes())
}

#[test]
fn what_is_written_is_started() {
    for (command, upload, protocol) in [
        (1, false, Protocol::Normal),
        (2, true, Protocol::Normal),
        (3, false, Protocol::Block),
        (4, true, Protocol::Block),
    ] {
        let mut b = described();
        assert_eq!(start(&mut b, command), Ok(()));
        let test = *b.device.transfer();
        assert!(test.is_under_way());
        assert_eq!(test.node(), Some(node(3)));
        assert_eq!(test.at(), Address::new(0x2FF0, 5));
        assert_eq!((test.size(), test.seed()), (100_000, 0xDEAD_BEEF));
        assert_eq!((test.is_upload(), test.protocol()), (upload, protocol));
    }
}

#[test]
fn what_it_comes_to_is_read() {
    let mut b = described();
    assert_eq!(b.number(TEST, 0), Ok(7));
    assert_eq!(b.number(TEST, 1), Ok(TARGET.into()));
    assert_eq!(b.number(TEST, 4), Err(AbortCode::WRITE_ONLY));
    assert_eq!(b.number(TEST, 7), Ok(0x0800_0024), "there was none");
    start(&mut b, 1).unwrap();
    assert_eq!(b.number(TEST, 5), Ok(0));
    assert_eq!(b.number(TEST, 7), Ok(0xFFFF_FFFF), "under way");
    b.device.transfer().end(50_000, 1000, Err(AbortCode::CRC));
    assert_eq!(b.number(TEST, 5), Ok(50_000));
    assert_eq!(b.number(TEST, 6), Ok(1000));
    assert_eq!(b.number(TEST, 7), Ok(0x0504_0004));
    start(&mut b, 2).unwrap();
    assert_eq!(b.number(TEST, 5), Ok(0), "anew");
    b.device.transfer().end(100_000, 2000, Ok(()));
    assert_eq!(b.number(TEST, 7), Ok(0));
    assert_eq!(b.number(TEST, 2), Ok(100_000));
    assert_eq!(b.number(TEST, 8), Err(AbortCode::NO_SUCH_SUB_INDEX));
}

#[test]
fn nonsense_is_refused() {
    let mut b = described();
    for command in [0, 5, 0x101, u32::MAX] {
        assert_eq!(start(&mut b, command), Err(AbortCode::VALUE_RANGE));
    }
    for target in [0, 0x2FF0_0080, 0x2FF0_00FF_u32] {
        b.write(TEST, 1, &target.to_le_bytes()).unwrap();
        assert_eq!(start(&mut b, 1), Err(AbortCode::VALUE_RANGE));
    }
    assert!(!b.device.transfer().is_under_way());
}

#[test]
fn not_while_an_axis_is_enabled_or_the_node_boots() {
    let mut b = described();
    b.device.set_axes_enabled(true);
    assert_eq!(start(&mut b, 3), Err(AbortCode::DEVICE_STATE));
    b.device.set_axes_enabled(false);
    b.boot(Event::ResetSent);
    assert_eq!(start(&mut b, 3), Err(AbortCode::DEVICE_STATE));
    b.boot(Event::BootUp(node(3)));
    assert_eq!(start(&mut b, 3), Err(AbortCode::DEVICE_STATE));
    b.boot(Event::Operational(node(3)));
    assert_eq!(start(&mut b, 3), Ok(()));
    assert_eq!(start(&mut b, 3), Err(AbortCode::DEVICE_STATE), "under way");
}

#[test]
fn a_node_that_the_network_does_not_name_can_be_tested() {
    let mut b = described();
    b.boot(Event::ResetSent);
    b.write(TEST, 1, &0x2FF0_000A_u32.to_le_bytes()).unwrap();
    assert_eq!(start(&mut b, 4), Ok(()));
}

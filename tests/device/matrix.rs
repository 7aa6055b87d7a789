//! Every object of the dictionary: its type, its access, and in which NMT state
//! it answers what.

use crate::rig::Bench;
use canmaster::nmt::State;
use canmaster::sdo::AbortCode;

/// Who may do what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Access {
    /// 06010002h
    Read,
    /// What is read can be written back.
    ReadWrite,
    /// The same, but only in pre-operational: 08000022h.
    ReadWritePreOperational,
    /// 06010001h
    Write,
    /// Can be written, but not with what it reads as.
    Command,
}

/// Index, sub-index, bytes (0: a string or domain), access.
const OBJECTS: &[(u16, u8, usize, Access)] = {
    use Access::{Command, Read, ReadWrite, ReadWritePreOperational, Write};
    &[
        (0x1000, 0, 4, Read),
        (0x1001, 0, 1, Read),
        (0x1002, 0, 4, Read),
        (0x1003, 0, 1, ReadWrite),
        (0x1005, 0, 4, ReadWritePreOperational),
        (0x1006, 0, 4, ReadWritePreOperational),
        (0x1007, 0, 4, ReadWritePreOperational),
        (0x1008, 0, 0, Read),
        (0x1009, 0, 0, Read),
        (0x100A, 0, 0, Read),
        (0x1010, 0, 1, Read),
        (0x1010, 1, 4, Command),
        (0x1011, 0, 1, Read),
        (0x1011, 1, 4, Command),
        (0x1012, 0, 4, ReadWrite),
        (0x1014, 0, 4, ReadWrite),
        (0x1015, 0, 2, ReadWrite),
        (0x1016, 0, 1, Read),
        (0x1016, 1, 4, ReadWrite),
        (0x1016, 6, 4, ReadWrite),
        (0x1017, 0, 2, ReadWrite),
        (0x1018, 0, 1, Read),
        (0x1018, 1, 4, Read),
        (0x1018, 4, 4, Read),
        (0x1020, 0, 1, Read),
        (0x1020, 1, 4, ReadWrite),
        (0x1020, 2, 4, ReadWrite),
        (0x1028, 0, 1, Read),
        (0x1028, 127, 4, Read),
        (0x1029, 0, 1, Read),
        (0x1029, 1, 1, ReadWrite),
        (0x1200, 0, 1, Read),
        (0x1200, 2, 4, Read),
        (0x1280, 0, 1, Read),
        (0x1285, 3, 1, Read),
        (0x1400, 0, 1, Read),
        (0x1400, 1, 4, Read),
        (0x140B, 2, 1, Read),
        (0x1600, 0, 1, Read),
        (0x160B, 2, 4, Read),
        (0x1800, 1, 4, ReadWrite),
        (0x180B, 2, 1, Read),
        (0x1A00, 1, 4, Read),
        (0x1A0B, 2, 4, Read),
        (0x1F22, 0, 1, Read),
        (0x1F22, 6, 0, Read),
        (0x1F25, 0, 1, Read),
        (0x1F25, 1, 4, Write),
        (0x1F25, 0x80, 4, Write),
        (0x1F26, 0, 1, Read),
        (0x1F26, 1, 4, Read),
        (0x1F27, 127, 4, Read),
        (0x1F80, 0, 4, ReadWrite),
        (0x1F81, 0, 1, Read),
        (0x1F81, 6, 4, ReadWrite),
        (0x1F81, 7, 4, Read),
        (0x1F82, 0, 1, Read),
        (0x1F82, 1, 1, Command),
        (0x1F82, 0x80, 1, Write),
        (0x1F84, 1, 4, Read),
        (0x1F85, 1, 4, Read),
        (0x1F86, 1, 4, Read),
        (0x1F87, 1, 4, Read),
        (0x1F88, 127, 4, Read),
        (0x1F89, 0, 4, ReadWrite),
        (0x1F8A, 1, 1, Read),
        (0x2F00, 1, 1, Read),
        (0x2F01, 0, 1, Read),
        (0x2F01, 127, 0, Read),
        (0x2F02, 1, 0, Read),
        (0x2F10, 0, 6, ReadWrite),
        (0x2F11, 0, 2, ReadWrite),
        (0x2F12, 0, 1, Read),
        (0x1804, 1, 4, Read),
        (0x2000, 0, 2, ReadWrite),
        (0x2001, 0, 1, Read),
        (0x2002, 0, 4, Read),
        (0x2003, 0, 4, ReadWrite),
        (0x2004, 1, 4, ReadWrite),
        (0x2005, 6, 4, ReadWrite),
        (0x2006, 1, 4, ReadWrite),
        (0x2007, 0, 4, ReadWrite),
        (0x2008, 6, 1, ReadWrite),
        (0x2009, 1, 4, Read),
        (0x200A, 6, 4, Read),
        (0x200B, 1, 4, Read),
        (0x200C, 1, 4, Read),
        (0x200D, 1, 2, Read),
        (0x200E, 1, 4, Read),
        (0x2010, 0, 2, Read),
        (0x2F12, 1, 4, ReadWrite),
        (0x2F12, 2, 4, ReadWrite),
        (0x2F12, 3, 4, ReadWrite),
        (0x2F12, 4, 4, Write),
        (0x2F12, 5, 4, Read),
        (0x2F12, 7, 4, Read),
        (0x2F20, 1, 4, ReadWrite),
        (0x2F20, 13, 4, Read),
        (0x2F81, 0, 1, ReadWrite),
        (0x3001, 0, 1, Read),
        (0x3001, 1, 2, Read),
        (0x3006, 8, 4, Read),
    ]
};

fn bench(state: State) -> Bench {
    let mut b = Bench::new();
    // Only then 1019h can be written and the clock be read.
    b.write(0x2F10, 0, &[0; 6]).unwrap();
    b.events();
    b.enter(state);
    b
}

#[test]
fn every_object_has_its_size_and_access_in_every_state() {
    for state in [State::PreOperational, State::Operational] {
        for &(index, sub, size, access) in OBJECTS {
            let mut b = bench(state);
            let name = std::format!("{index:04X}h:{sub:02X} in {state}");
            let read = b.read(index, sub);
            if access == Access::Write {
                assert_eq!(read, Err(AbortCode::WRITE_ONLY), "{name}");
            } else {
                let data = read
                    .as_ref()
                    .unwrap_or_else(|code| panic!("{name}: {code}"));
                assert!(size == 0 || data.len() == size, "{name}: {data:?}");
            }
            let data = match access {
                // A word nobody accepts.
                Access::Write | Access::Command => vec![0xEE; size],
                _ => read.unwrap(),
            };
            let data = if size == 0 { vec![0; 5] } else { data };
            let written = b.write(index, sub, &data);
            match access {
                Access::Read => assert_eq!(written, Err(AbortCode::READ_ONLY), "{name}"),
                Access::ReadWrite => assert_eq!(written, Ok(()), "{name}"),
                Access::ReadWritePreOperational => {
                    let expected = match state {
                        State::PreOperational => Ok(()),
                        _ => Err(AbortCode::DEVICE_STATE),
                    };
                    assert_eq!(written, expected, "{name}");
                }
                Access::Command | Access::Write => {
                    let refused = matches!(
                        written,
                        Err(AbortCode::CANNOT_STORE | AbortCode::VALUE_RANGE)
                    );
                    assert!(refused, "{name}: {written:?}");
                }
            }
            if matches!(access, Access::ReadWrite) && size < 4 {
                let long = b.write(index, sub, &vec![0; size + 1]);
                assert_eq!(long, Err(AbortCode::TOO_LONG), "{name}");
            }
        }
    }
}

/// Where a client may write at all: objects, sub-indices.
const WRITABLE: &[(std::ops::RangeInclusive<u16>, std::ops::RangeInclusive<u8>)] = &[
    (0x1003..=0x1003, 0..=0),
    (0x1005..=0x1007, 0..=0),
    (0x1010..=0x1011, 1..=1),
    (0x1012..=0x1012, 0..=0),
    (0x1014..=0x1015, 0..=0),
    (0x1016..=0x1016, 1..=6),
    (0x1017..=0x1017, 0..=0),
    (0x1019..=0x1019, 0..=0),
    (0x1020..=0x1020, 1..=2),
    (0x1029..=0x1029, 1..=1),
    // The TPDOs of the board's own.
    (0x1800..=0x1803, 1..=2),
    (0x1F25..=0x1F25, 1..=128),
    (0x1F80..=0x1F80, 0..=0),
    // Of the nodes that the network has.
    (0x1F81..=0x1F81, 1..=6),
    (0x1F82..=0x1F82, 1..=128),
    (0x1F89..=0x1F89, 0..=0),
    (0x2000..=0x2000, 0..=0),
    (0x2003..=0x2003, 0..=0),
    (0x2004..=0x2006, 1..=6),
    (0x2007..=0x2007, 0..=0),
    (0x2008..=0x2008, 1..=6),
    (0x200F..=0x200F, 0..=0),
    (0x2F10..=0x2F11, 0..=0),
    (0x2F12..=0x2F12, 1..=4),
    (0x2F20..=0x2F20, 1..=1),
    (0x2F81..=0x2F86, 0..=0),
];

/// What follows from the design of the network is constant: 06010002h for every
/// entry of the whole dictionary that is not named above, and for none that is.
#[test]
fn everything_else_is_constant() {
    let mut b = Bench::new();
    let mut constant = 0;
    for index in 0x1000..=0x3100 {
        for sub in 0..=255 {
            let missing = [AbortCode::NO_SUCH_OBJECT, AbortCode::NO_SUCH_SUB_INDEX];
            // A length that no entry has, so that nothing is changed.
            let written = b.write(index, sub, &[0; 7]);
            if written.is_err_and(|code| missing.contains(&code)) {
                continue;
            }
            let writable = WRITABLE
                .iter()
                .any(|(objects, subs)| objects.contains(&index) && subs.contains(&sub));
            let expected = if writable {
                AbortCode::TOO_LONG
            } else {
                constant += 1;
                AbortCode::READ_ONLY
            };
            assert_eq!(written, Err(expected), "{index:04X}h:{sub:02X}");
        }
    }
    assert!(constant > 1000, "{constant} entries");
    assert_eq!(b.events(), []);
}

/// Sub-index 0 of records and arrays: the last entry, as an UNSIGNED8.
#[test]
fn sub_index_0_names_the_last_entry() {
    let mut b = Bench::new();
    for (objects, last) in [
        (0x1010..=0x1011, 1),
        (0x1016..=0x1016, 6),
        (0x1018..=0x1018, 4),
        (0x1020..=0x1020, 2),
        (0x1028..=0x1028, 127),
        (0x1029..=0x1029, 1),
        (0x1200..=0x1200, 2),
        (0x1280..=0x1285, 3),
        (0x1400..=0x140B, 2),
        (0x1600..=0x160B, 2),
        (0x1800..=0x181B, 2),
        (0x1A00..=0x1A1B, 2),
        (0x1F22..=0x1F22, 127),
        (0x1F25..=0x1F25, 128),
        (0x1F26..=0x1F27, 127),
        (0x1F81..=0x1F81, 127),
        (0x1F82..=0x1F82, 128),
        (0x1F84..=0x1F88, 127),
        (0x1F8A..=0x1F8A, 127),
        (0x2004..=0x2006, 6),
        (0x2008..=0x200E, 6),
        (0x2F00..=0x2F02, 127),
        (0x3001..=0x3006, 12),
    ] {
        for index in objects {
            assert_eq!(b.read(index, 0), Ok(vec![last]), "{index:04X}h");
        }
    }
}

/// The edges of the ranges: what is taken and what is refused, each from the
/// design's settings.
#[test]
fn edges_of_the_ranges() {
    const TAKEN: Result<(), AbortCode> = Ok(());
    const RANGE: Result<(), AbortCode> = Err(AbortCode::VALUE_RANGE);
    const HIGH: Result<(), AbortCode> = Err(AbortCode::VALUE_TOO_HIGH);
    const LOW: Result<(), AbortCode> = Err(AbortCode::VALUE_TOO_LOW);
    for (index, sub, size, value, expected) in [
        (0x1003, 0, 1, 0, TAKEN),
        (0x1003, 0, 1, 255, RANGE),
        (0x1005, 0, 4, 0x0000_0080, TAKEN),
        (0x1005, 0, 4, 0x4000_0080, TAKEN),
        (0x1005, 0, 4, 0x4000_0081, RANGE),
        (0x1006, 0, 4, 0, TAKEN),
        (0x1006, 0, 4, 999, LOW),
        (0x1006, 0, 4, 1000, TAKEN),
        (0x1006, 0, 4, 65_535, TAKEN),
        (0x1006, 0, 4, 65_536, HIGH),
        (0x1006, 0, 4, u32::MAX, HIGH),
        (0x1007, 0, 4, 0, TAKEN),
        (0x1007, 0, 4, 299, LOW),
        (0x1007, 0, 4, 300, TAKEN),
        (0x1007, 0, 4, 10_000, TAKEN),
        (0x1007, 0, 4, 10_001, HIGH),
        (0x1014, 0, 4, 0x0000_00FF, TAKEN),
        (0x1014, 0, 4, 0x8000_00FF, TAKEN),
        (0x1014, 0, 4, 0x4000_00FF, RANGE),
        (0x1015, 0, 2, 0xFFFF, TAKEN),
        (0x1016, 1, 4, 0x007F_FFFF, TAKEN),
        (0x1016, 1, 4, 0x0100_0001, RANGE),
        (0x1017, 0, 2, 0, TAKEN),
        (0x1017, 0, 2, 0xFFFF, TAKEN),
        (0x1029, 1, 1, 2, TAKEN),
        (0x1029, 1, 1, 3, RANGE),
        (0x1F80, 0, 4, 0x5F, TAKEN),
        // Flying master is not offered.
        (0x1F80, 0, 4, 0x21, RANGE),
        (0x1F80, 0, 4, 0x80, RANGE),
        (0x1F81, 1, 4, 0xFFFF_FF9D, TAKEN),
        // Neither are check and update of the program.
        (0x1F81, 1, 4, 0x25, RANGE),
        (0x1F81, 1, 4, 0x45, RANGE),
        (0x1F82, 1, 1, 128, RANGE),
        (0x1F89, 0, 4, 0, TAKEN),
        (0x1F89, 0, 4, u32::MAX, HIGH),
        (0x2F81, 0, 1, 1, RANGE),
    ] {
        let mut b = Bench::new();
        let data = &value.to_le_bytes()[..size];
        let name = std::format!("{index:04X}h:{sub:02X} = {value:X}h");
        assert_eq!(b.write(index, sub, data), expected, "{name}");
        // One byte too many, and one too few.
        let long = [data, &[0]].concat();
        assert_eq!(
            b.write(index, sub, &long),
            Err(AbortCode::TOO_LONG),
            "{name}"
        );
        if size > 1 {
            let short = b.write(index, sub, &data[1..]);
            assert_eq!(short, Err(AbortCode::TOO_SHORT), "{name}");
        }
    }
}

#[test]
fn nothing_answers_where_sdo_is_not_allowed() {
    for state in [State::Initialising, State::Stopped] {
        let mut b = bench(state);
        for &(index, sub, ..) in OBJECTS {
            let [low, high] = index.to_le_bytes();
            assert_eq!(b.ask([0x40, low, high, sub, 0, 0, 0, 0]), None);
            assert_eq!(b.ask([0x2F, low, high, sub, 0, 0, 0, 0]), None);
        }
        b.enter(State::PreOperational);
        assert_eq!(b.events(), []);
    }
}

#[test]
fn a_transfer_ends_where_sdo_ends() {
    let mut b = Bench::new();
    b.ask([0x40, 0x08, 0x10, 0, 0, 0, 0, 0]);
    b.enter(State::Stopped);
    b.enter(State::PreOperational);
    // 05040001h: there is no transfer to go on with.
    b.expect(
        [0x60, 0, 0, 0, 0, 0, 0, 0],
        [0x80, 0, 0, 0, 0x01, 0, 0x04, 0x05],
    );
}

#[test]
fn what_does_not_exist() {
    let mut b = Bench::new();
    for (index, sub, code) in [
        (0x0FFF, 0, AbortCode::NO_SUCH_OBJECT),
        (0x1004, 0, AbortCode::NO_SUCH_OBJECT),
        (0x100C, 0, AbortCode::NO_SUCH_OBJECT),
        (0x1201, 0, AbortCode::NO_SUCH_OBJECT),
        (0x1286, 0, AbortCode::NO_SUCH_OBJECT),
        (0x140C, 0, AbortCode::NO_SUCH_OBJECT),
        (0x1BFF, 0, AbortCode::NO_SUCH_OBJECT),
        (0x1C00, 0, AbortCode::NO_SUCH_OBJECT),
        (0x1F83, 0, AbortCode::NO_SUCH_OBJECT),
        (0x2F80, 0, AbortCode::NO_SUCH_OBJECT),
        (0x2F87, 0, AbortCode::NO_SUCH_OBJECT),
        (0x3000, 0, AbortCode::NO_SUCH_OBJECT),
        (0x3007, 0, AbortCode::NO_SUCH_OBJECT),
        (0x6040, 0, AbortCode::NO_SUCH_OBJECT),
        (0xFFFF, 255, AbortCode::NO_SUCH_OBJECT),
        (0x1000, 1, AbortCode::NO_SUCH_SUB_INDEX),
        (0x1003, 9, AbortCode::NO_SUCH_SUB_INDEX),
        (0x1010, 2, AbortCode::NO_SUCH_SUB_INDEX),
        (0x1016, 7, AbortCode::NO_SUCH_SUB_INDEX),
        (0x1018, 5, AbortCode::NO_SUCH_SUB_INDEX),
        (0x1028, 128, AbortCode::NO_SUCH_SUB_INDEX),
        (0x1200, 3, AbortCode::NO_SUCH_SUB_INDEX),
        (0x1280, 4, AbortCode::NO_SUCH_SUB_INDEX),
        (0x1400, 3, AbortCode::NO_SUCH_SUB_INDEX),
        (0x1600, 3, AbortCode::NO_SUCH_SUB_INDEX),
        (0x1F25, 0x81, AbortCode::NO_SUCH_SUB_INDEX),
        (0x1F81, 128, AbortCode::NO_SUCH_SUB_INDEX),
        (0x2F81, 5, AbortCode::NO_SUCH_SUB_INDEX),
        (0x3001, 13, AbortCode::NO_SUCH_SUB_INDEX),
    ] {
        let name = std::format!("{index:04X}h:{sub:02X}");
        assert_eq!(b.read(index, sub), Err(code), "{name}");
        assert_eq!(b.write_u8(index, sub, 0), Err(code), "{name}");
    }
}

/// Reading the whole dictionary changes nothing and leaves nothing behind.
#[test]
fn the_whole_dictionary_can_be_walked() {
    let mut b = Bench::new();
    let mut found = 0;
    for index in (0x1000..=0x3100).chain([0x6040, 0xA000]) {
        for sub in 0..=255 {
            match b.read(index, sub) {
                Ok(_) | Err(AbortCode::WRITE_ONLY | AbortCode::NO_DATA) => found += 1,
                Err(AbortCode::NO_SUCH_OBJECT | AbortCode::NO_SUCH_SUB_INDEX) => {}
                Err(code) => panic!("{index:04X}h:{sub:02X}: {code}"),
            }
        }
    }
    assert!(found > 1500, "{found} entries");
    assert_eq!(b.events(), []);
}

//! PDOs: mapping, parameters, when they are sent and take effect
//! (CiA 301, 7.2.2, 7.5.2.35 .. 7.5.2.38).

use canmaster::id::Address;
use canmaster::od::{DataType, Entry, Mappable, Object, ObjectDictionary, Table, Value, Values};
use canmaster::pdo::{
    Configuration, Direction, Features, Mapping, MappingEntry, PdoCobId, Reader, Received,
    RpdoState, TpdoState, Transmission, Writer,
};
use canmaster::sdo::AbortCode;
use canmaster::{CobId, Duration, Instant};
use proptest::prelude::*;

const OBJECTS: &[Object] = &[
    Object::constant(0x1000, 0, DataType::Unsigned32, 0x0002_0192),
    Object::rw(0x6040, 0, DataType::Unsigned16, 0).pdo(),
    Object::ro(0x6041, 0, DataType::Unsigned16, 0x0250).pdo(),
    Object::rw(0x6060, 0, DataType::Integer8, 1)
        .limited(-4, 10)
        .mappable(Mappable::Rpdo),
    Object::ro(0x6064, 0, DataType::Integer32, 0).pdo(),
    Object::rw(0x6083, 0, DataType::Unsigned32, 10_000).pdo(),
    Object::rw(0x6084, 0, DataType::Unsigned32, 10_000).pdo(),
    Object::rw(0x60FF, 0, DataType::Integer32, 0).pdo(),
];
const TABLE: Table = Table::new(OBJECTS);

const CONTROLWORD: MappingEntry = MappingEntry::new(0x6040, 0, 16);
const STATUSWORD: MappingEntry = MappingEntry::new(0x6041, 0, 16);
const MODE: MappingEntry = MappingEntry::new(0x6060, 0, 8);
const POSITION: MappingEntry = MappingEntry::new(0x6064, 0, 32);
const ACCELERATION: MappingEntry = MappingEntry::new(0x6083, 0, 32);
const DECELERATION: MappingEntry = MappingEntry::new(0x6084, 0, 32);
const VELOCITY: MappingEntry = MappingEntry::new(0x60FF, 0, 32);

fn values() -> Values<{ OBJECTS.len() }> {
    Values::new(TABLE)
}

fn describe(entry: MappingEntry) -> Result<Entry, AbortCode> {
    values().entry(entry.at())
}

fn id(id: u16) -> CobId {
    CobId::new(id).unwrap()
}

/// As an EPOS4 has it.
fn configuration(direction: Direction) -> Configuration {
    let features = Features {
        highest_sub: 3,
        entries: 12,
        transmission: |t| {
            matches!(
                t,
                Transmission::Synchronous(1) | Transmission::EventProfile | Transmission::Rtr
            )
        },
        mapping_needs_invalid: false,
    };
    let (cob_id, mapping) = match direction {
        Direction::Receive => (PdoCobId::valid(id(0x201)), [CONTROLWORD]),
        Direction::Transmit => (PdoCobId::valid(id(0x181)).without_rtr(), [STATUSWORD]),
    };
    let mapping = Mapping::new(&mapping).unwrap();
    Configuration::new(
        direction,
        features,
        cob_id,
        Transmission::EventProfile,
        mapping,
    )
}

#[test]
fn mapping_entries_as_in_the_object_dictionary() {
    assert_eq!(CONTROLWORD.0, 0x6040_0010);
    assert_eq!(MappingEntry::new(0x30D2, 1, 16).0, 0x30D2_0110);
    let entry = MappingEntry(0x60FF_0020);
    assert_eq!((entry.at(), entry.bits()), (Address::new(0x60FF, 0), 32));
}

#[test]
fn rpdo1_and_rpdo2_of_the_experiment() {
    let mut od = values();
    let rpdo1 = Mapping::new(&[CONTROLWORD, VELOCITY]).unwrap();
    assert_eq!(rpdo1.bytes(), 6);
    let data = Writer::new().u16(0x000F).i32(-1500);
    let frame = data.frame(id(0x201)).unwrap();
    assert_eq!(frame.data(), [0x0F, 0x00, 0x24, 0xFA, 0xFF, 0xFF]);
    assert_eq!(rpdo1.unpack(frame.padded(), &mut od), Ok(()));
    assert_eq!(od.number(0x6040, 0), 0x0F);
    assert_eq!(od.number(0x60FF, 0), -1500);
    let rpdo2 = Mapping::new(&[ACCELERATION, DECELERATION]).unwrap();
    assert_eq!(rpdo2.bytes(), 8);
    let data = Writer::new()
        .u32(3000)
        .u32(u32::MAX)
        .frame(id(0x301))
        .unwrap();
    assert_eq!(rpdo2.unpack(data.padded(), &mut od), Ok(()));
    assert_eq!(od.number(0x6084, 0), 0xFFFF_FFFF);
}

#[test]
fn tpdo1_of_the_experiment() {
    let mut od = values();
    od.put(0x6064, 0, -2);
    let tpdo1 = Mapping::new(&[STATUSWORD, POSITION]).unwrap();
    let (data, len) = tpdo1.pack(&mut od).unwrap();
    assert_eq!(data[..len], [0x50, 0x02, 0xFE, 0xFF, 0xFF, 0xFF]);
    let mut reader = Reader::new(&data[..len]);
    assert_eq!(reader.u16(), Some(0x0250));
    assert_eq!(reader.i32(), Some(-2));
    assert_eq!(reader.u8(), None);
}

#[test]
fn a_refused_value_does_not_keep_the_others_from_theirs() {
    let mut od = values();
    let mapping = Mapping::new(&[MODE, VELOCITY]).unwrap();
    let refused = mapping.unpack([99, 7, 0, 0, 0, 0, 0, 0], &mut od);
    assert_eq!(refused, Err((MODE.at(), AbortCode::VALUE_RANGE)));
    assert_eq!(od.number(0x6060, 0), 1);
    assert_eq!(od.number(0x60FF, 0), 7);
}

#[test]
fn a_pdo_has_64_bits() {
    assert!(Mapping::new(&[VELOCITY, POSITION]).is_some());
    assert_eq!(Mapping::new(&[VELOCITY, POSITION, MODE]), None);
    assert_eq!(Mapping::new(&[MappingEntry::new(0x6060, 0, 1); 13]), None);
    assert_eq!(Writer::new().u32(1).u32(2).u8(3).frame(id(0x201)), None);
}

#[test]
fn remapping_in_the_order_of_the_standard() {
    let mut pdo = configuration(Direction::Receive);
    pdo.write_communication(1, Value::from(0x8000_0201u32))
        .unwrap();
    assert!(!pdo.is_valid());
    pdo.write_mapping(0, Value::from(0u8), describe).unwrap();
    assert_eq!(pdo.bytes(), 0);
    pdo.write_mapping(1, Value::from(CONTROLWORD.0), describe)
        .unwrap();
    pdo.write_mapping(2, Value::from(VELOCITY.0), describe)
        .unwrap();
    pdo.write_mapping(0, Value::from(2u8), describe).unwrap();
    pdo.write_communication(2, Value::from(1u8)).unwrap();
    pdo.write_communication(1, Value::from(0x0000_0201u32))
        .unwrap();
    assert!(pdo.is_valid());
    assert_eq!(pdo.transmission(), Transmission::Synchronous(1));
    assert_eq!(pdo.mapping().entries(), [CONTROLWORD, VELOCITY]);
    assert_eq!(pdo.bytes(), 6);
    assert_eq!(pdo.read_mapping(2), Ok(Value::from(VELOCITY.0)));
    assert_eq!(pdo.read_mapping(3), Ok(Value::from(0u32)));
    assert_eq!(pdo.read_communication(1), Ok(Value::from(0x201u32)));
}

#[test]
fn refusals_of_the_mapping() {
    let mut pdo = configuration(Direction::Receive);
    let entry = |e: MappingEntry| Value::from(e.0);
    assert_eq!(
        pdo.write_mapping(1, entry(VELOCITY), describe),
        Err(AbortCode::SUB0_NOT_ZERO)
    );
    // Bit 31 is not asked for by drives that were seen.
    pdo.write_mapping(0, Value::from(0u8), describe).unwrap();
    for (sub, value, code) in [
        (1, entry(STATUSWORD), AbortCode::NOT_MAPPABLE),
        (
            1,
            entry(MappingEntry::new(0x1000, 0, 32)),
            AbortCode::NOT_MAPPABLE,
        ),
        (
            1,
            entry(MappingEntry::new(0x60FF, 0, 16)),
            AbortCode::NOT_MAPPABLE,
        ),
        (
            1,
            entry(MappingEntry::new(0x60FE, 0, 32)),
            AbortCode::NO_SUCH_OBJECT,
        ),
        (
            1,
            entry(MappingEntry::new(0x60FF, 1, 32)),
            AbortCode::NO_SUCH_SUB_INDEX,
        ),
        (13, entry(VELOCITY), AbortCode::NO_SUCH_SUB_INDEX),
        (0, Value::from(13u8), AbortCode::PDO_LENGTH),
    ] {
        assert_eq!(pdo.write_mapping(sub, value, describe), Err(code));
    }
    for sub in 1..=3 {
        pdo.write_mapping(sub, entry(VELOCITY), describe).unwrap();
    }
    assert_eq!(
        pdo.write_mapping(0, Value::from(3u8), describe),
        Err(AbortCode::PDO_LENGTH)
    );
    assert_eq!(pdo.write_mapping(0, Value::from(2u8), describe), Ok(()));
}

#[test]
fn a_strict_device_wants_bit_31() {
    let mut pdo = configuration(Direction::Transmit);
    let features = Features {
        highest_sub: 6,
        entries: 8,
        transmission: |_| true,
        mapping_needs_invalid: true,
    };
    pdo = Configuration::new(
        Direction::Transmit,
        features,
        pdo.cob_id(),
        pdo.transmission(),
        *pdo.mapping(),
    );
    let off = Value::from(0u8);
    assert_eq!(
        pdo.write_mapping(0, off, describe),
        Err(AbortCode::UNSUPPORTED_ACCESS)
    );
    let inhibit = Value::from(10u16);
    assert_eq!(
        pdo.write_communication(3, inhibit),
        Err(AbortCode::UNSUPPORTED_ACCESS)
    );
    pdo.write_communication(1, Value::from(0xC000_0181u32))
        .unwrap();
    assert_eq!(pdo.write_mapping(0, off, describe), Ok(()));
    assert_eq!(pdo.write_communication(3, inhibit), Ok(()));
    assert_eq!(pdo.write_communication(5, Value::from(100u16)), Ok(()));
    assert_eq!(pdo.write_communication(6, Value::from(3u8)), Ok(()));
    assert_eq!(
        (pdo.inhibit_time(), pdo.event_timer(), pdo.sync_start()),
        (10, 100, 3)
    );
    assert_eq!(pdo.read_communication(4), Err(AbortCode::NO_SUCH_SUB_INDEX));
    assert_eq!(pdo.read_communication(7), Err(AbortCode::NO_SUCH_SUB_INDEX));
}

#[test]
fn refusals_of_the_communication_parameter() {
    let mut pdo = configuration(Direction::Receive);
    for (sub, value, code) in [
        (0, Value::from(2u8), AbortCode::READ_ONLY),
        (1, Value::from(0x0000_0202u32), AbortCode::VALUE_RANGE), // moved while valid
        (1, Value::from(0x2000_0201u32), AbortCode::VALUE_RANGE), // extended
        (1, Value::from(0x0000_0000u32), AbortCode::VALUE_RANGE), // NMT
        (2, Value::from(0u8), AbortCode::VALUE_RANGE),
        (2, Value::from(2u8), AbortCode::VALUE_RANGE),
        (2, Value::from(241u8), AbortCode::VALUE_RANGE),
        (2, Value::from(253u8), AbortCode::VALUE_RANGE), // RTR is for TPDOs
        (4, Value::from(0u8), AbortCode::NO_SUCH_SUB_INDEX),
        (5, Value::from(0u16), AbortCode::NO_SUCH_SUB_INDEX),
    ] {
        assert_eq!(pdo.write_communication(sub, value), Err(code), "sub {sub}");
    }
    let mut tpdo = configuration(Direction::Transmit);
    assert_eq!(tpdo.write_communication(2, Value::from(253u8)), Ok(()));
}

#[test]
fn restricted_identifiers() {
    let off = PdoCobId(0x8000_0201);
    for raw in 0..0x800u32 {
        let restricted = matches!(
            raw,
            0..=0x7F | 0x101..=0x180 | 0x581..=0x5FF | 0x601..=0x67F | 0x6E0..=0x6FF | 0x701..
        );
        assert_eq!(
            PdoCobId(raw).may_replace(off).is_err(),
            restricted,
            "{raw:03X}"
        );
        assert_eq!(PdoCobId(raw | 0x8000_0000).may_replace(off), Ok(()));
    }
    let word = PdoCobId::valid(id(0x281)).without_rtr().invalid();
    assert_eq!(word.0, 0xC000_0281);
    assert!(!word.is_valid() && !word.allows_rtr());
    assert_eq!(word.id(), Some(id(0x281)));
}

#[test]
fn synchronous_data_takes_effect_at_the_next_sync() {
    let mut rpdo = RpdoState::new();
    let sync = Transmission::Synchronous(1);
    assert_eq!(rpdo.sync(), None);
    assert_eq!(rpdo.receive(&[1, 2, 3, 4, 5, 6], 6, sync), Received::AtSync);
    assert_eq!(
        rpdo.receive(&[6, 5, 4, 3, 2, 1, 9, 9], 6, sync),
        Received::AtSync
    );
    assert_eq!(rpdo.sync(), Some([6, 5, 4, 3, 2, 1, 0, 0]));
    assert_eq!(rpdo.sync(), None);
    let event = Transmission::EventProfile;
    assert_eq!(
        rpdo.receive(&[7; 2], 2, event),
        Received::Now([7, 7, 0, 0, 0, 0, 0, 0])
    );
    let short = Received::TooShort {
        expected: 6,
        received: 5,
    };
    assert_eq!(rpdo.receive(&[0; 5], 6, sync), short);
    assert_eq!(rpdo.sync(), None);
    rpdo.receive(&[0; 6], 6, sync);
    rpdo.reset();
    assert_eq!(rpdo.sync(), None);
}

#[test]
fn every_nth_sync() {
    for n in 1..=240u8 {
        let mut tpdo = TpdoState::new();
        tpdo.start();
        let sent = (1..=480u32)
            .filter(|_| tpdo.sync(Transmission::Synchronous(n), None, 0))
            .collect::<Vec<_>>();
        let expected = (1..=480u32).filter(|i| i % u32::from(n) == 0);
        assert!(sent.into_iter().eq(expected));
    }
}

#[test]
fn the_start_value_of_the_counter_is_awaited() {
    let mut tpdo = TpdoState::new();
    tpdo.start();
    let counters = (0..12).map(|i| i % 6 + 1);
    let sent: Vec<bool> = counters
        .map(|c| tpdo.sync(Transmission::Synchronous(2), Some(c), 3))
        .collect();
    let yes = [2, 4, 6, 8, 10];
    assert!(sent.iter().enumerate().all(|(i, &s)| s == yes.contains(&i)));
}

#[test]
fn acyclic_and_event_driven() {
    let ms = |ms: u64| Instant::from_micros(ms * 1000);
    let mut tpdo = TpdoState::new();
    assert!(!tpdo.sync(Transmission::SynchronousAcyclic, None, 0));
    tpdo.trigger();
    assert!(!tpdo.sync(Transmission::EventProfile, None, 0));
    assert!(tpdo.sync(Transmission::SynchronousAcyclic, None, 0));
    assert!(!tpdo.sync(Transmission::SynchronousAcyclic, None, 0));
    // Inhibit time 1 ms, event timer 10 ms.
    let (inhibit, timer) = (Duration::from_millis(1), Duration::from_millis(10));
    let mut tpdo = TpdoState::new();
    assert_eq!(tpdo.next_deadline(inhibit, timer), None);
    tpdo.start();
    assert!(tpdo.poll(ms(5), inhibit, timer));
    tpdo.trigger();
    assert_eq!(tpdo.next_deadline(inhibit, timer), Some(ms(6)));
    assert!(!tpdo.poll(Instant::from_micros(5999), inhibit, timer));
    assert!(tpdo.poll(ms(6), inhibit, timer));
    assert!(!tpdo.poll(ms(15), inhibit, timer));
    assert!(tpdo.poll(ms(16), inhibit, timer));
    assert!(!tpdo.poll(ms(99), inhibit, Duration::ZERO));
}

#[test]
fn transmission_types() {
    for code in 0..=u8::MAX {
        let transmission = Transmission::from_code(code);
        assert_eq!(transmission.code(), code);
        let rtr = code == 252 || code == 253;
        let reserved = (241..=251).contains(&code);
        assert_eq!(transmission.exists(Direction::Transmit), !reserved);
        assert_eq!(transmission.exists(Direction::Receive), !reserved && !rtr);
        assert_eq!(transmission.is_synchronous(), code <= 240);
        assert_eq!(transmission.is_event_driven(), code >= 254);
    }
}

proptest! {
    #[test]
    fn what_is_packed_is_unpacked(control: u16, velocity: i32) {
        let mapping = Mapping::new(&[CONTROLWORD, VELOCITY]).unwrap();
        let (mut a, mut b) = (values(), values());
        a.put(0x6040, 0, i64::from(control));
        a.put(0x60FF, 0, i64::from(velocity));
        let (data, len) = mapping.pack(&mut a).unwrap();
        prop_assert_eq!(len, 6);
        prop_assert_eq!(mapping.unpack(data, &mut b), Ok(()));
        prop_assert_eq!(b.number(0x6040, 0), i64::from(control));
        prop_assert_eq!(b.number(0x60FF, 0), i64::from(velocity));
    }

    /// Any sequence of writes leaves a mapping of at most eight bytes.
    #[test]
    fn no_sequence_of_writes_breaks_the_mapping(
        writes in prop::collection::vec((0u8..14, 0usize..8, any::<u32>()), 0..60)
    ) {
        let entries =
            [CONTROLWORD, MODE, ACCELERATION, VELOCITY, DECELERATION, STATUSWORD, MODE, MODE];
        let mut pdo = configuration(Direction::Receive);
        for (sub, which, raw) in writes {
            let value = match sub {
                0 => Value::from((raw % 14) as u8),
                _ if which == 7 => Value::from(raw),
                _ => Value::from(entries[which].0),
            };
            let _ = pdo.write_mapping(sub, value, describe);
            prop_assert!(pdo.bytes() <= 8);
            prop_assert_eq!(
                Value::from(pdo.mapping().entries().len() as u8),
                pdo.read_mapping(0).unwrap()
            );
            prop_assert_eq!(pdo.mapping().unpack([0; 8], &mut values()).err(), None);
        }
    }
}

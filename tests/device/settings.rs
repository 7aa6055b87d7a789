//! Settings: which values are taken, and that they survive.

use crate::rig::{Bench, ms, node};
use canmaster::boot::{Assignment, Startup};
use canmaster::device::{Event, Setting};
use canmaster::network::sample::SIX_EPOS4_10_MS as SIX_EPOS4;
use canmaster::nmt::{Command, ErrorBehaviour, NodeControl, State, Target};
use canmaster::sdo::AbortCode;
use canmaster::store::CAPACITY;
use proptest::prelude::*;

#[test]
fn values_that_are_refused() {
    let mut b = Bench::new();
    let range = Err(AbortCode::VALUE_RANGE);
    // 1003h:00 takes 0 only.
    assert_eq!(b.write_u8(0x1003, 0, 1), range);
    // 1005h: another identifier, an extended one, a reserved bit.
    for value in [0x81, 0x2000_0080, 0x8000_0080, 0x0000_0880] {
        assert_eq!(b.write_u32(0x1005, 0, value), range, "{value:08X}");
    }
    // 1006h: shorter than the device can do.
    assert_eq!(b.write_u32(0x1006, 0, 999), Err(AbortCode::VALUE_TOO_LOW));
    // 1007h: longer than the period.
    assert_eq!(
        b.write_u32(0x1007, 0, 10_001),
        Err(AbortCode::VALUE_TOO_HIGH)
    );
    // 1012h: restricted, extended.
    for value in [0x101, 0x4000_0701, 0x2000_0100] {
        assert_eq!(b.write_u32(0x1012, 0, value), range, "{value:08X}");
    }
    // 1014h: another identifier while it is valid; restricted; extended.
    for value in [0x0FE, 0x101, 0x601, 0x2000_00FF] {
        assert_eq!(b.write_u32(0x1014, 0, value), range, "{value:08X}");
    }
    // 1016h: reserved bits; a node twice.
    assert_eq!(b.write_u32(0x1016, 1, 0x0101_0064), range);
    assert_eq!(
        b.write_u32(0x1016, 1, 0x0002_0064),
        Err(AbortCode::PARAMETER_INCOMPATIBLE)
    );
    // 1029h:01
    assert_eq!(b.write_u8(0x1029, 1, 3), range);
    // 1F80h: flying master and what is reserved.
    for bit in [5].into_iter().chain(7..32) {
        assert_eq!(b.write_u32(0x1F80, 0, 1 | 1 << bit), range, "bit {bit}");
    }
    // 1F81h: program check and update, and what is reserved.
    for bit in [1, 5, 6] {
        assert_eq!(b.write_u32(0x1F81, 1, 1 | 1 << bit), range, "bit {bit}");
    }
    // 1F82h
    for value in [0, 1, 2, 3, 8, 0x7E, 0x80, 0xFF] {
        assert_eq!(b.write_u8(0x1F82, 1, value), range, "{value}");
    }
    // 1F89h
    assert_eq!(
        b.write_u32(0x1F89, 0, u32::MAX),
        Err(AbortCode::VALUE_TOO_HIGH)
    );
    assert_eq!(b.events(), []);
}

#[test]
fn values_that_are_taken_are_told() {
    let mut b = Bench::new();
    let cases = [
        (0x1014, 0, 0x8000_00FF, Setting::EmcyCobId),
        (0x1014, 0, 0x8000_0091, Setting::EmcyCobId),
        (0x1014, 0, 0x0000_0091, Setting::EmcyCobId),
        (0x1012, 0, 0x8000_0100, Setting::TimeCobId),
        (0x1016, 6, 0x0000_0000, Setting::ConsumerHeartbeat(5)),
        (0x1016, 1, 0x0006_03E8, Setting::ConsumerHeartbeat(0)),
        (0x1005, 0, 0x4000_0080, Setting::SyncCobId),
        (0x1007, 0, 4000, Setting::SyncWindow),
        (0x1006, 0, 5000, Setting::SyncPeriod),
        (0x1F80, 0, 0x49, Setting::Startup),
        (0x1F81, 2, 0x0064_0385, Setting::Assignment(1)),
        (0x1F89, 0, 0, Setting::BootTime),
        (0x1020, 1, 15_000, Setting::ConfigurationDate),
    ];
    for (index, sub, value, setting) in cases {
        assert_eq!(b.write_u32(index, sub, value), Ok(()), "{index:04X}h");
        assert_eq!(b.number(index, sub), Ok(u64::from(value)));
        assert_eq!(b.events(), [Event::Changed(setting)]);
    }
    assert_eq!(b.write_u8(0x1029, 1, 2), Ok(()));
    let settings = b.device.settings();
    assert!(settings.sync().is_producing());
    assert_eq!(settings.emcy_cob_id().id().unwrap().get(), 0x91);
    assert_eq!(settings.consumer_time(node(6)).unwrap().as_millis(), 1000);
    assert_eq!(settings.consumer_time(node(1)), None);
    assert_eq!(settings.error_behaviour(), ErrorBehaviour::Stopped);
    let startup = settings.startup();
    assert!(startup.has(Startup::MASTER | Startup::NO_START | Startup::STOP_ALL));
    assert!(!startup.has(Startup::START_ALL));
    let assignment = settings.assignment(1).unwrap();
    assert!(assignment.has(Assignment::LISTED | Assignment::RESTORE));
    assert_eq!(assignment.guard_retries(), 3);
    assert_eq!(assignment.guard_time().as_millis(), 100);
}

/// 1019h is refused while 1006h is not 0 (CiA 301, 7.5.2.22).
#[test]
fn the_counter_is_changed_while_there_is_no_period() {
    let mut b = Bench::new();
    assert_eq!(b.write_u8(0x1019, 0, 10), Err(AbortCode::DEVICE_STATE));
    assert_eq!(b.write_u32(0x1006, 0, 0), Ok(()));
    for value in [1, 241, 255] {
        assert_eq!(b.write_u8(0x1019, 0, value), Err(AbortCode::VALUE_RANGE));
    }
    for value in [2, 240, 0, 10] {
        assert_eq!(b.write_u8(0x1019, 0, value), Ok(()));
        b.events();
    }
    assert_eq!(b.write_u32(0x1006, 0, 10_000), Ok(()));
    let mut counter = b.device.settings().sync().counter();
    let frame = counter.frame(canmaster::CobId::SYNC);
    assert_eq!(frame.data(), [1]);
    b.enter(State::Operational);
    assert_eq!(b.write_u8(0x1019, 0, 0), Err(AbortCode::DEVICE_STATE));
}

#[test]
fn any_other_change_takes_the_configuration_date_back() {
    let mut b = Bench::new();
    b.write_u32(0x1020, 1, 15_000).unwrap();
    b.write_u32(0x1020, 2, 43_200_000).unwrap();
    // The same value is no change.
    b.write_u16(0x1017, 0, 50).unwrap();
    assert_eq!(b.number(0x1020, 2), Ok(43_200_000));
    b.events();
    b.write_u16(0x1017, 0, 51).unwrap();
    assert_eq!(b.number(0x1020, 1), Ok(0));
    assert_eq!(b.number(0x1020, 2), Ok(0));
}

#[test]
fn nmt_is_requested() {
    let mut b = Bench::new();
    for (value, command) in [
        (4, Command::Stop),
        (5, Command::Start),
        (6, Command::ResetNode),
        (7, Command::ResetCommunication),
        (127, Command::EnterPreOperational),
    ] {
        assert_eq!(b.write_u8(0x1F82, 3, value), Ok(()));
        assert_eq!(b.write_u8(0x1F82, 0x80, value), Ok(()));
        let one = NodeControl::node(command, node(3));
        let all = NodeControl::all(command);
        assert_eq!(b.events(), [Event::Nmt(one), Event::Nmt(all)]);
    }
    assert_eq!(b.write(0x1F25, 3, b"conf"), Ok(()));
    assert_eq!(b.write(0x1F25, 0x80, b"conf"), Ok(()));
    assert_eq!(b.write(0x1F25, 3, b"fnoc"), Err(AbortCode::CANNOT_STORE));
    let one = Event::Configure(Target::Node(node(3)));
    assert_eq!(b.events(), [one, Event::Configure(Target::All)]);
}

#[test]
fn a_request_that_would_not_be_carried_out_is_refused() {
    let mut b = Bench::new();
    b.board.refuses_requests = Some(AbortCode::DEVICE_STATE);
    for sub in [3, 0x80] {
        for value in [4, 5, 6, 7, 127] {
            let refused = b.write_u8(0x1F82, sub, value);
            assert_eq!(refused, Err(AbortCode::DEVICE_STATE));
        }
        let refused = b.write(0x1F25, sub, b"conf");
        assert_eq!(refused, Err(AbortCode::DEVICE_STATE));
    }
    // What is no request at all is told first.
    assert_eq!(b.write_u8(0x1F82, 3, 1), Err(AbortCode::VALUE_RANGE));
    assert_eq!(b.write(0x1F25, 3, b"fnoc"), Err(AbortCode::CANNOT_STORE));
    assert_eq!(b.events(), []);
    // The board decides for others only.
    assert_eq!(b.write_u8(0x1F82, 127, 4), Ok(()));
}

#[test]
fn events_that_nobody_fetches_are_refused_at_last() {
    let mut b = Bench::new();
    for _ in 0..4 {
        assert_eq!(b.write_u8(0x1F82, 1, 5), Ok(()));
    }
    assert_eq!(b.write_u8(0x1F82, 1, 5), Err(AbortCode::OUT_OF_MEMORY));
    assert_eq!(b.write_u16(0x1017, 0, 7), Err(AbortCode::OUT_OF_MEMORY));
    assert_eq!(b.number(0x1017, 0), Ok(50));
    b.events();
    assert_eq!(b.write_u16(0x1017, 0, 7), Ok(()));
}

#[test]
fn saving_is_refused_while_an_axis_is_enabled() {
    let mut b = Bench::new();
    b.device.set_axes_enabled(true);
    assert_eq!(b.write(0x1010, 1, b"save"), Err(AbortCode::DEVICE_STATE));
    assert_eq!(b.write(0x1011, 1, b"load"), Err(AbortCode::DEVICE_STATE));
    // The wrong word is wrong in any state.
    assert_eq!(b.write(0x1011, 1, b"save"), Err(AbortCode::CANNOT_STORE));
    b.device.set_axes_enabled(false);
    b.board.refuses = Some(AbortCode::HARDWARE);
    assert_eq!(b.write(0x1010, 1, b"save"), Err(AbortCode::HARDWARE));
    b.board.refuses = None;
    assert_eq!(b.write(0x1010, 1, b"save"), Ok(()));
    assert_eq!(b.number(0x1010, 1), Ok(1));
    assert_eq!(b.number(0x1011, 1), Ok(1));
}

#[test]
fn a_board_that_cannot_store_says_so() {
    let mut b = Bench::new();
    b.board.can_save = false;
    for (index, signature) in [(0x1010, b"save"), (0x1011, b"load")] {
        assert_eq!(b.number(index, 1), Ok(0));
        assert_eq!(b.write(index, 1, signature), Err(AbortCode::DEVICE_STATE));
    }
    assert_eq!(b.board.saved, None);
}

/// 5530h, and it is over with the next save that succeeds.
#[test]
fn a_storage_that_fails_is_an_error_of_the_device() {
    let mut b = Bench::new();
    b.board.refuses = Some(AbortCode::HARDWARE);
    assert_eq!(b.write(0x1010, 1, b"save"), Err(AbortCode::HARDWARE));
    assert_eq!(b.number(0x1001, 0), Ok(1));
    assert_eq!(b.number(0x1003, 1), Ok(0x5530));
    let emcy = b.poll().unwrap();
    assert_eq!(emcy.data(), [0x30, 0x55, 1, 0, 0, 0, 0, 0]);
    b.board.refuses = None;
    assert_eq!(b.write(0x1010, 1, b"save"), Ok(()));
    assert_eq!(b.number(0x1001, 0), Ok(0));
    assert_eq!(b.poll().unwrap().data(), [0; 8]);
}

/// A device whose settings say that it is not the NMT master.
fn not_the_master() -> Bench {
    let mut b = Bench::new();
    b.write_u32(0x1F80, 0, 0).unwrap();
    b.write(0x1010, 1, b"save").unwrap();
    // The change of 1F80h, bit 0, has not taken effect yet.
    assert!(b.device.is_master());
    assert_eq!(b.write_u8(0x1F82, 1, 5), Ok(()));
    let saved = b.board.saved.take().unwrap();
    b.device.load(&saved, ms(0));
    b.events();
    b
}

#[test]
fn who_is_not_the_nmt_master_commands_itself_alone() {
    let mut b = not_the_master();
    assert!(!b.device.is_master());
    for sub in [1, 7, 128] {
        let written = b.write_u8(0x1F82, sub, 5);
        assert_eq!(written, Err(AbortCode::DEVICE_STATE), "{sub}");
        let written = b.write(0x1F25, sub, b"conf");
        assert_eq!(written, Err(AbortCode::DEVICE_STATE), "{sub}");
    }
    assert_eq!(b.events(), []);
    assert_eq!(b.write_u8(0x1F82, 127, 4), Ok(()));
    let stop = NodeControl::node(Command::Stop, node(127));
    assert_eq!(b.events(), [Event::Nmt(stop)]);
}

/// The axes would be left without their master.
#[test]
fn the_device_itself_is_not_commanded_while_an_axis_is_enabled() {
    let mut b = Bench::new();
    b.device.set_axes_enabled(true);
    for value in [4, 6, 7, 127] {
        let written = b.write_u8(0x1F82, 127, value);
        assert_eq!(written, Err(AbortCode::DEVICE_STATE), "{value}");
        // The drives may be commanded: they come to rest by themselves.
        assert_eq!(b.write_u8(0x1F82, 128, value), Ok(()));
        b.events();
    }
    assert_eq!(b.write_u8(0x1F82, 127, 5), Ok(()));
    b.enter(State::Operational);
    assert_eq!(b.number(0x1F82, 127), Ok(5));
}

/// What a tool can change, each in its own way.
const CHANGES: &[(u16, u8, &[u8])] = &[
    (0x1006, 0, &[0, 0, 0, 0]),
    (0x1019, 0, &[100]),
    (0x1006, 0, &[0x20, 0x4E, 0, 0]),
    (0x1007, 0, &[0x10, 0x27, 0, 0]),
    (0x1012, 0, &[0, 1, 0, 0x40]),
    (0x1014, 0, &[0xFF, 0, 0, 0x80]),
    (0x1015, 0, &[5, 0]),
    (0x1016, 2, &[0, 0, 0, 0]),
    (0x1017, 0, &[200, 0]),
    (0x1029, 1, &[2]),
    (0x1F80, 0, &[0x41, 0, 0, 0]),
    (0x1F81, 4, &[5, 0, 0, 0]),
    (0x1F89, 0, &[0x10, 0x27, 0, 0]),
    (0x2F11, 0, &[100, 0]),
    (0x1020, 1, &[1, 2, 3, 4]),
    (0x1020, 2, &[5, 6, 7, 8]),
];

fn all(b: &mut Bench) -> Vec<Vec<u8>> {
    CHANGES
        .iter()
        .map(|(index, sub, _)| b.read(*index, *sub).unwrap())
        .collect()
}

#[test]
fn saved_settings_are_there_after_a_reset_and_restored_ones_are_the_designs() {
    let mut b = Bench::new();
    let design = all(&mut b);
    for (index, sub, value) in CHANGES {
        assert_eq!(b.write(*index, *sub, value), Ok(()), "{index:04X}h");
        b.events();
    }
    let changed = all(&mut b);
    b.write(0x1010, 1, b"save").unwrap();
    let saved = b.board.saved.take().unwrap();
    assert!(saved.len() <= CAPACITY);

    let mut fresh = Bench::new();
    fresh.device.load(&saved, ms(0));
    assert_eq!(all(&mut fresh), changed);

    // "load" takes effect at the next reset (CiA 301, 7.5.2.14).
    fresh.write(0x1011, 1, b"load").unwrap();
    assert_eq!(all(&mut fresh), changed);
    let restored = fresh.board.saved.take().unwrap();
    fresh.device.load(&restored, ms(0));
    assert_eq!(all(&mut fresh), design);
}

/// The SYNC of a running network goes on over a reset of the settings.
#[test]
fn loading_leaves_the_producer_alone() {
    let mut b = Bench::new();
    b.device.set_sync_producer(true);
    b.device.load(&[], ms(0));
    assert_eq!(b.number(0x1005, 0), Ok(0x4000_0080));
    assert!(b.device.settings().sync().is_producing());
}

proptest! {
    /// Whatever the flash says: settings that are in force are legal.
    #[test]
    fn any_bytes_load(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let mut b = Bench::new();
        b.device.load(&bytes, ms(0));
        check(&mut b)?;
    }

    /// The same with a good set, damaged.
    #[test]
    fn any_damage_loads(at in 0usize..200, with: u8, cut in 0usize..300) {
        let mut b = Bench::new();
        b.write(0x1010, 1, b"save").unwrap();
        let mut saved = b.board.saved.take().unwrap();
        if let Some(byte) = saved.get_mut(at) {
            *byte = with;
        }
        saved.truncate(cut);
        b.device.load(&saved, ms(0));
        check(&mut b)?;
    }
}

fn check(b: &mut Bench) -> Result<(), TestCaseError> {
    let settings = b.device.settings();
    let period = settings.sync().period();
    prop_assert!(period == 0 || period >= 1000);
    prop_assert!(settings.sync().window() <= period || period == 0);
    prop_assert_eq!(settings.startup().0 & !0x5F, 0);
    let mut watched: Vec<_> = settings.consumers().map(|(node, _)| node).collect();
    watched.sort();
    watched.dedup();
    prop_assert_eq!(watched.len(), settings.consumers().count());
    prop_assert!(watched.len() <= SIX_EPOS4.nodes.len());
    Ok(())
}

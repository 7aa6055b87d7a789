//! Layer setting services: golden frames, conversations, fastscan over several
//! nodes (CiA 305).

use canmaster::lss::{
    Answer, BitRate, ConfigurationResult, Device, LssAddress, LssError, LssMaster, LssSlave, Mode,
    Outcome, Part, Progress, Request, Service, SlaveEvent,
};
use canmaster::{CobId, Duration, Frame, Instant, NodeId};
use proptest::prelude::*;

const DRIVE: LssAddress = LssAddress {
    vendor: 0xFB,
    product: 0x6150_0000,
    revision: 0x0170_0000,
    serial: 0x1234_5678,
};
const NODE: NodeId = NodeId::constant::<5>();
const TIMEOUT: Duration = Duration::from_millis(10);

struct Electronics {
    stored: Option<Option<NodeId>>,
}

impl Device for Electronics {
    fn configure_bit_timing(&mut self, table: u8, index: u8) -> ConfigurationResult {
        match (table, BitRate::from_index(index).bits_per_second()) {
            (BitRate::STANDARD_TABLE, Some(_)) => ConfigurationResult::OK,
            _ => ConfigurationResult::REFUSED,
        }
    }

    fn store(&mut self, node: Option<NodeId>) -> ConfigurationResult {
        self.stored = Some(node);
        ConfigurationResult::OK
    }
}

fn electronics() -> Electronics {
    Electronics { stored: None }
}

fn to_slave(bytes: [u8; 8]) -> Frame {
    Frame::full(CobId::new(0x7E5).unwrap(), bytes)
}

fn to_master(bytes: [u8; 8]) -> Frame {
    Frame::full(CobId::new(0x7E4).unwrap(), bytes)
}

fn ms(ms: u64) -> Instant {
    Instant::from_micros(ms * 1000)
}

#[test]
fn requests_on_the_wire() {
    for (request, bytes) in [
        (
            Request::SwitchGlobal(Mode::Waiting),
            [0x04, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            Request::SwitchGlobal(Mode::Configuration),
            [0x04, 1, 0, 0, 0, 0, 0, 0],
        ),
        (
            Request::Select(Part::Vendor, 0xFB),
            [0x40, 0xFB, 0, 0, 0, 0, 0, 0],
        ),
        (
            Request::Select(Part::Product, 1),
            [0x41, 1, 0, 0, 0, 0, 0, 0],
        ),
        (
            Request::Select(Part::Revision, 2),
            [0x42, 2, 0, 0, 0, 0, 0, 0],
        ),
        (
            Request::Select(Part::Serial, 0x0102_0304),
            [0x43, 4, 3, 2, 1, 0, 0, 0],
        ),
        (Request::NodeId(Some(NODE)), [0x11, 5, 0, 0, 0, 0, 0, 0]),
        (Request::NodeId(None), [0x11, 0xFF, 0, 0, 0, 0, 0, 0]),
        (
            Request::BitTiming { table: 0, index: 2 },
            [0x13, 0, 2, 0, 0, 0, 0, 0],
        ),
        (
            Request::Activate { delay: 1000 },
            [0x15, 0xE8, 0x03, 0, 0, 0, 0, 0],
        ),
        (Request::Store, [0x17, 0, 0, 0, 0, 0, 0, 0]),
        (Request::Inquire(Part::Vendor), [0x5A, 0, 0, 0, 0, 0, 0, 0]),
        (Request::Inquire(Part::Serial), [0x5D, 0, 0, 0, 0, 0, 0, 0]),
        (Request::InquireNodeId, [0x5E, 0, 0, 0, 0, 0, 0, 0]),
        (
            Request::Fastscan {
                id: 0x0102_0304,
                bit: 31,
                sub: 2,
                next: 3,
            },
            [0x51, 4, 3, 2, 1, 31, 2, 3],
        ),
    ] {
        assert_eq!(request.frame(), to_slave(bytes));
        assert_eq!(Request::decode(&to_slave(bytes)), Some(request));
    }
}

#[test]
fn answers_on_the_wire() {
    let medium = ConfigurationResult::MEDIUM;
    for (answer, bytes) in [
        (Answer::Selected, [0x44, 0, 0, 0, 0, 0, 0, 0]),
        (
            Answer::NodeId(ConfigurationResult::OK),
            [0x11, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            Answer::BitTiming(ConfigurationResult::REFUSED),
            [0x13, 1, 0, 0, 0, 0, 0, 0],
        ),
        (Answer::Store(medium), [0x17, 2, 0, 0, 0, 0, 0, 0]),
        (
            Answer::Store(ConfigurationResult {
                error: 255,
                specific: 7,
            }),
            [0x17, 255, 7, 0, 0, 0, 0, 0],
        ),
        (
            Answer::Inquire(Part::Revision, 0x0102_0304),
            [0x5C, 4, 3, 2, 1, 0, 0, 0],
        ),
        (
            Answer::InquireNodeId(Some(NODE)),
            [0x5E, 5, 0, 0, 0, 0, 0, 0],
        ),
        (Answer::InquireNodeId(None), [0x5E, 0xFF, 0, 0, 0, 0, 0, 0]),
        (Answer::Identified, [0x4F, 0, 0, 0, 0, 0, 0, 0]),
    ] {
        assert_eq!(answer.frame(), to_master(bytes));
        assert_eq!(Answer::decode(&to_master(bytes)), Some(answer));
    }
}

#[test]
fn bit_rates() {
    for (index, rate) in [
        (0, Some(1_000_000)),
        (1, Some(800_000)),
        (2, Some(500_000)),
        (3, Some(250_000)),
        (4, Some(125_000)),
        (5, None),
        (6, Some(50_000)),
        (7, Some(20_000)),
        (8, Some(10_000)),
        (9, None),
        (200, None),
    ] {
        let bit_rate = BitRate::from_index(index);
        assert_eq!(bit_rate.bits_per_second(), rate);
        assert_eq!(bit_rate.index(), index);
    }
}

/// What the slave answers to a frame, if it does.
fn ask(slave: &mut LssSlave, device: &mut Electronics, request: Request) -> Option<Answer> {
    match slave.on_frame(&request.frame(), device)? {
        SlaveEvent::Send(frame) => Some(Answer::decode(&frame).unwrap()),
        _ => None,
    }
}

fn select(slave: &mut LssSlave, address: LssAddress) -> Option<Answer> {
    let device = &mut electronics();
    let mut last = None;
    for part in Part::ALL {
        last = ask(slave, device, Request::Select(part, address.part(part)));
    }
    last
}

#[test]
fn selection_needs_all_four_numbers_in_order() {
    let mut slave = LssSlave::new(DRIVE, Some(NODE));
    for part in Part::ALL {
        let mut other = DRIVE;
        match part {
            Part::Vendor => other.vendor += 1,
            Part::Product => other.product += 1,
            Part::Revision => other.revision += 1,
            Part::Serial => other.serial += 1,
        }
        assert_eq!(select(&mut slave, other), None);
        assert_eq!(slave.mode(), Mode::Waiting);
    }
    let device = &mut electronics();
    for part in [Part::Vendor, Part::Revision, Part::Serial] {
        let request = Request::Select(part, DRIVE.part(part));
        assert_eq!(ask(&mut slave, device, request), None);
    }
    assert_eq!(slave.mode(), Mode::Waiting);
    assert_eq!(select(&mut slave, DRIVE), Some(Answer::Selected));
    assert_eq!(slave.mode(), Mode::Configuration);
}

#[test]
fn a_waiting_slave_is_silent() {
    let mut slave = LssSlave::new(DRIVE, Some(NODE));
    let device = &mut electronics();
    for request in [
        Request::NodeId(Some(NODE)),
        Request::BitTiming { table: 0, index: 0 },
        Request::Activate { delay: 1 },
        Request::Store,
        Request::Inquire(Part::Vendor),
        Request::InquireNodeId,
        Request::Fastscan {
            id: 0,
            bit: 0x80,
            sub: 0,
            next: 0,
        },
    ] {
        assert_eq!(slave.on_frame(&request.frame(), device), None);
    }
}

#[test]
fn configuration_of_a_node_that_has_a_node_id() {
    let mut slave = LssSlave::new(DRIVE, Some(NODE));
    let device = &mut electronics();
    ask(
        &mut slave,
        device,
        Request::SwitchGlobal(Mode::Configuration),
    );
    let ok = ConfigurationResult::OK;
    let new = NodeId::constant::<9>();
    let slave = &mut slave;
    assert_eq!(
        ask(slave, device, Request::NodeId(Some(new))),
        Some(Answer::NodeId(ok))
    );
    assert_eq!(
        ask(slave, device, Request::InquireNodeId),
        Some(Answer::InquireNodeId(Some(NODE)))
    );
    assert_eq!(ask(slave, device, Request::Store), Some(Answer::Store(ok)));
    assert_eq!(device.stored, Some(Some(new)));
    let timing = |index| Request::BitTiming { table: 0, index };
    assert_eq!(ask(slave, device, timing(2)), Some(Answer::BitTiming(ok)));
    let refused = ConfigurationResult::REFUSED;
    assert_eq!(
        ask(slave, device, timing(5)),
        Some(Answer::BitTiming(refused))
    );
    assert_eq!(
        slave.on_frame(&Request::Activate { delay: 20 }.frame(), device),
        Some(SlaveEvent::Activate { delay: 20 })
    );
    for part in Part::ALL {
        let number = DRIVE.part(part);
        assert_eq!(
            ask(slave, device, Request::Inquire(part)),
            Some(Answer::Inquire(part, number))
        );
    }
    // It takes effect with the next reset communication.
    ask(slave, device, Request::SwitchGlobal(Mode::Waiting));
    assert_eq!(slave.node(), Some(NODE));
    assert_eq!(slave.reset_communication(), Some(new));
    assert_eq!(slave.mode(), Mode::Waiting);
}

#[test]
fn a_node_without_node_id_boots_when_it_has_one() {
    let mut slave = LssSlave::new(DRIVE, None);
    let device = &mut electronics();
    select(&mut slave, DRIVE);
    for bad in [0, 128, 254] {
        let refused = slave.on_frame(&to_slave([0x11, bad, 0, 0, 0, 0, 0, 0]), device);
        assert_eq!(
            refused,
            Some(SlaveEvent::Send(to_master([0x11, 1, 0, 0, 0, 0, 0, 0])))
        );
    }
    ask(&mut slave, device, Request::NodeId(Some(NODE)));
    assert_eq!(slave.node(), None);
    let waiting = Request::SwitchGlobal(Mode::Waiting).frame();
    assert_eq!(
        slave.on_frame(&waiting, device),
        Some(SlaveEvent::Boot(NODE))
    );
    assert_eq!(slave.node(), Some(NODE));
}

#[test]
fn the_master_selects_and_configures() {
    let mut master = LssMaster::new(TIMEOUT);
    let first = master.start(Service::Select(DRIVE), ms(0)).unwrap();
    assert_eq!(first, to_slave([0x40, 0xFB, 0, 0, 0, 0, 0, 0]));
    assert_eq!(master.start(Service::Store, ms(0)), Err(LssError::Busy));
    for bytes in [
        [0x41, 0, 0, 0x50, 0x61, 0, 0, 0],
        [0x42, 0, 0, 0x70, 0x01, 0, 0, 0],
        [0x43, 0x78, 0x56, 0x34, 0x12, 0, 0, 0],
    ] {
        assert_eq!(master.poll(ms(0)), Progress::Send(to_slave(bytes)));
    }
    assert_eq!(master.poll(ms(0)), Progress::Nothing);
    // Answers to something else change nothing.
    assert_eq!(
        master.on_frame(&Answer::Identified.frame()),
        Progress::Nothing
    );
    assert_eq!(
        master.on_frame(&Answer::Selected.frame()),
        Progress::Done(Outcome::Confirmed)
    );
    assert_eq!(
        master.start(Service::ConfigureNodeId(Some(NODE)), ms(5)),
        Ok(to_slave([0x11, 5, 0, 0, 0, 0, 0, 0]))
    );
    let refused = ConfigurationResult::REFUSED;
    assert_eq!(
        master.on_frame(&Answer::NodeId(refused).frame()),
        Progress::Failed(LssError::Refused(refused))
    );
    master.start(Service::Inquire(Part::Serial), ms(6)).unwrap();
    let other = Answer::Inquire(Part::Vendor, 1).frame();
    assert_eq!(master.on_frame(&other), Progress::Nothing);
    let serial = Answer::Inquire(Part::Serial, 7).frame();
    assert_eq!(master.on_frame(&serial), Progress::Done(Outcome::Number(7)));
    master.start(Service::InquireNodeId, ms(7)).unwrap();
    let node = Answer::InquireNodeId(None).frame();
    assert_eq!(master.on_frame(&node), Progress::Done(Outcome::Node(None)));
    master.start(Service::Store, ms(8)).unwrap();
    assert_eq!(master.poll(ms(17)), Progress::Nothing);
    assert_eq!(master.poll(ms(18)), Progress::Failed(LssError::Timeout));
    assert_eq!(master.next_deadline(), None);
}

#[test]
fn the_master_sets_the_bit_rate() {
    let mut master = LssMaster::new(TIMEOUT);
    let index = BitRate::Kbit500.index();
    let table = BitRate::STANDARD_TABLE;
    let timing = Service::ConfigureBitTiming { table, index };
    for (result, end) in [
        (
            ConfigurationResult::REFUSED,
            Progress::Failed(LssError::Refused(ConfigurationResult::REFUSED)),
        ),
        (ConfigurationResult::OK, Progress::Done(Outcome::Confirmed)),
    ] {
        assert_eq!(
            master.start(timing, ms(0)),
            Ok(to_slave([0x13, 0, 2, 0, 0, 0, 0, 0]))
        );
        let node_id = Answer::NodeId(result).frame();
        assert_eq!(master.on_frame(&node_id), Progress::Nothing);
        assert_eq!(master.on_frame(&Answer::BitTiming(result).frame()), end);
    }
}

#[test]
fn unconfirmed_services() {
    let mut master = LssMaster::new(TIMEOUT);
    let waiting = Service::SwitchGlobal(Mode::Waiting);
    assert_eq!(
        master.start(waiting, ms(0)),
        Ok(to_slave([0x04, 0, 0, 0, 0, 0, 0, 0]))
    );
    assert_eq!(master.poll(ms(0)), Progress::Done(Outcome::Confirmed));
    let activate = Service::ActivateBitTiming { delay: 100 };
    assert_eq!(
        master.start(activate, ms(0)),
        Ok(to_slave([0x15, 100, 0, 0, 0, 0, 0, 0]))
    );
    assert_eq!(master.poll(ms(99)), Progress::Nothing);
    assert_eq!(master.poll(ms(100)), Progress::SwitchBitRate);
    assert_eq!(master.poll(ms(199)), Progress::Nothing);
    assert_eq!(master.poll(ms(200)), Progress::Done(Outcome::Confirmed));
}

/// Scans `slaves`; they answer after a tenth of the timeout. Counts questions.
fn scan(slaves: &mut [LssSlave], parts: [Option<u32>; 4]) -> (Progress, u32) {
    let mut master = LssMaster::new(TIMEOUT);
    let mut frame = master.start(Service::Fastscan(parts), ms(0)).unwrap();
    for questions in 1.. {
        for slave in slaves.iter_mut() {
            if let Some(SlaveEvent::Send(answer)) = slave.on_frame(&frame, &mut electronics()) {
                assert_eq!(master.on_frame(&answer), Progress::Nothing);
            }
        }
        match master.poll(master.next_deadline().unwrap()) {
            Progress::Send(next) => frame = next,
            end => return (end, questions),
        }
    }
    unreachable!()
}

const UNKNOWN: [Option<u32>; 4] = [None; 4];

#[test]
fn fastscan_finds_one_node_after_the_other() {
    let serials = [3, 0xFFFF_FFFF, 0, 0x8000_0001, 0x7FFF_FFFF, 3_000_000];
    let mut slaves: Vec<_> = serials
        .iter()
        .map(|&serial| LssSlave::new(LssAddress { serial, ..DRIVE }, None))
        .collect();
    slaves.push(LssSlave::new(DRIVE, Some(NodeId::constant::<100>())));
    let mut found = vec![];
    for id in 1..=6 {
        let (end, questions) = scan(&mut slaves, UNKNOWN);
        let Progress::Done(Outcome::Found(address)) = end else {
            panic!("{end:?}")
        };
        assert_eq!(questions, 1 + 4 * 33);
        found.push(address.serial);
        let configuring = slaves.iter().filter(|s| s.mode() == Mode::Configuration);
        assert_eq!(configuring.count(), 1);
        let device = &mut electronics();
        for slave in &mut slaves {
            slave.on_frame(&Request::NodeId(NodeId::new(id)).frame(), device);
            slave.on_frame(&Request::SwitchGlobal(Mode::Waiting).frame(), device);
        }
    }
    let mut sorted = serials;
    sorted.sort_unstable();
    assert_eq!(found, sorted);
    assert_eq!(
        scan(&mut slaves, UNKNOWN),
        (Progress::Done(Outcome::Nobody), 1)
    );
}

#[test]
fn what_is_known_is_only_confirmed() {
    let mut slaves = [LssSlave::new(DRIVE, None)];
    let mut parts = UNKNOWN;
    parts[0] = Some(DRIVE.vendor);
    parts[3] = Some(DRIVE.serial);
    let (end, questions) = scan(&mut slaves, parts);
    assert_eq!(end, Progress::Done(Outcome::Found(DRIVE)));
    assert_eq!(questions, 1 + 2 + 2 * 33);
    let mut slaves = [LssSlave::new(DRIVE, None)];
    parts[3] = Some(1);
    let (end, _) = scan(&mut slaves, parts);
    assert_eq!(end, Progress::Failed(LssError::Lost(Part::Serial)));
    assert_eq!(slaves[0].mode(), Mode::Waiting);
}

proptest! {
    #[test]
    fn fastscan_finds_any_address(vendor: u32, product: u32, revision: u32, serial: u32) {
        let address = LssAddress { vendor, product, revision, serial };
        let mut slaves = [LssSlave::new(address, None)];
        let (end, _) = scan(&mut slaves, UNKNOWN);
        prop_assert_eq!(end, Progress::Done(Outcome::Found(address)));
    }

    #[test]
    fn any_frame_is_taken(
        frames in prop::collection::vec(
            (any::<bool>(), prop::collection::vec(any::<u8>(), 0..=8)), 0..50)
    ) {
        let mut slave = LssSlave::new(DRIVE, None);
        let mut master = LssMaster::new(TIMEOUT);
        master.start(Service::Fastscan(UNKNOWN), ms(0)).unwrap();
        for (known, mut data) in frames {
            if let (true, Some(cs)) = (known, data.first_mut()) {
                *cs = [0x04, 0x11, 0x13, 0x17, 0x40, 0x44, 0x4F, 0x51][usize::from(*cs % 8)];
            }
            for id in [CobId::LSS_MASTER, CobId::LSS_SLAVE] {
                let frame = Frame::data_frame(id, &data).unwrap();
                if let Some(request) = Request::decode(&frame) {
                    prop_assert_eq!(Request::decode(&request.frame()), Some(request));
                }
                if let Some(answer) = Answer::decode(&frame) {
                    prop_assert_eq!(Answer::decode(&answer.frame()), Some(answer));
                }
                slave.on_frame(&frame, &mut electronics());
                let _ = master.on_frame(&frame);
            }
        }
        for _ in 0..200 {
            let now = master.next_deadline().unwrap_or(ms(0));
            let _ = master.poll(now);
        }
        prop_assert_eq!(master.next_deadline(), None);
    }
}

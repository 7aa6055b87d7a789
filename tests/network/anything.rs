//! Every frame of every length to every COB-ID in every state of NMT, error
//! control and LSS.

use canmaster::lss::{
    Answer, ConfigurationResult, Device, LssAddress, LssMaster, LssSlave, Mode, Outcome, Part,
    Progress, Service, SlaveEvent,
};
use canmaster::nmt::{Command, Consumer, Guard, Guarded, Guardian, Node, NodeEvent, State};
use canmaster::{CobId, Duration, Frame, Instant, NodeId};

const NODE: NodeId = NodeId::constant::<5>();
const TIMEOUT: Duration = Duration::from_millis(10);

fn ms(ms: u64) -> Instant {
    Instant::from_micros(ms * 1000)
}

/// All frames but those for which `meant` holds, remote frames included.
fn all_but(meant: impl Fn(u16, u8) -> bool) -> impl Iterator<Item = Frame> {
    let numbers = (0..0x800).flat_map(|number| (0..=8).map(move |len| (number, len)));
    numbers.flat_map(move |(number, len)| {
        let id = CobId::new(number).unwrap();
        let remote = Frame::remote_frame(id, len).unwrap();
        let firsts = [0x00, 0x01, 0x04, 0x05, 0x11, 0x44, 0x4F, 0x51, 0x81, 0xFF];
        let frames = firsts.map(|first| {
            let data = [first, 0, 0, 0, 0, 0x80, 0, 0];
            Frame::data_frame(id, &data[..usize::from(len)]).unwrap()
        });
        let frames = frames.into_iter().filter(|_| !meant(number, len));
        frames.chain([remote]).collect::<Vec<_>>()
    })
}

const NMT_STATES: [State; 4] = [
    State::Initialising,
    State::Stopped,
    State::PreOperational,
    State::Operational,
];

fn node(state: State) -> Node {
    let mut node = Node::new(NODE);
    if state != State::Initialising {
        node.boot();
    }
    node.command(match state {
        State::Stopped => Command::Stop,
        State::Operational => Command::Start,
        _ => Command::EnterPreOperational,
    });
    assert_eq!(node.state(), state);
    node
}

#[test]
fn only_node_control_of_two_bytes_changes_the_nmt_state() {
    for state in NMT_STATES {
        let mut node = node(state);
        for frame in all_but(|number, len| number == 0 && len == 2) {
            assert_eq!(node.on_frame(&frame), None, "{frame:?}");
        }
        assert_eq!(node.state(), state);
    }
}

#[test]
fn every_command_to_every_node_in_every_nmt_state() {
    for state in NMT_STATES {
        for command in 0..=u8::MAX {
            for target in 0..=u8::MAX {
                let mut node = node(state);
                let frame = Frame::data_frame(CobId::NMT, &[command, target]).unwrap();
                let event = node.on_frame(&frame);
                let heard = matches!(target, 0 | 5) && state != State::Initialising;
                let to = match command {
                    0x01 => State::Operational,
                    0x02 => State::Stopped,
                    0x80 => State::PreOperational,
                    0x81 | 0x82 => State::Initialising,
                    _ => state,
                };
                let name = std::format!("{state} {command:02X} {target}");
                if !heard || to == state {
                    assert_eq!((event, node.state()), (None, state), "{name}");
                    continue;
                }
                assert_eq!(node.state(), to, "{name}");
                assert_eq!(
                    event,
                    Some(match command {
                        0x81 => NodeEvent::ResetNode,
                        0x82 => NodeEvent::ResetCommunication,
                        _ => NodeEvent::Changed { from: state, to },
                    }),
                    "{name}"
                );
            }
        }
    }
}

#[test]
fn only_one_byte_of_the_node_itself_is_error_control() {
    let mut consumer = Consumer::new(NODE, TIMEOUT);
    let mut guardian = Guardian::new(NODE, TIMEOUT, 1);
    guardian.start(ms(0));
    assert!(matches!(guardian.poll(ms(0)), Some(Guard::Ask(_))));
    for frame in all_but(|number, len| number == 0x705 && len == 1) {
        assert_eq!(consumer.on_frame(&frame, ms(0)), None, "{frame:?}");
        assert_eq!(guardian.on_frame(&frame, ms(0)), None, "{frame:?}");
    }
    assert_eq!((consumer.state(), guardian.state()), (None, None));
    for byte in 0..=u8::MAX {
        let mut consumer = Consumer::new(NODE, TIMEOUT);
        let frame = Frame::data_frame(CobId::new(0x705).unwrap(), &[byte]).unwrap();
        assert!(consumer.on_frame(&frame, ms(0)).is_some());
        let state = State::from_code(byte);
        assert_eq!(consumer.is_monitoring(), state != State::Initialising);
    }
}

#[test]
fn only_a_remote_frame_to_the_node_itself_is_answered_by_it() {
    for state in NMT_STATES {
        let mut guarded = Guarded::new(NODE, TIMEOUT);
        for frame in all_but(|_, _| false) {
            let asked = frame.is_remote() && frame.id().get() == 0x705;
            let answer = guarded.on_frame(&frame, state, ms(0));
            let expected = asked && state != State::Initialising;
            assert_eq!(answer.is_some(), expected, "{state}: {frame:?}");
        }
    }
}

const ADDRESS: LssAddress = LssAddress {
    vendor: 0xFB,
    product: 0x6150_0000,
    revision: 0x0170_0000,
    serial: 0x1234_5678,
};

struct Medium;

impl Device for Medium {
    fn configure_bit_timing(&mut self, _: u8, _: u8) -> ConfigurationResult {
        ConfigurationResult::OK
    }

    fn store(&mut self, _: Option<NodeId>) -> ConfigurationResult {
        ConfigurationResult::OK
    }
}

/// Waiting with so many numbers of the address matched, or in configuration.
fn slaves() -> impl Iterator<Item = LssSlave> {
    [None, Some(NODE)].into_iter().flat_map(|node| {
        (0..=4_u8).map(move |matched| {
            let mut slave = LssSlave::new(ADDRESS, node);
            for part in Part::ALL.into_iter().take(usize::from(matched)) {
                slave.on_frame(&select(part), &mut Medium);
            }
            slave
        })
    })
}

fn select(part: Part) -> Frame {
    let [a, b, c, d] = ADDRESS.part(part).to_le_bytes();
    let command = 0x40 + part.position();
    Frame::full(CobId::LSS_MASTER, [command, a, b, c, d, 0, 0, 0])
}

#[test]
fn frames_that_are_no_request_leave_an_lss_slave_as_it_is() {
    for mut slave in slaves() {
        let before = std::format!("{slave:?}");
        for frame in all_but(|number, len| number == 0x7E5 && len == 8) {
            assert_eq!(slave.on_frame(&frame, &mut Medium), None, "{frame:?}");
        }
        assert_eq!(std::format!("{slave:?}"), before);
    }
}

#[test]
fn every_command_in_every_state_of_an_lss_slave() {
    for slave in slaves() {
        for command in 0..=u8::MAX {
            for argument in 0..=u8::MAX {
                let mut slave = slave.clone();
                let configuring = slave.mode() == Mode::Configuration;
                let bytes = [command, argument, 0, 0, 0, 0, 0, 0];
                let event = slave.on_frame(&Frame::full(CobId::LSS_MASTER, bytes), &mut Medium);
                let answer = match event {
                    Some(SlaveEvent::Send(frame)) => Some(frame.padded()[..2].to_vec()),
                    _ => None,
                };
                let name = std::format!("{slave:?}: {bytes:02X?}");
                let expected = match command {
                    0x11 if configuring => {
                        let refused = matches!(argument, 0 | 128..=254);
                        Some(vec![0x11, u8::from(refused)])
                    }
                    0x13 | 0x17 if configuring => Some(vec![command, 0]),
                    0x5A..=0x5D if configuring => {
                        let part = Part::at(command - 0x5A).unwrap();
                        Some(vec![command, ADDRESS.part(part).to_le_bytes()[0]])
                    }
                    0x5E if configuring => Some(vec![0x5E, slave.node().map_or(0xFF, NodeId::get)]),
                    // Fastscan compares all 32 bits of the vendor-ID here.
                    0x51 if !configuring && slave.node().is_none() && argument == 0xFB => {
                        Some(vec![0x4F, 0])
                    }
                    _ => None,
                };
                assert_eq!(answer, expected, "{name}");
                let activated = matches!(event, Some(SlaveEvent::Activate { .. }));
                assert_eq!(activated, configuring && command == 0x15, "{name}");
                assert!(!matches!(event, Some(SlaveEvent::Boot(_))), "{name}");
            }
        }
    }
}

const SERVICES: [Service; 9] = [
    Service::SwitchGlobal(Mode::Configuration),
    Service::Select(ADDRESS),
    Service::ConfigureNodeId(Some(NODE)),
    Service::ConfigureBitTiming { table: 0, index: 2 },
    Service::ActivateBitTiming { delay: 20 },
    Service::Store,
    Service::Inquire(Part::Serial),
    Service::InquireNodeId,
    Service::Fastscan([None; 4]),
];

/// A service is under way, all its frames sent.
fn master(service: Service) -> LssMaster {
    let mut master = LssMaster::new(TIMEOUT);
    master.start(service, ms(0)).unwrap();
    if matches!(service, Service::Select(_)) {
        for _ in 0..3 {
            assert!(matches!(master.poll(ms(0)), Progress::Send(_)));
        }
    }
    master
}

#[test]
fn frames_that_are_no_answer_change_nothing_for_the_lss_master() {
    let idle = LssMaster::new(TIMEOUT);
    for mut master in SERVICES.map(master).into_iter().chain([idle]) {
        let before = std::format!("{master:?}");
        for frame in all_but(|number, len| number == 0x7E4 && len == 8) {
            assert_eq!(master.on_frame(&frame), Progress::Nothing, "{frame:?}");
        }
        assert_eq!(std::format!("{master:?}"), before);
    }
}

#[test]
fn every_answer_to_every_service_of_the_lss_master() {
    for service in SERVICES {
        for command in 0..=u8::MAX {
            for argument in 0..=u8::MAX {
                let mut master = master(service);
                let bytes = [command, argument, 7, 0, 0, 0, 0, 0];
                let frame = Frame::full(CobId::LSS_SLAVE, bytes);
                let progress = master.on_frame(&frame);
                let result = match argument {
                    0 => Progress::Done(Outcome::Confirmed),
                    _ => {
                        let Some(
                            Answer::NodeId(result)
                            | Answer::BitTiming(result)
                            | Answer::Store(result),
                        ) = Answer::decode(&frame)
                        else {
                            // Decided below.
                            assert_expected(service, bytes, progress);
                            continue;
                        };
                        Progress::Failed(canmaster::lss::LssError::Refused(result))
                    }
                };
                let own = matches!(
                    (service, command),
                    (Service::ConfigureNodeId(_), 0x11)
                        | (Service::ConfigureBitTiming { .. }, 0x13)
                        | (Service::Store, 0x17)
                );
                if own {
                    assert_eq!(progress, result, "{service:?}: {bytes:02X?}");
                } else {
                    assert_expected(service, bytes, progress);
                }
                // Whatever came, it ends.
                for _ in 0..200 {
                    let now = master.next_deadline().unwrap_or(ms(0));
                    let _ = master.poll(now);
                }
                assert_eq!(master.next_deadline(), None);
            }
        }
    }
}

/// What answers to services other than the configuration ones lead to.
fn assert_expected(service: Service, bytes: [u8; 8], progress: Progress) {
    let expected = match (service, bytes[0], bytes[1]) {
        (Service::Select(_), 0x44, _) => Progress::Done(Outcome::Confirmed),
        (Service::Inquire(Part::Serial), 0x5D, low) => {
            Progress::Done(Outcome::Number(u32::from_le_bytes([low, 7, 0, 0])))
        }
        (Service::InquireNodeId, 0x5E, 0xFF) => Progress::Done(Outcome::Node(None)),
        (Service::InquireNodeId, 0x5E, id @ 1..=127) => {
            Progress::Done(Outcome::Node(NodeId::new(id)))
        }
        _ => Progress::Nothing,
    };
    assert_eq!(progress, expected, "{service:?}: {bytes:02X?}");
}

//! Every frame of every length to every COB-ID in every NMT state.

use crate::rig::Bench;
use canmaster::nmt::State;
use canmaster::{CobId, Frame};
use proptest::prelude::*;

const STATES: [State; 5] = [
    State::Initialising,
    State::Stopped,
    State::PreOperational,
    State::Operational,
    State::Other(0x33),
];

const REQUEST: u16 = 0x67F;

fn allows_sdo(state: State) -> bool {
    matches!(state, State::PreOperational | State::Operational)
}

#[test]
fn only_requests_are_answered() {
    for state in STATES {
        for id in 0..0x800 {
            let id = CobId::new(id).unwrap();
            for len in 0..=8 {
                let mut b = Bench::new();
                b.enter(state);
                let data = [0x40, 0x00, 0x10, 0, 0, 0, 0, 0];
                let data = Frame::data_frame(id, &data[..len]).unwrap();
                let remote = Frame::remote_frame(id, len as u8).unwrap();
                assert_eq!(b.frame(&remote), None);
                let expected = id.get() == REQUEST && len == 8 && allows_sdo(state);
                assert_eq!(b.frame(&data).is_some(), expected, "{id} {len} {state}");
                assert_eq!(b.events(), []);
            }
        }
    }
}

/// Entries of every type and access, and some that do not exist.
const ENTRIES: [(u16, u8); 26] = [
    (0x1000, 0),
    (0x1003, 0),
    (0x1003, 1),
    (0x1005, 0),
    (0x1006, 0),
    (0x1008, 0),
    (0x1010, 1),
    (0x1011, 1),
    (0x1014, 0),
    (0x1016, 6),
    (0x1017, 0),
    (0x1018, 4),
    (0x1019, 0),
    (0x1019, 1),
    (0x1029, 1),
    (0x1280, 3),
    (0x1400, 2),
    (0x1A00, 1),
    (0x1F22, 1),
    (0x1F25, 1),
    (0x1F80, 0),
    (0x1F81, 1),
    (0x1F82, 0x80),
    (0x2F10, 0),
    (0x3001, 1),
    (0x6040, 0),
];

/// Nothing but an abort goes unanswered where SDO is allowed, and nothing is
/// answered where it is not.
#[test]
fn every_command_to_an_entry_of_every_kind_in_every_state() {
    let tails = [
        [0; 4],
        [2, 0, 0, 0],
        [127, 0, 0, 0],
        [5, 0, 0, 0],
        [0xFF; 4],
    ];
    for state in STATES {
        for (index, sub) in ENTRIES {
            let [low, high] = index.to_le_bytes();
            let mut b = Bench::new();
            b.enter(state);
            for command in 0..=u8::MAX {
                for [t0, t1, t2, t3] in tails {
                    let bytes = [command, low, high, sub, t0, t1, t2, t3];
                    let answer = b.ask(bytes);
                    let expected = allows_sdo(state) && command >> 5 != 4;
                    assert_eq!(answer.is_some(), expected, "{state}: {bytes:02X?}");
                    // The next one begins anew.
                    assert_eq!(b.ask([0x80, low, high, sub, 0, 0, 0, 0]), None);
                    b.events();
                }
            }
            b.enter(State::PreOperational);
            assert_eq!(b.number(0x1200, 1), Ok(0x67F));
        }
    }
}

#[derive(Clone, Debug)]
enum Do {
    Frame(u16, [u8; 8], usize, bool),
    Request([u8; 8]),
    Object(u8, u16, u8, [u8; 4]),
    State(usize),
    Pass(u32),
}

fn anything() -> impl Strategy<Value = Do> {
    prop_oneof![
        (0u16..0x800, any::<[u8; 8]>(), 0usize..=8, any::<bool>())
            .prop_map(|(id, data, len, remote)| Do::Frame(id, data, len, remote)),
        any::<[u8; 8]>().prop_map(Do::Request),
        // Mostly what exists, with every command.
        (
            any::<u8>(),
            prop_oneof![
                0x1000u16..0x1030,
                0x1F20u16..0x1F90,
                0x2F00u16..0x2F12,
                0x1400u16..0x1410
            ],
            0u8..10,
            any::<[u8; 4]>()
        )
            .prop_map(|(command, index, sub, data)| Do::Object(command, index, sub, data)),
        (0..STATES.len()).prop_map(Do::State),
        (0u32..2_000_000).prop_map(Do::Pass),
    ]
}

proptest! {
    /// No panic, at most one answer of eight bytes, no answer where SDO is not
    /// allowed; and afterwards the device is of use.
    #[test]
    fn nothing_confuses_it(steps in prop::collection::vec(anything(), 0..60)) {
        let mut b = Bench::new();
        let mut state = State::PreOperational;
        for step in steps {
            let frame = match step {
                Do::Frame(id, data, len, remote) => {
                    let id = CobId::new(id).unwrap();
                    if remote {
                        Frame::remote_frame(id, len as u8).unwrap()
                    } else {
                        Frame::data_frame(id, &data[..len]).unwrap()
                    }
                }
                Do::Request(bytes) => Frame::full(CobId::new(REQUEST).unwrap(), bytes),
                Do::Object(command, index, sub, [a, b, c, d]) => {
                    let [low, high] = index.to_le_bytes();
                    let bytes = [command, low, high, sub, a, b, c, d];
                    Frame::full(CobId::new(REQUEST).unwrap(), bytes)
                }
                Do::State(n) => {
                    state = STATES[n];
                    b.enter(state);
                    continue;
                }
                Do::Pass(us) => {
                    b.now += canmaster::Duration::from_micros(us);
                    for _ in 0..200 {
                        let Some(sent) = b.poll() else { break };
                        prop_assert!(allows_sdo(state) || sent.id().get() != 0x5FF);
                    }
                    continue;
                }
            };
            if let Some(answer) = b.frame(&frame) {
                prop_assert!(allows_sdo(state));
                prop_assert_eq!(answer.id().get(), 0x5FF);
                prop_assert_eq!(answer.dlc(), 8);
                prop_assert_eq!(frame.id().get(), REQUEST);
            }
            b.events();
        }
        b.enter(State::PreOperational);
        // An abort ends whatever is under way.
        prop_assert_eq!(b.ask([0x80, 0, 0, 0, 0, 0, 0, 0]), None);
        prop_assert_eq!(b.number(0x1200, 1), Ok(0x67F));
    }
}

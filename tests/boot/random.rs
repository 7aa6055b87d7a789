//! Any frame at any time.

use crate::networks::network;
use crate::rig::{Rig, cob_id, id, ms};
use canmaster::boot::{Action, Assignment, Startup};
use canmaster::nmt::{Command, NodeControl};
use canmaster::{CobId, Frame};
use proptest::prelude::*;

#[derive(Clone, Debug)]
enum Stimulus {
    Frame(u16, Vec<u8>, bool),
    Wait(u32),
    Lost(u8),
    BusOff,
    Request(u8, u8),
}

fn stimulus() -> impl Strategy<Value = Stimulus> {
    let function = prop_oneof![Just(0x580_u16), Just(0x700), Just(0x080), Just(0x7E4)];
    let state = prop_oneof![Just(0_u8), Just(4), Just(5), Just(0x7F), any::<u8>()];
    let data = proptest::collection::vec(any::<u8>(), 0..=8);
    prop_oneof![
        // Mostly what looks like error control.
        4 => (1..=3_u16, state).prop_map(|(node, state)| {
            Stimulus::Frame(0x700 + node, vec![state], false)
        }),
        4 => (function, 0..=3_u16, data.clone(), prop::bool::weighted(0.05))
            .prop_map(|(base, node, data, remote)| Stimulus::Frame(base + node, data, remote)),
        1 => (0..0x800_u16, data).prop_map(|(id, data)| Stimulus::Frame(id, data, false)),
        6 => (0..700_u32).prop_map(Stimulus::Wait),
        1 => (1..=3_u8).prop_map(Stimulus::Lost),
        1 => Just(Stimulus::BusOff),
        2 => (0..=4_u8, prop_oneof![Just(1_u8), Just(2), Just(0x80), Just(0x81), Just(0x82)])
            .prop_map(|(node, command)| Stimulus::Request(node, command)),
    ]
}

fn apply(rig: &mut Rig, stimulus: &Stimulus, deaf: Option<u16>) {
    match stimulus {
        Stimulus::Frame(number, data, remote) => {
            let cob_id = cob_id(*number);
            let from_deaf = cob_id
                .split()
                .is_some_and(|(_, node)| Some(u16::from(node.get())) == deaf);
            if !from_deaf {
                let frame = if *remote {
                    Frame::remote_frame(cob_id, data.len() as u8)
                } else {
                    Frame::data_frame(cob_id, data)
                };
                rig.boot.on_frame(&frame.unwrap(), rig.now);
            }
        }
        Stimulus::Wait(span) => rig.run_for(ms(*span)),
        Stimulus::Lost(node) => {
            rig.boot.node_lost(id(*node));
        }
        Stimulus::BusOff => rig.boot.bus_off(rig.now),
        Stimulus::Request(node, command) => {
            let command = Command::from_code(*command);
            let control = match node {
                0 => NodeControl::all(command),
                node => NodeControl::node(command, id(*node)),
            };
            let _ = rig.boot.request(control, rig.now);
        }
    }
    // Whatever came, it comes to rest.
    for _ in 0..1000 {
        match rig.boot.poll(rig.now) {
            None => return,
            Some(Action::Send(frame)) => rig.sent.push((rig.now, frame)),
            Some(_) => {}
        }
    }
    panic!("actions without end");
}

fn starts(rig: &Rig) -> usize {
    let start = |data: &[u8; 2]| data[0] == 0x01;
    rig.nmt().into_iter().filter(start).count()
}

fn with_bits(startup: u32, assignments: [u32; 3]) -> Rig {
    let network = network(3, |node, _| node.serial = Some(7));
    let mut rig = Rig::with(network, |settings| {
        settings.startup = Startup(Startup::MASTER | startup & Startup::OFFERED);
        for (node, bits) in settings.nodes.iter_mut().zip(assignments) {
            // Guarding at most every 255 ms, seven retries.
            node.assignment = Assignment(bits & Assignment::OFFERED & 0x00FF_07FF);
            node.restore = 1;
        }
    });
    rig.fakes[1].set((0x1018, 4), 7);
    rig
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(128) })]

    #[test]
    fn nothing_panics_or_hangs(
        startup in any::<u32>(),
        assignments in any::<[u32; 3]>(),
        stimuli in proptest::collection::vec(stimulus(), 0..80),
    ) {
        let mut rig = with_bits(startup, assignments);
        for stimulus in &stimuli {
            apply(&mut rig, stimulus, None);
        }
    }

    #[test]
    fn a_network_without_a_mandatory_node_is_never_started(
        startup in any::<u32>(),
        assignments in any::<[u32; 3]>(),
        stimuli in proptest::collection::vec(stimulus(), 0..80),
    ) {
        let mandatory = Assignment::LISTED | Assignment::MAY_START | Assignment::MANDATORY;
        let [first, second, third] = assignments;
        let mut rig = with_bits(startup, [first, second | mandatory, third]);
        rig.fakes[1].missing = true;
        for stimulus in &stimuli {
            apply(&mut rig, stimulus, Some(2));
            prop_assert_eq!(starts(&rig), 0);
            prop_assert!(!rig.boot.is_ready());
        }
    }

    #[test]
    fn whatever_happened_a_reset_of_all_leads_to_a_running_network(
        stimuli in proptest::collection::vec(stimulus(), 0..40),
    ) {
        let mut rig = Rig::new(network(3, |_, _| {}));
        for stimulus in &stimuli {
            apply(&mut rig, stimulus, None);
        }
        // The longest pause after bus-off, and the silent phase.
        rig.run_for(ms(8000));
        let reset = NodeControl::all(Command::ResetCommunication);
        prop_assert_eq!(rig.boot.request(reset, rig.now), Ok(()));
        rig.run_for(ms(3000));
        prop_assert!(rig.boot.is_ready());
    }
}

#[test]
fn frames_of_strangers_are_left_alone() {
    let mut rig = Rig::new(network(2, |_, _| {}));
    rig.run_for(ms(700));
    rig.forget();
    for number in (0..0x800).filter(|number| !matches!(number, 0x701 | 0x702)) {
        for len in 0..=8 {
            let frame = Frame::data_frame(CobId::new(number).unwrap(), &[0; 8][..len]).unwrap();
            rig.boot.on_frame(&frame, rig.now);
            rig.run();
        }
    }
    assert_eq!((rig.sent.len(), rig.events.len()), (0, 0));
}

//! Whatever happens on the bus, some things always hold.

use super::*;
use proptest::prelude::*;

#[derive(Clone, Debug)]
enum Action {
    Send { port: usize, id: u16, data: u64 },
    Switch { port: usize, on: bool },
    Restart { port: usize },
    Rate { port: usize, rate: u32 },
    Fault(BusFault),
}

const NODES: usize = 5;

fn action() -> impl Strategy<Value = Action> {
    let port = 0..NODES;
    let some_port = prop::option::of((0..NODES).prop_map(PortId));
    let span = (0u64..3_000, 1u64..500)
        .prop_map(|(from, len)| (Time::from_us(from), Time::from_us(from + len)));
    prop_oneof![
        12 => (port.clone(), 0u16..16, any::<u64>())
            .prop_map(|(port, id, data)| Action::Send { port, id, data }),
        1 => (port.clone(), any::<bool>()).prop_map(|(port, on)| Action::Switch { port, on }),
        1 => port.clone().prop_map(|port| Action::Restart { port }),
        1 => (port, prop_oneof![Just(RATE), Just(RATE / 2), Just(2 * RATE), Just(RATE / 10 * 9)])
            .prop_map(|(port, rate)| Action::Rate { port, rate }),
        1 => (some_port.clone(), span.clone()).prop_map(|(isolated, (from, until))| {
            Action::Fault(BusFault::Cut { isolated, from, until })
        }),
        1 => span.clone().prop_map(|(from, until)| {
            Action::Fault(BusFault::StuckDominant { from, until })
        }),
        1 => (1e-4..1e-2, span).prop_map(|(rate, (from, until))| {
            Action::Fault(BusFault::BitErrors { rate, from, until })
        }),
        2 => (0u16..16, 0u32..60, some_port).prop_map(|(id, bit, seen_by)| {
            Action::Fault(BusFault::FlipBit { id: WireId::Standard(id), bit, seen_by })
        }),
    ]
}

fn play(actions: &[(u64, Action)]) -> Net {
    let timing = |rate| Some(BitTiming::new(rate, 0.0));
    let clocks = [0.0, 50.0, -100.0, 100.0, 13.0];
    let mut net = Net::with_clocks(&clocks);
    let mut now = Time::from_us(10);
    for (gap_ns, action) in actions {
        now += Time::from_ns(*gap_ns);
        net.run(now);
        match action.clone() {
            Action::Send { port, id, data } => {
                let len = data as usize % 9;
                net.send(
                    port,
                    WireFrame::standard(id, &data.to_le_bytes()[..len]),
                    now,
                );
            }
            Action::Switch { port, on } => {
                net.bus
                    .set_timing(PortId(port), timing(RATE).filter(|_| on), now);
                net.offer(port);
            }
            Action::Restart { port } => {
                net.bus.reset(PortId(port), now);
                net.bus.set_timing(PortId(port), timing(RATE), now);
                net.offer(port);
            }
            Action::Rate { port, rate } => {
                net.bus.set_timing(PortId(port), timing(rate), now);
                net.offer(port);
            }
            Action::Fault(fault) => net.bus.inject(fault),
        }
    }
    net
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]
    #[test]
    fn invariants(actions in prop::collection::vec((0u64..300_000, action()), 1..60)) {
        let mut net = play(&actions);
        // Faults are over by now, all nodes are restarted with the right rate
        // and nothing to say but one frame each.
        let calm = net.now + Time::from_ms(5);
        net.run(calm);
        for queue in &mut net.queues {
            queue.clear();
        }
        for port in 0..NODES {
            net.bus.reset(PortId(port), calm);
        }
        // The bit flips that were never reached stay ordered: other identifiers.
        for port in 0..NODES {
            net.bus.set_timing(PortId(port), Some(BitTiming::new(RATE, 0.0)), calm);
            net.send(port, WireFrame::standard(0x100 + port as u16, &[]), calm);
        }
        let before = net.log.len();
        net.run(calm + Time::from_ms(2));

        let after = &net.log[before..];
        for port in 0..NODES {
            let mine = |e: &&Event| e.port.0 == port;
            let done = |e: &&Event| matches!(e.kind, EventKind::TxDone { .. });
            let rx = |e: &&Event| matches!(e.kind, EventKind::Rx { .. });
            prop_assert_eq!(after.iter().filter(mine).filter(done).count(), 1);
            prop_assert_eq!(after.iter().filter(mine).filter(rx).count(), NODES - 1);
        }
        // Every start has one end, and starts do not overlap, unless the node
        // was switched off in between; counters and states agree.
        for port in 0..NODES {
            let mut sending = false;
            for event in net.log.iter().filter(|e| e.port.0 == port) {
                match event.kind {
                    EventKind::TxStarted { .. } => sending = true,
                    EventKind::TxDone { .. }
                    | EventKind::TxError { .. }
                    | EventKind::ArbitrationLost { .. } => {
                        prop_assert!(sending, "{event:?}");
                        sending = false;
                    }
                    EventKind::Rx { .. } => prop_assert!(!sending, "{event:?}"),
                    EventKind::Counters { tec, rec, state } => {
                        prop_assert_eq!(state == ErrorState::BusOff, tec > 255);
                        prop_assert_eq!(
                            state == ErrorState::Passive,
                            tec <= 255 && tec.max(rec) > 127
                        );
                    }
                    EventKind::RxError { .. } => {}
                }
            }
        }
        let records = net.bus.take_records();
        for record in &records {
            prop_assert!(record.end >= record.sof);
        }
        for pair in records.windows(2) {
            prop_assert!(pair[0].sof <= pair[1].sof, "{pair:?}");
        }
        // The last ones are the five calm frames, back to back.
        let calm_ones = &records[records.len() - NODES..];
        for pair in calm_ones.windows(2) {
            prop_assert_eq!(pair[0].end, pair[1].sof);
        }
    }

    #[test]
    fn the_same_again_is_the_same(
        actions in prop::collection::vec((0u64..300_000, action()), 1..60),
    ) {
        let (mut a, mut b) = (play(&actions), play(&actions));
        prop_assert_eq!(&a.log, &b.log);
        prop_assert_eq!(a.bus.take_records(), b.bus.take_records());
    }
}

use super::*;

fn cyclic(net: &mut Net, until: u64) {
    for cycle in 0..until / 1000 {
        let at = Time::from_us(100 + 1000 * cycle);
        for port in 0..net.bus.ports() {
            let frame = WireFrame::standard(0x180 + port as u16, &cycle.to_le_bytes()[..6]);
            net.send(port, frame, at);
        }
        net.run(at + Time::from_us(900));
    }
}

#[test]
fn noise_is_repaired_by_retransmission_and_seeded() {
    let run = |seed| {
        let timing = Some(BitTiming::new(RATE, 0.0));
        let mut net = Net::with_timings(Bus::new(seed), vec![timing; 4]);
        net.bus.inject(BusFault::BitErrors {
            rate: 1e-4,
            from: Time::from_us(100),
            until: Time::from_ms(190),
        });
        cyclic(&mut net, 200_000);
        let records = net.bus.take_records();
        (net, records)
    };
    let (net, records) = run(3);
    let destroyed = records
        .iter()
        .filter(|r| !matches!(r.kind, RecordKind::Frame(_)))
        .count();
    assert!((5..60).contains(&destroyed), "{destroyed}");
    for port in 0..4 {
        assert_eq!(net.done(port), 200);
    }
    assert_eq!(run(3).1, records);
    assert_ne!(run(4).1, records);
}

#[test]
fn a_cut_off_node_hears_nothing_and_comes_back() {
    let mut net = Net::new(3).settled();
    net.bus.inject(BusFault::Cut {
        isolated: Some(PortId(2)),
        from: Time::from_ms(10),
        until: Time::from_ms(20),
    });
    cyclic(&mut net, 40_000);
    // It repeated one frame in vain and became passive.
    assert!(net.errors(2).contains(&WireError::Ack));
    let passive = net.log.iter().any(|e| {
        e.port.0 == 2
            && matches!(
                e.kind,
                EventKind::Counters {
                    state: ErrorState::Passive,
                    ..
                }
            )
    });
    assert!(passive);
    assert_eq!(
        net.received(0)
            .iter()
            .filter(|id| **id == std_id(0x181))
            .count(),
        40
    );
    assert_eq!(net.done(2), 40);
    assert_ne!(net.counters(2).2, ErrorState::BusOff);
    // What it sent alone was not on the others' wire.
    let records = net.bus.take_records();
    let lost = |r: &&WireRecord| r.sof > Time::from_ms(11) && r.sof < Time::from_ms(19);
    assert!(
        records
            .iter()
            .filter(lost)
            .all(|r| r.transmitters != [PortId(2)])
    );
}

#[test]
fn an_open_cable_leaves_everybody_alone() {
    let mut net = Net::new(3).settled();
    net.bus.inject(BusFault::Cut {
        isolated: None,
        from: Time::from_ms(1),
        until: Time::from_ms(3),
    });
    cyclic(&mut net, 10_000);
    assert!((0..3).all(|port| net.errors(port).contains(&WireError::Ack)));
    assert!((0..3).all(|port| net.done(port) == 10));
}

#[test]
fn a_bus_held_dominant_is_survived() {
    let mut net = Net::new(3).settled();
    net.bus.inject(BusFault::StuckDominant {
        from: Time::from_ms(5),
        until: Time::from_ms(8),
    });
    cyclic(&mut net, 20_000);
    // Nobody sent at its beginning, so nobody's transmit counter rose.
    let worst = |port: usize| {
        let states = net.kinds(port).into_iter().filter_map(|k| match k {
            EventKind::Counters { state, .. } => Some(state),
            _ => None,
        });
        states.max()
    };
    assert!((0..3).all(|port| worst(port) == Some(ErrorState::Passive)));
    assert!((0..3).all(|port| net.done(port) == 20));
    assert_eq!(net.counters(0).2, ErrorState::Active);
}

#[test]
fn each_single_bit_of_a_frame_inverted_is_noticed_and_repaired() {
    let frame = WireFrame::standard(0x181, &[0x12, 0x00, 0xFF]);
    let bits = frame.encode().len();
    for seen_by in [None, Some(PortId(0)), Some(PortId(2))] {
        for bit in 1..bits - 1 {
            let mut net = Net::new(3).settled();
            net.bus.inject(BusFault::FlipBit {
                id: frame.id,
                bit,
                seen_by,
            });
            net.send(0, frame, Time::from_us(100));
            net.run(Time::from_ms(1));
            assert_eq!(net.done(0), 1, "{seen_by:?} bit {bit}");
            // The last but one bit of EOF may double a frame, never lose one.
            for port in [1, 2] {
                let copies = net.received(port);
                assert!(
                    !copies.is_empty() && copies.len() <= 2,
                    "{seen_by:?} bit {bit}"
                );
                assert!(copies.iter().all(|id| *id == frame.id));
            }
        }
    }
}

#[test]
fn a_sender_switched_off_in_the_middle_of_a_frame() {
    for off_us in 101..215 {
        let mut net = Net::new(3).settled();
        net.send(
            0,
            WireFrame::standard(0x100, &[0x55; 8]),
            Time::from_us(100),
        );
        net.run(Time::from_us(off_us));
        net.bus.set_timing(PortId(0), None, Time::from_us(off_us));
        net.send(1, WireFrame::standard(0x300, &[]), Time::from_us(off_us));
        net.run(Time::from_ms(1));
        assert_eq!(net.done(1), 1, "{off_us}");
        let got = net.received(2);
        assert_eq!(got.last(), Some(&std_id(0x300)), "{off_us}");
        // Nobody was told anything twice.
        assert!(got.len() <= 2 && net.kinds(0).len() <= 2);
    }
}

use super::*;

#[test]
fn a_frame_takes_its_bits() {
    let mut net = Net::new(2).settled();
    let frame = WireFrame::standard(0x181, &[1, 2, 3, 4, 5, 6]);
    net.send(0, frame, Time::from_us(100));
    net.run(Time::from_ms(1));
    let records = net.bus.take_records();
    let [record] = records.as_slice() else {
        panic!("{records:?}");
    };
    assert_eq!(record.sof, Time::from_us(100));
    assert_eq!(record.bits, frame.bits());
    assert_eq!(record.end, Time::from_us(100 + u64::from(frame.bits())));
    assert_eq!(record.transmitters, [PortId(0)]);
    assert_eq!(record.kind, RecordKind::Frame(frame));
    assert_eq!(
        net.kinds(0),
        [
            EventKind::TxStarted { tag: 0 },
            EventKind::TxDone {
                tag: 0,
                sof: record.sof
            }
        ]
    );
    assert_eq!(
        net.kinds(1),
        [EventKind::Rx {
            frame,
            sof: record.sof
        }]
    );
    // Valid for the receiver one bit before the sender is done.
    let at: Vec<_> = net.log.iter().map(|e| e.at).collect();
    assert_eq!(at[2] - at[1], Time::from_us(1));
    assert_eq!(record.end - at[2], Time::from_ns(3125));
}

#[test]
fn a_frame_starts_on_the_senders_own_bit_boundary() {
    for ready in 0..20 {
        let mut net = Net::new(2).settled();
        net.send(
            0,
            WireFrame::standard(1, &[]),
            Time::from_ns(100_000 + 100 * ready),
        );
        net.run(Time::from_ms(1));
        let sof = net.bus.take_records()[0].sof;
        assert_eq!(sof, Time::from_us(100 + ready.div_ceil(10)));
    }
}

#[test]
fn frames_follow_each_other_after_three_bits() {
    let mut net = Net::new(3).settled();
    for id in 0..50 {
        net.send(
            id as usize % 2,
            WireFrame::standard(id, &[0; 8]),
            Time::from_us(100),
        );
    }
    net.run(Time::from_ms(20));
    let records = net.bus.take_records();
    assert_eq!(records.len(), 50);
    for pair in records.windows(2) {
        assert_eq!(pair[0].end, pair[1].sof);
    }
    assert_eq!(net.received(2).len(), 50);
}

#[test]
fn clocks_drift_for_a_long_time_without_an_error() {
    let ppm = [100.0, -100.0, 37.0, -63.0, 0.0, 99.0, -99.0];
    let mut net = Net::with_clocks(&ppm).settled();
    const CYCLES: u64 = 5000;
    for cycle in 0..CYCLES {
        let at = Time::from_us(100) + Time::from_ms(2) * cycle;
        net.send(0, WireFrame::standard(0x80, &[]), at);
        for node in 1..7u16 {
            let data = (cycle * 0x0101_0101).to_le_bytes();
            let frame = WireFrame::standard(0x180 + node, &data[..6]);
            net.send(
                usize::from(node),
                frame,
                at + Time::from_us(50 + 30 * u64::from(node)),
            );
        }
        net.run(at + Time::from_us(1900));
    }
    let records = net.bus.take_records();
    assert_eq!(records.len() as u64, 7 * CYCLES);
    assert!(
        records
            .iter()
            .all(|r| matches!(r.kind, RecordKind::Frame(_)))
    );
    for port in 0..7 {
        assert_eq!(net.done(port) as u64, CYCLES);
        assert_eq!(net.received(port).len() as u64, 6 * CYCLES);
        assert_eq!(net.errors(port), []);
    }
    // Each sender waits for its own boundary: up to a bit late, never early.
    for (cycle, sync) in records
        .iter()
        .filter(|r| r.transmitters == [PortId(0)])
        .enumerate()
    {
        let asked = Time::from_us(100) + Time::from_ms(2) * cycle as u64;
        assert!(sync.sof >= asked && sync.sof <= asked + Time::from_us(1));
    }
}

#[test]
fn nothing_happens_on_a_quiet_bus() {
    let mut net = Net::new(127).settled();
    assert_eq!(net.bus.next_event(), None);
    net.run(Time::from_s(10));
    assert!(net.log.is_empty() && net.bus.take_records().is_empty());
}

#[test]
fn other_bit_rates_and_127_nodes() {
    for rate in [10_000, 125_000, 500_000, 800_000] {
        let timing = Some(BitTiming::new(rate, 50.0));
        let mut net = Net::with_timings(Bus::new(1), vec![timing; 127]);
        let frame = WireFrame::standard(0x77F, &[0xAA; 8]);
        net.run(Time::from_ms(2));
        net.send(126, frame, Time::from_ms(2));
        net.run(Time::from_ms(40));
        let record = &net.bus.take_records()[0];
        assert_eq!(record.bits, frame.bits());
        let bit = BitTiming::new(rate, 50.0).bit_time_ps;
        assert_eq!((record.end - record.sof).0, bit * u64::from(frame.bits()));
        assert!((0..126).all(|port| net.received(port).len() == 1));
    }
}

#[test]
fn a_node_joins_after_eleven_recessive_bits() {
    let mut bus = Bus::new(0);
    let timing = Some(BitTiming::new(RATE, 0.0));
    let (a, b) = (bus.attach("a"), bus.attach("b"));
    bus.set_timing(a, timing, Time::ZERO);
    bus.set_timing(b, timing, Time::ZERO);
    let frame = WireFrame::standard(5, &[]);
    let offer = Offer {
        frame,
        ready_at: Time::ZERO,
        tag: 9,
    };
    bus.offer(a, Some(offer));
    bus.advance(Time::from_ms(1), &mut Vec::new());
    assert_eq!(bus.take_records()[0].sof, Time::from_us(11));
}

#[test]
fn a_node_switched_on_in_the_middle_of_traffic_waits_for_its_end() {
    let timing = Some(BitTiming::new(RATE, 0.0));
    let mut net = Net::with_timings(Bus::new(1), vec![timing, timing, None]);
    for id in 0..10 {
        net.send(0, WireFrame::standard(id, &[0; 8]), Time::from_us(20));
    }
    net.run(Time::from_us(333));
    net.bus.set_timing(PortId(2), timing, Time::from_us(333));
    net.run(Time::from_ms(2));
    assert_eq!(net.received(1).len(), 10);
    assert_eq!(net.received(2).len(), 7);
    assert_eq!(net.errors(2), []);
    assert!(
        net.bus
            .take_records()
            .iter()
            .all(|r| matches!(r.kind, RecordKind::Frame(_)))
    );
}

#[test]
fn a_wrong_bit_rate_destroys_the_traffic_until_the_node_is_silenced() {
    // Half the rate: the stranger flags every frame until it is passive.
    let right = Some(BitTiming::new(RATE, 0.0));
    let wrong = Some(BitTiming::new(RATE / 2, 0.0));
    let mut net = Net::with_timings(Bus::new(1), vec![right, right, wrong]);
    for id in 0..100 {
        net.send(0, WireFrame::standard(id, &[0x0F; 8]), Time::from_us(100));
    }
    net.run(Time::from_ms(60));
    assert_eq!(net.received(2), []);
    assert!(!net.errors(0).is_empty());
    let records = net.bus.take_records();
    let destroyed = |r: &&WireRecord| matches!(r.kind, RecordKind::ErrorFrame { .. });
    assert!(records.iter().filter(destroyed).count() >= 10);
    assert_eq!(net.counters(2).2, ErrorState::Passive);
    // From then on the others get through (a flag into the last bit of a frame
    // may double it).
    assert_eq!(net.done(0), 100);
    let mut heard = net.received(1);
    heard.dedup();
    assert_eq!(heard.len(), 100);
}

#[test]
fn clock_errors_within_the_tolerance_do_no_harm_beyond_it_do() {
    // Jump width and second phase segment are an eighth of a bit, edges at
    // most ten bits apart: 2 * df * 10 bits < 1/8 bit, df < 0.6 %.
    for (ppm, good) in [(3000.0, true), (5000.0, true), (30_000.0, false)] {
        let mut net = Net::with_clocks(&[0.0, ppm, 0.0]).settled();
        net.retransmit = false;
        for id in 0..20 {
            let at = Time::from_us(100 + 400 * u64::from(id));
            net.send(0, WireFrame::standard(id, &[0xF0; 8]), at);
            net.run(at + Time::from_us(300));
        }
        assert_eq!(net.received(1).len() == 20, good, "{ppm}");
        assert_eq!(net.errors(1).is_empty(), good, "{ppm}");
    }
}

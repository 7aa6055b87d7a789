use super::*;

#[test]
fn the_lowest_identifier_goes_first() {
    let mut net = Net::new(5).settled();
    let ids = [0x7FF, 0x180, 0x080, 0x181, 0x000];
    for (port, id) in ids.into_iter().enumerate() {
        net.send(
            port,
            WireFrame::standard(id, &[port as u8]),
            Time::from_us(100),
        );
    }
    net.run(Time::from_ms(1));
    let order: Vec<_> = net
        .bus
        .take_records()
        .iter()
        .map(|r| r.transmitters[0].0)
        .collect();
    assert_eq!(order, [4, 2, 1, 3, 0]);
    for port in 0..5 {
        assert_eq!(net.done(port), 1);
        assert_eq!(net.received(port).len(), 4);
    }
    let lost = |port| {
        let kinds = net.kinds(port);
        kinds
            .iter()
            .filter(|k| matches!(k, EventKind::ArbitrationLost { .. }))
            .count()
    };
    assert_eq!([0, 1, 2, 3, 4].map(lost), [4, 2, 1, 3, 0]);
}

#[test]
fn arbitration_is_lost_at_the_bit_that_differs() {
    let mut net = Net::new(3).settled();
    net.send(
        0,
        WireFrame::standard(0b100_0000_0000, &[]),
        Time::from_us(100),
    );
    net.send(
        1,
        WireFrame::standard(0b000_0000_0000, &[]),
        Time::from_us(100),
    );
    net.send(
        2,
        WireFrame::standard(0b000_0000_0001, &[]),
        Time::from_us(100),
    );
    net.run(Time::from_us(130));
    let at = |port: usize| {
        let lost = |e: &&Event| matches!(e.kind, EventKind::ArbitrationLost { .. });
        net.log
            .iter()
            .filter(|e| e.port.0 == port)
            .find(lost)
            .unwrap()
            .at
    };
    // The first identifier bit, at its sample point.
    assert_eq!(at(0), Time::from_ns(101_875));
    // The eleventh, behind two stuff bits.
    assert_eq!(at(2), Time::from_ns(100_000 + 11_875 + 2_000));
}

#[test]
fn a_data_frame_beats_the_remote_frame_and_the_base_format_the_extended() {
    let mut net = Net::new(4).settled();
    let at = Time::from_us(100);
    net.send(0, WireFrame::remote(WireId::Extended(0x123 << 18), 0), at);
    net.send(1, WireFrame::extended(0x123 << 18, &[]), at);
    net.send(2, WireFrame::remote(WireId::Standard(0x123), 1), at);
    net.send(3, WireFrame::standard(0x123, &[1]), at);
    net.run(Time::from_ms(2));
    let order: Vec<_> = net
        .bus
        .take_records()
        .iter()
        .map(|r| r.transmitters[0].0)
        .collect();
    assert_eq!(order, [3, 2, 1, 0]);
    assert!((0..4).all(|port| net.errors(port).is_empty()));
}

#[test]
fn who_waits_for_its_boundary_when_the_first_starts_joins() {
    // Grids of 100 ppm difference drift apart by half a bit in 5 ms.
    let mut net = Net::with_clocks(&[0.0, 100.0, 0.0]).settled();
    net.send(0, WireFrame::standard(0x200, &[]), Time::from_us(5_500));
    net.send(1, WireFrame::standard(0x100, &[]), Time::from_us(5_500));
    net.run(Time::from_ms(10));
    let records = net.bus.take_records();
    assert_eq!(records[0].transmitters, [PortId(1)]);
    assert_eq!(
        net.kinds(0)[..2],
        [
            EventKind::TxStarted { tag: 0 },
            EventKind::ArbitrationLost { tag: 0 }
        ]
    );
}

#[test]
fn who_becomes_ready_after_the_start_of_frame_waits() {
    let mut net = Net::new(3).settled();
    net.send(0, WireFrame::standard(0x200, &[]), Time::from_us(100));
    net.send(
        1,
        WireFrame::standard(0x100, &[]),
        Time(Time::from_us(100).0 + 1),
    );
    net.run(Time::from_ms(1));
    let records = net.bus.take_records();
    assert_eq!(records[0].transmitters, [PortId(0)]);
    assert_eq!(records[1].transmitters, [PortId(1)]);
    assert_eq!(records[1].sof, records[0].end);
}

#[test]
fn identical_frames_in_the_same_bit_are_one_frame() {
    let mut net = Net::new(3).settled();
    let frame = WireFrame::remote(WireId::Standard(0x705), 1);
    net.send(0, frame, Time::from_us(100));
    net.send(1, frame, Time::from_us(100));
    net.run(Time::from_ms(1));
    let records = net.bus.take_records();
    assert_eq!(records.len(), 1);
    assert_eq!(records[0].transmitters, [PortId(0), PortId(1)]);
    assert_eq!((net.done(0), net.done(1)), (1, 1));
    assert_eq!(net.received(2), [std_id(0x705)]);
    assert_eq!(net.received(0), []);
}

#[test]
fn an_offer_may_change_until_it_starts() {
    let mut net = Net::new(2).settled();
    net.send(0, WireFrame::standard(0x200, &[]), Time::from_us(100));
    net.run(Time::from_us(99));
    net.queues[0].clear();
    net.offer(0);
    net.run(Time::from_us(200));
    assert!(net.log.is_empty());
    net.send(0, WireFrame::standard(0x300, &[]), Time::from_us(100));
    net.run(Time::from_us(300));
    assert_eq!(net.received(1), [std_id(0x300)]);
    // Asked for in the past: not before now.
    assert_eq!(net.bus.take_records()[0].sof, Time::from_us(200));
}

//! The express way and the bitwise one give the same events.

use super::*;
use proptest::prelude::*;

/// A few nanoseconds, see the module's list of simplifications.
const TOLERANCE: Time = Time::from_ns(20);

fn traffic(express: bool, ppm: &[f64], frames: &[(usize, u16, u64, u64)]) -> Net {
    let bus = if express {
        Bus::new(1)
    } else {
        Bus::new(1).without_express()
    };
    let timings = ppm.iter().map(|ppm| Some(BitTiming::new(RATE, *ppm)));
    let mut net = Net::with_timings(bus, timings.collect());
    for &(port, id, data, at) in frames {
        // The node's number in the data: no two nodes send the same
        // identifier with different data.
        let id = id << 3 | port as u16;
        let len = data as usize % 9;
        net.send(
            port,
            WireFrame::standard(id, &data.to_le_bytes()[..len]),
            Time::from_ns(at),
        );
    }
    net.run(Time::from_ms(10));
    net
}

fn same(a: &Net, b: &Net) {
    for port in 0..a.bus.ports() {
        let pick = |net: &Net| -> Vec<Event> {
            net.log
                .iter()
                .filter(|e| e.port.0 == port)
                .copied()
                .collect()
        };
        let (a, b) = (pick(a), pick(b));
        assert_eq!(a.len(), b.len(), "port {port}\n{a:?}\n{b:?}");
        for (x, y) in a.iter().zip(&b) {
            assert!(
                x.at.since(y.at) <= TOLERANCE && y.at.since(x.at) <= TOLERANCE,
                "{x:?} {y:?}"
            );
            match (x.kind, y.kind) {
                (EventKind::Rx { frame: f, .. }, EventKind::Rx { frame: g, .. }) => {
                    assert_eq!(f, g);
                }
                (EventKind::TxDone { tag: f, .. }, EventKind::TxDone { tag: g, .. }) => {
                    assert_eq!(f, g);
                }
                (f, g) => assert_eq!(f, g),
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    #[test]
    fn express_and_bitwise_agree(
        ppm in prop::collection::vec(-100.0..100.0f64, 4),
        frames in prop::collection::vec((0usize..4, 0u16..0xF0, any::<u64>(), 50_000u64..1_500_000), 1..20),
    ) {
        let mut fast = traffic(true, &ppm, &frames);
        let mut slow = traffic(false, &ppm, &frames);
        same(&fast, &slow);
        let (a, b) = (fast.bus.take_records(), slow.bus.take_records());
        prop_assert_eq!(a.len(), b.len());
        for (x, y) in a.iter().zip(&b) {
            prop_assert_eq!(x.kind, y.kind);
            prop_assert_eq!(x.bits, y.bits);
            prop_assert_eq!(&x.transmitters, &y.transmitters);
            prop_assert!(x.sof.since(y.sof) <= TOLERANCE && y.sof.since(x.sof) <= TOLERANCE);
            prop_assert!(x.end.since(y.end) <= TOLERANCE && y.end.since(x.end) <= TOLERANCE);
        }
        // And again: the same.
        let again = traffic(true, &ppm, &frames);
        prop_assert_eq!(again.log, fast.log);
    }

    /// A node that leaves in the middle of a frame takes the frame off the
    /// express way without anybody noticing.
    #[test]
    fn an_interrupted_frame_agrees_too(
        ppm in prop::collection::vec(-100.0..100.0f64, 4),
        off_ns in 100_000u64..260_000,
        port in 0usize..4,
    ) {
        let run = |express: bool| {
            let bus = if express { Bus::new(1) } else { Bus::new(1).without_express() };
            let timings = ppm.iter().map(|ppm| Some(BitTiming::new(RATE, *ppm)));
            let mut net = Net::with_timings(bus, timings.collect());
            net.send(0, WireFrame::standard(0x100, &[0x0F; 8]), Time::from_us(100));
            net.send(1, WireFrame::standard(0x110, &[0xF0; 8]), Time::from_us(100));
            let off = Time::from_ns(off_ns);
            net.run(off);
            net.bus.set_timing(PortId(port), None, off);
            net.run(Time::from_ms(2));
            net
        };
        let (fast, slow) = (run(true), run(false));
        // Within the tolerance of the moment itself either order is right.
        let close = |net: &Net| net.log.iter().any(|e| {
            let d = e.at.since(Time::from_ns(off_ns)).max(Time::from_ns(off_ns).since(e.at));
            d <= TOLERANCE
        });
        prop_assume!(!close(&fast) && !close(&slow));
        same(&fast, &slow);
    }
}

use proptest::prelude::*;

use crate::bridge::Adapter;
use crate::bus::{BitTiming, Bus, EventKind, Offer, PortId, RecordKind};
use crate::frame::WireFrame;
use crate::time::Time;

const BIT_RATE: u32 = 1_000_000;
const STEP: Time = Time::from_us(100);

/// An adapter and another node on a bus.
struct Rig {
    adapter: Adapter,
    bus: Bus,
    port: PortId,
    peer: PortId,
    timing: Option<BitTiming>,
    now: Time,
}

impl Rig {
    fn new() -> Rig {
        let mut bus = Bus::new(1);
        let port = bus.attach("adapter");
        let peer = bus.attach("peer");
        bus.set_timing(peer, Some(BitTiming::new(BIT_RATE, 50.0)), Time::ZERO);
        Rig {
            adapter: Adapter::new(BIT_RATE),
            bus,
            port,
            peer,
            timing: None,
            now: Time::ZERO,
        }
    }

    fn run(&mut self, time: Time) {
        let until = self.now + time;
        while self.now < until {
            self.adapter.work(self.now);
            let timing = self.adapter.timing();
            if timing != self.timing {
                self.timing = timing;
                self.bus.set_timing(self.port, timing, self.now);
            }
            self.bus.offer(self.port, self.adapter.offer());
            let mut next = self.now + STEP;
            if let Some(at) = self.bus.next_event() {
                next = next.min(at.max(self.now));
            }
            let mut events = Vec::new();
            self.bus.advance(next, &mut events);
            self.now = next;
            for event in events.iter().filter(|event| event.port == self.port) {
                self.adapter.on_event(event);
            }
            if next == until {
                return;
            }
        }
    }

    /// Says something and returns everything that was answered within 2 ms.
    fn ask(&mut self, words: &str) -> String {
        self.adapter.receive(words.as_bytes(), self.now);
        self.run(Time::from_ms(2));
        self.heard()
    }

    fn heard(&mut self) -> String {
        let bytes: Vec<u8> = self.adapter.output().drain(..).collect();
        String::from_utf8(bytes).unwrap()
    }

    /// The peer sends.
    fn peer_sends(&mut self, frame: WireFrame) {
        let offer = Offer {
            frame,
            ready_at: self.now,
            tag: 7,
        };
        self.bus.offer(self.peer, Some(offer));
    }

    fn wire(&mut self) -> Vec<WireFrame> {
        self.bus
            .take_records()
            .iter()
            .filter_map(|record| match record.kind {
                RecordKind::Frame(frame) => Some(frame),
                RecordKind::ErrorFrame { .. } => None,
            })
            .collect()
    }
}

#[test]
fn a_session_as_python_can_begins_it() {
    let mut rig = Rig::new();
    assert_eq!(rig.ask("C\rS8\r\rO\rO\r"), "\u{7}\r\r\r\u{7}");
    assert_eq!(rig.ask("V\rN\r"), "V0100\rNSIM1\r");
    assert_eq!(rig.ask("t6018401810010000\r"), "\u{7}", "a byte is missing");
    assert_eq!(rig.ask("t60184018100100000000\r"), "z\r");
    let request = [0x40, 0x18, 0x10, 1, 0, 0, 0, 0];
    assert_eq!(rig.wire(), [WireFrame::standard(0x601, &request)]);
    rig.peer_sends(WireFrame::standard(0x701, &[5]));
    assert_eq!(rig.ask(""), "t701105\r");
    assert_eq!(rig.ask("F\r"), "F00\r");
    assert_eq!(rig.ask("C\r"), "\r");
    rig.peer_sends(WireFrame::standard(0x701, &[5]));
    assert_eq!(rig.ask(""), "");
}

#[test]
fn what_the_channels_state_forbids_is_refused() {
    let mut rig = Rig::new();
    assert_eq!(rig.ask("t0800\rF\rC\r"), "\u{7}\u{7}\u{7}");
    assert_eq!(rig.ask("O\r"), "\r");
    assert_eq!(rig.ask("S8\rZ1\rO\r"), "\u{7}\u{7}\u{7}");
    assert_eq!(rig.wire(), []);
}

#[test]
fn a_closed_channel_acknowledges_nothing() {
    let mut rig = Rig::new();
    rig.peer_sends(WireFrame::standard(0x701, &[0]));
    rig.run(Time::from_us(300));
    assert_eq!(rig.wire(), [], "the peer is alone");
}

#[test]
fn frames_carry_simulated_milliseconds_if_asked_for() {
    let mut rig = Rig::new();
    assert_eq!(rig.ask("Z1\rO\r"), "\r\r");
    rig.run(Time::from_ms(300) - rig.now);
    rig.peer_sends(WireFrame::standard(0x080, &[]));
    assert_eq!(rig.ask(""), "t0800012C\r");
}

#[test]
fn who_loses_the_arbitration_sends_again() {
    let mut rig = Rig::new();
    rig.ask("O\r");
    rig.peer_sends(WireFrame::standard(0x080, &[]));
    assert_eq!(rig.ask("t7E50\r"), "z\rt0800\r");
    let wire = rig.wire();
    assert_eq!(wire[0], WireFrame::standard(0x080, &[]));
    assert_eq!(wire[1], WireFrame::standard(0x7E5, &[]));
    assert_eq!(rig.ask("F\r"), "F40\r", "arbitration was lost");
    assert_eq!(rig.ask("F\r"), "F00\r", "and that has been told");
}

#[test]
fn more_frames_than_wait_hold_the_client_up_and_keep_their_order() {
    const FRAMES: usize = 150;
    let mut rig = Rig::new();
    rig.ask("O\r");
    let lines: String = (0..FRAMES).map(|n| format!("t1231{n:02X}\r")).collect();
    rig.ask(&lines);
    // The client goes: what it has sent is still sent.
    rig.adapter.hang_up(rig.now);
    rig.run(Time::from_ms(20));
    let sent: Vec<usize> = rig.wire().iter().map(|f| usize::from(f.data[0])).collect();
    assert_eq!(sent, (0..FRAMES).collect::<Vec<_>>());
    assert!(rig.adapter.is_free() && rig.adapter.timing().is_none());
}

#[test]
fn alone_on_the_bus_it_gives_up_when_the_client_is_gone() {
    let mut rig = Rig::new();
    rig.bus.set_timing(rig.peer, None, Time::ZERO);
    rig.ask("O\rt1230\r");
    rig.adapter.hang_up(rig.now);
    rig.run(Time::from_ms(50));
    assert!(
        !rig.adapter.is_free(),
        "nobody acknowledges, it still tries"
    );
    rig.run(Time::from_ms(200));
    assert!(rig.adapter.is_free() && rig.adapter.timing().is_none());
}

#[test]
fn closed_and_opened_at_once_it_starts_anew() {
    let mut rig = Rig::new();
    rig.bus.set_timing(rig.peer, None, Time::ZERO);
    rig.ask("O\rt1230\r");
    rig.ask("C\rO\r");
    rig.run(Time::from_ms(150));
    rig.bus
        .set_timing(rig.peer, Some(BitTiming::new(BIT_RATE, 0.0)), rig.now);
    assert_eq!(rig.ask("t1240\r"), "\rz\r");
    assert_eq!(rig.wire(), [WireFrame::standard(0x124, &[])]);
}

#[test]
fn the_wrong_bit_rate_ends_in_silence_and_can_be_mended() {
    let mut rig = Rig::new();
    rig.ask("S6\rO\rt7FF0\r");
    rig.run(Time::from_ms(100));
    assert_eq!(rig.wire(), []);
    assert_ne!(rig.ask("F\r"), "F00\r");
    rig.ask("C\r");
    rig.run(Time::from_ms(200));
    rig.heard();
    // The other node has left the bus as well: it comes back.
    rig.bus.reset(rig.peer, rig.now);
    rig.bus
        .set_timing(rig.peer, Some(BitTiming::new(BIT_RATE, 0.0)), rig.now);
    assert_eq!(rig.ask("S8\rO\rt7FF0\r"), "\r\rz\r");
    assert_eq!(rig.wire(), [WireFrame::standard(0x7FF, &[])]);
}

#[test]
fn a_line_that_is_too_long_is_one_error() {
    let mut rig = Rig::new();
    let line = "T".repeat(500);
    assert_eq!(rig.ask(&format!("{line}\rV\r")), "\u{7}V0100\r");
}

#[test]
fn who_does_not_listen_loses_frames_and_not_the_memory() {
    let mut adapter = Adapter::new(BIT_RATE);
    adapter.receive(b"O\r", Time::ZERO);
    let event = crate::bus::Event {
        at: Time::ZERO,
        port: PortId(0),
        kind: EventKind::Rx {
            frame: WireFrame::standard(0x181, &[0; 8]),
            sof: Time::ZERO,
        },
    };
    for _ in 0..100_000 {
        adapter.on_event(&event);
    }
    assert!(adapter.output().len() < 600_000);
    adapter.output().clear();
    adapter.receive(b"F\r", Time::ZERO);
    let flags: Vec<u8> = adapter.output().drain(..).collect();
    assert_eq!(flags, b"F08\r", "an overrun");
}

proptest! {
    #[test]
    fn any_bytes_in_any_pieces_do(
        pieces in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..50), 0..20)
    ) {
        let mut rig = Rig::new();
        rig.ask("O\r");
        for piece in pieces {
            rig.adapter.receive(&piece, rig.now);
            rig.run(Time::from_us(300));
        }
        rig.heard_bytes();
        rig.adapter.receive(b"\r", rig.now);
        rig.run(Time::from_ms(300));
        rig.heard_bytes();
        rig.adapter.receive(b"V\r", rig.now);
        rig.run(Time::from_ms(2));
        let answer = rig.heard_bytes();
        prop_assert!(answer.ends_with(b"V0100\r"), "{answer:?}");
    }
}

impl Rig {
    fn heard_bytes(&mut self) -> Vec<u8> {
        self.adapter.output().drain(..).collect()
    }
}

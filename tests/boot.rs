//! Boot-up of the network, read as sequence charts: what is sent when, and
//! what the nodes answer. The nodes here are tables of bytes, not the
//! library's own server.

use canmaster::boot::{Action, Cause, Event, NetworkBoot, Status};
use canmaster::network::plan;
use canmaster::network::sample::SIX_EPOS4;
use canmaster::sdo::AbortCode;
use canmaster::{CobId, Duration, Frame, Instant, NodeId};

const NODES: usize = 6;
const BOOT_UP: u8 = 0x00;
const OPERATIONAL: u8 = 0x05;
const PRE_OPERATIONAL: u8 = 0x7F;

/// How one node of the test answers.
#[derive(Clone, Copy, Default)]
struct Fake {
    missing: bool,
    product: Option<u32>,
    refuses: Option<(u16, u8, u32)>,
    mute: Option<(u16, u8)>,
    no_heartbeat: bool,
    never_operational: bool,
    restarts_at: Option<(u16, u8)>,
}

struct Rig {
    boot: NetworkBoot<NODES>,
    now: Instant,
    fakes: [Fake; NODES],
    sent: Vec<Frame>,
    events: Vec<Event>,
    sync: bool,
}

impl Rig {
    fn new() -> Rig {
        Rig {
            boot: NetworkBoot::new(&SIX_EPOS4, Instant::ZERO),
            now: Instant::ZERO,
            fakes: [Fake::default(); NODES],
            sent: Vec::new(),
            events: Vec::new(),
            sync: false,
        }
    }

    fn error_control(&mut self, node: u8, state: u8) {
        let id = CobId::new(0x700 + u16::from(node)).unwrap();
        let frame = Frame::data_frame(id, &[state]).unwrap();
        self.boot.on_frame(&frame, self.now);
    }

    fn everybody(&mut self, state: u8, but: impl Fn(&Fake) -> bool) {
        for node in 1..=NODES as u8 {
            let fake = self.fakes[usize::from(node) - 1];
            if !fake.missing && !but(&fake) {
                self.error_control(node, state);
                self.run();
            }
        }
    }

    /// Carries out all that is to be done now.
    fn run(&mut self) {
        while let Some(action) = self.boot.poll(self.now) {
            match action {
                Action::Send(frame) => {
                    self.sent.push(frame);
                    self.answer(&frame);
                }
                Action::ProduceSync => self.sync = true,
                Action::Report(event) => self.events.push(event),
            }
        }
    }

    /// Lets time pass, deadline by deadline.
    fn run_for(&mut self, span: Duration) {
        let end = self.now + span;
        self.run();
        while let Some(deadline) = self
            .boot
            .next_deadline()
            .filter(|deadline| *deadline <= end)
        {
            self.now = self.now.max(deadline);
            self.run();
        }
        self.now = end;
        self.run();
    }

    fn answer(&mut self, frame: &Frame) {
        let id = frame.id().get();
        if !(0x601..=0x606).contains(&id) {
            return;
        }
        let node = (id - 0x600) as u8;
        let fake = self.fakes[usize::from(node) - 1];
        let data = frame.padded();
        let (index, sub) = (u16::from_le_bytes([data[1], data[2]]), data[3]);
        if fake.missing || fake.mute == Some((index, sub)) || data[0] == 0x80 {
            return;
        }
        if fake.restarts_at == Some((index, sub)) {
            return self.error_control(node, BOOT_UP);
        }
        let mut answer = [0, data[1], data[2], data[3], 0, 0, 0, 0];
        let refusal = fake
            .refuses
            .filter(|(at, at_sub, _)| (*at, *at_sub) == (index, sub));
        if let Some((_, _, code)) = refusal {
            answer[0] = 0x80;
            answer[4..].copy_from_slice(&code.to_le_bytes());
        } else if data[0] == 0x40 {
            answer[0] = 0x43;
            let value: u32 = match (index, sub) {
                (0x1000, 0) => 0x0002_0192,
                (0x1018, 1) => 0x0000_00FB,
                (0x1018, 2) => fake.product.unwrap_or(0x6150_0000),
                (0x1018, 3) => 0x0170_0000,
                _ => panic!("node {node} was asked for {index:04X}h:{sub:02X}"),
            };
            answer[4..].copy_from_slice(&value.to_le_bytes());
        } else {
            answer[0] = 0x60;
        }
        let id = CobId::new(0x580 + u16::from(node)).unwrap();
        self.boot.on_frame(&Frame::full(id, answer), self.now);
    }

    /// The whole start, as far as it goes.
    fn start(&mut self) {
        self.run_for(SIX_EPOS4.master.silence);
        self.everybody(BOOT_UP, |_| false);
        self.run_for(Duration::from_millis(10));
        self.everybody(PRE_OPERATIONAL, |fake| fake.no_heartbeat);
        self.run_for(Duration::from_millis(20));
        if self.sync {
            self.everybody(OPERATIONAL, |fake| fake.never_operational);
        }
        self.run_for(Duration::from_millis(2000));
    }

    fn failure(&self, node: u8) -> (Status, Cause) {
        let id = NodeId::new(node).unwrap();
        let found = self.events.iter().find_map(|event| match event {
            Event::Failed(failed, failure) if *failed == id => Some(failure),
            _ => None,
        });
        let failure = found.expect("the node failed");
        (failure.status, failure.cause)
    }

    fn assert_nothing_was_started(&self) {
        assert!(self.boot.is_failed());
        assert!(!self.sync);
        assert!(self.events.contains(&Event::NetworkFailed));
        let start = |frame: &&Frame| frame.id() == CobId::NMT && frame.data()[0] == 0x01;
        assert_eq!(self.sent.iter().find(start), None);
    }
}

#[test]
fn nothing_is_sent_in_the_silent_phase() {
    let mut rig = Rig::new();
    rig.run();
    rig.now = Instant::from_micros(599_999);
    rig.everybody(BOOT_UP, |_| false);
    assert_eq!(rig.sent, []);
    assert_eq!(
        rig.boot.next_deadline(),
        Some(Instant::from_micros(600_000))
    );
    rig.now = Instant::from_micros(600_000);
    rig.run();
    let reset = Frame::data_frame(CobId::NMT, &[0x82, 0x00]).unwrap();
    assert_eq!(rig.sent, [reset]);
}

#[test]
fn a_node_is_identified_before_anything_is_written() {
    let mut rig = Rig::new();
    rig.start();
    let to_node_4: Vec<_> = rig.sent.iter().filter(|f| f.id().get() == 0x604).collect();
    let reads: [[u8; 4]; 4] = [
        [0x40, 0x00, 0x10, 0x00],
        [0x40, 0x18, 0x10, 0x01],
        [0x40, 0x18, 0x10, 0x02],
        [0x40, 0x18, 0x10, 0x03],
    ];
    for (frame, read) in to_node_4.iter().zip(reads) {
        assert_eq!(
            frame.padded(),
            [read[0], read[1], read[2], read[3], 0, 0, 0, 0]
        );
    }
    let writes = plan(&SIX_EPOS4, &SIX_EPOS4.nodes[3]).count();
    assert_eq!(to_node_4.len(), reads.len() + writes);
    assert!(
        to_node_4[reads.len()..]
            .iter()
            .all(|f| f.padded()[0] & 0xE0 == 0x20)
    );
}

#[test]
fn all_nodes_are_started_by_one_broadcast_once_all_are_ready() {
    let mut rig = Rig::new();
    rig.start();
    assert!(rig.boot.is_ready());
    let nmt: Vec<_> = rig
        .sent
        .iter()
        .filter(|frame| frame.id() == CobId::NMT)
        .map(|frame| frame.data().to_vec())
        .collect();
    let mut expected = vec![vec![0x82, 0]];
    expected.extend((1..=6).map(|node| vec![0x80, node]));
    expected.push(vec![0x01, 0]);
    assert_eq!(nmt, expected);
    assert_eq!(rig.events.last(), Some(&Event::NetworkReady));
    assert!(rig.sync);
}

#[test]
fn a_missing_node_is_named_and_nothing_is_started() {
    let mut rig = Rig::new();
    rig.fakes[2].missing = true;
    rig.start();
    rig.assert_nothing_was_started();
    assert_eq!(rig.failure(3), (Status::B, Cause::NoBootUp));
}

#[test]
fn another_device_is_refused_before_anything_is_written() {
    let mut rig = Rig::new();
    rig.fakes[4].product = Some(0x6350_0000);
    rig.start();
    rig.assert_nothing_was_started();
    let (status, cause) = rig.failure(5);
    assert_eq!(status, Status::M);
    assert_eq!(
        cause.to_string(),
        "1018h:02 is 63500000h, expected 61500000h"
    );
    let written = rig
        .sent
        .iter()
        .any(|f| f.id().get() == 0x605 && f.padded()[0] != 0x40);
    assert!(!written);
}

#[test]
fn a_refused_write_is_named_with_its_abort_code() {
    let mut rig = Rig::new();
    rig.fakes[0].refuses = Some((0x1601, 2, 0x0604_0041));
    rig.start();
    rig.assert_nothing_was_started();
    let (status, cause) = rig.failure(1);
    assert_eq!(status, Status::J);
    let Cause::Refused { at, code } = cause else {
        panic!("{cause:?}");
    };
    assert_eq!((at.index.0, at.sub.0), (0x1601, 2));
    assert_eq!(code, AbortCode(0x0604_0041));
}

#[test]
fn a_mute_node_is_asked_again_and_then_given_up() {
    let mut rig = Rig::new();
    rig.fakes[5].mute = Some((0x1018, 2));
    rig.start();
    rig.assert_nothing_was_started();
    let (status, cause) = rig.failure(6);
    assert_eq!(status, Status::B);
    assert!(matches!(cause, Cause::NoAnswer { at } if at.index.0 == 0x1018 && at.sub.0 == 2));
    let asked = rig
        .sent
        .iter()
        .filter(|f| f.id().get() == 0x606 && f.padded()[..4] == [0x40, 0x18, 0x10, 0x02])
        .count();
    assert_eq!(asked, 3);
}

#[test]
fn a_node_without_heartbeat_is_not_started() {
    let mut rig = Rig::new();
    rig.fakes[1].no_heartbeat = true;
    rig.start();
    rig.assert_nothing_was_started();
    assert_eq!(rig.failure(2), (Status::K, Cause::NoHeartbeat));
}

#[test]
fn a_node_that_does_not_become_operational_fails_the_network() {
    let mut rig = Rig::new();
    rig.fakes[3].never_operational = true;
    rig.start();
    assert!(rig.boot.is_failed());
    assert_eq!(rig.failure(4), (Status::K, Cause::NotOperational));
}

#[test]
fn a_node_that_keeps_restarting_is_given_up() {
    let mut rig = Rig::new();
    rig.fakes[0].restarts_at = Some((0x1600, 1));
    rig.start();
    rig.assert_nothing_was_started();
    assert_eq!(rig.failure(1), (Status::B, Cause::Restarts));
}

#[test]
fn two_missing_nodes_are_both_named() {
    let mut rig = Rig::new();
    rig.fakes[0].missing = true;
    rig.fakes[5].missing = true;
    rig.start();
    rig.assert_nothing_was_started();
    assert_eq!(rig.failure(1), (Status::B, Cause::NoBootUp));
    assert_eq!(rig.failure(6), (Status::B, Cause::NoBootUp));
}

#[test]
fn a_node_that_resets_when_it_was_configured_is_configured_anew() {
    let mut rig = Rig::new();
    rig.fakes[5].no_heartbeat = true;
    rig.run_for(SIX_EPOS4.master.silence);
    rig.everybody(BOOT_UP, |_| false);
    rig.everybody(PRE_OPERATIONAL, |fake| fake.no_heartbeat);
    let writes = |rig: &Rig| {
        let written = |f: &&Frame| f.id().get() == 0x602 && f.padded()[0] & 0xE0 == 0x20;
        rig.sent.iter().filter(written).count()
    };
    let once = writes(&rig);
    rig.error_control(2, BOOT_UP);
    rig.run();
    assert_eq!(writes(&rig), 2 * once);
}

#[test]
fn a_node_that_resets_while_the_network_starts_fails_it() {
    let mut rig = Rig::new();
    rig.fakes[4].never_operational = true;
    rig.run_for(SIX_EPOS4.master.silence);
    rig.everybody(BOOT_UP, |_| false);
    rig.everybody(PRE_OPERATIONAL, |_| false);
    rig.run_for(Duration::from_millis(20));
    rig.everybody(OPERATIONAL, |fake| fake.never_operational);
    rig.error_control(2, BOOT_UP);
    rig.run();
    rig.error_control(2, PRE_OPERATIONAL);
    rig.error_control(5, OPERATIONAL);
    rig.run();
    assert!(!rig.boot.is_ready());
    rig.run_for(Duration::from_millis(2000));
    assert!(rig.boot.is_failed());
    assert_eq!(rig.failure(2), (Status::K, Cause::NotOperational));
}

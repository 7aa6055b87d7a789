//! Six drives on the bit-timed bus, each with its own clock.

use super::rig::{node, quick};
use crate::bus::{BitTiming, Bus, BusFault, EventKind, Offer, PortId, RecordKind};
use crate::drive::cia402::State;
use crate::drive::{Drive, DriveConfig, DriveFault};
use crate::frame::{WireFrame, WireId};
use crate::time::Time;
use std::collections::VecDeque;

const RATE: u32 = 1_000_000;

struct Net {
    bus: Bus,
    drives: Vec<(Drive, PortId, Option<BitTiming>)>,
    master: PortId,
    /// What the master has still to send, with the earliest moment.
    queue: VecDeque<(Time, WireFrame)>,
    now: Time,
    /// What the drives sent.
    log: Vec<(Time, u16, Vec<u8>)>,
    errors: usize,
}

impl Net {
    fn new(configs: impl IntoIterator<Item = DriveConfig>) -> Net {
        let mut bus = Bus::new(1);
        let master = bus.attach("master");
        bus.set_timing(master, Some(BitTiming::new(RATE, 20.0)), Time::ZERO);
        let drives = configs
            .into_iter()
            .map(|config| (Drive::new(config), bus.attach("drive"), None))
            .collect();
        Net {
            bus,
            drives,
            master,
            queue: VecDeque::new(),
            now: Time::ZERO,
            log: Vec::new(),
            errors: 0,
        }
    }

    fn send(&mut self, id: u16, data: &[u8]) {
        let frame = WireFrame::standard(id, data);
        self.queue.push_back((self.now, frame));
    }

    fn offer(&mut self) {
        let first = self.queue.front().map(|&(ready_at, frame)| Offer {
            frame,
            ready_at,
            tag: 0,
        });
        self.bus.offer(self.master, first);
        for (drive, port, timing) in &mut self.drives {
            if drive.timing() != *timing {
                *timing = drive.timing();
                self.bus.set_timing(*port, *timing, self.now);
            }
            self.bus.offer(*port, drive.offer());
        }
    }

    fn run_until(&mut self, end: Time) {
        let mut events = Vec::new();
        while self.now < end {
            self.offer();
            let deadlines = self.drives.iter().map(|(drive, ..)| drive.next_deadline());
            let next = deadlines.chain(self.bus.next_event()).min().unwrap_or(end);
            self.now = next.clamp(self.now, end);
            self.bus.advance(self.now, &mut events);
            for event in events.drain(..) {
                if event.port == self.master {
                    if let EventKind::TxDone { .. } = event.kind {
                        self.queue.pop_front();
                    }
                } else {
                    let mut drives = self.drives.iter_mut();
                    let found = drives.find(|(_, port, _)| *port == event.port);
                    found.expect("a drive").0.on_event(&event);
                }
            }
            for (drive, ..) in &mut self.drives {
                drive.advance(self.now);
            }
        }
        for record in self.bus.take_records() {
            match record.kind {
                RecordKind::Frame(frame) if record.transmitters != [self.master] => {
                    let WireId::Standard(id) = frame.id else {
                        panic!("drives send base frames");
                    };
                    self.log.push((record.sof, id, frame.payload().to_vec()));
                }
                RecordKind::Frame(_) => {}
                RecordKind::ErrorFrame { .. } => self.errors += 1,
            }
        }
    }

    fn run_ms(&mut self, ms: u64) {
        self.run_until(self.now + Time::from_ms(ms));
    }

    /// Writes to every drive and waits for the answers.
    fn write_all(&mut self, index: u16, sub: u8, data: &[u8]) {
        let [low, high] = index.to_le_bytes();
        let mut request = [
            0x23 | (4 - data.len() as u8) << 2,
            low,
            high,
            sub,
            0,
            0,
            0,
            0,
        ];
        request[4..4 + data.len()].copy_from_slice(data);
        let nodes: Vec<_> = self.drives.iter().map(|d| d.0.node().get()).collect();
        self.log.clear();
        for id in &nodes {
            self.send(0x600 + u16::from(*id), &request);
        }
        self.run_ms(5);
        let answers: Vec<_> = self
            .log
            .iter()
            .filter(|(_, id, data)| (0x581..0x600).contains(id) && data[0] == 0x60)
            .collect();
        assert_eq!(answers.len(), nodes.len(), "{index:04X}h:{sub}");
    }

    /// RPDO4 (6040h, 60FFh) and TPDO3 (6041h, 6064h) with every SYNC.
    fn configure(&mut self) {
        self.run_ms(300);
        self.write_all(0x1403, 2, &[1]);
        self.write_all(0x1802, 2, &[1]);
        for (drive, ..) in &self.drives {
            let id = drive.node().get();
            let cob_id = (0x4000_0380 + u32::from(id)).to_le_bytes();
            let mut request = [0x23, 0x02, 0x18, 1, 0, 0, 0, 0];
            request[4..].copy_from_slice(&cob_id);
            let frame = WireFrame::standard(0x600 + u16::from(id), &request);
            self.queue.push_back((self.now, frame));
        }
        self.run_ms(5);
        self.write_all(0x6060, 0, &[3]);
        self.write_all(0x1800, 2, &[1]);
        self.send(0x000, &[0x01, 0]);
        self.log.clear();
    }

    /// The command to every drive, SYNC, 10 ms.
    fn cycle(&mut self, word: u16, rpm: i32) {
        let mut data = word.to_le_bytes().to_vec();
        data.extend(rpm.to_le_bytes());
        for i in 0..self.drives.len() {
            let id = self.drives[i].0.node().get();
            self.send(0x500 + u16::from(id), &data);
        }
        self.send(0x080, &[]);
        self.run_ms(10);
    }

    fn enable(&mut self) {
        for word in [0x06, 0x0F, 0x0F] {
            self.cycle(word, 0);
        }
        for (drive, ..) in &self.drives {
            assert_eq!(drive.status().state, State::OperationEnabled);
        }
    }
}

fn six() -> impl Iterator<Item = DriveConfig> {
    (1..=6).map(|id| DriveConfig {
        seed: u64::from(id),
        ..quick(id)
    })
}

#[test]
fn six_drives_start_in_one_sync_and_answer_every_one() {
    let mut net = Net::new(six());
    net.configure();
    net.enable();
    net.log.clear();
    for _ in 0..50 {
        net.cycle(0x0F, 1500);
    }
    assert_eq!(net.errors, 0);
    for (drive, ..) in &net.drives {
        let id = 0x380 + u16::from(drive.node().get());
        let sent = net.log.iter().filter(|(_, sent, _)| *sent == id).count();
        assert_eq!(sent, 50, "{id:03X}");
        assert!((drive.truth().velocity_rpm - 1500.0).abs() < 5.0);
    }
    // They all took the command with the same SYNC: their ways differ by their
    // time constants, clocks and control cycles alone.
    let ways: Vec<_> = net
        .drives
        .iter()
        .map(|(drive, ..)| drive.truth().travelled_inc)
        .collect();
    let spread = ways.iter().copied().fold(f64::MIN, f64::max)
        - ways.iter().copied().fold(f64::MAX, f64::min);
    // 1500 rpm are 50 increments a millisecond; 7 ms of time constant, 0.8 ms
    // of control cycles.
    assert!(spread < 400.0, "{spread} {ways:?}");
}

#[test]
fn a_drive_that_loses_power_leaves_the_others_alone() {
    let off = Time::from_ms(800);
    let mut configs: Vec<_> = six().collect();
    configs[2] = configs[2].clone().with(DriveFault::PowerLoss { at: off });
    let mut net = Net::new(configs);
    net.configure();
    net.enable();
    net.run_until(off + Time::from_ms(1));
    net.log.clear();
    for _ in 0..20 {
        net.cycle(0x0F, 300);
    }
    for (drive, ..) in &net.drives {
        let id = drive.node();
        let cob_id = 0x380 + u16::from(id.get());
        let sent = net
            .log
            .iter()
            .filter(|(_, sent, _)| *sent == cob_id)
            .count();
        assert_eq!(sent, if id == node(3) { 0 } else { 20 });
    }
    assert_eq!(net.errors, 0);
}

#[test]
fn a_cable_cut_ends_in_error_passive_and_standstill() {
    let mut net = Net::new(six());
    net.configure();
    net.write_all(0x1017, 0, &20u16.to_le_bytes());
    net.enable();
    for _ in 0..30 {
        net.cycle(0x0F, 1000);
    }
    let cut = net.now;
    net.bus.inject(BusFault::Cut {
        isolated: Some(net.drives[0].1),
        from: cut,
        // Not on the edge of a bit of a retransmission.
        until: cut + Time::from_us(300_050),
    });
    net.run_ms(60);
    let status = net.drives[0].0.status();
    assert_eq!(
        status.last_emcy,
        Some(0x8120),
        "nobody acknowledged its heartbeat"
    );
    net.run_ms(240);
    assert_eq!(net.drives[0].0.status().state, State::Fault);
    assert_eq!(net.drives[0].0.truth().velocity_rpm, 0.0);
    assert_eq!(net.drives[1].0.status().state, State::OperationEnabled);
    net.log.clear();
    net.run_ms(100);
    let told = net
        .log
        .iter()
        .find(|(_, id, _)| *id == 0x081)
        .expect("its EMCY");
    assert_eq!(told.2[..3], [0x20, 0x81, 0x10]);
}

#[test]
fn two_servers_with_one_identifier_disturb_each_other_but_nobody_is_lost() {
    // Both answer after exactly 200 us of nearly equal clocks: the same
    // identifier at the same time with other data is a bit error.
    let exact = |id| DriveConfig {
        clock_ppm: 0.0,
        ..quick(id)
    };
    let twin = exact(4).with(DriveFault::NodeSwitches(node(3)));
    let mut net = Net::new([exact(3), twin]);
    net.run_ms(300);
    net.log.clear();
    net.errors = 0;
    net.send(0x603, &[0x40, 0x18, 0x10, 4, 0, 0, 0, 0]);
    net.run_ms(50);
    let answers = net.log.iter().filter(|(_, id, _)| *id == 0x583);
    assert_eq!(answers.count(), 2, "{:?}", net.log);
    assert!(net.errors > 0);
}

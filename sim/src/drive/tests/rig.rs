//! Drives on an ideal wire: every frame takes 100 us and reaches everybody.

use crate::bus::{Event, EventKind, PortId};
use crate::drive::{Drive, DriveConfig, Spread};
use crate::frame::WireFrame;
use crate::time::Time;
use canmaster::{CobId, Frame, NodeId};

const FRAME_TIME: Time = Time::from_us(100);

pub(super) struct Rig {
    pub(super) drives: Vec<Drive>,
    pub(super) now: Time,
    /// Everything that the drives sent.
    pub(super) log: Vec<(Time, Frame)>,
}

pub(super) fn node(id: u8) -> NodeId {
    NodeId::new(id).unwrap()
}

pub(super) fn config(id: u8) -> DriveConfig {
    DriveConfig::new(node(id), 1)
}

/// Answers at once, so that tests are short.
pub(super) fn quick(id: u8) -> DriveConfig {
    DriveConfig {
        boot: Spread::fixed(200_000),
        sdo_latency: Spread::fixed(200),
        store_time: Spread::fixed(0),
        ..config(id)
    }
}

impl Rig {
    pub(super) fn new(configs: impl IntoIterator<Item = DriveConfig>) -> Rig {
        Rig {
            drives: configs.into_iter().map(Drive::new).collect(),
            now: Time::ZERO,
            log: Vec::new(),
        }
    }

    /// One drive, booted.
    pub(super) fn booted(config: DriveConfig) -> Rig {
        let mut rig = Rig::new([config]);
        rig.run_ms(700);
        rig.log.clear();
        rig
    }

    pub(super) fn drive(&self) -> &Drive {
        &self.drives[0]
    }

    fn event(&mut self, drive: usize, kind: EventKind) {
        let event = Event {
            at: self.now,
            port: PortId(drive),
            kind,
        };
        self.drives[drive].on_event(&event);
    }

    /// The same event for every drive.
    pub(super) fn tell(&mut self, kind: EventKind) {
        for drive in 0..self.drives.len() {
            self.event(drive, kind);
        }
    }

    fn deliver(&mut self, frame: Frame, from: Option<usize>) {
        let frame = WireFrame::from(frame);
        let sof = self.now.since(FRAME_TIME);
        for drive in (0..self.drives.len()).filter(|&d| Some(d) != from) {
            self.event(drive, EventKind::Rx { frame, sof });
        }
    }

    /// The master sends.
    pub(super) fn send(&mut self, id: u16, data: &[u8]) {
        let id = CobId::new(id).unwrap();
        self.deliver(Frame::data_frame(id, data).unwrap(), None);
    }

    pub(super) fn send_remote(&mut self, id: u16) {
        let id = CobId::new(id).unwrap();
        self.deliver(Frame::remote_frame(id, 0).unwrap(), None);
    }

    pub(super) fn run_until(&mut self, end: Time) {
        loop {
            let offers = self.drives.iter().filter_map(|d| d.offer());
            let ready = offers.map(|offer| offer.ready_at.max(self.now)).min();
            let deadline = self.drives.iter().map(|d| d.next_deadline()).min();
            let next = ready.into_iter().chain(deadline).min().unwrap_or(end);
            if next > end {
                break;
            }
            self.now = self.now.max(next);
            for drive in &mut self.drives {
                drive.advance(next);
            }
            self.transfer();
        }
        self.now = end;
        for drive in &mut self.drives {
            drive.advance(end);
        }
    }

    /// The frame of highest priority that is ready goes over the wire.
    fn transfer(&mut self) {
        let ready = (0..self.drives.len())
            .filter_map(|d| Some((d, self.drives[d].offer()?)))
            .filter(|(_, offer)| offer.ready_at <= self.now)
            .min_by_key(|(_, offer)| offer.frame.arbitration_key());
        let Some((drive, offer)) = ready else {
            return;
        };
        let (tag, sof) = (offer.tag, self.now);
        self.event(drive, EventKind::TxStarted { tag });
        self.now += FRAME_TIME;
        self.event(drive, EventKind::TxDone { tag, sof });
        let frame = Frame::try_from(offer.frame).unwrap();
        self.log.push((self.now, frame));
        self.deliver(frame, Some(drive));
    }

    pub(super) fn run_us(&mut self, us: u64) {
        self.run_until(self.now + Time::from_us(us));
    }

    pub(super) fn run_ms(&mut self, ms: u64) {
        self.run_us(ms * 1000);
    }

    /// What was sent with this identifier since the log was cleared.
    pub(super) fn sent(&self, id: u16) -> Vec<Vec<u8>> {
        self.log
            .iter()
            .filter(|(_, frame)| frame.id().get() == id)
            .map(|(_, frame)| frame.data().to_vec())
            .collect()
    }

    /// A request to node 1, and its answer.
    pub(super) fn sdo(&mut self, request: [u8; 8]) -> Option<[u8; 8]> {
        self.sdo_of(1, request)
    }

    pub(super) fn sdo_of(&mut self, id: u8, request: [u8; 8]) -> Option<[u8; 8]> {
        let before = self.log.len();
        self.send(0x600 + u16::from(id), &request);
        self.run_ms(20);
        let answer = self.log[before..]
            .iter()
            .find(|(_, frame)| frame.id().get() == 0x580 + u16::from(id));
        answer.map(|(_, frame)| frame.padded())
    }

    /// Writes to node 1; the abort code as the error.
    pub(super) fn write(&mut self, index: u16, sub: u8, data: &[u8]) -> Result<(), u32> {
        self.write_of(1, index, sub, data)
    }

    pub(super) fn write_of(&mut self, id: u8, index: u16, sub: u8, data: &[u8]) -> Result<(), u32> {
        let [low, high] = index.to_le_bytes();
        let unused = 4 - data.len() as u8;
        let mut request = [0x23 | unused << 2, low, high, sub, 0, 0, 0, 0];
        request[4..4 + data.len()].copy_from_slice(data);
        let answer = self.sdo_of(id, request).expect("an answer");
        match answer[0] {
            0x60 => Ok(()),
            0x80 => Err(abort_code(answer)),
            other => panic!("not an answer to a download: {other:02X}"),
        }
    }

    /// Reads up to four bytes from node 1.
    pub(super) fn read(&mut self, index: u16, sub: u8) -> Result<u32, u32> {
        let [low, high] = index.to_le_bytes();
        let answer = self
            .sdo([0x40, low, high, sub, 0, 0, 0, 0])
            .expect("an answer");
        match answer[0] {
            0x80 => Err(abort_code(answer)),
            command => {
                assert_eq!(command & 0xE3, 0x43, "expedited with size");
                let len = 4 - usize::from(command >> 2 & 3);
                let mut bytes = [0; 4];
                bytes[..len].copy_from_slice(&answer[4..4 + len]);
                Ok(u32::from_le_bytes(bytes))
            }
        }
    }

    pub(super) fn nmt(&mut self, command: u8) {
        self.send(0x000, &[command, 0]);
    }

    pub(super) fn controlword(&mut self, word: u16) {
        assert_eq!(self.write(0x6040, 0, &word.to_le_bytes()), Ok(()));
    }

    pub(super) fn state(&self) -> crate::drive::cia402::State {
        self.drive().status().state
    }

    /// Profile velocity, operational, enabled, by SDO.
    pub(super) fn enable(&mut self) {
        self.enable_in(3);
    }

    /// The same in another mode.
    pub(super) fn enable_in(&mut self, mode: u8) {
        assert_eq!(self.write(0x6060, 0, &[mode]), Ok(()));
        self.nmt(0x01);
        for word in [0x06, 0x07, 0x0F] {
            self.controlword(word);
        }
        assert_eq!(self.state(), crate::drive::cia402::State::OperationEnabled);
    }

    pub(super) fn write32(&mut self, index: u16, sub: u8, number: i64) {
        assert_eq!(
            self.write(index, sub, &(number as u32).to_le_bytes()),
            Ok(())
        );
    }

    /// Bits of the statusword.
    pub(super) fn bits(&self, mask: u16) -> u16 {
        self.drive().status().statusword & mask
    }

    /// 6064h.
    pub(super) fn position(&self) -> i32 {
        self.drive().status().position
    }

    pub(super) fn target_velocity(&mut self, rpm: i32) {
        assert_eq!(self.write(0x60FF, 0, &rpm.to_le_bytes()), Ok(()));
    }

    pub(super) fn rpm(&self) -> f64 {
        self.drive().truth().velocity_rpm
    }
}

pub(super) fn abort_code(answer: [u8; 8]) -> u32 {
    u32::from_le_bytes([answer[4], answer[5], answer[6], answer[7]])
}

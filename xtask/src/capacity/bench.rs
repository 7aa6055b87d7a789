//! The library as master, on the host, with simulated drives on the bit-timed
//! bus.

use std::collections::VecDeque;

use anyhow::{Result, bail};
use canmaster::id::{Address, FunctionCode, NodeId};
use canmaster::nmt::{ErrorControl, State};
use canmaster::sdo::{Client, Progress, Response};
use canmaster::time::Duration;
use canmaster::{CobId, Frame};
use canmaster_sim::bus::{BitTiming, Bus, Event, EventKind, Offer, PortId, WireRecord};
use canmaster_sim::drive::{Drive, DriveConfig, Spread};
use canmaster_sim::frame::WireFrame;
use canmaster_sim::time::Time;

/// From power-on to the boot-up frame.
const BOOT_US: u64 = 200_000;
/// All drives send their boot-up frames by then, even at 10 kbit/s.
const BOOTED: Time = Time::from_s(10);
/// The longest answer takes 30 ms at 10 kbit/s.
const SDO_TIMEOUT: Duration = Duration::from_millis(500);

/// A drive, its place on the bus, and when it wants to be asked again.
struct Station {
    drive: Drive,
    port: PortId,
    timing: Option<BitTiming>,
    deadline: Time,
}

impl Station {
    /// Lets the drive do what is due, and tells the bus what it would send next.
    fn advance(&mut self, bus: &mut Bus, now: Time) {
        if self.drive.next_deadline() <= now {
            self.drive.advance(now);
        }
        let timing = self.drive.timing();
        if timing != self.timing {
            self.timing = timing;
            bus.set_timing(self.port, timing, now);
        }
        bus.offer(self.port, self.drive.offer());
        self.deadline = self.drive.next_deadline();
    }
}

/// Master and drives.
pub(super) struct Bench {
    bus: Bus,
    master: PortId,
    stations: Vec<Station>,
    queue: VecDeque<(Time, Frame)>,
    received: VecDeque<Frame>,
    events: Vec<Event>,
    now: Time,
}

impl Bench {
    /// Drives with the node-IDs 1 ..= `count`, powered now, that take `answer_us`
    /// to answer an SDO request.
    pub(super) fn new(bit_rate: u32, count: u8, answer_us: u64, seed: u64) -> Bench {
        let mut bus = Bus::new(seed);
        let master = bus.attach("master");
        bus.set_timing(master, Some(BitTiming::new(bit_rate, 0.0)), Time::ZERO);
        let nodes = (1..=count).filter_map(NodeId::new);
        let stations = nodes.map(|node| {
            let config = DriveConfig {
                bit_rate,
                boot: Spread::fixed(BOOT_US),
                sdo_latency: Spread::fixed(answer_us),
                ..DriveConfig::new(node, seed)
            };
            Station {
                drive: Drive::new(config),
                port: bus.attach("drive"),
                timing: None,
                deadline: Time::ZERO,
            }
        });
        Bench {
            stations: stations.collect(),
            bus,
            master,
            queue: VecDeque::new(),
            received: VecDeque::new(),
            events: Vec::new(),
            now: Time::ZERO,
        }
    }

    pub(super) fn now(&self) -> Time {
        self.now
    }

    /// Puts a frame behind those that wait.
    pub(super) fn send(&mut self, frame: Frame) {
        self.queue.push_back((self.now, frame));
        self.offer();
    }

    fn offer(&mut self) {
        let head = self.queue.front().map(|(ready_at, frame)| Offer {
            frame: WireFrame::from(*frame),
            ready_at: *ready_at,
            tag: 0,
        });
        self.bus.offer(self.master, head);
    }

    /// Goes on to whatever happens next, at most to `limit`.
    fn step(&mut self, limit: Time) {
        let deadlines = self.stations.iter().map(|station| station.deadline);
        let next = deadlines.chain(self.bus.next_event()).min();
        self.now = next.unwrap_or(limit).clamp(self.now, limit);
        let mut events = std::mem::take(&mut self.events);
        self.bus.advance(self.now, &mut events);
        let happened = !events.is_empty();
        for event in events.drain(..) {
            if event.port != self.master {
                let stations = self.stations.iter_mut();
                for station in stations.filter(|station| station.port == event.port) {
                    station.drive.on_event(&event);
                }
                continue;
            }
            match event.kind {
                EventKind::TxDone { .. } => {
                    self.queue.pop_front();
                }
                EventKind::Rx { frame, .. } => self.received.extend(Frame::try_from(frame)),
                _ => {}
            }
        }
        self.events = events;
        for station in &mut self.stations {
            if happened || station.deadline <= self.now {
                station.advance(&mut self.bus, self.now);
            }
        }
        self.offer();
    }

    /// Lets time pass.
    pub(super) fn run_until(&mut self, end: Time) {
        while self.now < end {
            self.step(end);
        }
    }

    /// Waits until everything that was to be sent is sent.
    pub(super) fn flush(&mut self, limit: Time) -> Result<()> {
        while !self.queue.is_empty() {
            if self.now >= limit {
                bail!(
                    "frames of the master are still waiting at {} ms",
                    limit.as_ms()
                );
            }
            self.step(limit);
        }
        Ok(())
    }

    /// Waits for the boot-up frames of all drives.
    pub(super) fn await_boot(&mut self) -> Result<()> {
        let mut booted = 0;
        while booted < self.stations.len() {
            if self.now >= BOOTED {
                bail!("only {booted} of {} drives booted", self.stations.len());
            }
            self.step(BOOTED);
            let frames = self.received.drain(..);
            let heard = frames.filter_map(|frame| ErrorControl::decode(&frame));
            booted += heard
                .filter(|heard| heard.state == State::Initialising)
                .count();
        }
        Ok(())
    }

    /// Writes an entry of a node and awaits the answer.
    pub(super) fn download(&mut self, node: NodeId, at: Address, data: &[u8]) -> Result<()> {
        let mut client = Client::new(node, SDO_TIMEOUT);
        let request = client.download(at, data, self.now.to_instant())?;
        self.exchange(&mut client, request).map(|_| ())
    }

    /// Reads an entry of a node.
    pub(super) fn upload(&mut self, node: NodeId, at: Address) -> Result<Response> {
        let mut client = Client::new(node, SDO_TIMEOUT);
        let request = client.upload(at, self.now.to_instant())?;
        self.exchange(&mut client, request)
    }

    fn exchange(&mut self, client: &mut Client, request: Frame) -> Result<Response> {
        self.send(request);
        let patience = self.now + Time::from_us(2 * u64::from(SDO_TIMEOUT.as_micros()));
        loop {
            let now = self.now.to_instant();
            let progress = match self.received.pop_front() {
                Some(frame) => client.on_frame(&frame, now),
                None => client.poll(now),
            };
            match progress {
                Progress::Done(response) => return Ok(response),
                Progress::Send(frame) => self.send(frame),
                Progress::Failed(error, _) => bail!("node {}: {error}", client.node()),
                Progress::Nothing if self.received.is_empty() => self.step(patience),
                Progress::Nothing => {}
            }
        }
    }

    /// Everything that was on the wire since the last time.
    pub(super) fn take_records(&mut self) -> Vec<WireRecord> {
        self.bus.take_records()
    }

    /// Whether only the master sent this.
    pub(super) fn is_masters(&self, record: &WireRecord) -> bool {
        record.transmitters == [self.master]
    }
}

/// The function and the node of a frame of the predefined connection set.
pub(super) fn function(frame: &WireFrame) -> Option<FunctionCode> {
    let frame = Frame::try_from(*frame).ok()?;
    CobId::split(frame.id()).map(|(function, _)| function)
}

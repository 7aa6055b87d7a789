//! A network of nodes that answer from tables, in virtual time.

use canmaster::boot::{Action, Cause, Event, NetworkBoot, Settings, Status};
use canmaster::lss::{ConfigurationResult, Device, LssSlave, SlaveEvent};
use canmaster::network::Network;
use canmaster::{CobId, Duration, Frame, Instant, NodeId};

pub(crate) const NODES: usize = 6;
pub(crate) const BOOT_UP: u8 = 0x00;
pub(crate) const STOPPED: u8 = 0x04;
pub(crate) const OPERATIONAL: u8 = 0x05;
pub(crate) const PRE_OPERATIONAL: u8 = 0x7F;

pub(crate) fn ms(ms: u32) -> Duration {
    Duration::from_millis(ms)
}

pub(crate) fn id(node: u8) -> NodeId {
    NodeId::new(node).unwrap()
}

pub(crate) fn cob_id(number: u16) -> CobId {
    CobId::new(number).unwrap()
}

pub(crate) type Entry = (u16, u8);

/// One node.
#[derive(Clone)]
pub(crate) struct Fake {
    pub(crate) id: u8,
    pub(crate) missing: bool,
    /// Its NMT state as error control tells it; 0: it is not up.
    pub(crate) state: u8,
    pub(crate) boots_at: Option<Instant>,
    pub(crate) period: Option<Duration>,
    pub(crate) beat: Option<Instant>,
    pub(crate) toggle: Option<bool>,
    pub(crate) values: Vec<(Entry, u32)>,
    pub(crate) written: Vec<(Entry, u32)>,
    pub(crate) refuses: Option<(Entry, u32)>,
    pub(crate) mute: Option<Entry>,
    pub(crate) no_heartbeat: bool,
    pub(crate) never_operational: bool,
    pub(crate) restarts_at: Option<Entry>,
    pub(crate) lss: Option<LssSlave>,
}

impl Fake {
    fn new(id: u8) -> Fake {
        Fake {
            id,
            missing: false,
            state: BOOT_UP,
            boots_at: None,
            period: None,
            beat: None,
            toggle: None,
            values: vec![
                ((0x1000, 0), 0x0002_0192),
                ((0x1018, 1), 0x0000_00FB),
                ((0x1018, 2), 0x6150_0000),
                ((0x1018, 3), 0x0170_0000),
                // As the sample network has it.
                ((0x1018, 4), 0x2600_0000 + u32::from(id)),
            ],
            written: Vec::new(),
            refuses: None,
            mute: None,
            no_heartbeat: false,
            never_operational: false,
            restarts_at: None,
            lss: None,
        }
    }

    pub(crate) fn set(&mut self, entry: Entry, value: u32) {
        self.values.retain(|(at, _)| *at != entry);
        self.values.push((entry, value));
    }

    /// Running since before the master was switched on.
    pub(crate) fn runs(&mut self, state: u8, period: Option<Duration>) {
        self.state = state;
        self.period = period;
        self.beat = period.map(|period| Instant::ZERO + period);
    }

    fn obey(&mut self, command: u8, now: Instant) {
        match command {
            0x01 if !self.never_operational => self.state = OPERATIONAL,
            0x02 => self.state = STOPPED,
            0x80 => self.state = PRE_OPERATIONAL,
            0x81 | 0x82 => {
                self.state = BOOT_UP;
                (self.period, self.beat) = (None, None);
                self.toggle = self.toggle.map(|_| false);
                self.boots_at = Some(now + ms(200));
            }
            _ => {}
        }
    }
}

struct NoStore;

impl Device for NoStore {
    fn configure_bit_timing(&mut self, _: u8, _: u8) -> ConfigurationResult {
        ConfigurationResult::REFUSED
    }

    fn store(&mut self, _: Option<NodeId>) -> ConfigurationResult {
        ConfigurationResult::OK
    }
}

pub(crate) struct Rig {
    pub(crate) boot: NetworkBoot<NODES>,
    pub(crate) now: Instant,
    pub(crate) fakes: Vec<Fake>,
    pub(crate) sent: Vec<(Instant, Frame)>,
    pub(crate) events: Vec<Event>,
    pub(crate) sync: bool,
    pub(crate) restarts: Vec<Instant>,
    /// Nobody takes this node-ID.
    pub(crate) refuses_node_id: Option<u8>,
}

impl Rig {
    pub(crate) fn new(network: &'static Network) -> Rig {
        Rig::with(network, |_| {})
    }

    pub(crate) fn with(
        network: &'static Network,
        change: impl FnOnce(&mut Settings<NODES>),
    ) -> Rig {
        let mut settings = Settings::of(network);
        change(&mut settings);
        Rig {
            boot: NetworkBoot::with_settings(network, &settings, Instant::ZERO),
            now: Instant::ZERO,
            fakes: network
                .nodes
                .iter()
                .map(|node| Fake::new(node.id.get()))
                .collect(),
            sent: Vec::new(),
            events: Vec::new(),
            sync: false,
            restarts: Vec::new(),
            refuses_node_id: None,
        }
    }

    pub(crate) fn error_control(&mut self, node: u8, state: u8) {
        let frame = Frame::data_frame(cob_id(0x700 + u16::from(node)), &[state]).unwrap();
        self.boot.on_frame(&frame, self.now);
    }

    /// Carries out all that is to be done now.
    pub(crate) fn run(&mut self) {
        while let Some(action) = self.boot.poll(self.now) {
            match action {
                Action::Send(frame) => {
                    self.sent.push((self.now, frame));
                    self.deliver(&frame);
                }
                Action::ProduceSync => self.sync = true,
                Action::RestartController => self.restarts.push(self.now),
                Action::Report(event) => self.events.push(event),
            }
        }
    }

    /// Lets time pass, deadline by deadline.
    pub(crate) fn run_for(&mut self, span: Duration) {
        let end = self.now + span;
        self.run();
        loop {
            let own = self
                .fakes
                .iter()
                .flat_map(|fake| [fake.boots_at, fake.beat]);
            let next = own.chain([self.boot.next_deadline()]).flatten().min();
            let Some(next) = next.filter(|next| *next <= end) else {
                break;
            };
            self.now = self.now.max(next);
            self.let_nodes_speak();
            self.run();
        }
        self.now = end;
        self.run();
    }

    fn let_nodes_speak(&mut self) {
        for n in 0..self.fakes.len() {
            let now = self.now;
            let fake = &mut self.fakes[n];
            if fake.boots_at.is_some_and(|at| at <= now) {
                fake.boots_at = None;
                fake.state = PRE_OPERATIONAL;
                let (node, missing) = (fake.id, fake.missing || fake.lss.is_some());
                if !missing {
                    self.error_control(node, BOOT_UP);
                }
            }
            let fake = &mut self.fakes[n];
            if fake.beat.is_some_and(|at| at <= now) {
                fake.beat = fake.period.map(|period| now + period);
                let (node, state) = (fake.id, fake.state);
                if !fake.missing && !fake.no_heartbeat {
                    self.error_control(node, state);
                }
            }
            self.run();
        }
    }

    fn deliver(&mut self, frame: &Frame) {
        let number = frame.id().get();
        for n in 0..self.fakes.len() {
            let own = u16::from(self.fakes[n].id);
            if self.fakes[n].missing {
                continue;
            }
            if number == 0x7E5 {
                self.answer_lss(n, frame);
            } else if self.fakes[n].lss.is_some() {
                continue;
            } else if number == 0 {
                let (command, target) = (frame.data()[0], u16::from(frame.data()[1]));
                if target == 0 || target == own {
                    self.fakes[n].obey(command, self.now);
                }
            } else if number == 0x700 + own && frame.is_remote() {
                self.answer_guarding(n);
            } else if number == 0x600 + own {
                self.answer_sdo(n, frame);
            }
        }
    }

    fn answer_guarding(&mut self, n: usize) {
        let fake = &mut self.fakes[n];
        if let (Some(toggle), true) = (fake.toggle, fake.state != BOOT_UP) {
            fake.toggle = Some(!toggle);
            let (node, state) = (fake.id, fake.state | u8::from(toggle) << 7);
            self.error_control(node, state);
        }
    }

    fn answer_lss(&mut self, n: usize, frame: &Frame) {
        let Some(slave) = &mut self.fakes[n].lss else {
            return;
        };
        let mut data = frame.padded();
        if data[0] == 0x11 && Some(data[1]) == self.refuses_node_id {
            // No node-ID at all.
            data[1] = 0;
        }
        let frame = Frame::full(frame.id(), data);
        match slave.on_frame(&frame, &mut NoStore) {
            Some(SlaveEvent::Send(answer)) => self.boot.on_frame(&answer, self.now),
            Some(SlaveEvent::Boot(node)) => {
                self.fakes[n].lss = None;
                self.fakes[n].id = node.get();
                self.fakes[n].boots_at = Some(self.now + ms(200));
            }
            _ => {}
        }
    }

    fn answer_sdo(&mut self, n: usize, frame: &Frame) {
        let now = self.now;
        let fake = &mut self.fakes[n];
        let node = fake.id;
        let data = frame.padded();
        let entry = (u16::from_le_bytes([data[1], data[2]]), data[3]);
        let up = matches!(fake.state, PRE_OPERATIONAL | OPERATIONAL);
        if !up || fake.mute == Some(entry) || data[0] == 0x80 {
            return;
        }
        if fake.restarts_at == Some(entry) {
            fake.obey(0x82, now);
            fake.boots_at = Some(now + ms(1));
            return;
        }
        let mut answer = [0, data[1], data[2], data[3], 0, 0, 0, 0];
        let written = u32::from_le_bytes([data[4], data[5], data[6], data[7]]);
        let refusal = fake.refuses.filter(|(at, _)| *at == entry);
        if let Some((_, code)) = refusal {
            answer[0] = 0x80;
            answer[4..].copy_from_slice(&code.to_le_bytes());
        } else if data[0] == 0x40 {
            answer[0] = 0x43;
            let value = fake.values.iter().find(|(at, _)| *at == entry);
            let (_, value) =
                value.unwrap_or_else(|| panic!("node {node} was asked for {entry:X?}"));
            answer[4..].copy_from_slice(&value.to_le_bytes());
        } else {
            answer[0] = 0x60;
            fake.written.push((entry, written));
            if entry == (0x1017, 0) {
                fake.period = Some(ms(written)).filter(|period| *period != Duration::ZERO);
                fake.beat = fake.period.map(|period| now + period);
            }
        }
        self.boot
            .on_frame(&Frame::full(cob_id(0x580 + u16::from(node)), answer), now);
    }

    /// NMT commands so far.
    pub(crate) fn nmt(&self) -> Vec<[u8; 2]> {
        let nmt = self
            .sent
            .iter()
            .filter(|(_, frame)| frame.id() == CobId::NMT);
        nmt.map(|(_, frame)| frame.data().try_into().unwrap())
            .collect()
    }

    /// The data of what went to the SDO server of a node.
    pub(crate) fn requests(&self, node: u8) -> Vec<[u8; 8]> {
        let to = cob_id(0x600 + u16::from(node));
        let requests = self.sent.iter().filter(|(_, frame)| frame.id() == to);
        requests.map(|(_, frame)| frame.padded()).collect()
    }

    /// Forgets what was, so that what follows can be read by itself.
    pub(crate) fn forget(&mut self) {
        self.sent.clear();
        self.events.clear();
    }

    pub(crate) fn failure(&self, node: u8) -> (Status, Cause) {
        let found = self.events.iter().find_map(|event| match event {
            Event::Failed(failed, failure) if *failed == id(node) => Some(failure),
            _ => None,
        });
        let failure = found.expect("the node failed");
        (failure.status, failure.cause)
    }

    pub(crate) fn letter(&self, node: u8) -> Option<char> {
        let result = self.boot.result(id(node)).unwrap();
        result.status().map(Status::letter)
    }

    pub(crate) fn assert_nothing_was_started(&self) {
        assert!(self.boot.is_failed());
        assert!(!self.sync);
        assert!(self.events.contains(&Event::NetworkFailed));
        assert!(self.nmt().iter().all(|[command, _]| *command != 0x01));
    }
}

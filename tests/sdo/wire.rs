//! A client's channel and a server with a wire between them that can be told
//! what to do with each frame, in virtual time.

use crate::common::{DOMAIN, Dictionary, Memory, NODE, TIMEOUT, ms};
use canmaster::sdo::{Channel, Progress, Protocol, SdoError, Server, Transfer};
use canmaster::{Frame, Instant};

/// Segments per block: few, so that a short transfer has several blocks.
pub(crate) const BLOCK_SIZE: u8 = 3;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum To {
    Server,
    Client,
}

/// A kind of transfer of the domain.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kind {
    pub(crate) protocol: Protocol,
    pub(crate) upload: bool,
}

pub(crate) const KINDS: [Kind; 4] = {
    const fn kind(protocol: Protocol, upload: bool) -> Kind {
        Kind { protocol, upload }
    }
    [
        kind(Protocol::Normal, false),
        kind(Protocol::Normal, true),
        kind(Protocol::Block, false),
        kind(Protocol::Block, true),
    ]
};

pub(crate) struct Wire {
    pub(crate) channel: Channel,
    pub(crate) memory: Memory,
    pub(crate) server: Server,
    pub(crate) od: Dictionary,
    pub(crate) now: Instant,
    /// Frames so far, both ways.
    pub(crate) count: usize,
    /// The frame with this number comes twice.
    pub(crate) twice: Option<usize>,
    to_server: Vec<Frame>,
    to_client: Vec<Frame>,
}

impl Wire {
    pub(crate) fn new() -> Wire {
        Wire {
            channel: Channel::new(NODE, TIMEOUT),
            memory: Memory::default(),
            server: Server::new(NODE, TIMEOUT).with_block_size(BLOCK_SIZE),
            od: Dictionary::new(),
            now: ms(0),
            count: 0,
            twice: None,
            to_server: vec![],
            to_client: vec![],
        }
    }

    /// Begins a transfer of the domain: an upload of what is there, or a
    /// download of `data`.
    pub(crate) fn begin(&mut self, kind: Kind, data: &[u8]) {
        let Wire {
            channel, memory, ..
        } = self;
        let first = if kind.upload {
            channel.upload(DOMAIN, kind.protocol, self.now)
        } else {
            *memory = Memory::of(data);
            channel.download(DOMAIN, data.len() as u32, kind.protocol, memory, self.now)
        };
        self.to_server.push(first.expect("the channel is free"));
    }

    pub(crate) fn say(&mut self, frame: Frame) -> Progress<Transfer> {
        self.channel.on_frame(&frame, self.now, &mut self.memory)
    }

    /// Carries on until the client has an end; `fate` says what becomes of each
    /// frame, by its number. Those of [`twice`](Self::twice) come twice.
    pub(crate) fn run(
        &mut self,
        mut fate: impl FnMut(usize, To, Frame) -> Option<Frame>,
    ) -> Result<u32, SdoError> {
        for _ in 0..100_000 {
            match self.step(&mut fate) {
                Progress::Nothing => {}
                Progress::Send(frame) => self.to_server.push(frame),
                Progress::Done(transfer) => return Ok(transfer.len),
                Progress::Failed(error, abort) => {
                    self.to_server.extend(abort);
                    return Err(error);
                }
            }
        }
        panic!("no end");
    }

    fn step(
        &mut self,
        fate: &mut impl FnMut(usize, To, Frame) -> Option<Frame>,
    ) -> Progress<Transfer> {
        let to = if !self.to_server.is_empty() {
            To::Server
        } else if !self.to_client.is_empty() {
            To::Client
        } else {
            let deadlines = [self.channel.next_deadline(), self.server.next_deadline()];
            let next = deadlines.into_iter().flatten().min();
            self.now = self.now.max(next.expect("somebody waits"));
            let polled = self.server.poll(self.now, &mut self.od);
            self.to_client.extend(polled);
            return self.channel.poll(self.now, &mut self.memory);
        };
        self.count += 1;
        let number = self.count - 1;
        let again = self.twice.take_if(|twice| *twice == number).is_some();
        if to == To::Server {
            let frame = self.to_server.remove(0);
            if again {
                self.to_server.insert(0, frame);
            }
            if let Some(frame) = fate(number, to, frame) {
                let answer = self.server.on_frame(&frame, self.now, &mut self.od);
                self.to_client.extend(answer);
            }
            Progress::Nothing
        } else {
            let frame = self.to_client.remove(0);
            if again {
                self.to_client.insert(0, frame);
            }
            match fate(number, to, frame) {
                Some(frame) => self.say(frame),
                None => Progress::Nothing,
            }
        }
    }

    /// The wire is whole again and nobody does anything: after the timeouts and
    /// the quarantine both ends are free.
    pub(crate) fn settle(&mut self) {
        for frame in std::mem::take(&mut self.to_server) {
            let answer = self.server.on_frame(&frame, self.now, &mut self.od);
            self.to_client.extend(answer);
        }
        for _ in 0..100 {
            for frame in std::mem::take(&mut self.to_client) {
                assert_eq!(self.say(frame), Progress::Nothing);
            }
            let deadlines = [self.channel.next_deadline(), self.server.next_deadline()];
            let Some(next) = deadlines.into_iter().flatten().min() else {
                break;
            };
            self.now = self.now.max(next);
            let polled = self.server.poll(self.now, &mut self.od);
            self.to_client.extend(polled);
            let progress = self.channel.poll(self.now, &mut self.memory);
            assert_eq!(progress, Progress::Nothing);
        }
        self.to_client.clear();
        assert!(self.channel.is_ready(self.now));
        assert!(self.server.is_idle());
        assert_eq!(self.od.incoming, []);
    }
}

/// Bytes that are all different from their neighbours.
pub(crate) fn data(len: usize) -> Vec<u8> {
    (0..len).map(|i| (i * 37 + 11) as u8).collect()
}

/// Where the frames of a whole transfer go.
pub(crate) fn ways(kind: Kind, data: &[u8]) -> Vec<To> {
    let mut wire = Wire::new();
    wire.od.domain = data.to_vec();
    wire.begin(kind, data);
    let mut ways = vec![];
    let result = wire.run(|_, to, frame| {
        ways.push(to);
        Some(frame)
    });
    assert_eq!(result, Ok(data.len() as u32));
    ways
}

/// How many frames a whole transfer has.
pub(crate) fn frames(kind: Kind, data: &[u8]) -> usize {
    ways(kind, data).len()
}

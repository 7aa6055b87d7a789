//! A segment of a segmented transfer, at the client and at the server. What the
//! other side says is recorded first.

use std::hint::black_box;

use canmaster::id::Address;
use canmaster::od::{
    Chunk, DataType, Entry, Object, ObjectDictionary, Part, Table, Value, Values, read_bytes,
};
use canmaster::sdo::{AbortCode, Channel, Payload, Progress, Protocol, Server};
use canmaster::time::{Duration, Instant};
use canmaster::{Frame, NodeId};

const NODE: NodeId = NodeId::constant::<5>();
const TIMEOUT: Duration = Duration::from_millis(500);
const DOMAIN: Address = Address::new(0x1F22, 1);
const OBJECTS: &[Object] = &[Object::rw(0x1F22, 1, DataType::Domain, 0)];
const SIZE: u32 = 1000;

/// One domain.
struct Dictionary {
    values: Values<1>,
    domain: Vec<u8>,
}

impl ObjectDictionary for Dictionary {
    fn entry(&self, at: Address) -> Result<Entry, AbortCode> {
        self.values.entry(at)
    }

    fn get(&mut self, at: Address) -> Result<Value, AbortCode> {
        self.values.get(at)
    }

    fn set(&mut self, at: Address, value: Value) -> Result<(), AbortCode> {
        self.values.set(at, value)
    }

    fn read(&mut self, _: Address, offset: u32, buf: &mut [u8]) -> Result<Chunk, AbortCode> {
        Ok(read_bytes(&self.domain, offset, buf))
    }

    fn write(&mut self, _: Address, part: Part<'_>) -> Result<(), AbortCode> {
        let place = self.domain.get_mut(part.offset as usize..);
        for (byte, new) in place.into_iter().flatten().zip(part.data) {
            *byte = *new;
        }
        Ok(())
    }
}

/// The data at the client.
struct Memory(Vec<u8>);

impl Payload for Memory {
    fn read(&mut self, offset: u32, buf: &mut [u8]) {
        let place = self.0.get(offset as usize..).unwrap_or_default();
        for (byte, old) in buf.iter_mut().zip(place) {
            *byte = *old;
        }
    }

    fn begin(&mut self, _: Option<u32>) -> Result<(), AbortCode> {
        Ok(())
    }

    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), AbortCode> {
        let place = self.0.get_mut(offset as usize..).unwrap_or_default();
        for (byte, new) in place.iter_mut().zip(data) {
            *byte = *new;
        }
        Ok(())
    }
}

struct Both {
    channel: Channel,
    memory: Memory,
    server: Server,
    dictionary: Dictionary,
    first: Frame,
}

fn both(download: bool) -> Both {
    let data: Vec<u8> = (0..SIZE).map(|n| n as u8).collect();
    let mut channel = Channel::new(NODE, TIMEOUT);
    let mut memory = Memory(data.clone());
    let first = match download {
        true => channel.download(DOMAIN, SIZE, Protocol::Normal, &mut memory, Instant::ZERO),
        false => channel.upload(DOMAIN, Protocol::Normal, Instant::ZERO),
    };
    Both {
        channel,
        memory,
        server: Server::new(NODE, TIMEOUT),
        dictionary: Dictionary {
            values: Values::new(Table::new(OBJECTS)),
            domain: data,
        },
        first: first.unwrap_or(Frame::empty(canmaster::id::CobId::NMT)),
    }
}

/// The requests of a whole transfer and their answers.
fn recorded(download: bool) -> (Vec<Frame>, Vec<Frame>) {
    let mut both = both(download);
    let (mut requests, mut answers) = (vec![both.first], Vec::new());
    while let Some(request) = requests.last() {
        let answer = both
            .server
            .on_frame(request, Instant::ZERO, &mut both.dictionary);
        let Some(answer) = answer else { break };
        answers.push(answer);
        let progress = both
            .channel
            .on_frame(&answer, Instant::ZERO, &mut both.memory);
        match progress {
            Progress::Send(request) => requests.push(request),
            Progress::Done(_) => break,
            other => panic!("the transfer ended with {other:?}"),
        }
    }
    (requests, answers)
}

fn client(download: bool, times: u32) {
    let (_, answers) = recorded(download);
    let mut both = both(download);
    // The first answer is that to the initiate.
    for answer in answers.iter().take(times as usize + 1) {
        let progress = both
            .channel
            .on_frame(black_box(answer), Instant::ZERO, &mut both.memory);
        let _ = black_box(progress);
    }
}

fn server(download: bool, times: u32) {
    let (requests, _) = recorded(download);
    let mut both = both(download);
    for request in requests.iter().take(times as usize + 1) {
        black_box(
            both.server
                .on_frame(black_box(request), Instant::ZERO, &mut both.dictionary),
        );
    }
}

pub(crate) fn client_download(times: u32) {
    client(true, times);
}

pub(crate) fn client_upload(times: u32) {
    client(false, times);
}

pub(crate) fn server_download(times: u32) {
    server(true, times);
}

pub(crate) fn server_upload(times: u32) {
    server(false, times);
}

//! An SDO client that is the guest on the bus, with a machine around it.

use canmaster::id::Address;
use canmaster::sdo::{AbortCode, Channel, Payload, Progress, Protocol, SdoError, Transfer};
use canmaster::time::{Duration, Instant};
use canmaster::{Frame, NodeId};

use super::World;
use crate::frame::WireFrame;
use crate::time::Time;

/// How long the client waits for an answer.
const TIMEOUT: Duration = Duration::from_millis(300);
/// How often it looks at what came.
const LOOK: Time = Time::from_us(200);

/// What is written, or was read.
#[derive(Default)]
struct Data(Vec<u8>);

impl Payload for Data {
    fn read(&mut self, offset: u32, buf: &mut [u8]) {
        let from = offset as usize;
        buf.copy_from_slice(&self.0[from..from + buf.len()]);
    }

    fn begin(&mut self, _: Option<u32>) -> Result<(), AbortCode> {
        self.0.clear();
        Ok(())
    }

    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), AbortCode> {
        self.0.truncate(offset as usize);
        self.0.extend_from_slice(data);
        Ok(())
    }
}

/// See the module. What it hears beside its own answers is kept.
pub struct Client<'i> {
    /// The machine.
    pub world: World<'i>,
    channel: Channel,
    heard: Vec<(Time, Frame)>,
}

impl<'i> Client<'i> {
    /// A client of the server of `node`.
    pub fn new(world: World<'i>, node: NodeId) -> Client<'i> {
        Client {
            world: world.with_guest(),
            channel: Channel::new(node, TIMEOUT),
            heard: Vec::new(),
        }
    }

    fn now(&self) -> Instant {
        Instant::from_micros(self.world.now().0 / Time::from_us(1).0)
    }

    /// Sends a frame.
    ///
    /// # Panics
    /// If too much waits to be sent.
    pub fn say(&mut self, frame: Frame) {
        assert!(self.world.say(WireFrame::from(frame)), "the guest is full");
    }

    /// Runs for `time` and listens.
    pub fn listen(&mut self, time: Time) {
        let end = self.world.now() + time;
        while self.world.now() < end {
            let next = (self.world.now() + LOOK).min(end);
            self.world.run_until(next);
            while self.hear().is_some() {}
        }
    }

    /// Takes what was heard so far.
    pub fn take_heard(&mut self) -> Vec<(Time, Frame)> {
        while self.hear().is_some() {}
        std::mem::take(&mut self.heard)
    }

    /// What was heard with this identifier, oldest first; the rest is forgotten.
    pub fn heard_from(&mut self, id: u16) -> Vec<Vec<u8>> {
        let of_it =
            |(_, frame): (Time, Frame)| (frame.id().get() == id).then(|| frame.data().to_vec());
        self.take_heard().into_iter().filter_map(of_it).collect()
    }

    fn hear(&mut self) -> Option<Frame> {
        // An extended identifier is nothing to this client.
        let frame = std::iter::from_fn(|| self.world.hear())
            .find_map(|frame| Frame::try_from(frame).ok())?;
        self.heard.push((self.world.now(), frame));
        Some(frame)
    }

    /// Sends a frame of a transfer as soon as there is room.
    fn send(&mut self, frame: Frame) {
        while !self.world.say(WireFrame::from(frame)) {
            let next = self.world.now() + LOOK;
            self.world.run_until(next);
        }
    }

    fn finish(&mut self, first: Frame, data: &mut Data) -> Result<Transfer, SdoError> {
        self.send(first);
        loop {
            let next = self.world.now() + LOOK;
            self.world.run_until(next);
            loop {
                let now = self.now();
                let progress = match self.hear() {
                    Some(frame) => self.channel.on_frame(&frame, now, data),
                    None => match self.channel.poll(now, data) {
                        Progress::Nothing => break,
                        progress => progress,
                    },
                };
                match progress {
                    Progress::Nothing => {}
                    Progress::Send(frame) => self.send(frame),
                    Progress::Done(transfer) => return Ok(transfer),
                    Progress::Failed(error, abort) => {
                        if let Some(abort) = abort {
                            self.send(abort);
                        }
                        return Err(error);
                    }
                }
            }
        }
    }

    /// Reads an entry.
    ///
    /// # Errors
    /// As the channel has them.
    pub fn read(&mut self, at: Address, protocol: Protocol) -> Result<Vec<u8>, SdoError> {
        let mut data = Data::default();
        let first = loop {
            match self.channel.upload(at, protocol, self.now()) {
                Ok(frame) => break frame,
                // It is closed after a timeout.
                Err(_) => self.listen(LOOK),
            }
        };
        self.finish(first, &mut data)?;
        Ok(data.0)
    }

    /// Writes an entry.
    ///
    /// # Errors
    /// As the channel has them.
    pub fn write(&mut self, at: Address, bytes: &[u8], protocol: Protocol) -> Result<(), SdoError> {
        let mut data = Data(bytes.to_vec());
        let size = bytes.len() as u32;
        let first = loop {
            let now = self.now();
            match self.channel.download(at, size, protocol, &mut data, now) {
                Ok(frame) => break frame,
                // It is closed after a timeout.
                Err(_) => self.listen(LOOK),
            }
        };
        self.finish(first, &mut data).map(|_| ())
    }

    /// Reads an entry of at most four bytes.
    ///
    /// # Errors
    /// As the channel has them.
    pub fn number(&mut self, index: u16, sub: u8) -> Result<u32, SdoError> {
        let bytes = self.read(Address::new(index, sub), Protocol::Normal)?;
        let places = bytes.iter().take(4).rev();
        Ok(places.fold(0, |number, byte| number << 8 | u32::from(*byte)))
    }

    /// Writes the first `len` bytes of a number to an entry.
    ///
    /// # Errors
    /// As the channel has them.
    pub fn put(&mut self, index: u16, sub: u8, number: u32, len: usize) -> Result<(), SdoError> {
        let bytes = number.to_le_bytes();
        self.write(Address::new(index, sub), &bytes[..len], Protocol::Normal)
    }
}

//! The board as a CANopen device: a client on the same bus reads and writes its
//! object dictionary while the master runs the network.

mod common;

use canmaster::id::Address;
use canmaster::sdo::{Channel, Payload, Progress, Protocol, SdoError, Transfer};
use canmaster::time::{Duration, Instant};
use canmaster::{Frame, NodeId};
use canmaster_sim::frame::WireFrame;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Scenario, World, enabled};

use common::image;

const MASTER: NodeId = NodeId::constant::<127>();
const END: Time = Time::from_ms(20_000);
const PATIENCE: Time = Time::from_ms(2000);

/// What is written, or was read.
#[derive(Default)]
struct Data(Vec<u8>);

impl Payload for Data {
    fn read(&mut self, offset: u32, buf: &mut [u8]) {
        let from = offset as usize;
        buf.copy_from_slice(&self.0[from..from + buf.len()]);
    }

    fn begin(&mut self, _: Option<u32>) -> Result<(), canmaster::sdo::AbortCode> {
        self.0.clear();
        Ok(())
    }

    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), canmaster::sdo::AbortCode> {
        self.0.truncate(offset as usize);
        self.0.extend_from_slice(data);
        Ok(())
    }
}

/// A client with a machine around it.
struct Client<'i> {
    world: World<'i>,
    channel: Channel,
}

impl Client<'_> {
    fn now(&self) -> Instant {
        Instant::from_micros(self.world.now().0 / 1_000_000)
    }

    fn say(&mut self, frame: Frame) {
        assert!(self.world.say(WireFrame::from(frame)));
    }

    fn finish(&mut self, first: Frame, data: &mut Data) -> Result<Transfer, SdoError> {
        self.say(first);
        let limit = self.world.now() + PATIENCE;
        while self.world.now() < limit {
            let next = self.world.now() + Time::from_us(200);
            self.world.run_until(next);
            loop {
                let now = self.now();
                let progress = match self.world.hear() {
                    Some(frame) => match Frame::try_from(frame) {
                        Ok(frame) => self.channel.on_frame(&frame, now, data),
                        Err(_) => continue,
                    },
                    None => match self.channel.poll(now, data) {
                        Progress::Nothing => break,
                        progress => progress,
                    },
                };
                match progress {
                    Progress::Nothing => {}
                    Progress::Send(frame) => self.say(frame),
                    Progress::Done(transfer) => return Ok(transfer),
                    Progress::Failed(error, _) => return Err(error),
                }
            }
        }
        panic!("the server neither answered nor was given up");
    }

    fn read(&mut self, at: Address, protocol: Protocol) -> Result<Vec<u8>, SdoError> {
        let mut data = Data::default();
        let first = self.channel.upload(at, protocol, self.now()).unwrap();
        self.finish(first, &mut data)?;
        Ok(data.0)
    }

    fn write(&mut self, at: Address, bytes: &[u8], protocol: Protocol) -> Result<(), SdoError> {
        let mut data = Data(bytes.to_vec());
        let (size, now) = (bytes.len() as u32, self.now());
        let first = self.channel.download(at, size, protocol, &mut data, now);
        self.finish(first.unwrap(), &mut data).map(|_| ())
    }
}

/// A client beside a master in standby.
fn in_standby(seed: u64) -> Client<'static> {
    let scenario = Scenario::new(seed, END).unattended();
    let mut world = World::new(image(), scenario).unwrap().with_guest();
    let standby = |world: &World<'_>| world.statuses().flatten().all(|status| enabled(&status));
    assert!(world.run_to(Time::from_ms(4000), standby));
    Client {
        world,
        channel: Channel::new(MASTER, Duration::from_millis(300)),
    }
}

fn at(index: u16, sub: u8) -> Address {
    Address::new(index, sub)
}

#[test]
fn expedited_segmented_and_block_transfers_beside_the_running_network() {
    let mut client = in_standby(31);
    for protocol in [Protocol::Normal, Protocol::Block] {
        assert_eq!(client.read(at(0x1000, 0), protocol).unwrap(), [0; 4]);
        let name = client.read(at(0x1008, 0), protocol).unwrap();
        assert_eq!(name, b"canmaster");
        let dcf = client.read(at(0x1F22, 1), protocol).unwrap();
        assert!(dcf.len() > 100, "{} bytes", dcf.len());
        let words = client.read(at(0x2F01, 3), protocol).unwrap();
        assert_eq!(words, b"axis 3: operational");
    }
    // 1F82h: every drive is operational.
    for node in 1..=6 {
        assert_eq!(
            client.read(at(0x1F82, node), Protocol::Normal).unwrap(),
            [5]
        );
    }
    // What follows from the design is constant; the SYNC is not to be touched now.
    let refused = |result: Result<(), SdoError>, code: u32| match result {
        Err(SdoError::Aborted { code: got, .. }) => assert_eq!(got.0, code),
        other => panic!("{other:?}"),
    };
    let normal = Protocol::Normal;
    refused(client.write(at(0x1000, 0), &[0; 4], normal), 0x0601_0002);
    refused(client.write(at(0x1006, 0), &[0; 4], normal), 0x0800_0022);
    // Saving is refused while the axes are enabled.
    refused(client.write(at(0x1010, 1), b"save", normal), 0x0800_0022);
    assert!(
        client
            .world
            .statuses()
            .flatten()
            .all(|status| enabled(&status))
    );
}

#[test]
fn the_heartbeat_follows_1017h() {
    let mut client = in_standby(32);
    client
        .write(at(0x1017, 0), &100_u16.to_le_bytes(), Protocol::Normal)
        .unwrap();
    while client.world.hear().is_some() {}
    let until = client.world.now() + Time::from_ms(2000);
    client.world.run_until(until);
    let heard = std::iter::from_fn(|| client.world.hear());
    let own = heard
        .filter_map(|frame| Frame::try_from(frame).ok())
        .filter(|frame| frame.id().get() == 0x77F);
    let count = own.count();
    assert!((19..=21).contains(&count), "{count} heartbeats in 2 s");
}

//! The client for async code, against the server, in virtual time.

use std::collections::VecDeque;
use std::pin::pin;
use std::task::{Context, Poll, Waker};

use crate::common::{DOMAIN, Dictionary, Memory, NODE, TIMEOUT, ms};
use canmaster::id::Address;
use canmaster::sdo::{
    AbortCode, AsyncClient, AsyncLink, Channel, Link, Protocol, SdoError, Server, TestData,
    Transfer,
};
use canmaster::time::{Duration, Instant};
use canmaster::{CobId, Frame};

const NAME: Address = Address::new(0x1008, 0);
const HEARTBEAT: Address = Address::new(0x1017, 0);
/// From a request to its answer.
const LATENCY: Duration = Duration::from_millis(1);

/// The link with the server at its other end.
struct Wire {
    now: Instant,
    server: Server,
    od: Dictionary,
    coming: VecDeque<Frame>,
    sent: Vec<Frame>,
    /// The server does not answer.
    dead: bool,
    /// Every other frame finds no room at first.
    crowded: bool,
    refused: bool,
}

impl Wire {
    fn new() -> Wire {
        Wire {
            now: ms(0),
            server: Server::new(NODE, TIMEOUT),
            od: Dictionary::new(),
            coming: VecDeque::new(),
            sent: Vec::new(),
            dead: false,
            crowded: false,
            refused: false,
        }
    }
}

impl Link for Wire {
    fn now(&self) -> Instant {
        self.now
    }

    fn send(&mut self, frame: Frame) -> bool {
        self.refused = self.crowded && !self.refused;
        if self.refused {
            return false;
        }
        self.sent.push(frame);
        if !self.dead {
            let answer = self.server.on_frame(&frame, self.now, &mut self.od);
            self.coming.extend(answer);
        }
        true
    }

    fn receive(&mut self) -> Option<Frame> {
        self.coming.pop_front()
    }
}

impl AsyncLink for Wire {
    async fn wait(&mut self, until: Instant) {
        self.now += LATENCY;
        while let Some(frame) = self.server.poll(self.now, &mut self.od) {
            self.coming.push_back(frame);
        }
        if self.coming.is_empty() {
            self.now = self.now.max(until);
        }
    }
}

/// Nothing here ever has to be woken.
fn done<T>(future: impl Future<Output = T>) -> T {
    let mut future = pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        if let Poll::Ready(result) = future.as_mut().poll(&mut context) {
            return result;
        }
    }
}

#[test]
fn small_entries() {
    let (mut wire, mut channel) = (Wire::new(), Channel::new(NODE, TIMEOUT));
    let mut client = AsyncClient::new(&mut channel, &mut wire);
    let name = done(client.read(NAME)).unwrap();
    assert_eq!(name.as_str(), Some("EPOS4"));
    done(client.write(HEARTBEAT, &[100, 0])).unwrap();
    assert_eq!(done(client.read(HEARTBEAT)).unwrap().as_u32(), Some(100));
    let refused = done(client.write(NAME, b"other"));
    let error = SdoError::Aborted {
        at: NAME,
        code: AbortCode::READ_ONLY,
    };
    assert_eq!(refused, Err(error));
}

#[test]
fn any_amount_in_both_ways_by_both_protocols() {
    for crowded in [false, true] {
        for protocol in [Protocol::Normal, Protocol::Block] {
            let (mut wire, mut channel) = (Wire::new(), Channel::new(NODE, TIMEOUT));
            wire.crowded = crowded;
            let mut client = AsyncClient::new(&mut channel, &mut wire);
            let len = 10_000;
            let transfer = Transfer { at: DOMAIN, len };
            let mut data = TestData::new(5);
            let there = done(client.transfer(DOMAIN, Some(len), protocol, &mut data));
            assert_eq!(there, Ok(transfer));
            let mut check = TestData::new(5);
            let back = done(client.transfer(DOMAIN, None, protocol, &mut check));
            assert_eq!(back, Ok(transfer));
            assert_eq!(check.reached(), len);
            // Of another seed: the client ends it, and says why.
            let other = done(client.transfer(DOMAIN, None, protocol, &mut TestData::new(6)));
            assert_eq!(other.unwrap_err().code(), AbortCode::VALUE_RANGE);
        }
    }
}

#[test]
fn a_server_without_block_transfer_is_served_in_segments() {
    let (mut wire, mut channel) = (Wire::new(), Channel::new(NODE, TIMEOUT));
    wire.server = Server::new(NODE, TIMEOUT).with_block_size(0);
    let mut client = AsyncClient::new(&mut channel, &mut wire);
    let mut data = Memory::of(&[7; 100]);
    let there = done(client.transfer(DOMAIN, Some(100), Protocol::Block, &mut data));
    assert_eq!(there.map(|transfer| transfer.len), Ok(100));
    assert_eq!(wire.od.domain, [7; 100]);
}

#[test]
fn a_timeout_is_told_after_the_quarantine() {
    let (mut wire, mut channel) = (Wire::new(), Channel::new(NODE, TIMEOUT));
    wire.dead = true;
    let mut client = AsyncClient::new(&mut channel, &mut wire);
    let error = SdoError::Timeout {
        at: NAME,
        waited: TIMEOUT,
    };
    assert_eq!(done(client.read(NAME)), Err(error));
    assert_eq!(wire.now, ms(1000));
    assert!(channel.is_ready(wire.now));
    let abort = [0x80, 0x08, 0x10, 0, 0, 0, 0x04, 0x05];
    let request = CobId::new(0x605).unwrap();
    assert_eq!(wire.sent.last(), Some(&Frame::full(request, abort)));
    // The late answer meets nobody.
    wire.dead = false;
    let mut client = AsyncClient::new(&mut channel, &mut wire);
    assert_eq!(done(client.read(NAME)).unwrap().as_str(), Some("EPOS4"));
}

#[test]
fn a_transfer_that_was_dropped_is_aborted_by_the_next() {
    let (mut wire, mut channel) = (Wire::new(), Channel::new(NODE, TIMEOUT));
    // What a dropped future leaves behind.
    let mut data = Memory::of(&[7; 100]);
    let begun = channel.download(DOMAIN, 100, Protocol::Block, &mut data, wire.now);
    assert!(begun.is_ok() && !channel.is_ready(wire.now));
    let mut client = AsyncClient::new(&mut channel, &mut wire);
    assert_eq!(done(client.read(NAME)).unwrap().as_str(), Some("EPOS4"));
    let abort = [0x80, 0x22, 0x1F, 1, 0, 0, 0, 0x08];
    assert_eq!(wire.sent[0].padded(), abort);
    assert!(wire.now >= ms(500), "the quarantine was kept");
}

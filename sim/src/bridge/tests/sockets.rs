use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use crate::bridge::{Bridge, CLIENTS};
use crate::bus::Bus;
use crate::time::Time;

const BIT_RATE: u32 = 1_000_000;
const STEP: Time = Time::from_us(200);
/// Exchanges until something that has to come is given up, a millisecond each.
const PATIENCE: usize = 10_000;

/// A bridge on a bus of its own.
struct Rig {
    bridge: Bridge,
    bus: Bus,
    now: Time,
}

impl Rig {
    fn new() -> Rig {
        let mut bridge = Bridge::listen(0, BIT_RATE).unwrap();
        let mut bus = Bus::new(1);
        assert_eq!(bridge.attach(&mut bus).len(), CLIENTS);
        Rig {
            bridge,
            bus,
            now: Time::ZERO,
        }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.bridge.address()).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_millis(1)))
            .unwrap();
        stream
    }

    fn step(&mut self) {
        self.bridge.exchange(self.now);
        self.bridge.offer(&mut self.bus, self.now);
        self.now += STEP;
        let mut events = Vec::new();
        self.bus.advance(self.now, &mut events);
        for event in &events {
            self.bridge.on_event(event);
        }
    }

    /// Goes on until `client` has been told so many bytes.
    fn hear(&mut self, client: &mut TcpStream, bytes: usize) -> Vec<u8> {
        let mut heard = Vec::new();
        for _ in 0..PATIENCE {
            self.step();
            let mut chunk = [0; 256];
            if let Ok(read) = client.read(&mut chunk) {
                heard.extend_from_slice(&chunk[..read]);
            }
            if heard.len() >= bytes {
                break;
            }
        }
        heard
    }

    fn ask(&mut self, client: &mut TcpStream, words: &[u8], bytes: usize) -> Vec<u8> {
        client.write_all(words).unwrap();
        self.hear(client, bytes)
    }

    fn until(&mut self, what: impl Fn(&Rig) -> bool) {
        for _ in 0..PATIENCE {
            if what(self) {
                return;
            }
            self.step();
            std::thread::yield_now();
        }
        panic!("it does not come");
    }
}

#[test]
fn only_this_computer_can_connect() {
    assert!(Rig::new().bridge.address().ip().is_loopback());
}

#[test]
fn a_port_that_is_taken_is_an_error() {
    let rig = Rig::new();
    assert!(Bridge::listen(rig.bridge.address().port(), BIT_RATE).is_err());
}

#[test]
fn clients_hear_each_other_over_the_bus() {
    let mut rig = Rig::new();
    let (mut one, mut other) = (rig.connect(), rig.connect());
    assert_eq!(rig.ask(&mut one, b"S8\rO\r", 2), b"\r\r");
    assert_eq!(rig.ask(&mut other, b"O\r", 1), b"\r");
    assert_eq!(rig.ask(&mut one, b"t60121234\r", 2), b"z\r");
    assert_eq!(rig.hear(&mut other, 10), b"t60121234\r");
    assert_eq!(rig.hear(&mut one, 0), b"", "no echo");
}

#[test]
fn a_client_that_goes_without_a_word_makes_room() {
    let mut rig = Rig::new();
    for _ in 0..3 * CLIENTS {
        let mut client = rig.connect();
        assert_eq!(rig.ask(&mut client, b"O\r", 1), b"\r");
        drop(client);
        rig.until(|rig| rig.bridge.clients() == 0);
    }
}

#[test]
fn one_client_too_many_is_shown_the_door() {
    let mut rig = Rig::new();
    let mut clients: Vec<TcpStream> = (0..CLIENTS).map(|_| rig.connect()).collect();
    rig.until(|rig| rig.bridge.clients() == CLIENTS);
    let mut late = rig.connect();
    let mut ended = false;
    for _ in 0..PATIENCE {
        rig.step();
        let mut chunk = [0; 1];
        match late.read(&mut chunk) {
            Ok(read) => {
                assert_eq!(read, 0);
                ended = true;
                break;
            }
            Err(error) if error.kind() == std::io::ErrorKind::ConnectionReset => {
                ended = true;
                break;
            }
            Err(_) => {}
        }
    }
    assert!(ended);
    for client in &mut clients {
        assert_eq!(rig.ask(client, b"V\r", 6), b"V0100\r");
    }
}

#[test]
fn rubbish_ends_nothing() {
    let mut rig = Rig::new();
    let mut client = rig.connect();
    let rubbish: Vec<u8> = (0..20_000u32)
        .map(|n| (n.wrapping_mul(2_654_435_761) >> 24) as u8)
        .collect();
    client.write_all(&rubbish).unwrap();
    rig.ask(&mut client, b"\rC\r", 1);
    let mut other = rig.connect();
    assert_eq!(rig.ask(&mut other, b"V\r", 6), b"V0100\r");
}

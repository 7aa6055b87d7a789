//! One adapter: bytes from its client and events from the bus go in, bytes for
//! the client and a frame to offer come out. No socket, no clock.

use std::collections::VecDeque;

use super::controller::Controller;
use super::slcan::{self, BELL, Command, LONGEST, OK};
use crate::bus::{BitTiming, Event, Offer};
use crate::frame::WireId;
use crate::time::Time;

/// Hardware and software version, two digits each.
const VERSION: &str = "V0100\r";
/// Serial number.
const SERIAL: &str = "NSIM1\r";
/// Answer to a frame that was taken, by its format.
const TAKEN: &str = "z\r";
const TAKEN_EXTENDED: &str = "Z\r";
/// Bytes that wait for the client, at most; what comes then is lost. A
/// fully loaded bus fills this in about three seconds.
const OUTPUT: usize = 1 << 19;
/// Bytes of the client that wait for the bus, at most.
const INPUT: usize = 1 << 12;
/// How long frames that were taken before the end are still tried.
const LAST_FRAMES: Time = Time::from_ms(100);

/// What the client has made of its channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Channel {
    Closed,
    Open,
    /// Closed, but what was taken is still sent, until then at most.
    Closing(Time),
}

/// See the module.
#[derive(Debug)]
pub struct Adapter {
    bus_bit_rate: u32,
    bit_rate: u32,
    channel: Channel,
    stamps: bool,
    controller: Controller,
    input: VecDeque<u8>,
    line: Vec<u8>,
    /// The line is longer than any command.
    too_long: bool,
    output: VecDeque<u8>,
    /// The client is gone; what it has sent is still worked through, until
    /// then at most.
    gone: Option<Time>,
}

impl Adapter {
    /// An adapter with a closed channel, at the bit rate of the bus.
    pub fn new(bit_rate: u32) -> Adapter {
        Adapter {
            bus_bit_rate: bit_rate,
            bit_rate,
            channel: Channel::Closed,
            stamps: false,
            controller: Controller::default(),
            input: VecDeque::new(),
            line: Vec::new(),
            too_long: false,
            output: VecDeque::new(),
            gone: None,
        }
    }

    /// Nobody's: a client may have it.
    pub fn is_free(&self) -> bool {
        self.gone.is_none()
    }

    /// How many bytes of the client it takes now.
    pub fn room(&self) -> usize {
        INPUT - self.input.len()
    }

    /// Takes bytes of the client, [`Adapter::room`] of them at most.
    pub fn receive(&mut self, bytes: &[u8], now: Time) {
        self.input.extend(bytes.iter().take(self.room()));
        self.work(now);
    }

    /// What the client is to be told; take off what was.
    pub fn output(&mut self) -> &mut VecDeque<u8> {
        &mut self.output
    }

    /// Goes on with what the client has sent, as far as the controller and the
    /// client take it, and leaves the bus when it is time. Call it often.
    pub fn work(&mut self, now: Time) {
        if let Channel::Closing(until) = self.channel {
            if self.controller.is_idle() || now >= until {
                self.controller.stop();
                self.channel = Channel::Closed;
            }
            // The bus has to see that the controller is off before it may be
            // on again.
            return;
        }
        while !self.controller.is_full()
            && self.output.len() < OUTPUT
            && matches!(self.channel, Channel::Open | Channel::Closed)
        {
            match self.input.pop_front() {
                Some(OK) => self.end_of_line(now),
                // Terminals send it after CR.
                Some(b'\n') => {}
                Some(byte) if self.line.len() < LONGEST => self.line.push(byte),
                Some(_) => self.too_long = true,
                None => break,
            }
        }
        if let Some(until) = self.gone {
            self.output.clear();
            if self.input.is_empty() || now >= until {
                self.leave(now);
            }
        }
    }

    /// The client is gone. What it has sent is still worked through, and its
    /// last frames are sent; then the adapter is as new.
    pub fn hang_up(&mut self, now: Time) {
        self.gone = Some(now + LAST_FRAMES);
    }

    fn leave(&mut self, now: Time) {
        match self.channel {
            Channel::Open => self.close(now),
            Channel::Closing(_) => {}
            Channel::Closed => *self = Adapter::new(self.bus_bit_rate),
        }
    }

    /// Its bit timing; `None` while it is off the bus.
    pub fn timing(&self) -> Option<BitTiming> {
        self.controller.timing()
    }

    /// What it would send next.
    pub fn offer(&self) -> Option<Offer> {
        self.controller.offer()
    }

    /// Takes in what the bus says.
    pub fn on_event(&mut self, event: &Event) {
        let Some(frame) = self.controller.on_event(event.kind) else {
            return;
        };
        if self.channel != Channel::Open {
            return;
        }
        if self.output.len() >= OUTPUT {
            self.controller.overrun();
            return;
        }
        let stamp = self.stamps.then(|| event.at.as_ms());
        self.say(&slcan::received(&frame, stamp));
    }

    fn end_of_line(&mut self, now: Time) {
        let line = std::mem::take(&mut self.line);
        let known = !std::mem::take(&mut self.too_long);
        let command = Command::parse(&line).filter(|_| known);
        if !command.is_some_and(|command| self.obey(command, now)) {
            self.output.push_back(BELL);
        }
    }

    /// Whether the command could be obeyed; then it has been answered.
    fn obey(&mut self, command: Command, now: Time) -> bool {
        let open = self.channel == Channel::Open;
        match command {
            Command::Nothing => {}
            Command::BitRate(bit_rate) if !open => self.bit_rate = bit_rate,
            Command::Stamps(stamps) if !open => self.stamps = stamps,
            Command::Open if !open => {
                self.controller.start(self.bit_rate);
                self.channel = Channel::Open;
            }
            Command::Close if open => self.close(now),
            Command::Version => return self.say(VERSION),
            Command::Serial => return self.say(SERIAL),
            Command::Flags if open => {
                let flags = self.controller.take_flags();
                return self.say(&format!("F{flags:02X}\r"));
            }
            Command::Send(frame) if open => {
                let taken = match frame.id {
                    WireId::Standard(_) => TAKEN,
                    WireId::Extended(_) => TAKEN_EXTENDED,
                };
                return self.controller.send(frame, now) && self.say(taken);
            }
            _ => return false,
        }
        self.output.push_back(OK);
        true
    }

    fn close(&mut self, now: Time) {
        self.channel = Channel::Closing(now + LAST_FRAMES);
    }

    /// Always true: it has been answered.
    fn say(&mut self, text: &str) -> bool {
        self.output.extend(text.bytes());
        true
    }
}

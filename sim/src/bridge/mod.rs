//! Other people's tools on the simulated bus: a TCP server on this computer
//! that speaks `slcan`, the serial protocol of the Lawicel CAN adapters.
//!
//! Each client is an adapter of its own on the bus, with a CAN controller that
//! arbitrates, acknowledges and retransmits, from the moment it opens its
//! channel (`O`) until it closes it (`C`) or goes away. Clients see each other
//! on the bus like any other node. python-can opens the bridge as interface
//! `slcan`, channel `socket://127.0.0.1:PORT`.
//!
//! | command | | answer |
//! | --- | --- | --- |
//! | `S0` .. `S8` | bit rate: 10, 20, 50, 100, 125, 250, 500, 800, 1000 kbit/s | CR |
//! | `O`, `C` | open, close the channel | CR |
//! | `tiiil..`, `Tiiiiiiiil..` | send a data frame, 11 or 29 bits | `z` CR, `Z` CR |
//! | `riiil`, `Riiiiiiiil` | send a remote frame, 11 or 29 bits | `z` CR, `Z` CR |
//! | `F` | status flags, then forgotten | `Fxx` CR |
//! | `V`, `N` | version, serial number | `Vxxxx` CR, `Nxxxx` CR |
//! | `Z0`, `Z1` | frames without, with a time stamp in ms of simulated time | CR |
//!
//! Whatever is unknown, malformed, or not possible in the channel's state is
//! answered with BEL. Without `S` an adapter has the bit rate of the bus.
//!
//! Differences to a real adapter: frames that were accepted before the channel
//! is closed are still sent; a client that sends faster than the bus takes it
//! is held up, not refused.

mod adapter;
mod controller;
mod pace;
mod server;
pub mod slcan;

pub use adapter::Adapter;
pub use controller::Controller;
pub use pace::Pace;

use std::io;
use std::net::SocketAddr;

use crate::bus::{BitTiming, Bus, Event, PortId};
use crate::time::Time;
use server::{Client, Server};

/// Clients at the same time; one more is shown the door.
pub const CLIENTS: usize = 4;

/// A place for a client.
struct Seat {
    port: PortId,
    timing: Option<BitTiming>,
    adapter: Adapter,
    client: Option<Client>,
}

impl Seat {
    fn is_free(&self) -> bool {
        self.client.is_none() && self.adapter.is_free()
    }
}

/// The server with its adapters.
pub struct Bridge {
    server: Server,
    bit_rate: u32,
    seats: Vec<Seat>,
}

impl Bridge {
    /// Listens on the loopback interface, on `port`; 0 = any that is free. The
    /// bus has `bit_rate` bit/s.
    ///
    /// # Errors
    /// The port is taken or not allowed.
    pub fn listen(port: u16, bit_rate: u32) -> io::Result<Bridge> {
        Ok(Bridge {
            server: Server::listen(port)?,
            bit_rate,
            seats: Vec::new(),
        })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.server.address()
    }

    /// Clients that are connected.
    pub fn clients(&self) -> usize {
        self.seats
            .iter()
            .filter(|seat| seat.client.is_some())
            .count()
    }

    /// Wires the adapters to the bus and returns their names.
    pub fn attach(&mut self, bus: &mut Bus) -> Vec<String> {
        let names: Vec<String> = (1..=CLIENTS).map(|n| format!("bridge {n}")).collect();
        self.seats = names
            .iter()
            .map(|name| Seat {
                port: bus.attach(name),
                timing: None,
                adapter: Adapter::new(self.bit_rate),
                client: None,
            })
            .collect();
        names
    }

    /// Takes in what the bus tells one of its adapters.
    pub fn on_event(&mut self, event: &Event) {
        let seat = self.seats.iter_mut().find(|seat| seat.port == event.port);
        if let Some(seat) = seat {
            seat.adapter.on_event(event);
        }
    }

    /// Tells the bus what the adapters would send next.
    pub fn offer(&mut self, bus: &mut Bus, now: Time) {
        for seat in &mut self.seats {
            let timing = seat.adapter.timing();
            if timing != seat.timing {
                if timing.is_none() {
                    bus.reset(seat.port, now);
                }
                seat.timing = timing;
                bus.set_timing(seat.port, timing, now);
            }
            bus.offer(seat.port, seat.adapter.offer());
        }
    }

    /// Talks to the clients: never waits for one.
    pub fn exchange(&mut self, now: Time) {
        while let Some(client) = self.server.accept() {
            // Without a free place the connection is closed again.
            if let Some(seat) = self.seats.iter_mut().find(|seat| seat.is_free()) {
                seat.client = Some(client);
            }
        }
        for seat in &mut self.seats {
            let Some(client) = &mut seat.client else {
                seat.adapter.work(now);
                continue;
            };
            let stays = client.read(&mut seat.adapter, now) && client.write(&mut seat.adapter);
            if !stays {
                seat.client = None;
                seat.adapter.hang_up(now);
            }
        }
    }
}

#[cfg(test)]
mod tests;

//! The sockets: none of them is ever waited for.

use std::io::{self, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};

use super::adapter::Adapter;
use crate::time::Time;

/// Read at a time.
const CHUNK: usize = 1 << 12;

/// Listens on the loopback interface only: whoever can open this port can move
/// the (simulated) machine.
pub(super) struct Server {
    listener: TcpListener,
    address: SocketAddr,
}

impl Server {
    pub(super) fn listen(port: u16) -> io::Result<Server> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        Ok(Server { listener, address })
    }

    pub(super) fn address(&self) -> SocketAddr {
        self.address
    }

    /// The next client at the door. One that left again while it waited is
    /// none.
    pub(super) fn accept(&self) -> Option<Client> {
        let (stream, _) = self.listener.accept().ok()?;
        stream.set_nonblocking(true).ok()?;
        // Lines are short and somebody waits for each.
        stream.set_nodelay(true).ok()?;
        Some(Client { stream })
    }
}

/// One connection.
pub(super) struct Client {
    stream: TcpStream,
}

impl Client {
    /// Takes over what the client has sent, as much as the adapter takes. False
    /// if the client is gone.
    pub(super) fn read(&mut self, adapter: &mut Adapter, now: Time) -> bool {
        let mut chunk = [0; CHUNK];
        let room = adapter.room().min(CHUNK);
        let (read, stays) = match self.stream.read(&mut chunk[..room]) {
            // An empty buffer reads nothing; otherwise this is the end.
            Ok(read) => (read, read > 0 || room == 0),
            Err(error) => (0, may_go_on(&error)),
        };
        adapter.receive(&chunk[..read], now);
        stays
    }

    /// Hands over what the client is to be told, as much as it takes. False if
    /// the client is gone.
    pub(super) fn write(&mut self, adapter: &mut Adapter) -> bool {
        let output = adapter.output();
        while !output.is_empty() {
            match self.stream.write(output.as_slices().0) {
                Ok(0) => return false,
                Ok(written) => {
                    output.drain(..written);
                }
                Err(error) => return may_go_on(&error),
            }
        }
        true
    }
}

fn may_go_on(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted
    )
}

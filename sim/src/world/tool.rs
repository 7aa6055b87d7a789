//! Somebody else's SDO client on the bus: reads and writes small objects of a
//! node, the board for instance.

use canmaster::id::Address;
use canmaster::sdo::{Client, Progress, Response, SdoError};
use canmaster::time::Duration;
use canmaster::{Frame, NodeId};

use super::World;
use crate::frame::WireFrame;
use crate::time::Time;

/// How long the tool waits for an answer.
const TIMEOUT: Duration = Duration::from_millis(300);
/// How often it looks.
const LOOK: Time = Time::from_us(200);

impl World<'_> {
    /// Reads an entry of `node` as the guest, while time goes on.
    ///
    /// # Errors
    /// As a client is told them.
    ///
    /// # Panics
    /// Without a guest.
    pub fn sdo_read(&mut self, node: NodeId, at: Address) -> Result<Response, SdoError> {
        let mut client = Client::new(node, TIMEOUT);
        let first = client.upload(at, self.now.to_instant());
        self.converse(client, first.expect("the channel is new"))
    }

    /// Writes an entry of `node` as the guest, while time goes on.
    ///
    /// # Errors
    /// As a client is told them.
    ///
    /// # Panics
    /// Without a guest, or if there are no data or too much.
    pub fn sdo_write(&mut self, node: NodeId, at: Address, data: &[u8]) -> Result<(), SdoError> {
        let mut client = Client::new(node, TIMEOUT);
        let first = client.download(at, data, self.now.to_instant());
        self.converse(client, first.expect("the data fit"))
            .map(drop)
    }

    fn converse(&mut self, mut client: Client, first: Frame) -> Result<Response, SdoError> {
        // What came before is not the answer.
        while self.hear().is_some() {}
        let mut next = Some(first);
        loop {
            if let Some(frame) = next.take() {
                assert!(self.say(WireFrame::from(frame)), "there is a guest");
            }
            let now = self.now.to_instant();
            let progress = match self.hear().map(Frame::try_from) {
                Some(Ok(frame)) => client.on_frame(&frame, now),
                Some(Err(_)) => continue,
                None => {
                    self.run_until(self.now + LOOK);
                    client.poll(self.now.to_instant())
                }
            };
            match progress {
                Progress::Nothing => {}
                Progress::Send(frame) => next = Some(frame),
                Progress::Done(response) => return Ok(response),
                Progress::Failed(error, _) => return Err(error),
            }
        }
    }
}

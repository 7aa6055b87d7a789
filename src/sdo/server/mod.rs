//! The server: lets a client read and write this node's object dictionary
//! (CiA 301, 7.2.4).
//!
//! One server serves one client at a time. A frame that fits no transfer is
//! answered with an abort; an initiate in the middle of a transfer replaces
//! it, because that client has given up the old one; a transfer that stands
//! still is aborted with 05040000h.

mod block;
mod segmented;
mod transfer;

use super::abort::AbortCode;
use super::block::{Receiver, Sender};
use super::command::{BLOCK_MAX, Bytes, Command, Request};
use crate::frame::Frame;
use crate::id::{Address, CobId, FunctionCode, NodeId};
use crate::od::ObjectDictionary;
use crate::time::{Duration, Instant};
use transfer::{Sink, Source};

/// For an abort that answers a frame without index and sub-index.
const NOWHERE: Address = Address::new(0, 0);

/// An SDO server (CiA 301, 7.2.4, 7.5.2.33).
#[derive(Clone, Debug)]
pub struct Server {
    request: CobId,
    response: CobId,
    timeout: Duration,
    /// Segments per block that this server takes; 0: no block transfer.
    block_size: u8,
    deadline: Instant,
    state: State,
}

#[derive(Clone, Debug)]
enum State {
    Idle,
    Download {
        sink: Sink,
        toggle: bool,
    },
    Upload {
        source: Source,
        toggle: bool,
        offset: u32,
    },
    BlockDownload {
        sink: Sink,
        receiver: Receiver,
        /// The entry has refused what came.
        refused: Option<AbortCode>,
    },
    BlockUpload {
        source: Source,
        sender: Sender,
        phase: Phase,
    },
}

/// What a block upload waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The client's start command.
    Start,
    /// Segments to be sent, or their acknowledgement.
    Segments,
    /// The client's end command.
    End,
}

/// What the client is told, or nothing.
type Reply = Result<Option<Command>, AbortCode>;

impl Server {
    /// The default server of `node`: requests on 600h + node-ID, answers on
    /// 580h + node-ID. A transfer that stands still for `timeout` is aborted.
    pub const fn new(node: NodeId, timeout: Duration) -> Server {
        Server {
            request: CobId::of(FunctionCode::SdoRequest, node),
            response: CobId::of(FunctionCode::SdoResponse, node),
            timeout,
            block_size: BLOCK_MAX,
            deadline: Instant::ZERO,
            state: State::Idle,
        }
    }

    /// The same with `block_size` segments per block of a block download, at
    /// most 127; 0 refuses block transfers with 05040001h, as devices without
    /// them do.
    pub const fn with_block_size(self, block_size: u8) -> Server {
        let block_size = if block_size > BLOCK_MAX {
            BLOCK_MAX
        } else {
            block_size
        };
        Server { block_size, ..self }
    }

    /// The identifier that requests arrive on.
    pub const fn request_id(&self) -> CobId {
        self.request
    }

    /// Whether no transfer is under way.
    pub const fn is_idle(&self) -> bool {
        matches!(self.state, State::Idle)
    }

    /// Ends any transfer without a word: NMT reset, or the service is no
    /// longer allowed.
    pub fn reset(&mut self, od: &mut impl ObjectDictionary) {
        if let State::Download { sink, .. } | State::BlockDownload { sink, .. } = &self.state {
            sink.cancel(od);
        }
        self.state = State::Idle;
    }

    /// When [`poll`](Server::poll) has something to do. In the middle of a
    /// block upload that is at once, as soon as there is room for a frame.
    pub const fn next_deadline(&self) -> Option<Instant> {
        match self.state {
            State::Idle => None,
            _ => Some(self.deadline),
        }
    }

    /// Lets time pass: sends the segments of a block upload one by one, and
    /// notices transfers that stand still. To be called until it returns
    /// `None`, or until there is no room for another frame.
    pub fn poll(&mut self, now: Instant, od: &mut impl ObjectDictionary) -> Option<Frame> {
        let at = self.address()?;
        if now < self.deadline {
            return None;
        }
        let command = match self.block_poll(now, od) {
            Ok(Some(command)) => command,
            Ok(None) => self.abort(at, AbortCode::TIMEOUT, od),
            Err(code) => self.abort(at, code, od),
        };
        Some(Frame::full(self.response, command.0))
    }

    /// Serves a frame. Frames for others and frames without eight bytes are
    /// ignored.
    pub fn on_frame(
        &mut self,
        frame: &Frame,
        now: Instant,
        od: &mut impl ObjectDictionary,
    ) -> Option<Frame> {
        if frame.id() != self.request || frame.data().len() != size_of::<Bytes>() {
            return None;
        }
        let command = Command(frame.padded());
        let mut at = self.address();
        let reply = match self.block_segment(command, od) {
            Some(reply) => reply,
            None => {
                let request = command.request();
                // An initiate names its entry; everything else belongs to the
                // transfer that is under way.
                if request.map_or(at.is_none(), Request::is_addressed) {
                    at = Some(command.address());
                }
                self.serve(request, command, od)
            }
        };
        self.deadline = now + self.patience();
        let answer = match reply {
            Ok(answer) => answer?,
            Err(code) => self.abort(at.unwrap_or(NOWHERE), code, od),
        };
        Some(Frame::full(self.response, answer.0))
    }

    fn serve(
        &mut self,
        request: Option<Request>,
        command: Command,
        od: &mut impl ObjectDictionary,
    ) -> Reply {
        let request = request.ok_or(AbortCode::COMMAND)?;
        if request.is_addressed() {
            // An initiate, or an abort: the transfer under way is over.
            self.reset(od);
        }
        match request {
            Request::Download => self.download(command, od),
            Request::Upload => self.upload(command.address(), od),
            Request::DownloadSegment => self.download_segment(command, od),
            Request::UploadSegment => self.upload_segment(command.toggle(), od),
            Request::BlockDownload => self.block_download(command, od),
            Request::BlockDownloadEnd => self.block_download_end(command.end(), od),
            Request::BlockUpload => self.block_upload(command, od),
            Request::BlockUploadStart => self.block_upload_start(),
            Request::BlockUploadAcknowledge => self.block_upload_acknowledge(command),
            Request::BlockUploadEnd => self.block_upload_end(),
            Request::Abort => Ok(None),
        }
    }

    /// How long the client may be silent.
    const fn patience(&self) -> Duration {
        match &self.state {
            State::BlockUpload {
                sender,
                phase: Phase::Segments,
                ..
            } if sender.is_sending() => Duration::ZERO,
            State::BlockDownload { receiver, .. } if !receiver.is_complete() => self.timeout.half(),
            _ => self.timeout,
        }
    }

    fn abort(&mut self, at: Address, code: AbortCode, od: &mut impl ObjectDictionary) -> Command {
        self.reset(od);
        Command::abort(at, code)
    }

    /// The entry of the transfer under way.
    const fn address(&self) -> Option<Address> {
        match &self.state {
            State::Idle => None,
            State::Download { sink, .. } | State::BlockDownload { sink, .. } => Some(sink.at),
            State::Upload { source, .. } | State::BlockUpload { source, .. } => Some(source.at),
        }
    }
}

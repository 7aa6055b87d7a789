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
use transfer::Transfer;

/// For an abort that answers a frame without index and sub-index.
const NOWHERE: Address = Address::new(0, 0);

/// An SDO server (CiA 301, 7.2.4, 7.5.2.33).
#[derive(Clone, Debug)]
// In this order, so that what is used most is near: it takes shorter instructions.
#[repr(C)]
pub struct Server {
    request: CobId,
    response: CobId,
    timeout: Duration,
    /// Segments per block that this server takes; 0: no block transfer.
    block_size: u8,
    deadline: Instant,
    phase: Phase,
    /// The entry that is transferred, unless idle.
    transfer: Transfer,
    /// The toggle bit of the next segment, or of the next request for one.
    toggle: bool,
    /// This end of a block upload.
    sender: Sender,
    /// This end of a block download.
    receiver: Receiver,
    /// In a block download, the entry has refused what came.
    refused: Option<AbortCode>,
    /// What the client is told.
    answer: Command,
}

/// Which transfer is under way, and what it waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Idle,
    /// A segment.
    Download,
    /// A request for a segment.
    Upload,
    /// Segments, or the end command.
    BlockDownload,
    /// The client's start command.
    BlockUploadStart,
    /// Segments to be sent, or their acknowledgement.
    BlockUpload,
    /// The client's end command.
    BlockUploadEnd,
}

/// Whether what the client wants can be done: if not, the transfer is aborted.
type Outcome = Result<Reply, AbortCode>;

/// Whether there is an answer. As wide as an abort code, so that either comes back in
/// registers.
#[derive(Clone, Copy)]
#[repr(u32)]
enum Reply {
    Nothing,
    Answer,
}

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
            phase: Phase::Idle,
            transfer: Transfer::NONE,
            toggle: false,
            sender: Sender::new(BLOCK_MAX, false),
            receiver: Receiver::new(BLOCK_MAX, false),
            refused: None,
            answer: Command([0; 8]),
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
        matches!(self.phase, Phase::Idle)
    }

    /// Ends any transfer without a word: NMT reset, or the service is no
    /// longer allowed.
    pub fn reset(&mut self, od: &mut impl ObjectDictionary) {
        if let Phase::Download | Phase::BlockDownload = self.phase {
            self.transfer.cancel(od);
        }
        self.phase = Phase::Idle;
        self.toggle = false;
    }

    /// When [`poll`](Server::poll) has something to do. In the middle of a
    /// block upload that is at once, as soon as there is room for a frame.
    pub const fn next_deadline(&self) -> Option<Instant> {
        match self.phase {
            Phase::Idle => None,
            _ => Some(self.deadline),
        }
    }

    /// Lets time pass: sends the segments of a block upload one by one, and
    /// notices transfers that stand still. To be called until it returns
    /// `None`, or until there is no room for another frame.
    pub fn poll(&mut self, now: Instant, od: &mut impl ObjectDictionary) -> Option<Frame> {
        if self.is_idle() || now < self.deadline {
            return None;
        }
        let outcome = self.block_poll(od);
        self.reply(self.transfer.at, outcome, now, od)
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
        let at = match self.phase {
            Phase::Idle => NOWHERE,
            _ => self.transfer.at,
        };
        if self.is_block_segment(&command) {
            let outcome = self.block_segment(&command, od);
            return self.reply(at, outcome, now, od);
        }
        let request = command.request();
        // An initiate names its entry; everything else belongs to the transfer
        // that is under way.
        let at = match request.map_or(self.is_idle(), Request::is_addressed) {
            true => command.address(),
            false => at,
        };
        let outcome = self.serve(request, &command, od);
        self.reply(at, outcome, now, od)
    }

    /// Its own function, so that the command stays in memory: in registers its
    /// fields would be shifted out again and again, for 300 bytes more of flash.
    #[inline(never)]
    fn serve(
        &mut self,
        request: Option<Request>,
        command: &Command,
        od: &mut impl ObjectDictionary,
    ) -> Outcome {
        let request = request.ok_or(AbortCode::COMMAND)?;
        if request.is_addressed() {
            // An initiate, or an abort: the transfer under way is over.
            self.reset(od);
        }
        match (request, self.phase) {
            (Request::Abort, _) => Ok(Reply::Nothing),
            (Request::Download, _) => self.download(command, od),
            (Request::Upload, _) => {
                self.transfer.open_upload(od, command.address())?;
                self.upload(od)
            }
            (Request::BlockDownload, _) if self.block_size > 0 => self.block_download(command, od),
            (Request::BlockUpload, _) if self.block_size > 0 => self.block_upload(command, od),
            (Request::DownloadSegment, Phase::Download) => self.download_segment(command, od),
            (Request::UploadSegment, Phase::Upload) => self.upload_segment(command, od),
            (Request::BlockDownloadEnd, Phase::BlockDownload) => {
                self.block_download_end(command, od)
            }
            (Request::BlockUploadStart, Phase::BlockUploadStart) => {
                self.phase = Phase::BlockUpload;
                Ok(Reply::Nothing)
            }
            (Request::BlockUploadAcknowledge, Phase::BlockUpload) => {
                self.block_upload_acknowledge(command)
            }
            (Request::BlockUploadEnd, Phase::BlockUploadEnd) => {
                self.phase = Phase::Idle;
                Ok(Reply::Nothing)
            }
            _ => Err(AbortCode::COMMAND),
        }
    }

    /// What the client is told, if anything.
    fn reply(
        &mut self,
        at: Address,
        outcome: Outcome,
        now: Instant,
        od: &mut impl ObjectDictionary,
    ) -> Option<Frame> {
        self.deadline = now + self.patience();
        match outcome {
            Ok(Reply::Nothing) => return None,
            Ok(Reply::Answer) => {}
            Err(code) => {
                self.reset(od);
                self.answer = Command::abort(at, code);
            }
        }
        Some(Frame::full(self.response, self.answer.0))
    }

    /// How long the client may be silent.
    const fn patience(&self) -> Duration {
        match self.phase {
            Phase::BlockUpload if self.sender.is_sending() => Duration::ZERO,
            Phase::BlockDownload if !self.receiver.is_complete() => self.timeout.half(),
            _ => self.timeout,
        }
    }
}

//! The server: lets a client read and write this node's object dictionary
//! (CiA 301, 7.2.4).
//!
//! One server serves one client at a time. A frame that fits no transfer is
//! answered with an abort; an initiate in the middle of a transfer replaces
//! it, because that client has given up the old one; a transfer that stands
//! still is aborted with 05040000h.

mod transfer;

use super::abort::AbortCode;
use super::command::{Answer, Bytes, EXPEDITED_MAX, Initiate, Request, SEGMENT_MAX, Segment};
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
}

/// What the client is told, or nothing.
type Reply = Result<Option<Answer>, (Address, AbortCode)>;

impl Server {
    /// The default server of `node`: requests on 600h + node-ID, answers on
    /// 580h + node-ID. A transfer that stands still for `timeout` is aborted.
    pub const fn new(node: NodeId, timeout: Duration) -> Server {
        Server {
            request: CobId::of(FunctionCode::SdoRequest, node),
            response: CobId::of(FunctionCode::SdoResponse, node),
            timeout,
            deadline: Instant::ZERO,
            state: State::Idle,
        }
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
        if let State::Download { sink, .. } = &self.state {
            sink.cancel(od);
        }
        self.state = State::Idle;
    }

    /// When [`poll`](Server::poll) has something to do.
    pub const fn next_deadline(&self) -> Option<Instant> {
        match self.state {
            State::Idle => None,
            _ => Some(self.deadline),
        }
    }

    /// Lets time pass. To be called until it returns `None`.
    pub fn poll(&mut self, now: Instant, od: &mut impl ObjectDictionary) -> Option<Frame> {
        let at = self.address()?;
        if now < self.deadline {
            return None;
        }
        self.reset(od);
        Some(self.frame(Answer::Abort {
            at,
            code: AbortCode::TIMEOUT,
        }))
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
        let bytes = frame.padded();
        let reply = self.serve(bytes, od);
        self.deadline = now + self.timeout;
        match reply {
            Ok(answer) => answer.map(|answer| self.frame(answer)),
            Err((at, code)) => {
                self.reset(od);
                Some(self.frame(Answer::Abort { at, code }))
            }
        }
    }

    fn serve(&mut self, bytes: Bytes, od: &mut impl ObjectDictionary) -> Reply {
        let here = self.address();
        let unknown = (
            here.unwrap_or(super::command::address(bytes)),
            AbortCode::COMMAND,
        );
        match Request::decode(bytes).ok_or(unknown)? {
            Request::Download { at, data } => {
                self.reset(od);
                self.download(at, data, od).map_err(|code| (at, code))
            }
            Request::Upload { at } => {
                self.reset(od);
                self.upload(at, od).map_err(|code| (at, code))
            }
            Request::DownloadSegment(segment) => self
                .download_segment(segment, od)
                .map_err(|code| (here.unwrap_or(NOWHERE), code)),
            Request::UploadSegment { toggle } => self
                .upload_segment(toggle, od)
                .map_err(|code| (here.unwrap_or(NOWHERE), code)),
            Request::Abort { .. } => {
                self.reset(od);
                Ok(None)
            }
            Request::BlockDownload { at, .. } | Request::BlockUpload { at, .. } => {
                Err((at, AbortCode::COMMAND))
            }
            _ => Err((here.unwrap_or(NOWHERE), AbortCode::COMMAND)),
        }
    }

    /// CiA 301, 7.2.4.3.3.
    fn download(
        &mut self,
        at: Address,
        data: Initiate,
        od: &mut impl ObjectDictionary,
    ) -> Result<Option<Answer>, AbortCode> {
        match data {
            Initiate::Expedited { data, len } => {
                let mut sink = Sink::open(od, at, len.map(u32::from))?;
                // Without a length the type decides.
                let len = match (len, sink.fixed_size()) {
                    (Some(len), _) => usize::from(len),
                    (None, Some(size)) if size > EXPEDITED_MAX => {
                        return Err(AbortCode::TOO_SHORT);
                    }
                    (None, Some(size)) => size,
                    (None, None) => EXPEDITED_MAX,
                };
                sink.push(od, data.get(..len).unwrap_or(&data), true)
                    .inspect_err(|_| sink.cancel(od))?;
            }
            Initiate::Segmented { size } => {
                self.state = State::Download {
                    sink: Sink::open(od, at, size)?,
                    toggle: false,
                };
            }
        }
        Ok(Some(Answer::Download { at }))
    }

    /// CiA 301, 7.2.4.3.4.
    fn download_segment(
        &mut self,
        segment: Segment,
        od: &mut impl ObjectDictionary,
    ) -> Result<Option<Answer>, AbortCode> {
        let State::Download { sink, toggle } = &mut self.state else {
            return Err(AbortCode::COMMAND);
        };
        if segment.toggle != *toggle {
            return Err(AbortCode::TOGGLE);
        }
        sink.push(od, segment.data(), segment.last)?;
        *toggle = !*toggle;
        if segment.last {
            self.state = State::Idle;
        }
        Ok(Some(Answer::DownloadSegment {
            toggle: segment.toggle,
        }))
    }

    /// CiA 301, 7.2.4.3.6.
    fn upload(
        &mut self,
        at: Address,
        od: &mut impl ObjectDictionary,
    ) -> Result<Option<Answer>, AbortCode> {
        let source = Source::open(od, at)?;
        let mut first = [0; EXPEDITED_MAX];
        let chunk = source.read(od, 0, &mut first)?;
        let whole = first.get(..chunk.len).filter(|_| chunk.last);
        let data = match whole.and_then(Initiate::expedited) {
            Some(expedited) => expedited,
            None => {
                self.state = State::Upload {
                    source,
                    toggle: false,
                    offset: 0,
                };
                Initiate::Segmented { size: chunk.size }
            }
        };
        Ok(Some(Answer::Upload { at, data }))
    }

    /// CiA 301, 7.2.4.3.7.
    fn upload_segment(
        &mut self,
        asked: bool,
        od: &mut impl ObjectDictionary,
    ) -> Result<Option<Answer>, AbortCode> {
        let State::Upload {
            source,
            toggle,
            offset,
        } = &mut self.state
        else {
            return Err(AbortCode::COMMAND);
        };
        if asked != *toggle {
            return Err(AbortCode::TOGGLE);
        }
        let mut data = [0; SEGMENT_MAX];
        let chunk = source.read(od, *offset, &mut data)?;
        if chunk.len < SEGMENT_MAX && !chunk.last {
            return Err(AbortCode::GENERAL);
        }
        let data = data.get(..chunk.len).unwrap_or(&[]);
        let segment = Segment::new(asked, chunk.last, data).ok_or(AbortCode::GENERAL)?;
        *toggle = !*toggle;
        *offset = offset
            .checked_add(chunk.len as u32)
            .ok_or(AbortCode::GENERAL)?;
        if chunk.last {
            self.state = State::Idle;
        }
        Ok(Some(Answer::UploadSegment(segment)))
    }

    /// The entry of the transfer under way.
    const fn address(&self) -> Option<Address> {
        match &self.state {
            State::Idle => None,
            State::Download { sink, .. } => Some(sink.at),
            State::Upload { source, .. } => Some(source.at),
        }
    }

    fn frame(&self, answer: Answer) -> Frame {
        Frame::full(self.response, answer.encode())
    }
}

//! Expedited and segmented transfers (CiA 301, 7.2.4.3.3 .. 7.2.4.3.7).

use super::{Channel, Payload, State, Step};
use crate::sdo::AbortCode;
use crate::sdo::command::{EXPEDITED_MAX, Initiate, Request, SEGMENT_MAX, Segment};

impl Channel {
    /// CiA 301, 7.2.4.3.3.
    pub(super) fn begin_download(&mut self, size: u32, payload: &mut dyn Payload) -> Request {
        let mut data = [0; EXPEDITED_MAX];
        let expedited = usize::try_from(size)
            .ok()
            .and_then(|size| data.get_mut(..size))
            .and_then(|space| {
                payload.read(0, space);
                Initiate::expedited(space)
            });
        self.state = State::Download {
            expedited: expedited.is_some(),
        };
        Request::Download {
            at: self.at,
            data: expedited.unwrap_or(Initiate::Segmented { size: Some(size) }),
        }
    }

    /// CiA 301, 7.2.4.3.6.
    pub(super) fn begin_upload(&mut self) -> Request {
        self.state = State::Upload;
        Request::Upload { at: self.at }
    }

    pub(super) fn download_begun(&mut self, expedited: bool, payload: &mut dyn Payload) -> Step {
        if expedited {
            Step::Done(self.size.unwrap_or(0))
        } else {
            self.next_segment(0, false, payload)
        }
    }

    /// CiA 301, 7.2.4.3.4.
    pub(super) fn segment_taken(
        &mut self,
        sent: u32,
        toggle: bool,
        got: bool,
        payload: &mut dyn Payload,
    ) -> Step {
        if got != toggle {
            Step::Violation(AbortCode::TOGGLE)
        } else if self.size.is_none_or(|size| sent >= size) {
            Step::Done(sent)
        } else {
            self.next_segment(sent, !toggle, payload)
        }
    }

    fn next_segment(&mut self, sent: u32, toggle: bool, payload: &mut dyn Payload) -> Step {
        let left = self.size.unwrap_or(0).saturating_sub(sent);
        let len = left.min(SEGMENT_MAX as u32);
        let mut data = [0; SEGMENT_MAX];
        let piece = data.get_mut(..len as usize).unwrap_or(&mut []);
        payload.read(sent, piece);
        match Segment::new(toggle, len == left, piece) {
            Some(segment) => {
                let sent = sent + len;
                self.state = State::DownloadSegment { sent, toggle };
                Step::Send(Request::DownloadSegment(segment))
            }
            None => Step::Violation(AbortCode::GENERAL),
        }
    }

    /// CiA 301, 7.2.4.3.6. A block upload may be answered like this, too.
    pub(super) fn upload_begun(&mut self, initiate: Initiate, payload: &mut dyn Payload) -> Step {
        let size = match initiate {
            Initiate::Expedited { len, .. } => Some(len.map_or(EXPEDITED_MAX as u32, u32::from)),
            Initiate::Segmented { size } => size,
        };
        self.size = size;
        if let Err(code) = payload.begin(size) {
            return self.refused(code, size.unwrap_or(0));
        }
        match initiate {
            Initiate::Expedited { data, len } => {
                let len = len.map_or(EXPEDITED_MAX, usize::from);
                let data = data.get(..len).unwrap_or(&data);
                match self.take(data, true, payload) {
                    Ok(()) => Step::Done(self.received),
                    Err(step) => step,
                }
            }
            Initiate::Segmented { .. } => {
                let toggle = false;
                self.state = State::UploadSegment { toggle };
                Step::Send(Request::UploadSegment { toggle })
            }
        }
    }

    /// CiA 301, 7.2.4.3.7.
    pub(super) fn segment_given(
        &mut self,
        toggle: bool,
        segment: Segment,
        payload: &mut dyn Payload,
    ) -> Step {
        if segment.toggle != toggle {
            return Step::Violation(AbortCode::TOGGLE);
        }
        if segment.is_fruitless() {
            return Step::Violation(AbortCode::COMMAND);
        }
        if let Err(step) = self.take(segment.data(), segment.last, payload) {
            return step;
        }
        if segment.last {
            return Step::Done(self.received);
        }
        let toggle = !toggle;
        self.state = State::UploadSegment { toggle };
        Step::Send(Request::UploadSegment { toggle })
    }
}

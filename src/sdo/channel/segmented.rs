//! Expedited and segmented transfers (CiA 301, 7.2.4.3.3 .. 7.2.4.3.7).

use super::{Channel, Payload, State, Step};
use crate::sdo::AbortCode;
use crate::sdo::command::{Command, EXPEDITED_MAX, Request, SEGMENT_MAX};

impl Channel {
    /// CiA 301, 7.2.4.3.3.
    pub(super) fn begin_download(&mut self, size: u32, payload: &mut dyn Payload) -> Command {
        let code = Request::Download.code();
        let mut data = [0; EXPEDITED_MAX];
        let expedited = usize::try_from(size)
            .ok()
            .and_then(|size| data.get_mut(..size))
            .and_then(|space| {
                payload.read(0, space);
                Command::expedited(code, self.at, space)
            });
        self.state = State::Download {
            expedited: expedited.is_some(),
        };
        expedited.unwrap_or_else(|| Command::segmented(code, self.at, Some(size)))
    }

    /// CiA 301, 7.2.4.3.6.
    pub(super) fn begin_upload(&mut self) -> Command {
        self.state = State::Upload;
        Command::addressed(Request::Upload.code(), self.at, [0; 4])
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
        let code = Request::DownloadSegment.code();
        match Command::segment(code, toggle, len == left, piece) {
            Some(segment) => {
                let sent = sent + len;
                self.state = State::DownloadSegment { sent, toggle };
                Step::Send(segment)
            }
            None => Step::Violation(AbortCode::GENERAL),
        }
    }

    /// CiA 301, 7.2.4.3.6. A block upload may be answered like this, too.
    pub(super) fn upload_begun(&mut self, command: Command, payload: &mut dyn Payload) -> Step {
        let expedited = command.is_expedited();
        self.size = match command.size() {
            None if expedited => Some(EXPEDITED_MAX as u32),
            size => size,
        };
        if let Err(code) = payload.begin(self.size) {
            return self.refused(code, self.size.unwrap_or(0));
        }
        if !expedited {
            return self.ask_segment(false);
        }
        let data = command.tail();
        let len = self.size.unwrap_or(0) as usize;
        match self.take(data.get(..len).unwrap_or(&data), true, payload) {
            Ok(()) => Step::Done(self.received),
            Err(step) => step,
        }
    }

    fn ask_segment(&mut self, toggle: bool) -> Step {
        self.state = State::UploadSegment { toggle };
        Step::Send(Command::bare(Request::UploadSegment.code(), toggle))
    }

    /// CiA 301, 7.2.4.3.7.
    pub(super) fn segment_given(
        &mut self,
        toggle: bool,
        segment: Command,
        payload: &mut dyn Payload,
    ) -> Step {
        if segment.toggle() != toggle {
            return Step::Violation(AbortCode::TOGGLE);
        }
        if segment.is_fruitless() {
            return Step::Violation(AbortCode::COMMAND);
        }
        if let Err(step) = self.take(segment.data(), segment.is_last(), payload) {
            return step;
        }
        if segment.is_last() {
            return Step::Done(self.received);
        }
        self.ask_segment(!toggle)
    }
}

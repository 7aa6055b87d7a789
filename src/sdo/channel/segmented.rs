//! Expedited and segmented transfers (CiA 301, 7.2.4.3.3 .. 7.2.4.3.7).

use super::{Channel, Payload, State, Step};
use crate::sdo::AbortCode;
use crate::sdo::command::{Command, EXPEDITED_MAX, Request};

impl Channel {
    /// CiA 301, 7.2.4.3.3.
    pub(super) fn download_initiate(
        &mut self,
        size: u32,
        payload: &mut dyn Payload,
    ) -> (State, Command) {
        let code = Request::Download.code();
        let mut data = [0; EXPEDITED_MAX];
        if let Some(space) = data.get_mut(..size as usize) {
            payload.read(0, space);
            if let Some(expedited) = Command::expedited(code, self.at, space) {
                return (State::ExpeditedDownload, expedited);
            }
        }
        // Turned before the first segment.
        self.toggle = true;
        let command = Command::segmented(code, self.at, Some(size));
        (State::Download, command)
    }

    /// CiA 301, 7.2.4.3.4.
    pub(super) fn segment_taken(
        &mut self,
        command: &Command,
        payload: &mut dyn Payload,
    ) -> Result<Step, AbortCode> {
        self.toggled(command)?;
        Ok(if self.left(self.done) == 0 {
            Step::Done
        } else {
            self.next_segment(payload)
        })
    }

    pub(super) fn next_segment(&mut self, payload: &mut dyn Payload) -> Step {
        self.state = State::DownloadSegment;
        self.toggle = !self.toggle;
        self.request = Command::bare(Request::DownloadSegment.code(), self.toggle);
        let (len, last) = self.fill(self.done, payload);
        self.done += len as u32;
        self.request.close(len, last);
        Step::Send
    }

    /// Puts the bytes of a segment into the request: how many, and whether they are the
    /// last.
    #[inline(never)]
    pub(super) fn fill(&mut self, offset: u32, payload: &mut dyn Payload) -> (usize, bool) {
        let left = self.left(offset);
        let space = self.request.space();
        let len = left.min(space.len());
        payload.read(offset, space.get_mut(..len).unwrap_or(&mut []));
        (len, len == left)
    }

    /// How many bytes of a download there are from `offset` on.
    pub(super) fn left(&self, offset: u32) -> usize {
        self.size.unwrap_or(0).saturating_sub(offset) as usize
    }

    /// CiA 301, 7.2.4.3.6. A block upload may be answered like this, too.
    pub(super) fn upload_begun(
        &mut self,
        command: &Command,
        payload: &mut dyn Payload,
    ) -> Result<Step, AbortCode> {
        let size = command.size();
        if !command.is_expedited() {
            self.announced(size, payload)?;
            self.toggle = true;
            return Ok(self.ask_segment());
        }
        let size = size.unwrap_or(EXPEDITED_MAX as u32);
        self.announced(Some(size), payload)?;
        let data = command.tail();
        let data = data.get(..size as usize).unwrap_or(&data);
        self.take(data, true, payload)?;
        Ok(Step::Done)
    }

    fn ask_segment(&mut self) -> Step {
        self.state = State::UploadSegment;
        self.toggle = !self.toggle;
        self.request = Command::bare(Request::UploadSegment.code(), self.toggle);
        Step::Send
    }

    /// CiA 301, 7.2.4.3.7.
    pub(super) fn segment_given(
        &mut self,
        segment: &Command,
        payload: &mut dyn Payload,
    ) -> Result<Step, AbortCode> {
        self.toggled(segment)?;
        if segment.is_fruitless() {
            return Err(AbortCode::COMMAND);
        }
        let last = segment.is_last();
        self.take(segment.data(), last, payload)?;
        Ok(if last { Step::Done } else { self.ask_segment() })
    }

    fn toggled(&self, answer: &Command) -> Result<(), AbortCode> {
        if answer.toggle() == self.toggle {
            Ok(())
        } else {
            Err(AbortCode::TOGGLE)
        }
    }
}

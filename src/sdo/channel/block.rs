//! Block transfers (CiA 301, 7.2.4.3.8 .. 7.2.4.3.15).

use super::{BLOCK_SIZE, Channel, Failure, Payload, State, Step};
use crate::sdo::AbortCode;
use crate::sdo::block::{Receiver, Sender, check_block_size};
use crate::sdo::command::{Answer, BlockSegment, Command, Request, SEGMENT_MAX};

impl Channel {
    /// CiA 301, 7.2.4.3.9.
    pub(super) fn block_download_begun(&mut self, command: Command) -> Result<Step, Failure> {
        let [block_size, ..] = command.tail();
        let block_size = check_block_size(block_size)?;
        self.sender = Sender::new(block_size, command.has_crc());
        self.state = State::BlockDownloadSegments;
        Ok(Step::Wait)
    }

    /// CiA 301, 7.2.4.3.10.
    pub(super) fn block_acknowledged(&mut self, command: Command) -> Result<Step, Failure> {
        Ok(match self.sender.acknowledged(command)? {
            Some(end) => {
                self.state = State::BlockDownloadEnd;
                Step::Send(end)
            }
            None => Step::Wait,
        })
    }

    /// CiA 301, 7.2.4.3.13.
    pub(super) fn block_upload_begun(
        &mut self,
        command: Command,
        payload: &mut dyn Payload,
    ) -> Result<Step, Failure> {
        self.announced(command.block_data(), payload)?;
        self.receiver = Receiver::new(BLOCK_SIZE, command.has_crc());
        self.state = State::BlockUploadSegments;
        Ok(Step::Send(Command::bare(
            Request::BlockUploadStart.code(),
            false,
        )))
    }

    /// CiA 301, 7.2.4.3.15.
    pub(super) fn block_upload_end(
        &mut self,
        command: Command,
        payload: &mut dyn Payload,
    ) -> Result<Step, Failure> {
        let (data, len) = self.receiver.end(command.end())?;
        self.take(data.get(..len).unwrap_or(&data), true, payload)?;
        self.state = State::Finished;
        Ok(Step::Send(Command::bare(
            Request::BlockUploadEnd.code(),
            false,
        )))
    }

    /// While a block is being received a frame has no command specifier, except
    /// for an abort. `None` if this is no such moment.
    ///
    /// CiA 301, 7.2.4.3.14.
    pub(super) fn block_segment(
        &mut self,
        command: Command,
        payload: &mut dyn Payload,
    ) -> Option<Result<Step, Failure>> {
        if self.state != State::BlockUploadSegments || self.receiver.is_complete() {
            return None;
        }
        match BlockSegment::decode(command.0) {
            None if command.answer() == Some(Answer::Abort) => None,
            None => Some(Err(AbortCode::SEQUENCE_NUMBER.into())),
            Some(segment) => Some(self.block_given(segment, payload)),
        }
    }

    fn block_given(
        &mut self,
        segment: BlockSegment,
        payload: &mut dyn Payload,
    ) -> Result<Step, Failure> {
        if let Some(before) = self.receiver.segment(segment)? {
            self.take(&before, false, payload)?;
        }
        Ok(self.receiver.over().map_or(Step::Wait, Step::Send))
    }

    /// At its deadline a block download sends the next segment, and a block
    /// upload acknowledges what it has, once, so that the rest is sent again.
    pub(super) fn block_poll(
        &mut self,
        payload: &mut dyn Payload,
    ) -> Result<Option<Command>, AbortCode> {
        match self.state {
            State::BlockDownloadSegments => {
                let Some(offset) = self.sender.next_offset()? else {
                    return Ok(None);
                };
                let mut data = [0; SEGMENT_MAX];
                let left = self.left(offset);
                let len = left.min(SEGMENT_MAX);
                payload.read(offset, data.get_mut(..len).unwrap_or(&mut []));
                self.sender.segment(data, len, len == left).map(Some)
            }
            State::BlockUploadSegments => Ok(self.receiver.stall()),
            _ => Ok(None),
        }
    }
}

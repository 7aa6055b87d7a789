//! Block transfers (CiA 301, 7.2.4.3.8 .. 7.2.4.3.15).

use super::{BLOCK_SIZE, Channel, Failure, Payload, State, Step};
use crate::sdo::AbortCode;
use crate::sdo::block::{Receiver, Sender, check_block_size};
use crate::sdo::command::{BlockSegment, Command, Request, SEGMENT_MAX};

impl Channel {
    /// CiA 301, 7.2.4.3.9.
    pub(super) fn block_download_begun(&mut self, command: &Command) -> Result<Step, Failure> {
        let [block_size, ..] = command.tail();
        let block_size = check_block_size(block_size)?;
        self.sender = Sender::new(block_size, command.has_crc());
        self.state = State::BlockDownloadSegments;
        Ok(Step::Wait)
    }

    /// CiA 301, 7.2.4.3.10.
    pub(super) fn block_acknowledged(&mut self, command: &Command) -> Result<Step, Failure> {
        Ok(match self.sender.acknowledged(command)? {
            Some(end) => {
                self.state = State::BlockDownloadEnd;
                self.request = end;
                Step::Send
            }
            None => Step::Wait,
        })
    }

    /// CiA 301, 7.2.4.3.13.
    pub(super) fn block_upload_begun(
        &mut self,
        command: &Command,
        payload: &mut dyn Payload,
    ) -> Result<Step, Failure> {
        self.announced(command.block_data(), payload)?;
        self.receiver = Receiver::new(BLOCK_SIZE, command.has_crc());
        self.state = State::BlockUploadSegments;
        self.request = Command::bare(Request::BlockUploadStart.code(), false);
        Ok(Step::Send)
    }

    /// CiA 301, 7.2.4.3.15.
    pub(super) fn block_upload_end(
        &mut self,
        command: &Command,
        payload: &mut dyn Payload,
    ) -> Result<Step, Failure> {
        let (data, len) = self.receiver.end(command.end())?;
        self.take(data.get(..len).unwrap_or(&data), true, payload)?;
        self.state = State::Finished;
        self.request = Command::bare(Request::BlockUploadEnd.code(), false);
        Ok(Step::Send)
    }

    /// While a block is being received a frame has no command specifier, except
    /// for an abort.
    pub(super) fn is_block_segment(&self, command: &Command) -> bool {
        self.state == State::BlockUploadSegments
            && !self.receiver.is_complete()
            && !command.is_bare_abort()
    }

    /// CiA 301, 7.2.4.3.14.
    pub(super) fn block_segment(
        &mut self,
        command: &Command,
        payload: &mut dyn Payload,
    ) -> Result<Step, Failure> {
        let segment = BlockSegment::decode(command.0).ok_or(AbortCode::SEQUENCE_NUMBER)?;
        if let Some(before) = self.receiver.segment(&segment)? {
            self.take(&before, false, payload)?;
        }
        Ok(match self.receiver.over() {
            Some(acknowledgement) => {
                self.request = acknowledgement;
                Step::Send
            }
            None => Step::Wait,
        })
    }

    /// At its deadline a block download sends the next segment, and a block
    /// upload acknowledges what it has, once, so that the rest is sent again.
    pub(super) fn block_poll(&mut self, payload: &mut dyn Payload) -> Result<bool, AbortCode> {
        let command = match self.state {
            State::BlockDownloadSegments => match self.sender.next_offset()? {
                Some(offset) => {
                    let mut data = [0; SEGMENT_MAX];
                    let left = self.left(offset);
                    let len = left.min(SEGMENT_MAX);
                    payload.read(offset, data.get_mut(..len).unwrap_or(&mut []));
                    Some(self.sender.segment(data, len, len == left)?)
                }
                None => None,
            },
            State::BlockUploadSegments => self.receiver.stall(),
            _ => None,
        };
        if let Some(command) = command {
            self.request = command;
        }
        Ok(command.is_some())
    }
}

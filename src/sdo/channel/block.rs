//! Block transfers (CiA 301, 7.2.4.3.8 .. 7.2.4.3.15).

use super::{BLOCK_SIZE, Channel, Payload, State, Step};
use crate::sdo::AbortCode;
use crate::sdo::block::{Receiver, Sender, check_block_size};
use crate::sdo::command::{Command, Request};

impl Channel {
    /// CiA 301, 7.2.4.3.9.
    pub(super) fn block_download_begun(&mut self, command: &Command) -> Result<Step, AbortCode> {
        let [block_size, ..] = command.tail();
        let block_size = check_block_size(block_size)?;
        self.sender = Sender::new(block_size, command.has_crc());
        self.state = State::BlockDownloadSegments;
        Ok(Step::Wait)
    }

    /// CiA 301, 7.2.4.3.10.
    pub(super) fn block_acknowledged(&mut self, command: &Command) -> Result<Step, AbortCode> {
        self.sender.acknowledged(command, &mut self.request)?;
        if self.sender.is_sending() {
            return Ok(Step::Wait);
        }
        self.state = State::BlockDownloadEnd;
        Ok(Step::Send)
    }

    /// CiA 301, 7.2.4.3.13.
    pub(super) fn block_upload_begun(
        &mut self,
        command: &Command,
        payload: &mut dyn Payload,
    ) -> Result<Step, AbortCode> {
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
    ) -> Result<Step, AbortCode> {
        let len = self.receiver.end(command.end())?;
        let held = *self.receiver.held();
        let data = held.bytes();
        self.take(data.get(..len).unwrap_or(data), true, payload)?;
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
    ) -> Result<Step, AbortCode> {
        if command.sequence() == 0 {
            return Err(AbortCode::SEQUENCE_NUMBER);
        }
        let before = &mut Command([0; 8]);
        self.receiver.segment(command, before)?;
        if before.sequence() != 0 {
            self.take(before.bytes(), false, payload)?;
        }
        Ok(match self.receiver.over(&mut self.request) {
            true => Step::Send,
            false => Step::Wait,
        })
    }

    /// At its deadline a block download sends the next segment, and a block
    /// upload acknowledges what it has, once, so that the rest is sent again.
    /// [`Step::Ignore`]: there is nothing to be done.
    pub(super) fn block_poll(&mut self, payload: &mut dyn Payload) -> Result<Step, AbortCode> {
        let send = match self.state {
            State::BlockDownloadSegments if self.sender.is_sending() => {
                self.request = Command([0; 8]);
                let offset = self.sender.next_offset()?;
                let (len, last) = self.fill(offset, payload);
                self.sender.segment(&mut self.request, len, last)?;
                true
            }
            State::BlockUploadSegments => self.receiver.stall(&mut self.request),
            _ => false,
        };
        Ok(match send {
            true => Step::Send,
            false => Step::Ignore,
        })
    }
}

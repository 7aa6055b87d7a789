//! Block transfers (CiA 301, 7.2.4.3.8 .. 7.2.4.3.15).

use super::{BLOCK_SIZE, Channel, Payload, State, Step};
use crate::sdo::AbortCode;
use crate::sdo::block::{Receiver, Sender, check_block_size};
use crate::sdo::command::{Answer, BlockSegment, Command, Request, SEGMENT_MAX};

impl Channel {
    /// CiA 301, 7.2.4.3.9.
    pub(super) fn begin_block_download(&mut self, size: u32) -> Command {
        self.state = State::BlockDownload;
        Command::block_of(Request::BlockDownload.code(), self.at, Some(size))
    }

    /// CiA 301, 7.2.4.3.13.
    pub(super) fn begin_block_upload(&mut self) -> Command {
        self.state = State::BlockUpload;
        Command::block_for(Request::BlockUpload.code(), self.at, BLOCK_SIZE)
    }

    /// The server does not know block transfers.
    pub(super) fn fall_back(&mut self, payload: &mut dyn Payload) -> Step {
        self.block = false;
        Step::Send(match (self.state, self.size) {
            (State::BlockDownload, Some(size)) => self.begin_download(size, payload),
            _ => self.begin_upload(),
        })
    }

    /// An answer of a block transfer, other than a segment.
    pub(super) fn block_step(
        &mut self,
        answer: Answer,
        command: Command,
        payload: &mut dyn Payload,
    ) -> Step {
        match (&mut self.state, answer) {
            (State::BlockDownload, Answer::BlockDownload) => {
                let [block_size, ..] = command.tail();
                match check_block_size(block_size) {
                    Ok(block_size) => {
                        let sender = Sender::new(block_size, command.has_crc());
                        self.state = State::BlockDownloadSegments(sender);
                        Step::Wait
                    }
                    Err(code) => Step::Violation(code),
                }
            }
            (State::BlockDownloadSegments(sender), Answer::BlockDownloadAcknowledge) => {
                match sender.acknowledged(command) {
                    Ok(Some(end)) => {
                        self.state = State::BlockDownloadEnd;
                        let code = Request::BlockDownloadEnd.code();
                        Step::Send(Command::block_end(code, end))
                    }
                    Ok(None) => Step::Wait,
                    Err(code) => Step::Violation(code),
                }
            }
            (State::BlockDownloadEnd, Answer::BlockDownloadEnd) => {
                Step::Done(self.size.unwrap_or(0))
            }
            (State::BlockUpload, Answer::BlockUpload) => {
                self.size = command.block_data();
                if let Err(code) = payload.begin(self.size) {
                    return self.refused(code, self.size.unwrap_or(0));
                }
                let receiver = Receiver::new(BLOCK_SIZE, command.has_crc());
                self.state = State::BlockUploadSegments(receiver);
                Step::Send(Command::bare(Request::BlockUploadStart.code(), false))
            }
            (State::BlockUploadSegments(receiver), Answer::BlockUploadEnd) => {
                match receiver.end(command.end()) {
                    Ok((data, len)) => {
                        let data = data.get(..len).unwrap_or(&data);
                        match self.take(data, true, payload) {
                            Ok(()) => {
                                self.state = State::Finished(self.received);
                                Step::Send(Command::bare(Request::BlockUploadEnd.code(), false))
                            }
                            Err(step) => step,
                        }
                    }
                    Err(code) => Step::Violation(code),
                }
            }
            _ => Step::Ignore,
        }
    }

    /// While a block is being received a frame has no command specifier, except
    /// for an abort. `None` if this is no such moment.
    pub(super) fn block_segment(
        &mut self,
        command: Command,
        payload: &mut dyn Payload,
    ) -> Option<Step> {
        let State::BlockUploadSegments(receiver) = &mut self.state else {
            return None;
        };
        if receiver.is_complete() {
            return None;
        }
        let Some(segment) = BlockSegment::decode(command.0) else {
            return match command.answer() {
                Some(Answer::Abort) => None,
                _ => Some(Step::Violation(AbortCode::SEQUENCE_NUMBER)),
            };
        };
        let before = match receiver.segment(segment) {
            Ok(before) => before,
            Err(code) => return Some(Step::Violation(code)),
        };
        let over = receiver.over();
        if let Some(Err(step)) = before.map(|data| self.take(&data, false, payload)) {
            return Some(step);
        }
        Some(match over {
            Some(sequence) => Step::Send(acknowledge(sequence)),
            None => Step::Wait,
        })
    }

    /// At its deadline a block download sends the next segment, and a block
    /// upload acknowledges what it has, once, so that the rest is sent again.
    pub(super) fn block_poll(
        &mut self,
        payload: &mut dyn Payload,
    ) -> Result<Option<Command>, AbortCode> {
        let size = self.size.unwrap_or(0);
        match &mut self.state {
            State::BlockDownloadSegments(sender) => {
                let Some(offset) = sender.next_offset()? else {
                    return Ok(None);
                };
                let mut data = [0; SEGMENT_MAX];
                let left = size.saturating_sub(offset) as usize;
                let len = left.min(SEGMENT_MAX);
                payload.read(offset, data.get_mut(..len).unwrap_or(&mut []));
                let segment = sender.segment(data, len, len == left)?;
                Ok(Some(Command(segment.encode())))
            }
            State::BlockUploadSegments(receiver) => Ok(receiver.stall().map(acknowledge)),
            _ => Ok(None),
        }
    }
}

const fn acknowledge(sequence: u8) -> Command {
    Command::acknowledge(Request::BlockUploadAcknowledge.code(), sequence, BLOCK_SIZE)
}

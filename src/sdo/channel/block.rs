//! Block transfers (CiA 301, 7.2.4.3.8 .. 7.2.4.3.15).

use super::{BLOCK_SIZE, Channel, Payload, State, Step};
use crate::sdo::AbortCode;
use crate::sdo::block::{End, Receiver, Sender, check_block_size};
use crate::sdo::command::{Answer, BlockSegment, Bytes, Request, SEGMENT_MAX};

impl Channel {
    /// CiA 301, 7.2.4.3.9.
    pub(super) fn begin_block_download(&mut self, size: u32) -> Request {
        self.state = State::BlockDownload;
        Request::BlockDownload {
            at: self.at,
            crc: true,
            size: Some(size),
        }
    }

    /// CiA 301, 7.2.4.3.13.
    pub(super) fn begin_block_upload(&mut self) -> Request {
        self.state = State::BlockUpload;
        Request::BlockUpload {
            at: self.at,
            crc: true,
            block_size: BLOCK_SIZE,
            protocol_switch: 0,
        }
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
    pub(super) fn block_step(&mut self, answer: Answer, payload: &mut dyn Payload) -> Step {
        match (&mut self.state, answer) {
            (
                State::BlockDownload,
                Answer::BlockDownload {
                    crc, block_size, ..
                },
            ) => match check_block_size(block_size) {
                Ok(block_size) => {
                    self.state = State::BlockDownloadSegments(Sender::new(block_size, crc));
                    Step::Wait
                }
                Err(code) => Step::Violation(code),
            },
            (
                State::BlockDownloadSegments(sender),
                Answer::BlockDownloadAcknowledge {
                    sequence,
                    block_size,
                },
            ) => match sender.acknowledged(sequence, block_size) {
                Ok(Some(End { unused, crc })) => {
                    self.state = State::BlockDownloadEnd;
                    Step::Send(Request::BlockDownloadEnd { unused, crc })
                }
                Ok(None) => Step::Wait,
                Err(code) => Step::Violation(code),
            },
            (State::BlockDownloadEnd, Answer::BlockDownloadEnd) => {
                Step::Done(self.size.unwrap_or(0))
            }
            (State::BlockUpload, Answer::BlockUpload { crc, size, .. }) => {
                self.size = size;
                if let Err(code) = payload.begin(size) {
                    return self.refused(code, size.unwrap_or(0));
                }
                self.state = State::BlockUploadSegments(Receiver::new(BLOCK_SIZE, crc));
                Step::Send(Request::BlockUploadStart)
            }
            (State::BlockUploadSegments(receiver), Answer::BlockUploadEnd { unused, crc }) => {
                match receiver.end(End { unused, crc }) {
                    Ok((data, len)) => {
                        let data = data.get(..len).unwrap_or(&data);
                        match self.take(data, true, payload) {
                            Ok(()) => {
                                self.state = State::Finished(self.received);
                                Step::Send(Request::BlockUploadEnd)
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
        bytes: Bytes,
        payload: &mut dyn Payload,
    ) -> Option<Step> {
        let State::BlockUploadSegments(receiver) = &mut self.state else {
            return None;
        };
        if receiver.is_complete() {
            return None;
        }
        let Some(segment) = BlockSegment::decode(bytes) else {
            return match Answer::decode(bytes) {
                Some(Answer::Abort { .. }) => None,
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
    ) -> Result<Option<Bytes>, AbortCode> {
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
                Ok(Some(segment.encode()))
            }
            State::BlockUploadSegments(receiver) => Ok(receiver
                .stall()
                .map(|sequence| acknowledge(sequence).encode())),
            _ => Ok(None),
        }
    }
}

const fn acknowledge(sequence: u8) -> Request {
    Request::BlockUploadAcknowledge {
        sequence,
        block_size: BLOCK_SIZE,
    }
}

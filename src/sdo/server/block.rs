//! Block transfers (CiA 301, 7.2.4.3.8 .. 7.2.4.3.15).

use super::transfer::{Sink, Source};
use super::{Phase, Reply, Server, State};
use crate::od::ObjectDictionary;
use crate::sdo::AbortCode;
use crate::sdo::block::{Receiver, Sender, check_block_size};
use crate::sdo::command::{Answer, BlockSegment, Command, End, Request, SEGMENT_MAX};
use crate::time::Instant;

impl Server {
    /// CiA 301, 7.2.4.3.9.
    pub(super) fn block_download(
        &mut self,
        command: Command,
        od: &mut impl ObjectDictionary,
    ) -> Reply {
        let at = command.address();
        let block_size = check_block_size(self.block_size).map_err(|_| AbortCode::COMMAND)?;
        self.state = State::BlockDownload {
            sink: Sink::open(od, at, command.block_data())?,
            receiver: Receiver::new(block_size, command.has_crc()),
            refused: None,
        };
        let code = Answer::BlockDownload.code();
        Ok(Some(Command::block_for(code, at, block_size)))
    }

    /// While a block is being received a frame has no command specifier, except
    /// for an abort. `None` if this is no such moment.
    ///
    /// A refusal waits for the end of the block: the client may have sent it all
    /// before it learns of the abort, and with the transfer gone a segment would be
    /// taken for a command, that with the number 23h for a download. A second frame
    /// without sequence number is not waited for.
    ///
    /// CiA 301, 7.2.4.3.10.
    pub(super) fn block_segment(
        &mut self,
        command: Command,
        od: &mut impl ObjectDictionary,
    ) -> Option<Reply> {
        let State::BlockDownload {
            sink,
            receiver,
            refused,
        } = &mut self.state
        else {
            return None;
        };
        if receiver.is_complete() {
            return None;
        }
        let Some(segment) = BlockSegment::decode(command.0) else {
            return match (command.request(), *refused) {
                (Some(Request::Abort), _) => None,
                (_, Some(code)) => Some(Err(code)),
                (_, None) => {
                    *refused = Some(AbortCode::SEQUENCE_NUMBER);
                    Some(Ok(None))
                }
            };
        };
        let answer = match receiver.segment(segment) {
            Ok(before) => {
                if let (Some(data), None) = (before, &refused) {
                    *refused = sink.push(od, &data, false).err();
                }
                let over = receiver.over();
                over.map(|sequence| acknowledge(sequence, receiver))
            }
            Err(code) => return Some(Err(code)),
        };
        Some(match (answer, *refused) {
            (Some(_), Some(code)) => Err(code),
            (answer, _) => Ok(answer),
        })
    }

    /// CiA 301, 7.2.4.3.11.
    pub(super) fn block_download_end(&mut self, end: End, od: &mut impl ObjectDictionary) -> Reply {
        let State::BlockDownload { sink, receiver, .. } = &mut self.state else {
            return Err(AbortCode::COMMAND);
        };
        let (data, len) = receiver.end(end)?;
        sink.push(od, data.get(..len).unwrap_or(&data), true)?;
        self.state = State::Idle;
        Ok(Some(Command::bare(Answer::BlockDownloadEnd.code(), false)))
    }

    /// CiA 301, 7.2.4.3.13.
    pub(super) fn block_upload(
        &mut self,
        command: Command,
        od: &mut impl ObjectDictionary,
    ) -> Reply {
        if self.block_size == 0 {
            return Err(AbortCode::COMMAND);
        }
        let at = command.address();
        let [block_size, protocol_switch, ..] = command.tail();
        let block_size = check_block_size(block_size)?;
        let source = Source::open(od, at)?;
        let size = source.read(od, 0, &mut [0])?.size;
        if protocol_switch > 0 && size.is_some_and(|size| size <= u32::from(protocol_switch)) {
            return self.upload(at, od);
        }
        self.state = State::BlockUpload {
            source,
            sender: Sender::new(block_size, command.has_crc()),
            phase: Phase::Start,
        };
        let code = Answer::BlockUpload.code();
        Ok(Some(Command::block_of(code, at, size)))
    }

    /// CiA 301, 7.2.4.3.13.
    pub(super) fn block_upload_start(&mut self) -> Reply {
        match &mut self.state {
            State::BlockUpload { phase, .. } if *phase == Phase::Start => {
                *phase = Phase::Segments;
                Ok(None)
            }
            _ => Err(AbortCode::COMMAND),
        }
    }

    /// CiA 301, 7.2.4.3.14.
    pub(super) fn block_upload_acknowledge(&mut self, command: Command) -> Reply {
        match &mut self.state {
            State::BlockUpload { sender, phase, .. } if *phase == Phase::Segments => {
                let end = sender.acknowledged(command)?;
                Ok(end.map(|end| {
                    *phase = Phase::End;
                    Command::block_end(Answer::BlockUploadEnd.code(), end)
                }))
            }
            _ => Err(AbortCode::COMMAND),
        }
    }

    /// CiA 301, 7.2.4.3.15.
    pub(super) fn block_upload_end(&mut self) -> Reply {
        match &self.state {
            State::BlockUpload { phase, .. } if *phase == Phase::End => {
                self.state = State::Idle;
                Ok(None)
            }
            _ => Err(AbortCode::COMMAND),
        }
    }

    /// At its deadline a block upload sends the next segment, and a block
    /// download acknowledges what it has, once, so that the rest is sent again.
    pub(super) fn block_poll(&mut self, now: Instant, od: &mut impl ObjectDictionary) -> Reply {
        let command = match &mut self.state {
            State::BlockUpload {
                source,
                sender,
                phase: Phase::Segments,
            } => match sender.next_offset()? {
                Some(offset) => {
                    let mut data = [0; SEGMENT_MAX];
                    let chunk = source.read(od, offset, &mut data)?;
                    Some(Command(
                        sender.segment(data, chunk.len, chunk.last)?.encode(),
                    ))
                }
                None => None,
            },
            State::BlockDownload {
                refused: Some(code),
                ..
            } => return Err(*code),
            State::BlockDownload { receiver, .. } => receiver
                .stall()
                .map(|sequence| acknowledge(sequence, receiver)),
            _ => None,
        };
        self.deadline = now + self.patience();
        Ok(command)
    }
}

const fn acknowledge(sequence: u8, receiver: &Receiver) -> Command {
    let code = Answer::BlockDownloadAcknowledge.code();
    Command::acknowledge(code, sequence, receiver.block_size())
}

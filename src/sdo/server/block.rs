//! Block transfers (CiA 301, 7.2.4.3.8 .. 7.2.4.3.15).

use super::{Phase, Reply, Server};
use crate::od::ObjectDictionary;
use crate::sdo::AbortCode;
use crate::sdo::block::{Receiver, Sender, check_block_size};
use crate::sdo::command::{Answer, BlockSegment, Command, Request, SEGMENT_MAX};
use crate::time::Instant;

impl Server {
    /// CiA 301, 7.2.4.3.9.
    pub(super) fn block_download(
        &mut self,
        command: Command,
        od: &mut impl ObjectDictionary,
    ) -> Reply {
        let (at, block_size) = (command.address(), self.block_size);
        self.transfer.open_download(od, at, command.block_data())?;
        self.phase = Phase::BlockDownload;
        self.receiver = Receiver::new(block_size, command.has_crc());
        self.refused = None;
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
        if self.phase != Phase::BlockDownload || self.receiver.is_complete() {
            return None;
        }
        let Some(segment) = BlockSegment::decode(command.0) else {
            return match (command.request(), self.refused) {
                (Some(Request::Abort), _) => None,
                (_, Some(code)) => Some(Err(code)),
                (_, None) => {
                    self.refused = Some(AbortCode::SEQUENCE_NUMBER);
                    Some(Ok(None))
                }
            };
        };
        let before = match self.receiver.segment(segment) {
            Ok(before) => before,
            Err(code) => return Some(Err(code)),
        };
        if let (Some(data), None) = (before, self.refused) {
            self.refused = self.transfer.push(od, &data, false).err();
        }
        let answer = self.receiver.over();
        Some(match self.refused {
            Some(code) if answer.is_some() => Err(code),
            _ => Ok(answer),
        })
    }

    /// CiA 301, 7.2.4.3.11.
    pub(super) fn block_download_end(
        &mut self,
        command: Command,
        od: &mut impl ObjectDictionary,
    ) -> Reply {
        let (data, len) = self.receiver.end(command.end())?;
        let data = data.get(..len).unwrap_or(&data);
        self.transfer.push(od, data, true)?;
        self.phase = Phase::Idle;
        Ok(Some(Command::bare(Answer::BlockDownloadEnd.code(), false)))
    }

    /// CiA 301, 7.2.4.3.13.
    pub(super) fn block_upload(
        &mut self,
        command: Command,
        od: &mut impl ObjectDictionary,
    ) -> Reply {
        let at = command.address();
        let [block_size, protocol_switch, ..] = command.tail();
        let block_size = check_block_size(block_size)?;
        self.transfer.open_upload(od, at)?;
        let size = self.transfer.size;
        if protocol_switch > 0 && size.is_some_and(|size| size <= protocol_switch.into()) {
            return self.upload(at, od);
        }
        self.phase = Phase::BlockUploadStart;
        self.sender = Sender::new(block_size, command.has_crc());
        let code = Answer::BlockUpload.code();
        Ok(Some(Command::block_of(code, at, size)))
    }

    /// CiA 301, 7.2.4.3.14.
    pub(super) fn block_upload_acknowledge(&mut self, command: Command) -> Reply {
        let end = self.sender.acknowledged(command)?;
        if end.is_some() {
            self.phase = Phase::BlockUploadEnd;
        }
        Ok(end)
    }

    /// At its deadline a block upload sends the next segment, and a block
    /// download acknowledges what it has, once, so that the rest is sent again.
    pub(super) fn block_poll(&mut self, now: Instant, od: &mut impl ObjectDictionary) -> Reply {
        let command = match self.phase {
            Phase::BlockUpload => match self.sender.next_offset()? {
                Some(offset) => {
                    let mut data = [0; SEGMENT_MAX];
                    let chunk = self.transfer.read(od, offset, &mut data)?;
                    Some(self.sender.segment(data, chunk.len, chunk.last)?)
                }
                None => None,
            },
            Phase::BlockDownload => match self.refused {
                Some(code) => return Err(code),
                None => self.receiver.stall(),
            },
            _ => None,
        };
        self.deadline = now + self.patience();
        Ok(command)
    }
}

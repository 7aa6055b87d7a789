//! Block transfers (CiA 301, 7.2.4.3.8 .. 7.2.4.3.15).

use super::{Outcome, Phase, Reply, Server};
use crate::od::ObjectDictionary;
use crate::sdo::AbortCode;
use crate::sdo::block::{Receiver, Sender, check_block_size};
use crate::sdo::command::{Answer, Command};

impl Server {
    /// CiA 301, 7.2.4.3.9.
    pub(super) fn block_download(
        &mut self,
        command: &Command,
        od: &mut impl ObjectDictionary,
    ) -> Outcome {
        let (at, block_size) = (command.address(), self.block_size);
        self.transfer.open_download(od, at, command.block_data())?;
        self.phase = Phase::BlockDownload;
        self.receiver = Receiver::new(block_size, command.has_crc());
        self.refused = None;
        let code = Answer::BlockDownload.code();
        self.answer = Command::block_for(code, at, block_size);
        Ok(Reply::Answer)
    }

    /// While a block is being received a frame has no command specifier, except
    /// for an abort.
    pub(super) fn is_block_segment(&self, command: &Command) -> bool {
        self.phase == Phase::BlockDownload
            && !self.receiver.is_complete()
            && !command.is_bare_abort()
    }

    /// A refusal waits for the end of the block: the client may have sent it all
    /// before it learns of the abort, and with the transfer gone a segment would be
    /// taken for a command, that with the number 23h for a download. A second frame
    /// without sequence number is not waited for.
    ///
    /// CiA 301, 7.2.4.3.10.
    pub(super) fn block_segment(
        &mut self,
        command: &Command,
        od: &mut impl ObjectDictionary,
    ) -> Outcome {
        if command.sequence() == 0 {
            return match self.refused.replace(AbortCode::SEQUENCE_NUMBER) {
                Some(code) => Err(code),
                None => Ok(Reply::Nothing),
            };
        }
        let before = &mut Command([0; 8]);
        self.receiver.segment(command, before)?;
        if before.sequence() != 0 && self.refused.is_none() {
            self.refused = self.transfer.push(od, before.bytes(), false).err();
        }
        if !self.receiver.over(&mut self.answer) {
            return Ok(Reply::Nothing);
        }
        match self.refused {
            Some(code) => Err(code),
            None => Ok(Reply::Answer),
        }
    }

    /// CiA 301, 7.2.4.3.11.
    pub(super) fn block_download_end(
        &mut self,
        command: &Command,
        od: &mut impl ObjectDictionary,
    ) -> Outcome {
        let len = self.receiver.end(command.end())?;
        let data = self.receiver.held().bytes();
        let data = data.get(..len).unwrap_or(data);
        self.transfer.push(od, data, true)?;
        self.phase = Phase::Idle;
        self.answer = Command::bare(Answer::BlockDownloadEnd.code(), false);
        Ok(Reply::Answer)
    }

    /// CiA 301, 7.2.4.3.13.
    pub(super) fn block_upload(
        &mut self,
        command: &Command,
        od: &mut impl ObjectDictionary,
    ) -> Outcome {
        let at = command.address();
        let [block_size, protocol_switch, ..] = command.tail();
        let block_size = check_block_size(block_size)?;
        self.transfer.open_upload(od, at)?;
        let size = self.transfer.size;
        if protocol_switch > 0 && size.is_some_and(|size| size <= protocol_switch.into()) {
            return self.upload(od);
        }
        self.phase = Phase::BlockUploadStart;
        self.sender = Sender::new(block_size, command.has_crc());
        let code = Answer::BlockUpload.code();
        self.answer = Command::block_of(code, at, size);
        Ok(Reply::Answer)
    }

    /// CiA 301, 7.2.4.3.14.
    pub(super) fn block_upload_acknowledge(&mut self, command: &Command) -> Outcome {
        self.sender.acknowledged(command, &mut self.answer)?;
        if self.sender.is_sending() {
            return Ok(Reply::Nothing);
        }
        self.phase = Phase::BlockUploadEnd;
        Ok(Reply::Answer)
    }

    /// At its deadline a block upload sends the next segment, and a block
    /// download acknowledges what it has, once, so that the rest is sent again.
    ///
    /// # Errors
    /// 05040000h if there is neither to be done: the client is silent.
    pub(super) fn block_poll(&mut self, od: &mut impl ObjectDictionary) -> Outcome {
        let answered = match self.phase {
            Phase::BlockUpload if self.sender.is_sending() => {
                self.answer = Command([0; 8]);
                let offset = self.sender.next_offset()?;
                let chunk = self.transfer.read(od, offset, self.answer.space())?;
                self.sender
                    .segment(&mut self.answer, chunk.len, chunk.last)?;
                true
            }
            Phase::BlockDownload => {
                if let Some(code) = self.refused {
                    return Err(code);
                }
                self.receiver.stall(&mut self.answer)
            }
            _ => false,
        };
        match answered {
            true => Ok(Reply::Answer),
            false => Err(AbortCode::TIMEOUT),
        }
    }
}

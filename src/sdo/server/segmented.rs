//! Expedited and segmented transfers (CiA 301, 7.2.4.3.3 .. 7.2.4.3.7).

use super::{Outcome, Phase, Reply, Server};
use crate::od::ObjectDictionary;
use crate::sdo::AbortCode;
use crate::sdo::command::{Answer, Command, EXPEDITED_MAX};

impl Server {
    /// CiA 301, 7.2.4.3.3.
    pub(super) fn download(
        &mut self,
        command: &Command,
        od: &mut impl ObjectDictionary,
    ) -> Outcome {
        let (at, size) = (command.address(), command.size());
        let transfer = &mut self.transfer;
        transfer.open_download(od, at, size)?;
        self.phase = Phase::Download;
        if command.is_expedited() {
            // Without a length the type decides.
            let len = match size {
                Some(size) => size as usize,
                None => transfer.fixed_size().unwrap_or(EXPEDITED_MAX),
            };
            let data = command.tail();
            transfer.push(od, data.get(..len).unwrap_or(&data), true)?;
            self.phase = Phase::Idle;
        }
        let code = Answer::Download.code();
        self.answer = Command::addressed(code, at, [0; 4]);
        Ok(Reply::Answer)
    }

    /// CiA 301, 7.2.4.3.4.
    pub(super) fn download_segment(
        &mut self,
        segment: &Command,
        od: &mut impl ObjectDictionary,
    ) -> Outcome {
        let toggle = self.toggled(segment)?;
        if segment.is_fruitless() {
            return Err(AbortCode::COMMAND);
        }
        let last = segment.is_last();
        self.transfer.push(od, segment.data(), last)?;
        if last {
            self.phase = Phase::Idle;
        }
        let code = Answer::DownloadSegment.code();
        self.answer = Command::bare(code, toggle);
        Ok(Reply::Answer)
    }

    /// CiA 301, 7.2.4.3.6.
    pub(super) fn upload(&mut self, od: &mut impl ObjectDictionary) -> Outcome {
        let mut first = [0; EXPEDITED_MAX];
        let chunk = self.transfer.read(od, 0, &mut first)?;
        let (code, at) = (Answer::Upload.code(), self.transfer.at);
        let whole = first.get(..chunk.len).filter(|_| chunk.last);
        self.answer = match whole.and_then(|whole| Command::expedited(code, at, whole)) {
            Some(expedited) => expedited,
            None => {
                self.phase = Phase::Upload;
                Command::segmented(code, at, chunk.size)
            }
        };
        Ok(Reply::Answer)
    }

    /// CiA 301, 7.2.4.3.7.
    pub(super) fn upload_segment(
        &mut self,
        request: &Command,
        od: &mut impl ObjectDictionary,
    ) -> Outcome {
        let toggle = self.toggled(request)?;
        self.answer = Command::bare(Answer::UploadSegment.code(), toggle);
        let chunk = self.transfer.next(od, self.answer.space())?;
        if chunk.last {
            self.phase = Phase::Idle;
        }
        self.answer.close(chunk.len, chunk.last);
        Ok(Reply::Answer)
    }

    /// The toggle bit of a request, which alternates from one to the next.
    fn toggled(&mut self, request: &Command) -> Result<bool, AbortCode> {
        let toggle = request.toggle();
        if toggle != self.toggle {
            return Err(AbortCode::TOGGLE);
        }
        self.toggle = !toggle;
        Ok(toggle)
    }
}

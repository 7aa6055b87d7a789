//! Expedited and segmented transfers (CiA 301, 7.2.4.3.3 .. 7.2.4.3.7).

use super::transfer::{Sink, Source};
use super::{Reply, Server, State};
use crate::id::Address;
use crate::od::ObjectDictionary;
use crate::sdo::AbortCode;
use crate::sdo::command::{Answer, Command, EXPEDITED_MAX, SEGMENT_MAX};

impl Server {
    /// CiA 301, 7.2.4.3.3.
    pub(super) fn download(&mut self, command: Command, od: &mut impl ObjectDictionary) -> Reply {
        let (at, size) = (command.address(), command.size());
        let mut sink = Sink::open(od, at, size)?;
        if command.is_expedited() {
            // Without a length the type decides.
            let len = match (size, sink.fixed_size()) {
                (Some(size), _) => size as usize,
                (None, Some(size)) if size > EXPEDITED_MAX => {
                    return Err(AbortCode::TOO_SHORT);
                }
                (None, Some(size)) => size,
                (None, None) => EXPEDITED_MAX,
            };
            let data = command.tail();
            sink.push(od, data.get(..len).unwrap_or(&data), true)
                .inspect_err(|_| sink.cancel(od))?;
        } else {
            self.state = State::Download {
                sink,
                toggle: false,
            };
        }
        let code = Answer::Download.code();
        Ok(Some(Command::addressed(code, at, [0; 4])))
    }

    /// CiA 301, 7.2.4.3.4.
    pub(super) fn download_segment(
        &mut self,
        segment: Command,
        od: &mut impl ObjectDictionary,
    ) -> Reply {
        let State::Download { sink, toggle } = &mut self.state else {
            return Err(AbortCode::COMMAND);
        };
        if segment.toggle() != *toggle {
            return Err(AbortCode::TOGGLE);
        }
        if segment.is_fruitless() {
            return Err(AbortCode::COMMAND);
        }
        sink.push(od, segment.data(), segment.is_last())?;
        *toggle = !*toggle;
        if segment.is_last() {
            self.state = State::Idle;
        }
        let code = Answer::DownloadSegment.code();
        Ok(Some(Command::bare(code, segment.toggle())))
    }

    /// CiA 301, 7.2.4.3.6.
    pub(super) fn upload(&mut self, at: Address, od: &mut impl ObjectDictionary) -> Reply {
        let source = Source::open(od, at)?;
        let mut first = [0; EXPEDITED_MAX];
        let chunk = source.read(od, 0, &mut first)?;
        let code = Answer::Upload.code();
        if chunk.last
            && let Some(whole) = first.get(..chunk.len)
            && let Some(answer) = Command::expedited(code, at, whole)
        {
            return Ok(Some(answer));
        }
        self.state = State::Upload {
            source,
            toggle: false,
            offset: 0,
        };
        Ok(Some(Command::segmented(code, at, chunk.size)))
    }

    /// CiA 301, 7.2.4.3.7.
    pub(super) fn upload_segment(&mut self, asked: bool, od: &mut impl ObjectDictionary) -> Reply {
        let State::Upload {
            source,
            toggle,
            offset,
        } = &mut self.state
        else {
            return Err(AbortCode::COMMAND);
        };
        if asked != *toggle {
            return Err(AbortCode::TOGGLE);
        }
        let mut data = [0; SEGMENT_MAX];
        let chunk = source.read(od, *offset, &mut data)?;
        if chunk.len < SEGMENT_MAX && !chunk.last {
            return Err(AbortCode::GENERAL);
        }
        let data = data.get(..chunk.len).unwrap_or(&[]);
        let code = Answer::UploadSegment.code();
        let segment = Command::segment(code, asked, chunk.last, data).ok_or(AbortCode::GENERAL)?;
        *toggle = !*toggle;
        *offset = offset
            .checked_add(chunk.len as u32)
            .ok_or(AbortCode::GENERAL)?;
        if chunk.last {
            self.state = State::Idle;
        }
        Ok(Some(segment))
    }
}

//! Expedited and segmented transfers (CiA 301, 7.2.4.3.3 .. 7.2.4.3.7).

use super::transfer::{Sink, Source};
use super::{Reply, Server, State};
use crate::id::Address;
use crate::od::ObjectDictionary;
use crate::sdo::AbortCode;
use crate::sdo::command::{Answer, EXPEDITED_MAX, Initiate, SEGMENT_MAX, Segment};

impl Server {
    /// CiA 301, 7.2.4.3.3.
    pub(super) fn download(
        &mut self,
        at: Address,
        data: Initiate,
        od: &mut impl ObjectDictionary,
    ) -> Reply {
        match data {
            Initiate::Expedited { data, len } => {
                let mut sink = Sink::open(od, at, len.map(u32::from))?;
                // Without a length the type decides.
                let len = match (len, sink.fixed_size()) {
                    (Some(len), _) => usize::from(len),
                    (None, Some(size)) if size > EXPEDITED_MAX => {
                        return Err(AbortCode::TOO_SHORT);
                    }
                    (None, Some(size)) => size,
                    (None, None) => EXPEDITED_MAX,
                };
                sink.push(od, data.get(..len).unwrap_or(&data), true)
                    .inspect_err(|_| sink.cancel(od))?;
            }
            Initiate::Segmented { size } => {
                self.state = State::Download {
                    sink: Sink::open(od, at, size)?,
                    toggle: false,
                };
            }
        }
        Ok(Some(Answer::Download { at }))
    }

    /// CiA 301, 7.2.4.3.4.
    pub(super) fn download_segment(
        &mut self,
        segment: Segment,
        od: &mut impl ObjectDictionary,
    ) -> Reply {
        let State::Download { sink, toggle } = &mut self.state else {
            return Err(AbortCode::COMMAND);
        };
        if segment.toggle != *toggle {
            return Err(AbortCode::TOGGLE);
        }
        if segment.is_fruitless() {
            return Err(AbortCode::COMMAND);
        }
        sink.push(od, segment.data(), segment.last)?;
        *toggle = !*toggle;
        if segment.last {
            self.state = State::Idle;
        }
        Ok(Some(Answer::DownloadSegment {
            toggle: segment.toggle,
        }))
    }

    /// CiA 301, 7.2.4.3.6.
    pub(super) fn upload(&mut self, at: Address, od: &mut impl ObjectDictionary) -> Reply {
        let source = Source::open(od, at)?;
        let mut first = [0; EXPEDITED_MAX];
        let chunk = source.read(od, 0, &mut first)?;
        let whole = first.get(..chunk.len).filter(|_| chunk.last);
        let data = match whole.and_then(Initiate::expedited) {
            Some(expedited) => expedited,
            None => {
                self.state = State::Upload {
                    source,
                    toggle: false,
                    offset: 0,
                };
                Initiate::Segmented { size: chunk.size }
            }
        };
        Ok(Some(Answer::Upload { at, data }))
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
        let segment = Segment::new(asked, chunk.last, data).ok_or(AbortCode::GENERAL)?;
        *toggle = !*toggle;
        *offset = offset
            .checked_add(chunk.len as u32)
            .ok_or(AbortCode::GENERAL)?;
        if chunk.last {
            self.state = State::Idle;
        }
        Ok(Some(Answer::UploadSegment(segment)))
    }
}

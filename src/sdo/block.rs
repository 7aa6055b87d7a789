//! The two ends of a block transfer. Client and server share them, since a
//! block download and a block upload differ only in who sends
//! (CiA 301, 7.2.4.3.8 .. 7.2.4.3.16).

use super::abort::AbortCode;
use super::command::{Answer, BLOCK_MAX, BlockSegment, Command, End, Request, SEGMENT_MAX};
use super::crc::Crc16;

/// The codes of the commands that either side sends in the course of a block
/// transfer: they go by who sends the data, not by who is the client.
const ACKNOWLEDGE: u8 = Request::BlockUploadAcknowledge.code();
const END: u8 = Request::BlockDownloadEnd.code();
const _: () = assert!(
    ACKNOWLEDGE == Answer::BlockDownloadAcknowledge.code() && END == Answer::BlockUploadEnd.code()
);

/// After so many acknowledgements in a row of nothing at all the sender gives
/// up: a transfer that makes no progress must end.
const FRUITLESS_MAX: u8 = 3;
/// After so many segments in a row that are out of sequence the receiver gives
/// up, for the same reason: it is what the sender's limit lets through.
const STRAY_MAX: u16 = (FRUITLESS_MAX as u16 + 1) * BLOCK_MAX as u16;

/// # Errors
/// 05040002h unless a block has 1..=127 segments.
pub(super) const fn check_block_size(block_size: u8) -> Result<u8, AbortCode> {
    if block_size >= 1 && block_size <= BLOCK_MAX {
        Ok(block_size)
    } else {
        Err(AbortCode::BLOCK_SIZE)
    }
}

/// The sending end. It keeps no data: what has to be sent again is read again.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sender {
    /// Offset of the first byte of the block.
    base: u32,
    block_size: u8,
    /// The last segment sent of the block.
    sequence: u8,
    /// The block is not complete yet.
    sending: bool,
    /// Bytes of the last segment of all, once that has been read.
    tail: Option<u8>,
    use_crc: bool,
    crc: Crc16,
    /// The checksum covers the bytes before this offset.
    summed: u32,
    fruitless: u8,
}

impl Sender {
    pub(super) const fn new(block_size: u8, use_crc: bool) -> Sender {
        Sender {
            base: 0,
            block_size,
            sequence: 0,
            sending: true,
            tail: None,
            use_crc,
            crc: Crc16::new(),
            summed: 0,
            fruitless: 0,
        }
    }

    /// Whether [`Sender::segment`] has something to send, or an
    /// acknowledgement is awaited.
    pub(super) const fn is_sending(&self) -> bool {
        self.sending
    }

    /// The offset of the next segment of the block; `None` if it is complete.
    pub(super) fn next_offset(&self) -> Result<Option<u32>, AbortCode> {
        match self.sending {
            true => self.offset(self.sequence).map(Some),
            false => Ok(None),
        }
    }

    /// The next segment of the block: the first `len` bytes of `data`, which
    /// belong at [`next_offset`](Sender::next_offset).
    pub(super) fn segment(
        &mut self,
        data: [u8; SEGMENT_MAX],
        len: usize,
        last: bool,
    ) -> Result<Command, AbortCode> {
        let offset = self.offset(self.sequence)?;
        let bytes = data.get(..len).unwrap_or(&data);
        // What is sent again has been summed before.
        if self.use_crc && offset == self.summed {
            self.crc = self.crc.update(bytes);
            self.summed = offset.checked_add(len as u32).ok_or(AbortCode::GENERAL)?;
        }
        self.sequence += 1;
        self.tail = last.then_some(len as u8);
        self.sending = !last && self.sequence < self.block_size;
        let segment = BlockSegment {
            last,
            sequence: self.sequence,
            data,
        };
        Ok(Command(segment.encode()))
    }

    /// The receiver tells how many segments of the block it has and how many it
    /// wants in the next. Yields the end command once it has everything.
    pub(super) fn acknowledged(&mut self, command: &Command) -> Result<Option<Command>, AbortCode> {
        let (sequence, block_size) = command.acknowledged();
        if sequence > self.sequence {
            return Err(AbortCode::SEQUENCE_NUMBER);
        }
        if let Some(tail) = self.tail.filter(|_| sequence == self.sequence) {
            self.sending = false;
            let end = End {
                unused: (SEGMENT_MAX as u8).saturating_sub(tail),
                crc: self.crc.get(),
            };
            return Ok(Some(Command::block_end(END, end)));
        }
        self.fruitless = if sequence == 0 { self.fruitless + 1 } else { 0 };
        if self.fruitless > FRUITLESS_MAX {
            return Err(AbortCode::SEQUENCE_NUMBER);
        }
        self.base = self.offset(sequence)?;
        self.block_size = check_block_size(block_size)?;
        self.sequence = 0;
        self.tail = None;
        self.sending = true;
        Ok(None)
    }

    fn offset(&self, segments: u8) -> Result<u32, AbortCode> {
        self.base
            .checked_add(u32::from(segments) * SEGMENT_MAX as u32)
            .ok_or(AbortCode::TOO_LONG)
    }
}

/// The receiving end.
///
/// The last segment is held back until the end command has told how many of
/// its bytes count and the checksum is right.
#[derive(Clone, Copy, Debug)]
pub(super) struct Receiver {
    block_size: u8,
    /// The last segment of the block received in sequence.
    sequence: u8,
    held: Option<[u8; SEGMENT_MAX]>,
    /// The last segment of all is held; the end command is awaited.
    complete: bool,
    use_crc: bool,
    crc: Crc16,
    /// The block has come to its end.
    over: bool,
    stalled: bool,
    /// Segments out of sequence since the last one in sequence.
    stray: u16,
}

impl Receiver {
    pub(super) const fn new(block_size: u8, use_crc: bool) -> Receiver {
        Receiver {
            block_size,
            sequence: 0,
            held: None,
            complete: false,
            use_crc,
            crc: Crc16::new(),
            over: false,
            stalled: false,
            stray: 0,
        }
    }

    /// Whether segments are over and the end command is awaited.
    pub(super) const fn is_complete(&self) -> bool {
        self.complete
    }

    /// Takes in a segment and gives out the one before it, which is not the last.
    /// A segment out of sequence is discarded with all that follow it in the
    /// block.
    ///
    /// # Errors
    /// 05040003h if nothing but such segments comes.
    pub(super) fn segment(
        &mut self,
        segment: &BlockSegment,
    ) -> Result<Option<[u8; SEGMENT_MAX]>, AbortCode> {
        self.stalled = false;
        self.over = segment.last || segment.sequence >= self.block_size;
        if segment.sequence != self.sequence + 1 {
            if self.stray >= STRAY_MAX {
                return Err(AbortCode::SEQUENCE_NUMBER);
            }
            self.stray += 1;
            return Ok(None);
        }
        self.sequence = segment.sequence;
        self.complete = segment.last;
        self.stray = 0;
        let before = self.held.replace(segment.data);
        if let Some(before) = &before {
            self.crc = self.crc.update(before);
        }
        Ok(before)
    }

    /// The acknowledgement, if the block is over.
    pub(super) fn over(&mut self) -> Option<Command> {
        core::mem::take(&mut self.over).then(|| self.acknowledge())
    }

    /// Nothing has come for a while: the acknowledgement that lets the sender
    /// repeat the rest. `None` the second time in a row, or if there is nothing
    /// to repeat.
    pub(super) fn stall(&mut self) -> Option<Command> {
        if self.stalled || self.complete {
            return None;
        }
        self.stalled = true;
        Some(self.acknowledge())
    }

    fn acknowledge(&mut self) -> Command {
        let sequence = core::mem::take(&mut self.sequence);
        Command::acknowledge(ACKNOWLEDGE, sequence, self.block_size)
    }

    /// The end command has come: the bytes of the last segment, if the
    /// checksum is right.
    pub(super) fn end(&self, end: End) -> Result<([u8; SEGMENT_MAX], usize), AbortCode> {
        let held = self
            .held
            .filter(|_| self.complete)
            .ok_or(AbortCode::COMMAND)?;
        let len = SEGMENT_MAX.saturating_sub(usize::from(end.unused));
        let crc = self.crc.update(held.get(..len).unwrap_or(&[])).get();
        if self.use_crc && crc != end.crc {
            return Err(AbortCode::CRC);
        }
        Ok((held, len))
    }
}

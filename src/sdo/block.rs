//! The two ends of a block transfer. Client and server share them, since a
//! block download and a block upload differ only in who sends
//! (CiA 301, 7.2.4.3.8 .. 7.2.4.3.16).

use super::abort::AbortCode;
use super::command::{Answer, BLOCK_MAX, Command, End, Request, SEGMENT_MAX};
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

    /// The offset of the next segment of the block.
    pub(super) fn next_offset(&self) -> Result<u32, AbortCode> {
        self.offset(self.sequence)
    }

    /// Makes `segment` the next one of the block: `len` bytes of those that belong at
    /// [`next_offset`](Sender::next_offset) are in its space.
    pub(super) fn segment(
        &mut self,
        segment: &mut Command,
        len: usize,
        last: bool,
    ) -> Result<(), AbortCode> {
        let offset = self.next_offset()?;
        // What is sent again has been summed before.
        if self.use_crc && offset == self.summed {
            let bytes = segment.bytes();
            self.crc = self.crc.update(bytes.get(..len).unwrap_or(bytes));
            self.summed = offset.checked_add(len as u32).ok_or(AbortCode::GENERAL)?;
        }
        self.sequence += 1;
        self.tail = last.then_some(len as u8);
        self.sending = !last && self.sequence < self.block_size;
        segment.number(self.sequence, last);
        Ok(())
    }

    /// The receiver tells how many segments of the block it has and how many it
    /// wants in the next. Once it has everything, nothing is [to be
    /// sent](Sender::is_sending) but `end`, which becomes the end command.
    pub(super) fn acknowledged(
        &mut self,
        command: &Command,
        end: &mut Command,
    ) -> Result<(), AbortCode> {
        let (sequence, block_size) = command.acknowledged();
        if sequence > self.sequence {
            return Err(AbortCode::SEQUENCE_NUMBER);
        }
        if let Some(tail) = self.tail.filter(|_| sequence == self.sequence) {
            self.sending = false;
            let unused = (SEGMENT_MAX as u8).saturating_sub(tail);
            let crc = self.crc.get();
            *end = Command::block_end(END, End { unused, crc });
            return Ok(());
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
        Ok(())
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
    /// No segment, with the number 0, before the first.
    held: Command,
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
            held: Command([0; 8]),
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

    /// Takes in a segment; `before` becomes the one before it, which is not the last,
    /// if there was one: it has a number. A segment out of sequence is discarded with
    /// all that follow it in the block.
    ///
    /// # Errors
    /// 05040003h if nothing but such segments comes.
    pub(super) fn segment(
        &mut self,
        segment: &Command,
        before: &mut Command,
    ) -> Result<(), AbortCode> {
        let (sequence, last) = (segment.sequence(), segment.is_last_of_all());
        self.stalled = false;
        self.over = last || sequence >= self.block_size;
        if sequence != self.sequence + 1 {
            if self.stray >= STRAY_MAX {
                return Err(AbortCode::SEQUENCE_NUMBER);
            }
            self.stray += 1;
            return Ok(());
        }
        self.sequence = sequence;
        self.complete = last;
        self.stray = 0;
        *before = core::mem::replace(&mut self.held, *segment);
        if before.sequence() != 0 {
            self.crc = self.crc.update(before.bytes());
        }
        Ok(())
    }

    /// Whether the block is over; then `answer` becomes the acknowledgement.
    pub(super) fn over(&mut self, answer: &mut Command) -> bool {
        let over = core::mem::take(&mut self.over);
        if over {
            self.acknowledge(answer);
        }
        over
    }

    /// Nothing has come for a while: `answer` becomes the acknowledgement that lets the
    /// sender repeat the rest. Not the second time in a row, nor if there is nothing to
    /// repeat.
    pub(super) fn stall(&mut self, answer: &mut Command) -> bool {
        if self.stalled || self.complete {
            return false;
        }
        self.stalled = true;
        self.acknowledge(answer);
        true
    }

    fn acknowledge(&mut self, answer: &mut Command) {
        let sequence = core::mem::take(&mut self.sequence);
        *answer = Command::acknowledge(ACKNOWLEDGE, sequence, self.block_size);
    }

    /// The end command has come: how many bytes of the last segment count, if the
    /// checksum is right.
    pub(super) fn end(&self, end: End) -> Result<usize, AbortCode> {
        if !self.complete {
            return Err(AbortCode::COMMAND);
        }
        let len = SEGMENT_MAX.saturating_sub(usize::from(end.unused));
        let crc = self.crc.update(self.held.bytes().get(..len).unwrap_or(&[]));
        if self.use_crc && crc.get() != end.crc {
            return Err(AbortCode::CRC);
        }
        Ok(len)
    }

    /// The last segment.
    pub(super) const fn held(&self) -> &Command {
        &self.held
    }
}

//! The bytes of SDO frames: every command of the expedited, segmented and block
//! protocols, both ways (CiA 301, 7.2.4.3).
//!
//! A [`Command`] is read where it stands: which one it is tell [`Request`] on
//! the server's side and [`Answer`] on the client's; what it says tell its
//! methods, each of them only for the commands that have the field. Nothing
//! fails on a length, because every SDO frame has eight bytes. Segments of a
//! block have a sequence number instead of a command specifier.

mod kind;

pub use kind::{Answer, Request};

use crate::id::{Address, Index, SubIndex};
use crate::sdo::AbortCode;

/// The data bytes of an SDO frame.
pub type Bytes = [u8; 8];

/// Data bytes in an expedited transfer.
pub const EXPEDITED_MAX: usize = 4;
/// Data bytes in a segment.
pub const SEGMENT_MAX: usize = 7;
/// Segments in a block (CiA 301, 7.2.4.3.10).
pub const BLOCK_MAX: u8 = 127;

/// `t` of a segment, and of what asks for or confirms one.
const TOGGLE: u8 = 0x10;
/// `e` of an initiate.
const EXPEDITED: u8 = 0x02;
/// `s` of an initiate.
const SIZE_TOLD: u8 = 0x01;
/// `n` of an expedited initiate: how many of the four bytes mean nothing.
const EXPEDITED_UNUSED_SHIFT: u8 = 2;
const EXPEDITED_UNUSED_MASK: u8 = 0x03;
/// `c` of a segment.
const LAST: u8 = 0x01;
/// `n` of a segment: how many of the seven bytes mean nothing.
const UNUSED_SHIFT: u8 = 1;
const UNUSED_MASK: u8 = 0x07;

/// The same in the block protocols.
mod block {
    /// `cc` and `sc`: this side computes the CRC.
    pub(super) const CRC: u8 = 0x04;
    pub(super) const SIZE_TOLD: u8 = 0x02;
    pub(super) const UNUSED_SHIFT: u8 = 2;
    /// `c` of a segment.
    pub(super) const LAST: u8 = 0x80;
    pub(super) const SEQUENCE_MASK: u8 = 0x7F;
}

/// What the end command of a block transfer tells of the data
/// (CiA 301, 7.2.4.3.11, 7.2.4.3.15).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct End {
    /// Unused bytes of the last segment, 0..=7.
    pub unused: u8,
    /// Over all data; 0 if one side does not compute it.
    pub crc: u16,
}

/// The eight bytes of an SDO frame.
///
/// ```
/// # use canmaster::{id::Address, sdo::command::{Command, Request}};
/// let device_type = Address::new(0x1000, 0);
/// let command = Command::addressed(Request::Upload.code(), device_type, [0; 4]);
/// assert_eq!(command.0, [0x40, 0x00, 0x10, 0x00, 0, 0, 0, 0]);
/// assert_eq!(command.request(), Some(Request::Upload));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Command(pub Bytes);

/// Putting commands together. `code` is that of a [`Request`] or an [`Answer`].
impl Command {
    /// A command that names an entry, with its last four bytes.
    // Inlined everywhere it would take 176 bytes of flash more.
    #[inline(never)]
    pub const fn addressed(code: u8, at: Address, data: [u8; 4]) -> Command {
        let [low, high] = at.index.0.to_le_bytes();
        let [a, b, c, d] = data;
        Command([code, low, high, at.sub.0, a, b, c, d])
    }

    /// A command that says nothing else, but for the toggle bit where it has
    /// one.
    pub const fn bare(code: u8, toggle: bool) -> Command {
        let toggle = if toggle { TOGGLE } else { 0 };
        Command([code | toggle, 0, 0, 0, 0, 0, 0, 0])
    }

    /// The end of a transfer by either side (CiA 301, 7.2.4.3.17).
    pub const fn abort(at: Address, code: AbortCode) -> Command {
        Command::addressed(Request::Abort.code(), at, code.0.to_le_bytes())
    }

    /// An initiate with all its data; `None` unless these are 1..=4 bytes
    /// (CiA 301, 7.2.4.3.3, 7.2.4.3.6).
    pub fn expedited(code: u8, at: Address, data: &[u8]) -> Option<Command> {
        if data.is_empty() {
            return None;
        }
        let mut bytes = [0; EXPEDITED_MAX];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        let unused = (EXPEDITED_MAX - data.len()) as u8;
        let code = code | EXPEDITED | SIZE_TOLD | unused << EXPEDITED_UNUSED_SHIFT;
        Some(Command::addressed(code, at, bytes))
    }

    /// An initiate that segments follow, of this many bytes in all if told
    /// (CiA 301, 7.2.4.3.3, 7.2.4.3.6).
    pub fn segmented(code: u8, at: Address, size: Option<u32>) -> Command {
        let told = if size.is_some() { SIZE_TOLD } else { 0 };
        Command::addressed(code | told, at, size.unwrap_or(0).to_le_bytes())
    }

    /// Room for the data of a segment.
    pub const fn space(&mut self) -> &mut [u8; SEGMENT_MAX] {
        let [_, space @ ..] = &mut self.0;
        space
    }

    /// Makes a [`bare`](Self::bare) command a segment with the first `len` bytes that
    /// were put into its [`space`](Self::space) (CiA 301, 7.2.4.3.4, 7.2.4.3.7).
    pub fn close(&mut self, len: usize, last: bool) {
        let unused = SEGMENT_MAX.saturating_sub(len) as u8;
        let [head, ..] = &mut self.0;
        *head |= unused << UNUSED_SHIFT | u8::from(last);
    }

    /// Makes it a segment of a block, with the seven bytes in its
    /// [`space`](Self::space): number `sequence` of 1..=127, and whether it is the last
    /// of the transfer, not merely of the block. How many of the last one's bytes are
    /// meant is told by the end command (CiA 301, 7.2.4.3.10, 7.2.4.3.14).
    pub const fn number(&mut self, sequence: u8, last: bool) {
        let last = if last { block::LAST } else { 0 };
        let [head, ..] = &mut self.0;
        *head = last | sequence & block::SEQUENCE_MASK;
    }

    /// The initiate of a block transfer by the side that sends the data and
    /// computes the CRC, of this many bytes in all if told
    /// (CiA 301, 7.2.4.3.9, 7.2.4.3.13).
    pub fn block_of(code: u8, at: Address, size: Option<u32>) -> Command {
        let told = if size.is_some() { block::SIZE_TOLD } else { 0 };
        let code = code | block::CRC | told;
        Command::addressed(code, at, size.unwrap_or(0).to_le_bytes())
    }

    /// The initiate of a block transfer by the side that receives the data and
    /// checks the CRC; blocks are to have `block_size` segments
    /// (CiA 301, 7.2.4.3.9, 7.2.4.3.13).
    pub const fn block_for(code: u8, at: Address, block_size: u8) -> Command {
        Command::addressed(code | block::CRC, at, [block_size, 0, 0, 0])
    }

    /// The segments of a block up to `sequence` have come, 0 for none; the next
    /// is to have `block_size` (CiA 301, 7.2.4.3.10, 7.2.4.3.14).
    pub const fn acknowledge(code: u8, sequence: u8, block_size: u8) -> Command {
        Command([code, sequence, block_size, 0, 0, 0, 0, 0])
    }

    /// The end of the data of a block transfer (CiA 301, 7.2.4.3.11,
    /// 7.2.4.3.15).
    pub const fn block_end(code: u8, end: End) -> Command {
        let [low, high] = end.crc.to_le_bytes();
        let unused = (end.unused & UNUSED_MASK) << block::UNUSED_SHIFT;
        Command([code | unused, low, high, 0, 0, 0, 0, 0])
    }
}

/// Taking them apart.
impl Command {
    /// What a client wants; `None` for a command that does not exist.
    pub const fn request(&self) -> Option<Request> {
        Request::of(self.head())
    }

    /// What a server answers; `None` for a command that does not exist.
    pub const fn answer(&self) -> Option<Answer> {
        Answer::of(self.head())
    }

    const fn head(&self) -> u8 {
        let [head, ..] = self.0;
        head
    }

    const fn has(&self, flag: u8) -> bool {
        self.head() & flag != 0
    }

    /// The entry, of a command that names one.
    pub const fn address(&self) -> Address {
        let [_, low, high, sub, ..] = self.0;
        Address {
            index: Index(u16::from_le_bytes([low, high])),
            sub: SubIndex(sub),
        }
    }

    /// The last four bytes: the data of an expedited transfer, for instance.
    pub const fn tail(&self) -> [u8; 4] {
        let [.., a, b, c, d] = self.0;
        [a, b, c, d]
    }

    /// An abort where segments of a block are awaited: those have a sequence
    /// number in its unused bits.
    pub(super) const fn is_bare_abort(&self) -> bool {
        self.head() == Request::Abort.code()
    }

    /// Why a transfer is aborted.
    pub const fn abort_code(&self) -> AbortCode {
        AbortCode(u32::from_le_bytes(self.tail()))
    }

    /// The toggle bit.
    pub const fn toggle(&self) -> bool {
        self.has(TOGGLE)
    }

    /// An initiate has its data with it, else segments follow.
    pub const fn is_expedited(&self) -> bool {
        self.has(EXPEDITED)
    }

    /// How many bytes an initiate announces. Of those that it has with it, all
    /// that the type needs count if it does not tell.
    pub fn size(&self) -> Option<u32> {
        if !self.has(SIZE_TOLD) {
            None
        } else if self.is_expedited() {
            let unused = self.head() >> EXPEDITED_UNUSED_SHIFT & EXPEDITED_UNUSED_MASK;
            Some(EXPEDITED_MAX as u32 - u32::from(unused))
        } else {
            Some(u32::from_le_bytes(self.tail()))
        }
    }

    /// No segment follows.
    pub const fn is_last(&self) -> bool {
        self.has(LAST)
    }

    /// The 0..=7 data bytes of a segment.
    pub fn data(&self) -> &[u8] {
        let unused = usize::from(self.head() >> UNUSED_SHIFT & UNUSED_MASK);
        self.bytes().get(..SEGMENT_MAX - unused).unwrap_or(&[])
    }

    /// The seven bytes of a segment of a block.
    pub const fn bytes(&self) -> &[u8; SEGMENT_MAX] {
        let [_, bytes @ ..] = &self.0;
        bytes
    }

    /// The number of a segment of a block; 0 for what is none, as an abort (0x80).
    pub const fn sequence(&self) -> u8 {
        self.head() & block::SEQUENCE_MASK
    }

    /// No segment of a block follows in the whole transfer.
    pub const fn is_last_of_all(&self) -> bool {
        self.has(block::LAST)
    }

    /// A segment with neither data nor the end: a transfer of such segments
    /// would never end.
    pub(super) fn is_fruitless(&self) -> bool {
        self.data().is_empty() && !self.is_last()
    }

    /// The other side of a block transfer computes the CRC.
    pub const fn has_crc(&self) -> bool {
        self.has(block::CRC)
    }

    /// How many bytes the initiate of a block transfer announces.
    pub fn block_data(&self) -> Option<u32> {
        self.has(block::SIZE_TOLD)
            .then_some(u32::from_le_bytes(self.tail()))
    }

    /// What an acknowledgement says: the last segment received in sequence, and
    /// how many the next block is to have.
    pub const fn acknowledged(&self) -> (u8, u8) {
        let [_, sequence, block_size, ..] = self.0;
        (sequence, block_size)
    }

    /// What the end command says of the data.
    pub const fn end(&self) -> End {
        let [head, low, high, ..] = self.0;
        End {
            unused: head >> block::UNUSED_SHIFT & UNUSED_MASK,
            crc: u16::from_le_bytes([low, high]),
        }
    }
}

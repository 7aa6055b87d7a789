//! The commands of the server.

use super::{
    ABORT, Bytes, Initiate, SPECIFIER_SHIFT, Segment, TOGGLE, address, addressed, bare, block,
    block_acknowledge, block_end, block_initiate, crc_bit, tail, toggle_bit,
};
use crate::id::Address;
use crate::sdo::AbortCode;

/// Command specifiers of the server (`scs`).
mod scs {
    pub(super) const UPLOAD_SEGMENT: u8 = 0;
    pub(super) const DOWNLOAD_SEGMENT: u8 = 1;
    pub(super) const UPLOAD: u8 = 2;
    pub(super) const DOWNLOAD: u8 = 3;
    pub(super) const ABORT: u8 = 4;
    pub(super) const BLOCK_DOWNLOAD: u8 = 5;
    pub(super) const BLOCK_UPLOAD: u8 = 6;
}

/// What a server sends to a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Answer {
    /// The download was started or, if expedited, is done
    /// (CiA 301, 7.2.4.3.3).
    Download {
        /// The entry written.
        at: Address,
    },
    /// CiA 301, 7.2.4.3.4.
    DownloadSegment {
        /// That of the segment acknowledged.
        toggle: bool,
    },
    /// CiA 301, 7.2.4.3.6.
    Upload {
        /// The entry read.
        at: Address,
        /// The data or its size.
        data: Initiate,
    },
    /// CiA 301, 7.2.4.3.7.
    UploadSegment(Segment),
    /// CiA 301, 7.2.4.3.9.
    BlockDownload {
        /// The entry to be written.
        at: Address,
        /// The server computes the CRC.
        crc: bool,
        /// Segments per block, 1..=127.
        block_size: u8,
    },
    /// CiA 301, 7.2.4.3.10.
    BlockDownloadAcknowledge {
        /// The last segment received in sequence; 0: resend the whole block.
        sequence: u8,
        /// Segments in the next block.
        block_size: u8,
    },
    /// CiA 301, 7.2.4.3.11.
    BlockDownloadEnd,
    /// CiA 301, 7.2.4.3.13.
    BlockUpload {
        /// The entry read.
        at: Address,
        /// The server computes the CRC.
        crc: bool,
        /// Bytes in all, if told.
        size: Option<u32>,
    },
    /// CiA 301, 7.2.4.3.15.
    BlockUploadEnd {
        /// Unused bytes of the last segment, 0..=7.
        unused: u8,
        /// Over all data, 0 without CRC support.
        crc: u16,
    },
    /// CiA 301, 7.2.4.3.17.
    Abort {
        /// The entry of the transfer.
        at: Address,
        /// Why.
        code: AbortCode,
    },
}

impl Answer {
    /// `None` for a command specifier or sub-command that does not exist.
    pub fn decode(bytes: Bytes) -> Option<Answer> {
        let [command, b1, b2, _, b4, ..] = bytes;
        let at = address(bytes);
        Some(match command >> SPECIFIER_SHIFT {
            scs::UPLOAD_SEGMENT => Answer::UploadSegment(Segment::parse(bytes)),
            scs::DOWNLOAD_SEGMENT => Answer::DownloadSegment {
                toggle: command & TOGGLE != 0,
            },
            scs::UPLOAD => Answer::Upload {
                at,
                data: Initiate::parse(bytes),
            },
            scs::DOWNLOAD => Answer::Download { at },
            scs::ABORT => Answer::Abort {
                at,
                code: AbortCode(tail(bytes)),
            },
            scs::BLOCK_DOWNLOAD => match command & block::SUB_MASK {
                block::INITIATE => Answer::BlockDownload {
                    at,
                    crc: command & block::CRC != 0,
                    block_size: b4,
                },
                block::END => Answer::BlockDownloadEnd,
                block::ACKNOWLEDGE => Answer::BlockDownloadAcknowledge {
                    sequence: b1,
                    block_size: b2,
                },
                _ => return None,
            },
            scs::BLOCK_UPLOAD if command & block::DOWNLOAD_END == 0 => Answer::BlockUpload {
                at,
                crc: command & block::CRC != 0,
                size: (command & block::SIZE_TOLD != 0).then(|| tail(bytes)),
            },
            scs::BLOCK_UPLOAD => Answer::BlockUploadEnd {
                unused: (command >> block::UNUSED_SHIFT) & block::UNUSED_MASK,
                crc: u16::from_le_bytes([b1, b2]),
            },
            _ => return None,
        })
    }

    /// The entry that the command names.
    pub const fn address(&self) -> Option<Address> {
        match *self {
            Answer::Download { at }
            | Answer::Upload { at, .. }
            | Answer::BlockDownload { at, .. }
            | Answer::BlockUpload { at, .. }
            | Answer::Abort { at, .. } => Some(at),
            _ => None,
        }
    }

    /// The eight bytes of the frame.
    pub fn encode(&self) -> Bytes {
        match *self {
            Answer::Download { at } => addressed(scs::DOWNLOAD << SPECIFIER_SHIFT, at, [0; 4]),
            Answer::DownloadSegment { toggle } => {
                bare(scs::DOWNLOAD_SEGMENT << SPECIFIER_SHIFT | toggle_bit(toggle))
            }
            Answer::Upload { at, data } => data.emit(scs::UPLOAD, at),
            Answer::UploadSegment(segment) => segment.emit(scs::UPLOAD_SEGMENT),
            Answer::BlockDownload {
                at,
                crc,
                block_size,
            } => addressed(
                scs::BLOCK_DOWNLOAD << SPECIFIER_SHIFT | crc_bit(crc),
                at,
                [block_size, 0, 0, 0],
            ),
            Answer::BlockDownloadAcknowledge {
                sequence,
                block_size,
            } => block_acknowledge(scs::BLOCK_DOWNLOAD, sequence, block_size),
            Answer::BlockDownloadEnd => bare(scs::BLOCK_DOWNLOAD << SPECIFIER_SHIFT | block::END),
            Answer::BlockUpload { at, crc, size } => {
                block_initiate(scs::BLOCK_UPLOAD, at, crc, size)
            }
            Answer::BlockUploadEnd { unused, crc } => block_end(scs::BLOCK_UPLOAD, unused, crc),
            Answer::Abort { at, code } => addressed(ABORT, at, code.0.to_le_bytes()),
        }
    }
}

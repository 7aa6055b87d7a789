//! The commands of the client.

use super::{
    ABORT, Bytes, Initiate, SPECIFIER_SHIFT, Segment, TOGGLE, address, addressed, bare, block,
    block_acknowledge, block_end, block_initiate, crc_bit, tail, toggle_bit,
};
use crate::id::Address;
use crate::sdo::AbortCode;

/// Command specifiers of the client (`ccs`).
mod ccs {
    pub(super) const DOWNLOAD_SEGMENT: u8 = 0;
    pub(super) const DOWNLOAD: u8 = 1;
    pub(super) const UPLOAD: u8 = 2;
    pub(super) const UPLOAD_SEGMENT: u8 = 3;
    pub(super) const ABORT: u8 = 4;
    pub(super) const BLOCK_UPLOAD: u8 = 5;
    pub(super) const BLOCK_DOWNLOAD: u8 = 6;
}

/// What a client sends to a server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request {
    /// Start of a download (CiA 301, 7.2.4.3.3).
    Download {
        /// The entry to write.
        at: Address,
        /// The data or its size.
        data: Initiate,
    },
    /// CiA 301, 7.2.4.3.4.
    DownloadSegment(Segment),
    /// Start of an upload (CiA 301, 7.2.4.3.6).
    Upload {
        /// The entry to read.
        at: Address,
    },
    /// CiA 301, 7.2.4.3.7.
    UploadSegment {
        /// Alternates, starting with `false`.
        toggle: bool,
    },
    /// CiA 301, 7.2.4.3.9.
    BlockDownload {
        /// The entry to write.
        at: Address,
        /// The client computes the CRC.
        crc: bool,
        /// Bytes in all, if told.
        size: Option<u32>,
    },
    /// CiA 301, 7.2.4.3.11.
    BlockDownloadEnd {
        /// Unused bytes of the last segment, 0..=7.
        unused: u8,
        /// Over all data, 0 without CRC support.
        crc: u16,
    },
    /// CiA 301, 7.2.4.3.13.
    BlockUpload {
        /// The entry to read.
        at: Address,
        /// The client computes the CRC.
        crc: bool,
        /// Segments per block, 1..=127.
        block_size: u8,
        /// Up to this size the server may answer as a normal upload; 0: never.
        protocol_switch: u8,
    },
    /// CiA 301, 7.2.4.3.13.
    BlockUploadStart,
    /// CiA 301, 7.2.4.3.14.
    BlockUploadAcknowledge {
        /// The last segment received in sequence; 0: resend the whole block.
        sequence: u8,
        /// Segments in the next block.
        block_size: u8,
    },
    /// CiA 301, 7.2.4.3.15.
    BlockUploadEnd,
    /// CiA 301, 7.2.4.3.17.
    Abort {
        /// The entry of the transfer.
        at: Address,
        /// Why.
        code: AbortCode,
    },
}

impl Request {
    /// `None` for a command specifier or sub-command that does not exist.
    pub fn decode(bytes: Bytes) -> Option<Request> {
        let [command, b1, b2, _, b4, b5, ..] = bytes;
        let at = address(bytes);
        Some(match command >> SPECIFIER_SHIFT {
            ccs::DOWNLOAD_SEGMENT => Request::DownloadSegment(Segment::parse(bytes)),
            ccs::DOWNLOAD => Request::Download {
                at,
                data: Initiate::parse(bytes),
            },
            ccs::UPLOAD => Request::Upload { at },
            ccs::UPLOAD_SEGMENT => Request::UploadSegment {
                toggle: command & TOGGLE != 0,
            },
            ccs::ABORT => Request::Abort {
                at,
                code: AbortCode(tail(bytes)),
            },
            ccs::BLOCK_UPLOAD => match command & block::SUB_MASK {
                block::INITIATE => Request::BlockUpload {
                    at,
                    crc: command & block::CRC != 0,
                    block_size: b4,
                    protocol_switch: b5,
                },
                block::END => Request::BlockUploadEnd,
                block::ACKNOWLEDGE => Request::BlockUploadAcknowledge {
                    sequence: b1,
                    block_size: b2,
                },
                _ => Request::BlockUploadStart,
            },
            ccs::BLOCK_DOWNLOAD if command & block::DOWNLOAD_END == 0 => Request::BlockDownload {
                at,
                crc: command & block::CRC != 0,
                size: (command & block::SIZE_TOLD != 0).then(|| tail(bytes)),
            },
            ccs::BLOCK_DOWNLOAD => Request::BlockDownloadEnd {
                unused: (command >> block::UNUSED_SHIFT) & block::UNUSED_MASK,
                crc: u16::from_le_bytes([b1, b2]),
            },
            _ => return None,
        })
    }

    /// The entry that the command names: an initiate or an abort does.
    pub const fn address(&self) -> Option<Address> {
        match *self {
            Request::Download { at, .. }
            | Request::Upload { at }
            | Request::BlockDownload { at, .. }
            | Request::BlockUpload { at, .. }
            | Request::Abort { at, .. } => Some(at),
            _ => None,
        }
    }

    /// The eight bytes of the frame.
    pub fn encode(&self) -> Bytes {
        match *self {
            Request::Download { at, data } => data.emit(ccs::DOWNLOAD, at),
            Request::DownloadSegment(segment) => segment.emit(ccs::DOWNLOAD_SEGMENT),
            Request::Upload { at } => addressed(ccs::UPLOAD << SPECIFIER_SHIFT, at, [0; 4]),
            Request::UploadSegment { toggle } => {
                bare(ccs::UPLOAD_SEGMENT << SPECIFIER_SHIFT | toggle_bit(toggle))
            }
            Request::BlockDownload { at, crc, size } => {
                block_initiate(ccs::BLOCK_DOWNLOAD, at, crc, size)
            }
            Request::BlockDownloadEnd { unused, crc } => {
                block_end(ccs::BLOCK_DOWNLOAD, unused, crc)
            }
            Request::BlockUpload {
                at,
                crc,
                block_size,
                protocol_switch,
            } => addressed(
                ccs::BLOCK_UPLOAD << SPECIFIER_SHIFT | crc_bit(crc),
                at,
                [block_size, protocol_switch, 0, 0],
            ),
            Request::BlockUploadStart => bare(ccs::BLOCK_UPLOAD << SPECIFIER_SHIFT | block::START),
            Request::BlockUploadAcknowledge {
                sequence,
                block_size,
            } => block_acknowledge(ccs::BLOCK_UPLOAD, sequence, block_size),
            Request::BlockUploadEnd => bare(ccs::BLOCK_UPLOAD << SPECIFIER_SHIFT | block::END),
            Request::Abort { at, code } => addressed(ABORT, at, code.0.to_le_bytes()),
        }
    }
}

//! SDO answers that are wrong in one way each, for tests of a client
//! (CiA 301, 7.2.4.3).

use canmaster::Frame;

/// What is wrong with a drive's SDO answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoWrong {
    /// The toggle bit of every answer to a segment.
    Toggle,
    /// Every answer that names an object names the next index.
    Object,
    /// The size that the begin of an upload tells is one byte too large.
    Size,
    /// The sequence number of every segment of a block upload, and of every
    /// acknowledgement of a block download, is one too large.
    Sequence,
    /// The checksum at the end of a block upload.
    Crc,
    /// The command specifier of every answer is one that does not exist.
    Command,
    /// A transfer is begun and then left: no answer after the first.
    Cut,
    /// Every answer is one byte short.
    Short,
}

/// A frame of the server, and what it is: segments of a block upload have no
/// command specifier.
#[derive(Clone, Copy, Debug)]
pub(super) struct Answer {
    pub(super) frame: Frame,
    pub(super) block_segment: bool,
}

/// Bits 7..5 of the first byte: the server's command specifier.
const SPECIFIER: u8 = 0xE0;
const UPLOAD_SEGMENT: u8 = 0x00;
const DOWNLOAD_SEGMENT: u8 = 0x20;
const UPLOAD: u8 = 0x40;
const DOWNLOAD: u8 = 0x60;
const BLOCK_DOWNLOAD: u8 = 0xA0;
const BLOCK_UPLOAD: u8 = 0xC0;
/// Within block transfer: begin, end, acknowledgement. Two bits in a download,
/// one in an upload, where bit 1 tells whether there is a size.
const DOWNLOAD_STEP: u8 = 0x03;
const UPLOAD_STEP: u8 = 0x01;
const BEGIN: u8 = 0;
const END: u8 = 1;
const ACKNOWLEDGE: u8 = 2;
/// No specifier has this value.
const NONE: u8 = 0xE0;
/// Toggle bit of a segment.
const TOGGLE: u8 = 0x10;
/// Expedited, in the answer to an upload.
const EXPEDITED: u8 = 0x02;

impl SdoWrong {
    /// The answer as it is sent; `None`: not at all.
    pub(super) fn mangle(self, answer: Answer) -> Option<Frame> {
        let mut bytes = answer.frame.padded();
        let command = bytes[0];
        let specifier = if answer.block_segment {
            NONE
        } else {
            command & SPECIFIER
        };
        let step = if specifier == BLOCK_UPLOAD {
            command & UPLOAD_STEP
        } else {
            command & DOWNLOAD_STEP
        };
        let block = matches!(specifier, BLOCK_DOWNLOAD | BLOCK_UPLOAD);
        let segment = matches!(specifier, UPLOAD_SEGMENT | DOWNLOAD_SEGMENT);
        let begin = matches!(specifier, UPLOAD | DOWNLOAD) || block && step == BEGIN;
        match self {
            SdoWrong::Toggle if segment => bytes[0] ^= TOGGLE,
            SdoWrong::Object if begin => bytes[1] = bytes[1].wrapping_add(1),
            SdoWrong::Size
                if specifier == UPLOAD && command & EXPEDITED == 0
                    || specifier == BLOCK_UPLOAD && step == BEGIN =>
            {
                bytes[4] = bytes[4].wrapping_add(1);
            }
            SdoWrong::Sequence if answer.block_segment => bytes[0] = bytes[0].wrapping_add(1),
            SdoWrong::Sequence if specifier == BLOCK_DOWNLOAD && step == ACKNOWLEDGE => {
                bytes[1] = bytes[1].wrapping_add(1);
            }
            SdoWrong::Crc if specifier == BLOCK_UPLOAD && step == END => bytes[1] ^= 1,
            SdoWrong::Command if !answer.block_segment => bytes[0] |= NONE,
            SdoWrong::Cut if !begin => return None,
            SdoWrong::Short => {
                let (_, short) = bytes.split_last()?;
                return Frame::data_frame(answer.frame.id(), short);
            }
            _ => {}
        }
        Some(Frame::full(answer.frame.id(), bytes))
    }
}

//! Every SDO command byte of CiA 301, 7.2.4.3, both ways.

use canmaster::id::Address;
use canmaster::sdo::AbortCode;
use canmaster::sdo::command::{Answer, BlockSegment, Initiate, Request, Segment};
use proptest::prelude::*;

const AT: Address = Address::new(0x6083, 0x01);

fn expedited(data: &[u8]) -> Initiate {
    Initiate::expedited(data).unwrap()
}

fn segment(toggle: bool, last: bool, data: &[u8]) -> Segment {
    Segment::new(toggle, last, data).unwrap()
}

#[test]
fn requests() {
    let download = |data| Request::Download { at: AT, data };
    let golden: [(Request, [u8; 8]); 23] = [
        (
            download(expedited(&[1, 2, 3, 4])),
            [0x23, 0x83, 0x60, 1, 1, 2, 3, 4],
        ),
        (
            download(expedited(&[1, 2, 3])),
            [0x27, 0x83, 0x60, 1, 1, 2, 3, 0],
        ),
        (
            download(expedited(&[1, 2])),
            [0x2B, 0x83, 0x60, 1, 1, 2, 0, 0],
        ),
        (download(expedited(&[1])), [0x2F, 0x83, 0x60, 1, 1, 0, 0, 0]),
        (
            download(Initiate::Expedited {
                data: [1, 2, 3, 4],
                len: None,
            }),
            [0x22, 0x83, 0x60, 1, 1, 2, 3, 4],
        ),
        (
            download(Initiate::Segmented {
                size: Some(0x0102_0304),
            }),
            [0x21, 0x83, 0x60, 1, 4, 3, 2, 1],
        ),
        (
            download(Initiate::Segmented { size: None }),
            [0x20, 0x83, 0x60, 1, 0, 0, 0, 0],
        ),
        (
            Request::DownloadSegment(segment(false, false, &[1, 2, 3, 4, 5, 6, 7])),
            [0x00, 1, 2, 3, 4, 5, 6, 7],
        ),
        (
            Request::DownloadSegment(segment(true, true, &[9])),
            [0x1D, 9, 0, 0, 0, 0, 0, 0],
        ),
        (
            Request::DownloadSegment(segment(false, true, &[])),
            [0x0F, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            Request::Upload { at: AT },
            [0x40, 0x83, 0x60, 1, 0, 0, 0, 0],
        ),
        (
            Request::UploadSegment { toggle: false },
            [0x60, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            Request::UploadSegment { toggle: true },
            [0x70, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            Request::BlockDownload {
                at: AT,
                crc: true,
                size: Some(100_000),
            },
            [0xC6, 0x83, 0x60, 1, 0xA0, 0x86, 0x01, 0],
        ),
        (
            Request::BlockDownload {
                at: AT,
                crc: false,
                size: None,
            },
            [0xC0, 0x83, 0x60, 1, 0, 0, 0, 0],
        ),
        (
            Request::BlockDownloadEnd {
                unused: 5,
                crc: 0x31C3,
            },
            [0xD5, 0xC3, 0x31, 0, 0, 0, 0, 0],
        ),
        (
            Request::BlockDownloadEnd { unused: 0, crc: 0 },
            [0xC1, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            Request::BlockUpload {
                at: AT,
                crc: true,
                block_size: 127,
                protocol_switch: 21,
            },
            [0xA4, 0x83, 0x60, 1, 127, 21, 0, 0],
        ),
        (
            Request::BlockUpload {
                at: AT,
                crc: false,
                block_size: 1,
                protocol_switch: 0,
            },
            [0xA0, 0x83, 0x60, 1, 1, 0, 0, 0],
        ),
        (Request::BlockUploadStart, [0xA3, 0, 0, 0, 0, 0, 0, 0]),
        (
            Request::BlockUploadAcknowledge {
                sequence: 3,
                block_size: 127,
            },
            [0xA2, 3, 127, 0, 0, 0, 0, 0],
        ),
        (Request::BlockUploadEnd, [0xA1, 0, 0, 0, 0, 0, 0, 0]),
        (
            Request::Abort {
                at: AT,
                code: AbortCode::TIMEOUT,
            },
            [0x80, 0x83, 0x60, 1, 0x00, 0x00, 0x04, 0x05],
        ),
    ];
    for (request, bytes) in golden {
        assert_eq!(request.encode(), bytes, "{request:?}");
        assert_eq!(Request::decode(bytes), Some(request));
    }
}

#[test]
fn answers() {
    let upload = |data| Answer::Upload { at: AT, data };
    let golden: [(Answer, [u8; 8]); 18] = [
        (
            Answer::Download { at: AT },
            [0x60, 0x83, 0x60, 1, 0, 0, 0, 0],
        ),
        (
            Answer::DownloadSegment { toggle: false },
            [0x20, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            Answer::DownloadSegment { toggle: true },
            [0x30, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            upload(expedited(&[1, 2, 3, 4])),
            [0x43, 0x83, 0x60, 1, 1, 2, 3, 4],
        ),
        (
            upload(expedited(&[1, 2, 3])),
            [0x47, 0x83, 0x60, 1, 1, 2, 3, 0],
        ),
        (
            upload(expedited(&[1, 2])),
            [0x4B, 0x83, 0x60, 1, 1, 2, 0, 0],
        ),
        (upload(expedited(&[1])), [0x4F, 0x83, 0x60, 1, 1, 0, 0, 0]),
        (
            upload(Initiate::Expedited {
                data: [1, 2, 3, 4],
                len: None,
            }),
            [0x42, 0x83, 0x60, 1, 1, 2, 3, 4],
        ),
        (
            upload(Initiate::Segmented { size: Some(5) }),
            [0x41, 0x83, 0x60, 1, 5, 0, 0, 0],
        ),
        (
            Answer::UploadSegment(segment(false, true, b"EPOS4")),
            [0x05, b'E', b'P', b'O', b'S', b'4', 0, 0],
        ),
        (
            Answer::UploadSegment(segment(true, false, b"abcdefg")),
            [0x10, b'a', b'b', b'c', b'd', b'e', b'f', b'g'],
        ),
        (
            Answer::BlockDownload {
                at: AT,
                crc: true,
                block_size: 127,
            },
            [0xA4, 0x83, 0x60, 1, 127, 0, 0, 0],
        ),
        (
            Answer::BlockDownloadAcknowledge {
                sequence: 127,
                block_size: 64,
            },
            [0xA2, 127, 64, 0, 0, 0, 0, 0],
        ),
        (Answer::BlockDownloadEnd, [0xA1, 0, 0, 0, 0, 0, 0, 0]),
        (
            Answer::BlockUpload {
                at: AT,
                crc: true,
                size: Some(9),
            },
            [0xC6, 0x83, 0x60, 1, 9, 0, 0, 0],
        ),
        (
            Answer::BlockUpload {
                at: AT,
                crc: false,
                size: None,
            },
            [0xC0, 0x83, 0x60, 1, 0, 0, 0, 0],
        ),
        (
            Answer::BlockUploadEnd {
                unused: 7,
                crc: 0x1234,
            },
            [0xDD, 0x34, 0x12, 0, 0, 0, 0, 0],
        ),
        (
            Answer::Abort {
                at: AT,
                code: AbortCode(0xDEAD_BEEF),
            },
            [0x80, 0x83, 0x60, 1, 0xEF, 0xBE, 0xAD, 0xDE],
        ),
    ];
    for (answer, bytes) in golden {
        assert_eq!(answer.encode(), bytes, "{answer:?}");
        assert_eq!(Answer::decode(bytes), Some(answer));
    }
}

#[test]
fn what_does_not_exist_is_not_decoded() {
    assert_eq!(Request::decode([0xE0, 0, 0, 0, 0, 0, 0, 0]), None);
    assert_eq!(Answer::decode([0xE0, 0, 0, 0, 0, 0, 0, 0]), None);
    assert_eq!(Answer::decode([0xA3, 0, 0, 0, 0, 0, 0, 0]), None);
    assert_eq!(Initiate::expedited(&[]), None);
    assert_eq!(Initiate::expedited(&[0; 5]), None);
    assert_eq!(Segment::new(false, false, &[0; 8]), None);
}

#[test]
fn a_block_segment_has_a_number_instead_of_a_command() {
    let last = BlockSegment {
        last: true,
        sequence: 3,
        data: *b"1234567",
    };
    assert_eq!(last.encode(), *b"\x831234567");
    assert_eq!(BlockSegment::decode(*b"\x831234567"), Some(last));
    // 0x80 is an abort, 0x00 nothing at all.
    assert_eq!(BlockSegment::decode([0x80; 8]), None);
    assert_eq!(BlockSegment::decode([0x00; 8]), None);
}

proptest! {
    #[test]
    fn what_is_decoded_is_encoded_to_the_same_meaning(bytes: [u8; 8]) {
        if let Some(request) = Request::decode(bytes) {
            prop_assert_eq!(Request::decode(request.encode()), Some(request));
        }
        if let Some(answer) = Answer::decode(bytes) {
            prop_assert_eq!(Answer::decode(answer.encode()), Some(answer));
        }
        if let Some(segment) = BlockSegment::decode(bytes) {
            prop_assert_eq!(segment.encode(), bytes);
        }
    }
}

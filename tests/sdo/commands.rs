//! Every SDO command byte of CiA 301, 7.2.4.3, both ways.

use canmaster::id::Address;
use canmaster::sdo::AbortCode;
use canmaster::sdo::command::{Answer, Command, End, Request};
use proptest::prelude::*;

const AT: Address = Address::new(0x6083, 0x01);

fn plain(code: u8) -> Command {
    Command::addressed(code, AT, [0; 4])
}

fn expedited(code: u8, data: &[u8]) -> Command {
    Command::expedited(code, AT, data).unwrap()
}

fn segment(code: u8, toggle: bool, last: bool, data: &[u8]) -> Command {
    let mut segment = Command::bare(code, toggle);
    segment.space()[..data.len()].copy_from_slice(data);
    segment.close(data.len(), last);
    segment
}

#[test]
fn requests() {
    let download = Request::Download;
    let pieces = Request::DownloadSegment;
    let golden: [(Request, Command, [u8; 8]); 20] = [
        (
            download,
            expedited(download.code(), &[1, 2, 3, 4]),
            [0x23, 0x83, 0x60, 1, 1, 2, 3, 4],
        ),
        (
            download,
            expedited(download.code(), &[1, 2, 3]),
            [0x27, 0x83, 0x60, 1, 1, 2, 3, 0],
        ),
        (
            download,
            expedited(download.code(), &[1, 2]),
            [0x2B, 0x83, 0x60, 1, 1, 2, 0, 0],
        ),
        (
            download,
            expedited(download.code(), &[1]),
            [0x2F, 0x83, 0x60, 1, 1, 0, 0, 0],
        ),
        (
            download,
            Command::segmented(download.code(), AT, Some(0x0102_0304)),
            [0x21, 0x83, 0x60, 1, 4, 3, 2, 1],
        ),
        (
            download,
            Command::segmented(download.code(), AT, None),
            [0x20, 0x83, 0x60, 1, 0, 0, 0, 0],
        ),
        (
            pieces,
            segment(pieces.code(), false, false, &[1, 2, 3, 4, 5, 6, 7]),
            [0x00, 1, 2, 3, 4, 5, 6, 7],
        ),
        (
            pieces,
            segment(pieces.code(), true, true, &[9]),
            [0x1D, 9, 0, 0, 0, 0, 0, 0],
        ),
        (
            pieces,
            segment(pieces.code(), false, true, &[]),
            [0x0F, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            Request::Upload,
            plain(Request::Upload.code()),
            [0x40, 0x83, 0x60, 1, 0, 0, 0, 0],
        ),
        (
            Request::UploadSegment,
            Command::bare(Request::UploadSegment.code(), false),
            [0x60, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            Request::UploadSegment,
            Command::bare(Request::UploadSegment.code(), true),
            [0x70, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            Request::BlockDownload,
            Command::block_of(Request::BlockDownload.code(), AT, Some(100_000)),
            [0xC6, 0x83, 0x60, 1, 0xA0, 0x86, 0x01, 0],
        ),
        (
            Request::BlockDownloadEnd,
            Command::block_end(
                Request::BlockDownloadEnd.code(),
                End {
                    unused: 5,
                    crc: 0x31C3,
                },
            ),
            [0xD5, 0xC3, 0x31, 0, 0, 0, 0, 0],
        ),
        (
            Request::BlockDownloadEnd,
            Command::block_end(Request::BlockDownloadEnd.code(), End { unused: 0, crc: 0 }),
            [0xC1, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            Request::BlockUpload,
            Command::block_for(Request::BlockUpload.code(), AT, 127),
            [0xA4, 0x83, 0x60, 1, 127, 0, 0, 0],
        ),
        (
            Request::BlockUploadStart,
            Command::bare(Request::BlockUploadStart.code(), false),
            [0xA3, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            Request::BlockUploadAcknowledge,
            Command::acknowledge(Request::BlockUploadAcknowledge.code(), 3, 127),
            [0xA2, 3, 127, 0, 0, 0, 0, 0],
        ),
        (
            Request::BlockUploadEnd,
            Command::bare(Request::BlockUploadEnd.code(), false),
            [0xA1, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            Request::Abort,
            Command::abort(AT, AbortCode::TIMEOUT),
            [0x80, 0x83, 0x60, 1, 0x00, 0x00, 0x04, 0x05],
        ),
    ];
    for (request, command, bytes) in golden {
        assert_eq!(command.0, bytes, "{request:?}");
        assert_eq!(command.request(), Some(request));
        assert!(!request.is_addressed() || command.address() == AT);
    }
}

#[test]
fn answers() {
    let upload = Answer::Upload;
    let pieces = Answer::UploadSegment;
    let golden: [(Answer, Command, [u8; 8]); 16] = [
        (
            Answer::Download,
            plain(Answer::Download.code()),
            [0x60, 0x83, 0x60, 1, 0, 0, 0, 0],
        ),
        (
            Answer::DownloadSegment,
            Command::bare(Answer::DownloadSegment.code(), false),
            [0x20, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            Answer::DownloadSegment,
            Command::bare(Answer::DownloadSegment.code(), true),
            [0x30, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            upload,
            expedited(upload.code(), &[1, 2, 3, 4]),
            [0x43, 0x83, 0x60, 1, 1, 2, 3, 4],
        ),
        (
            upload,
            expedited(upload.code(), &[1, 2, 3]),
            [0x47, 0x83, 0x60, 1, 1, 2, 3, 0],
        ),
        (
            upload,
            expedited(upload.code(), &[1, 2]),
            [0x4B, 0x83, 0x60, 1, 1, 2, 0, 0],
        ),
        (
            upload,
            expedited(upload.code(), &[1]),
            [0x4F, 0x83, 0x60, 1, 1, 0, 0, 0],
        ),
        (
            upload,
            Command::segmented(upload.code(), AT, Some(5)),
            [0x41, 0x83, 0x60, 1, 5, 0, 0, 0],
        ),
        (
            pieces,
            segment(pieces.code(), false, true, b"EPOS4"),
            [0x05, b'E', b'P', b'O', b'S', b'4', 0, 0],
        ),
        (
            pieces,
            segment(pieces.code(), true, false, b"abcdefg"),
            [0x10, b'a', b'b', b'c', b'd', b'e', b'f', b'g'],
        ),
        (
            Answer::BlockDownload,
            Command::block_for(Answer::BlockDownload.code(), AT, 127),
            [0xA4, 0x83, 0x60, 1, 127, 0, 0, 0],
        ),
        (
            Answer::BlockDownloadAcknowledge,
            Command::acknowledge(Answer::BlockDownloadAcknowledge.code(), 127, 64),
            [0xA2, 127, 64, 0, 0, 0, 0, 0],
        ),
        (
            Answer::BlockDownloadEnd,
            Command::bare(Answer::BlockDownloadEnd.code(), false),
            [0xA1, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            Answer::BlockUpload,
            Command::block_of(Answer::BlockUpload.code(), AT, Some(9)),
            [0xC6, 0x83, 0x60, 1, 9, 0, 0, 0],
        ),
        (
            Answer::BlockUploadEnd,
            Command::block_end(
                Answer::BlockUploadEnd.code(),
                End {
                    unused: 7,
                    crc: 0x1234,
                },
            ),
            [0xDD, 0x34, 0x12, 0, 0, 0, 0, 0],
        ),
        (
            Answer::Abort,
            Command::abort(AT, AbortCode(0xDEAD_BEEF)),
            [0x80, 0x83, 0x60, 1, 0xEF, 0xBE, 0xAD, 0xDE],
        ),
    ];
    for (answer, command, bytes) in golden {
        assert_eq!(command.0, bytes, "{answer:?}");
        assert_eq!(command.answer(), Some(answer));
        assert!(!answer.is_addressed() || command.address() == AT);
    }
}

#[test]
fn what_an_initiate_says_of_the_data() {
    let initiate = |head| Command([head, 0x83, 0x60, 1, 4, 3, 2, 1]);
    let golden: [(u8, bool, Option<u32>); 7] = [
        (0x23, true, Some(4)),
        (0x27, true, Some(3)),
        (0x2B, true, Some(2)),
        (0x2F, true, Some(1)),
        (0x22, true, None),
        (0x21, false, Some(0x0102_0304)),
        (0x20, false, None),
    ];
    for (head, is_expedited, size) in golden {
        // An upload answers with the same bits.
        for command in [initiate(head), initiate(head ^ 0x60)] {
            assert_eq!(command.is_expedited(), is_expedited, "{head:02X}h");
            assert_eq!(command.size(), size, "{head:02X}h");
            assert_eq!(command.tail(), [4, 3, 2, 1]);
        }
    }
}

#[test]
fn what_a_segment_says() {
    let bytes = |head| Command([head, 1, 2, 3, 4, 5, 6, 7]);
    assert_eq!(bytes(0x00).data(), [1, 2, 3, 4, 5, 6, 7]);
    assert_eq!(bytes(0x1D).data(), [1]);
    assert_eq!(bytes(0x0F).data(), []);
    for (head, toggle, last) in [
        (0x00, false, false),
        (0x10, true, false),
        (0x01, false, true),
        (0x11, true, true),
    ] {
        assert_eq!(bytes(head).toggle(), toggle);
        assert_eq!(bytes(head).is_last(), last);
    }
}

#[test]
fn what_the_commands_of_a_block_transfer_say() {
    let begun = |head| Command([head, 0x83, 0x60, 1, 0xA0, 0x86, 0x01, 0]);
    assert_eq!(begun(0xC6).block_data(), Some(100_000));
    assert!(begun(0xC6).has_crc());
    assert_eq!(begun(0xC0).block_data(), None);
    assert!(!begun(0xC0).has_crc());
    assert!(!begun(0xA0).has_crc());
    let acknowledge = Command([0xA2, 3, 127, 0, 0, 0, 0, 0]);
    assert_eq!(acknowledge.acknowledged(), (3, 127));
    let end = End {
        unused: 7,
        crc: 0x1234,
    };
    assert_eq!(Command([0xDD, 0x34, 0x12, 0, 0, 0, 0, 0]).end(), end);
    let abort = Command([0x80, 0x83, 0x60, 1, 0xEF, 0xBE, 0xAD, 0xDE]);
    assert_eq!(abort.abort_code(), AbortCode(0xDEAD_BEEF));
}

#[test]
fn what_does_not_exist_is_no_command() {
    assert_eq!(Command([0xE0, 0, 0, 0, 0, 0, 0, 0]).request(), None);
    assert_eq!(Command([0xE0, 0, 0, 0, 0, 0, 0, 0]).answer(), None);
    assert_eq!(Command([0xA3, 0, 0, 0, 0, 0, 0, 0]).answer(), None);
    assert_eq!(Command::expedited(0x20, AT, &[]), None);
    assert_eq!(Command::expedited(0x20, AT, &[0; 5]), None);
}

#[test]
fn a_block_segment_has_a_number_instead_of_a_command() {
    let mut last = Command([0; 8]);
    *last.space() = *b"1234567";
    last.number(3, true);
    assert_eq!(last, Command(*b"\x831234567"));
    assert_eq!((last.sequence(), last.is_last_of_all()), (3, true));
    assert_eq!(last.bytes(), b"1234567");
    last.number(127, false);
    assert_eq!(last, Command(*b"\x7F1234567"));
    assert_eq!((last.sequence(), last.is_last_of_all()), (127, false));
    // 0x80 is an abort, 0x00 nothing at all.
    assert_eq!(Command([0x80; 8]).sequence(), 0);
    assert_eq!(Command([0x00; 8]).sequence(), 0);
}

proptest! {
    #[test]
    fn every_flag_leaves_the_command_what_it_is(bytes: [u8; 8]) {
        let [head, ..] = bytes;
        let (request, answer) = (Command(bytes).request(), Command(bytes).answer());
        if let Some(request) = request {
            prop_assert_eq!(request.code() & !head, 0);
            prop_assert_eq!(Command::bare(request.code(), false).request(), Some(request));
        }
        if let Some(answer) = answer {
            prop_assert_eq!(answer.code() & !head, 0);
            prop_assert_eq!(Command::bare(answer.code(), false).answer(), Some(answer));
        }
        prop_assert_eq!(request.is_none(), head >> 5 == 7);
    }

    #[test]
    fn what_is_put_together_says_the_same(
        toggle: bool, last: bool, data in prop::collection::vec(any::<u8>(), 0..=7), size: Option<u32>
    ) {
        let piece = segment(0x00, toggle, last, &data);
        prop_assert_eq!(piece.data(), &data[..]);
        prop_assert_eq!((piece.toggle(), piece.is_last()), (toggle, last));
        prop_assert_eq!(Command::segmented(0x20, AT, size).size(), size);
        prop_assert_eq!(Command::block_of(0xC0, AT, size).block_data(), size);
        if let Some(whole) = Command::expedited(0x20, AT, &data) {
            prop_assert_eq!(whole.size(), Some(data.len() as u32));
            prop_assert_eq!(&whole.tail()[..data.len()], &data[..]);
        }
    }

    #[test]
    fn a_block_segment_survives_a_round_trip(bytes: [u8; 8]) {
        let read = Command(bytes);
        let mut made = Command([0; 8]);
        *made.space() = *read.bytes();
        made.number(read.sequence(), read.is_last_of_all());
        prop_assert_eq!(made, read);
    }
}

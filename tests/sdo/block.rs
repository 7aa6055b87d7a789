//! Block transfers: golden conversations, losses, lies
//! (CiA 301, 7.2.4.3.8 .. 7.2.4.3.16).

use crate::common::{DOMAIN, Dictionary, Memory, NODE, TIMEOUT, ms, request, response};
use canmaster::Instant;
use canmaster::sdo::{AbortCode, Channel, Crc16, Progress, Protocol, SdoError, Server, Transfer};

fn abort(at: [u8; 3], code: AbortCode) -> [u8; 8] {
    let [a, b, c, d] = code.0.to_le_bytes();
    [0x80, at[0], at[1], at[2], a, b, c, d]
}

const AT: [u8; 3] = [0x22, 0x1F, 1];

struct Bench {
    server: Server,
    od: Dictionary,
}

impl Bench {
    fn new() -> Bench {
        Bench {
            server: Server::new(NODE, TIMEOUT),
            od: Dictionary::new(),
        }
    }

    fn ask(&mut self, bytes: [u8; 8]) -> Option<[u8; 8]> {
        let answer = self.server.on_frame(&request(bytes), ms(0), &mut self.od);
        answer.map(|frame| frame.padded())
    }

    fn expect(&mut self, bytes: [u8; 8], answer: [u8; 8]) {
        assert_eq!(self.ask(bytes), Some(answer), "to {bytes:02X?}");
    }

    fn segment(&mut self, now: Instant) -> Option<[u8; 8]> {
        self.server.poll(now, &mut self.od).map(|f| f.padded())
    }
}

#[test]
fn download() {
    let mut b = Bench::new();
    b.expect(
        [0xC6, 0x22, 0x1F, 1, 9, 0, 0, 0],
        [0xA4, 0x22, 0x1F, 1, 127, 0, 0, 0],
    );
    assert_eq!(b.ask(*b"\x011234567"), None);
    b.expect(*b"\x8289\0\0\0\0\0", [0xA2, 2, 127, 0, 0, 0, 0, 0]);
    assert_eq!(b.od.domain, b"");
    b.expect(
        [0xD5, 0xC3, 0x31, 0, 0, 0, 0, 0],
        [0xA1, 0, 0, 0, 0, 0, 0, 0],
    );
    assert_eq!(b.od.domain, b"123456789");
    assert!(b.server.is_idle());
}

#[test]
fn upload() {
    let mut b = Bench::new();
    b.od.domain = b"123456789".to_vec();
    b.expect(
        [0xA4, 0x22, 0x1F, 1, 127, 0, 0, 0],
        [0xC6, 0x22, 0x1F, 1, 9, 0, 0, 0],
    );
    assert_eq!(b.segment(ms(0)), None);
    assert_eq!(b.ask([0xA3, 0, 0, 0, 0, 0, 0, 0]), None);
    assert_eq!(b.server.next_deadline(), Some(ms(0)));
    assert_eq!(b.segment(ms(0)), Some(*b"\x011234567"));
    assert_eq!(b.segment(ms(0)), Some(*b"\x8289\0\0\0\0\0"));
    assert_eq!(b.segment(ms(0)), None);
    b.expect(
        [0xA2, 2, 127, 0, 0, 0, 0, 0],
        [0xD5, 0xC3, 0x31, 0, 0, 0, 0, 0],
    );
    assert_eq!(b.ask([0xA1, 0, 0, 0, 0, 0, 0, 0]), None);
    assert!(b.server.is_idle());
}

#[test]
fn a_small_object_may_be_answered_as_a_normal_upload() {
    let mut b = Bench::new();
    b.od.domain = b"123456789".to_vec();
    b.expect(
        [0xA4, 0x22, 0x1F, 1, 127, 9, 0, 0],
        [0x41, 0x22, 0x1F, 1, 9, 0, 0, 0],
    );
    b.expect(
        [0xA4, 0, 0x10, 0, 127, 4, 0, 0],
        [0x43, 0, 0x10, 0, 0x92, 1, 2, 0],
    );
    b.expect(
        [0xA4, 0, 0x10, 0, 127, 3, 0, 0],
        [0xC6, 0, 0x10, 0, 4, 0, 0, 0],
    );
}

#[test]
fn a_gap_is_repeated_from_the_last_segment_in_sequence() {
    let mut b = Bench::new();
    b.server = Server::new(NODE, TIMEOUT).with_block_size(3);
    b.expect(
        [0xC6, 0x22, 0x1F, 1, 21, 0, 0, 0],
        [0xA4, 0x22, 0x1F, 1, 3, 0, 0, 0],
    );
    b.ask(*b"\x01abcdefg");
    b.expect(*b"\x83opqrstu", [0xA2, 1, 3, 0, 0, 0, 0, 0]);
    b.ask(*b"\x01hijklmn");
    b.expect(*b"\x82opqrstu", [0xA2, 2, 3, 0, 0, 0, 0, 0]);
    let crc = Crc16::new()
        .update(b"abcdefghijklmnopqrstu")
        .get()
        .to_le_bytes();
    b.expect(
        [0xC1, crc[0], crc[1], 0, 0, 0, 0, 0],
        [0xA1, 0, 0, 0, 0, 0, 0, 0],
    );
    assert_eq!(b.od.domain, b"abcdefghijklmnopqrstu");
}

#[test]
fn a_lost_end_of_block_is_asked_for_once() {
    let mut b = Bench::new();
    b.ask([0xC6, 0x22, 0x1F, 1, 21, 0, 0, 0]);
    b.ask(*b"\x01abcdefg");
    assert_eq!(b.server.next_deadline(), Some(ms(250)));
    assert_eq!(b.segment(ms(250)), Some([0xA2, 1, 127, 0, 0, 0, 0, 0]));
    assert_eq!(b.segment(ms(499)), None);
    assert_eq!(b.segment(ms(500)), Some(abort(AT, AbortCode::TIMEOUT)));
    assert_eq!(b.od.cancelled, 1);
}

#[test]
fn a_wrong_checksum_aborts() {
    let mut b = Bench::new();
    b.ask([0xC6, 0x22, 0x1F, 1, 9, 0, 0, 0]);
    b.ask(*b"\x011234567");
    b.ask(*b"\x8289\0\0\0\0\0");
    b.expect([0xD5, 0xC4, 0x31, 0, 0, 0, 0, 0], abort(AT, AbortCode::CRC));
    assert_eq!((b.od.domain.len(), b.od.cancelled), (0, 1));
    // A client without checksum sends 0.
    b.ask([0xC2, 0x22, 0x1F, 1, 9, 0, 0, 0]);
    b.ask(*b"\x011234567");
    b.ask(*b"\x8289\0\0\0\0\0");
    b.expect([0xD5, 0, 0, 0, 0, 0, 0, 0], [0xA1, 0, 0, 0, 0, 0, 0, 0]);
}

#[test]
fn what_the_server_refuses() {
    let mut b = Bench::new();
    // Block sizes.
    for size in [0, 128, 255] {
        b.expect(
            [0xA4, 0x22, 0x1F, 1, size, 0, 0, 0],
            abort(AT, AbortCode::BLOCK_SIZE),
        );
    }
    // Sizes that lie.
    b.ask([0xC6, 0x22, 0x1F, 1, 8, 0, 0, 0]);
    b.ask(*b"\x811234567");
    b.expect([0xC1, 0, 0, 0, 0, 0, 0, 0], abort(AT, AbortCode::CRC));
    b.ask([0xC2, 0x22, 0x1F, 1, 8, 0, 0, 0]);
    b.ask(*b"\x811234567");
    b.expect([0xC1, 0, 0, 0, 0, 0, 0, 0], abort(AT, AbortCode::TOO_SHORT));
    b.ask([0xC2, 0x22, 0x1F, 1, 6, 0, 0, 0]);
    b.ask(*b"\x811234567");
    b.expect([0xC1, 0, 0, 0, 0, 0, 0, 0], abort(AT, AbortCode::TOO_LONG));
    // A sequence number of 0, an end too early, an acknowledgement too many.
    b.ask([0xC6, 0x22, 0x1F, 1, 9, 0, 0, 0]);
    assert_eq!(b.ask([0; 8]), None);
    b.expect(*b"\x811234567", abort(AT, AbortCode::SEQUENCE_NUMBER));
    b.expect(
        [0xC1, 0, 0, 0, 0, 0, 0, 0],
        abort([0; 3], AbortCode::COMMAND),
    );
    b.od.domain = b"123456789".to_vec();
    b.ask([0xA4, 0x22, 0x1F, 1, 127, 0, 0, 0]);
    b.expect([0xA2, 1, 127, 0, 0, 0, 0, 0], abort(AT, AbortCode::COMMAND));
    b.ask([0xA4, 0x22, 0x1F, 1, 127, 0, 0, 0]);
    b.ask([0xA3, 0, 0, 0, 0, 0, 0, 0]);
    b.segment(ms(0));
    b.expect(
        [0xA2, 2, 127, 0, 0, 0, 0, 0],
        abort(AT, AbortCode::SEQUENCE_NUMBER),
    );
    // The entry is checked before anything is transferred.
    b.expect(
        [0xC6, 0, 0x10, 0, 4, 0, 0, 0],
        abort([0, 0x10, 0], AbortCode::READ_ONLY),
    );
    b.expect(
        [0xC6, 0x17, 0x10, 0, 4, 0, 0, 0],
        abort([0x17, 0x10, 0], AbortCode::TOO_LONG),
    );
    // An abort in the middle of a block.
    b.ask([0xC6, 0x22, 0x1F, 1, 9, 0, 0, 0]);
    assert_eq!(b.ask(abort(AT, AbortCode::GENERAL)), None);
    assert!(b.server.is_idle());
}

#[test]
fn a_refusal_waits_for_the_end_of_the_block_so_that_no_segment_is_taken_for_a_command() {
    let at = [0x17, 0x10, 0];
    let open = |b: &mut Bench| {
        b.expect(
            [0xC4, 0x17, 0x10, 0, 0, 0, 0, 0],
            [0xA4, 0x17, 0x10, 0, 127, 0, 0, 0],
        );
    };
    let mut b = Bench::new();
    open(&mut b);
    for sequence in 1..127 {
        // The segment 2Fh would write 5 to 6060h.
        assert_eq!(b.ask([sequence, 0x60, 0x60, 0, 5, 0, 0, 0]), None);
    }
    let last = [127, 0x60, 0x60, 0, 5, 0, 0, 0];
    b.expect(last, abort(at, AbortCode::TOO_LONG));
    assert!(b.server.is_idle());
    assert_eq!(b.od.values.number(0x6060, 0), 1);
    // The rest does not come.
    open(&mut b);
    for sequence in 1..=3 {
        assert_eq!(b.ask([sequence, 0, 0, 0, 0, 0, 0, 0]), None);
    }
    assert_eq!(b.segment(ms(250)), Some(abort(at, AbortCode::TOO_LONG)));
    assert!(b.server.is_idle());
}

#[test]
fn a_server_without_block_transfer() {
    let mut b = Bench::new();
    b.server = Server::new(NODE, TIMEOUT).with_block_size(0);
    b.expect(
        [0xC6, 0x22, 0x1F, 1, 9, 0, 0, 0],
        abort(AT, AbortCode::COMMAND),
    );
    b.expect(
        [0xA4, 0x22, 0x1F, 1, 127, 0, 0, 0],
        abort(AT, AbortCode::COMMAND),
    );
}

#[test]
fn a_sender_that_is_never_understood_gives_up() {
    let mut b = Bench::new();
    b.od.domain = vec![7; 100];
    b.ask([0xA4, 0x22, 0x1F, 1, 2, 0, 0, 0]);
    b.ask([0xA3, 0, 0, 0, 0, 0, 0, 0]);
    for _ in 0..3 {
        while b.segment(ms(0)).is_some() {}
        assert_eq!(b.ask([0xA2, 0, 2, 0, 0, 0, 0, 0]), None);
    }
    while b.segment(ms(0)).is_some() {}
    let code = AbortCode::SEQUENCE_NUMBER;
    b.expect([0xA2, 0, 2, 0, 0, 0, 0, 0], abort(AT, code));
}

#[test]
fn the_client_downloads() {
    let (mut c, mut m) = (Channel::new(NODE, TIMEOUT), Memory::of(b"123456789"));
    let first = c
        .download(DOMAIN, 9, Protocol::Block, &mut m, ms(0))
        .unwrap();
    assert_eq!(first, request([0xC6, 0x22, 0x1F, 1, 9, 0, 0, 0]));
    let answer = response([0xA4, 0x22, 0x1F, 1, 1, 0, 0, 0]);
    assert_eq!(c.on_frame(&answer, ms(1), &mut m), Progress::Nothing);
    assert_eq!(c.next_deadline(), Some(ms(1)));
    assert_eq!(
        c.poll(ms(1), &mut m),
        Progress::Send(request(*b"\x011234567"))
    );
    assert_eq!(c.poll(ms(1), &mut m), Progress::Nothing);
    let again = response([0xA2, 0, 2, 0, 0, 0, 0, 0]);
    assert_eq!(c.on_frame(&again, ms(1), &mut m), Progress::Nothing);
    assert_eq!(
        c.poll(ms(1), &mut m),
        Progress::Send(request(*b"\x011234567"))
    );
    assert_eq!(
        c.poll(ms(1), &mut m),
        Progress::Send(request(*b"\x8289\0\0\0\0\0"))
    );
    let all = response([0xA2, 2, 2, 0, 0, 0, 0, 0]);
    let end = request([0xD5, 0xC3, 0x31, 0, 0, 0, 0, 0]);
    assert_eq!(c.on_frame(&all, ms(2), &mut m), Progress::Send(end));
    let done = Progress::Done(Transfer { at: DOMAIN, len: 9 });
    assert_eq!(
        c.on_frame(&response([0xA1, 0, 0, 0, 0, 0, 0, 0]), ms(3), &mut m),
        done
    );
}

#[test]
fn the_client_uploads() {
    let (mut c, mut m) = (Channel::new(NODE, TIMEOUT), Memory::default());
    let first = c.upload(DOMAIN, Protocol::Block, ms(0)).unwrap();
    assert_eq!(first, request([0xA4, 0x22, 0x1F, 1, 127, 0, 0, 0]));
    let answer = response([0xC6, 0x22, 0x1F, 1, 9, 0, 0, 0]);
    let start = request([0xA3, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(c.on_frame(&answer, ms(1), &mut m), Progress::Send(start));
    assert_eq!(
        c.on_frame(&response(*b"\x011234567"), ms(1), &mut m),
        Progress::Nothing
    );
    let acknowledge = request([0xA2, 2, 127, 0, 0, 0, 0, 0]);
    assert_eq!(
        c.on_frame(&response(*b"\x8289\0\0\0\0\0"), ms(1), &mut m),
        Progress::Send(acknowledge)
    );
    let end = response([0xD5, 0xC3, 0x31, 0, 0, 0, 0, 0]);
    let thanks = request([0xA1, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(c.on_frame(&end, ms(2), &mut m), Progress::Send(thanks));
    assert_eq!(
        c.poll(ms(2), &mut m),
        Progress::Done(Transfer { at: DOMAIN, len: 9 })
    );
    assert_eq!(m.data, b"123456789");
    assert!(c.is_ready(ms(2)));
}

#[test]
fn the_client_falls_back_and_remembers() {
    let (mut c, mut m) = (Channel::new(NODE, TIMEOUT), Memory::of(b"123456789"));
    let refusal = response(abort(AT, AbortCode::COMMAND));
    c.download(DOMAIN, 9, Protocol::Block, &mut m, ms(0))
        .unwrap();
    let segmented = request([0x21, 0x22, 0x1F, 1, 9, 0, 0, 0]);
    assert_eq!(
        c.on_frame(&refusal, ms(1), &mut m),
        Progress::Send(segmented)
    );
    // Refused again it is refused.
    let error = SdoError::Aborted {
        at: DOMAIN,
        code: AbortCode::COMMAND,
    };
    assert_eq!(
        c.on_frame(&refusal, ms(1), &mut m),
        Progress::Failed(error, None)
    );
    let upload = c.upload(DOMAIN, Protocol::Block, ms(2)).unwrap();
    assert_eq!(upload, request([0x40, 0x22, 0x1F, 1, 0, 0, 0, 0]));
    c.reset();
    let upload = c.upload(DOMAIN, Protocol::Block, ms(2)).unwrap();
    assert_eq!(upload.padded()[0], 0xA4);
    let normal = request([0x40, 0x22, 0x1F, 1, 0, 0, 0, 0]);
    assert_eq!(c.on_frame(&refusal, ms(3), &mut m), Progress::Send(normal));
}

#[test]
fn what_the_client_refuses() {
    let started = |limit| {
        let (mut c, mut m) = (Channel::new(NODE, TIMEOUT), Memory::default());
        m.limit = limit;
        c.upload(DOMAIN, Protocol::Block, ms(0)).unwrap();
        (c, m)
    };
    let failed = |code| Some(request(abort(AT, code)));
    let begun = response([0xC6, 0x22, 0x1F, 1, 9, 0, 0, 0]);
    let (mut c, mut m) = started(Some(8));
    let error = SdoError::NoRoom {
        at: DOMAIN,
        size: 9,
    };
    assert_eq!(
        c.on_frame(&begun, ms(1), &mut m),
        Progress::Failed(error, failed(AbortCode::OUT_OF_MEMORY))
    );
    let (mut c, mut m) = started(None);
    let _ = c.on_frame(&begun, ms(1), &mut m);
    let _ = c.on_frame(&response(*b"\x011234567"), ms(1), &mut m);
    let _ = c.on_frame(&response(*b"\x8289\0\0\0\0\0"), ms(1), &mut m);
    let error = SdoError::Protocol {
        at: DOMAIN,
        code: AbortCode::CRC,
    };
    assert_eq!(
        c.on_frame(&response([0xD5, 0, 0, 0, 0, 0, 0, 0]), ms(1), &mut m),
        Progress::Failed(error, failed(AbortCode::CRC))
    );
    let (mut c, mut m) = started(None);
    let _ = c.on_frame(&begun, ms(1), &mut m);
    let _ = c.on_frame(&response(*b"\x8189\0\0\0\0\0"), ms(1), &mut m);
    let error = SdoError::Size {
        at: DOMAIN,
        announced: 9,
        received: 2,
    };
    let crc = Crc16::new().update(b"89").get().to_le_bytes();
    assert_eq!(
        c.on_frame(
            &response([0xD5, crc[0], crc[1], 0, 0, 0, 0, 0]),
            ms(1),
            &mut m
        ),
        Progress::Failed(error, failed(AbortCode::LENGTH_MISMATCH))
    );
    let mut m = Memory::of(&[0; 99]);
    let mut c = Channel::new(NODE, TIMEOUT);
    c.download(DOMAIN, 99, Protocol::Block, &mut m, ms(0))
        .unwrap();
    let error = SdoError::Protocol {
        at: DOMAIN,
        code: AbortCode::BLOCK_SIZE,
    };
    assert_eq!(
        c.on_frame(
            &response([0xA4, 0x22, 0x1F, 1, 128, 0, 0, 0]),
            ms(1),
            &mut m
        ),
        Progress::Failed(error, failed(AbortCode::BLOCK_SIZE))
    );
}

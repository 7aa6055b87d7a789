//! Every command byte, in every state of the server: what the standard wants to
//! be answered, and that nothing is left behind (CiA 301, 7.2.4.3).

use crate::common::{DOMAIN, Dictionary, NODE, TIMEOUT, ms, request};
use canmaster::id::Address;
use canmaster::sdo::{AbortCode, Crc16, Server};
use canmaster::{CobId, Frame};

/// What the domain holds, and what is written to it.
const DATA: &[u8; 20] = b"abcdefghijklmnopqrst";
const SIZE: u8 = DATA.len() as u8;
const D0: u8 = DOMAIN.index.0.to_le_bytes()[0];
const D1: u8 = DOMAIN.index.0.to_le_bytes()[1];
const DS: u8 = DOMAIN.sub.0;

/// A state of the server, and how far its transfer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Idle,
    /// Which toggle is awaited.
    Download(bool),
    Upload(bool),
    /// Segments received.
    BlockDownload(u8),
    BlockDownloadEnd,
    BlockUploadStart,
    /// Segments sent.
    BlockUpload(u8),
    BlockUploadEnd,
}

const STATES: [State; 13] = [
    State::Idle,
    State::Download(false),
    State::Download(true),
    State::Upload(false),
    State::Upload(true),
    State::BlockDownload(0),
    State::BlockDownload(1),
    State::BlockDownload(2),
    State::BlockDownloadEnd,
    State::BlockUploadStart,
    State::BlockUpload(1),
    State::BlockUpload(3),
    State::BlockUploadEnd,
];

struct Bench {
    server: Server,
    od: Dictionary,
}

impl Bench {
    fn in_state(state: State) -> Bench {
        let mut b = Bench {
            server: Server::new(NODE, TIMEOUT),
            od: Dictionary::new(),
        };
        b.od.domain = DATA.to_vec();
        let before: &[[u8; 8]] = match state {
            State::Idle => &[],
            State::Download(false) => &[[0x21, D0, D1, DS, SIZE, 0, 0, 0]],
            State::Download(true) => &[[0x21, D0, D1, DS, SIZE, 0, 0, 0], *b"\x00abcdefg"],
            State::Upload(false) => &[[0x40, D0, D1, DS, 0, 0, 0, 0]],
            State::Upload(true) => &[[0x40, D0, D1, DS, 0, 0, 0, 0], [0x60, 0, 0, 0, 0, 0, 0, 0]],
            State::BlockDownload(0) => &[[0xC6, D0, D1, DS, SIZE, 0, 0, 0]],
            State::BlockDownload(1) => &[[0xC6, D0, D1, DS, SIZE, 0, 0, 0], *b"\x01abcdefg"],
            State::BlockDownload(_) => &[
                [0xC6, D0, D1, DS, SIZE, 0, 0, 0],
                *b"\x01abcdefg",
                *b"\x02hijklmn",
            ],
            State::BlockDownloadEnd => &[
                [0xC6, D0, D1, DS, SIZE, 0, 0, 0],
                *b"\x01abcdefg",
                *b"\x02hijklmn",
                *b"\x83opqrst\0",
            ],
            State::BlockUploadStart => &[[0xA4, D0, D1, DS, 127, 0, 0, 0]],
            State::BlockUpload(_) | State::BlockUploadEnd => &[
                [0xA4, D0, D1, DS, 127, 0, 0, 0],
                [0xA3, 0, 0, 0, 0, 0, 0, 0],
            ],
        };
        for bytes in before {
            b.ask(*bytes);
        }
        let sent = match state {
            State::BlockUpload(sent) => sent,
            State::BlockUploadEnd => 3,
            _ => 0,
        };
        for _ in 0..sent {
            assert!(b.server.poll(ms(0), &mut b.od).is_some());
        }
        if state == State::BlockUploadEnd {
            assert!(b.ask([0xA2, 3, 127, 0, 0, 0, 0, 0]).is_some());
        }
        assert_eq!(b.server.is_idle(), state == State::Idle);
        b
    }

    fn ask(&mut self, bytes: [u8; 8]) -> Option<[u8; 8]> {
        let answer = self.server.on_frame(&request(bytes), ms(0), &mut self.od);
        answer.map(|frame| frame.padded())
    }

    /// Whatever was done, after the timeouts the server is free and of use, and
    /// the domain holds the old value or the whole new one.
    fn settle(mut self, name: &str) {
        let mut now = ms(0);
        for _ in 0..300 {
            now = now.max(self.server.next_deadline().unwrap_or(now));
            self.server.poll(now, &mut self.od);
        }
        assert!(self.server.is_idle(), "{name}");
        let known = [0x40, 0x00, 0x10, 0, 0, 0, 0, 0];
        let answer = [0x43, 0x00, 0x10, 0, 0x92, 0x01, 0x02, 0];
        assert_eq!(self.ask(known), Some(answer), "{name}");
        assert_eq!(self.od.incoming, [], "{name}");
    }
}

/// What the standard wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wanted {
    /// No answer.
    Silence,
    /// An answer with this first byte.
    Answer(u8),
    Abort(AbortCode),
}

use Wanted::{Abort, Answer, Silence};

const NUMBER: Address = Address::new(0x1017, 0);
const NUMBER_SIZE: u32 = 2;
const ENTRIES: [Address; 4] = [
    DOMAIN,
    NUMBER,
    Address::new(0x1F23, 0),
    Address::new(0x1F22, 9),
];

fn missing(at: Address) -> Option<Wanted> {
    match at {
        DOMAIN | NUMBER => None,
        _ if at.index == DOMAIN.index => Some(Abort(AbortCode::NO_SUCH_SUB_INDEX)),
        _ => Some(Abort(AbortCode::NO_SUCH_OBJECT)),
    }
}

/// A number takes exactly its size, a domain any.
fn sized(at: Address, size: Option<u32>, ok: u8) -> Wanted {
    match size {
        Some(size) if at == NUMBER && size > NUMBER_SIZE => Abort(AbortCode::TOO_LONG),
        Some(size) if at == NUMBER && size < NUMBER_SIZE => Abort(AbortCode::TOO_SHORT),
        _ => Answer(ok),
    }
}

fn length(at: Address) -> u32 {
    if at == NUMBER {
        NUMBER_SIZE
    } else {
        u32::from(SIZE)
    }
}

fn normal_upload(at: Address) -> Wanted {
    Answer(if at == NUMBER { 0x4B } else { 0x41 })
}

/// The answer to `bytes`, which name `at`.
fn wanted(state: State, bytes: [u8; 8], at: Address) -> Wanted {
    let [command, b1, b2, _, b4, b5, ..] = bytes;
    let tail = u32::from_le_bytes([b4, b5, bytes[6], bytes[7]]);
    if let State::BlockDownload(_) = state {
        let (sequence, last) = (command & 0x7F, command & 0x80 != 0);
        return match sequence {
            // An abort, or a refusal that waits for the end of the block.
            0 => Silence,
            _ if last || sequence == 127 => Answer(0xA2),
            _ => Silence,
        };
    }
    let toggle = command & 0x10 != 0;
    match (command >> 5, state) {
        (0, State::Download(awaited)) => match (toggle == awaited, command & 0x0F) {
            (false, _) => Abort(AbortCode::TOGGLE),
            // No data and not the last.
            (_, 0x0E) => Abort(AbortCode::COMMAND),
            // Less than was announced.
            (_, flags) if flags & 1 != 0 => Abort(AbortCode::TOO_SHORT),
            _ => Answer(0x20 | command & 0x10),
        },
        (1, _) => missing(at).unwrap_or_else(|| match command & 0x03 {
            0 => sized(at, None, 0x60),
            1 => sized(at, Some(tail), 0x60),
            2 => sized(at, None, 0x60),
            _ => sized(at, Some(4 - u32::from(command >> 2 & 3)), 0x60),
        }),
        (2, _) => missing(at).unwrap_or(normal_upload(at)),
        (3, State::Upload(awaited)) if toggle != awaited => Abort(AbortCode::TOGGLE),
        (3, State::Upload(awaited)) => Answer(if awaited { 0x10 } else { 0x00 }),
        (4, _) => Silence,
        (5, _) => match (command & 0x03, state) {
            (0, _) if !(1..=127).contains(&b4) => Abort(AbortCode::BLOCK_SIZE),
            (0, _) => missing(at).unwrap_or_else(|| {
                // The protocol may be switched for what is small.
                if b5 > 0 && length(at) <= u32::from(b5) {
                    normal_upload(at)
                } else {
                    Answer(0xC6)
                }
            }),
            (1, State::BlockUploadEnd) | (3, State::BlockUploadStart) => Silence,
            (2, State::BlockUpload(sent)) => match (b1, b2) {
                (sequence, _) if sequence > sent => Abort(AbortCode::SEQUENCE_NUMBER),
                (3, _) => Answer(0xC5),
                (_, 1..=127) => Silence,
                _ => Abort(AbortCode::BLOCK_SIZE),
            },
            _ => Abort(AbortCode::COMMAND),
        },
        (6, _) if command & 1 == 0 => missing(at).unwrap_or_else(|| {
            let size = (command & 2 != 0).then_some(tail);
            sized(at, size, 0xA4)
        }),
        (6, State::BlockDownloadEnd) => {
            let used = 7 - (command >> 2 & 7);
            let right =
                Crc16::new().update(&[&DATA[..14], &b"opqrst\0"[..usize::from(used)]].concat());
            if u16::from_le_bytes([b1, b2]) != right.get() {
                Abort(AbortCode::CRC)
            } else if used < 6 {
                Abort(AbortCode::TOO_SHORT)
            } else if used > 6 {
                Abort(AbortCode::TOO_LONG)
            } else {
                Answer(0xA1)
            }
        }
        _ => Abort(AbortCode::COMMAND),
    }
}

/// Which entry an abort names.
fn named(state: State, bytes: [u8; 8], at: Address) -> [u8; 3] {
    let [low, high] = at.index.0.to_le_bytes();
    let own = [low, high, at.sub.0];
    if matches!(state, State::BlockDownload(_)) {
        return [D0, D1, DS];
    }
    match bytes[0] >> 5 {
        1 | 2 => own,
        5 if bytes[0] & 3 == 0 => own,
        6 if bytes[0] & 1 == 0 => own,
        _ if state != State::Idle => [D0, D1, DS],
        // Nobody's: what the frame has in its place, if it is no command at all.
        7 => own,
        _ => [0; 3],
    }
}

fn check(state: State, bytes: [u8; 8]) {
    let name = std::format!("{state:?}, {bytes:02X?}");
    let at = Address::new(u16::from_le_bytes([bytes[1], bytes[2]]), bytes[3]);
    let mut b = Bench::in_state(state);
    let answer = b.ask(bytes);
    match wanted(state, bytes, at) {
        Silence => assert_eq!(answer, None, "{name}"),
        Answer(first) => assert_eq!(answer.map(|a| a[0]), Some(first), "{name}"),
        Abort(code) => {
            let [n0, n1, n2] = named(state, bytes, at);
            let [a, b4, c, d] = code.0.to_le_bytes();
            assert_eq!(answer, Some([0x80, n0, n1, n2, a, b4, c, d]), "{name}");
            assert!(b.server.is_idle(), "{name}");
            assert_eq!(b.od.domain, DATA, "{name}");
        }
    }
    b.settle(&name);
}

#[test]
fn every_command_in_every_state() {
    let tails = [
        [0; 4],
        [127, 0, 0, 0],
        [2, 0, 0, 0],
        [5, 20, 0, 0],
        [0xFF; 4],
    ];
    for state in STATES {
        for command in 0..=u8::MAX {
            for at in ENTRIES {
                for [t0, t1, t2, t3] in tails {
                    let [low, high] = at.index.0.to_le_bytes();
                    check(state, [command, low, high, at.sub.0, t0, t1, t2, t3]);
                }
            }
        }
    }
}

#[test]
fn every_acknowledgement_of_a_block() {
    for state in [State::BlockUpload(1), State::BlockUpload(3)] {
        for sequence in 0..=u8::MAX {
            for block_size in [0, 1, 127, 128, 255] {
                check(state, [0xA2, sequence, block_size, 0, 0, 0, 0, 0]);
            }
        }
    }
}

#[test]
fn every_checksum_but_one_is_wrong() {
    for unused in 0..=7 {
        // Where the length is right all of them, else every 257th.
        let step = if unused == 1 { 1 } else { 0x101 };
        for crc in (0..=u16::MAX).step_by(step) {
            let [low, high] = crc.to_le_bytes();
            let end = 0xC1 | unused << 2;
            check(State::BlockDownloadEnd, [end, low, high, 0, 0, 0, 0, 0]);
        }
    }
}

/// The frame that carries a transfer to its end, and the last answer's first
/// byte.
fn finish(b: &mut Bench, state: State) {
    let crc = Crc16::new().update(DATA).get().to_le_bytes();
    let end = [0xC5, crc[0], crc[1], 0, 0, 0, 0, 0];
    let whole: &[([u8; 8], Option<u8>)] = &[
        (*b"\x01abcdefg", None),
        (*b"\x02hijklmn", None),
        (*b"\x83opqrst\0", Some(0xA2)),
        (end, Some(0xA1)),
    ];
    let steps: Vec<([u8; 8], Option<u8>)> = match state {
        State::Idle => vec![],
        State::Download(toggle) => {
            let steps = [
                (*b"\x00abcdefg", Some(0x20)),
                (*b"\x10hijklmn", Some(0x30)),
                (*b"\x03opqrst\0", Some(0x20)),
            ];
            steps[usize::from(toggle)..].to_vec()
        }
        State::Upload(toggle) => {
            let steps = [
                ([0x60, 0, 0, 0, 0, 0, 0, 0], Some(0x00)),
                ([0x70, 0, 0, 0, 0, 0, 0, 0], Some(0x10)),
                ([0x60, 0, 0, 0, 0, 0, 0, 0], Some(0x03)),
            ];
            steps[usize::from(toggle)..].to_vec()
        }
        State::BlockDownload(received) => whole[usize::from(received)..].to_vec(),
        State::BlockDownloadEnd => vec![(end, Some(0xA1))],
        State::BlockUploadStart => vec![([0xA3, 0, 0, 0, 0, 0, 0, 0], None)],
        State::BlockUpload(_) => vec![],
        State::BlockUploadEnd => vec![([0xA1, 0, 0, 0, 0, 0, 0, 0], None)],
    };
    for (bytes, first) in steps {
        assert_eq!(b.ask(bytes).map(|answer| answer[0]), first, "{state:?}");
    }
    if matches!(state, State::BlockUploadStart | State::BlockUpload(_)) {
        while b.server.poll(ms(0), &mut b.od).is_some() {}
        assert_eq!(
            b.ask([0xA2, 3, 127, 0, 0, 0, 0, 0]).map(|a| a[0]),
            Some(0xC5)
        );
        assert_eq!(b.ask([0xA1, 0, 0, 0, 0, 0, 0, 0]), None);
    }
    assert!(b.server.is_idle(), "{state:?}");
    assert_eq!(b.od.domain, DATA);
}

#[test]
fn frames_of_other_lengths_remote_frames_and_other_identifiers_disturb_no_transfer() {
    for state in STATES {
        let mut b = Bench::in_state(state);
        let mut tell = |frame: Frame| {
            assert_eq!(
                b.server.on_frame(&frame, ms(0), &mut b.od),
                None,
                "{frame:?}"
            );
        };
        for number in 0..0x800 {
            let id = CobId::new(number).unwrap();
            for len in 0..=8 {
                tell(Frame::remote_frame(id, len).unwrap());
                for command in [0x00, 0x01, 0x21, 0x40, 0x60, 0x80, 0xA0, 0xC1, 0xFF] {
                    if number != 0x605 || len != 8 {
                        let data = [command; 8];
                        tell(Frame::data_frame(id, &data[..usize::from(len)]).unwrap());
                    }
                }
            }
        }
        finish(&mut b, state);
    }
}

#[test]
fn every_transfer_comes_to_its_end_from_every_state() {
    for state in STATES {
        finish(&mut Bench::in_state(state), state);
    }
}

/// Neither data nor an end: the transfer would never end.
#[test]
fn an_empty_segment_that_is_not_the_last_aborts() {
    let mut b = Bench::in_state(State::Idle);
    b.ask([0x20, D0, D1, DS, 0, 0, 0, 0]);
    let [c0, c1, c2, c3] = AbortCode::COMMAND.0.to_le_bytes();
    assert_eq!(
        b.ask([0x0E, 0, 0, 0, 0, 0, 0, 0]),
        Some([0x80, D0, D1, DS, c0, c1, c2, c3])
    );
    assert_eq!(b.od.cancelled, 1);
}

/// What is left of a block must not be taken for commands.
#[test]
fn a_frame_without_sequence_number_aborts_at_the_end_of_the_block() {
    let [c0, c1, c2, c3] = AbortCode::SEQUENCE_NUMBER.0.to_le_bytes();
    let abort = Some([0x80, D0, D1, DS, c0, c1, c2, c3]);
    for last in [0x7F, 0x82] {
        let mut b = Bench::in_state(State::BlockDownload(1));
        assert_eq!(b.ask([0; 8]), None);
        // It would write 1017h.
        assert_eq!(b.ask([0x2B, 0x17, 0x10, 0, 5, 0, 0, 0]), None);
        assert_eq!(b.ask([last, 0, 0, 0, 0, 0, 0, 0]), abort);
        assert!(b.server.is_idle());
        assert_eq!(b.od.values.number(0x1017, 0), 0);
    }
    // The rest does not come, or nothing but that.
    let mut b = Bench::in_state(State::BlockDownload(1));
    assert_eq!(b.ask([0; 8]), None);
    let polled = b.server.poll(ms(250), &mut b.od);
    assert_eq!(polled.map(|frame| frame.padded()), abort);
    let mut b = Bench::in_state(State::BlockDownload(1));
    assert_eq!(b.ask([0; 8]), None);
    assert_eq!(b.ask([0; 8]), abort);
}

#[test]
fn segments_that_are_never_in_sequence_end_the_transfer() {
    let mut b = Bench::in_state(State::BlockDownload(0));
    let mut acknowledged = 0;
    for sent in 1.. {
        let sequence = 2 + (sent % 126) as u8;
        match b.ask([sequence, 0, 0, 0, 0, 0, 0, 0]) {
            None => {}
            Some([0xA2, 0, 127, ..]) => acknowledged += 1,
            Some(answer) => {
                let [c0, c1, c2, c3] = AbortCode::SEQUENCE_NUMBER.0.to_le_bytes();
                assert_eq!(answer, [0x80, D0, D1, DS, c0, c1, c2, c3]);
                // Four whole blocks, the first and three that were repeated.
                assert_eq!((sent, acknowledged), (4 * 127 + 1, 4));
                break;
            }
        }
    }
    assert!(b.server.is_idle());
}

/// The client was told how many bytes to expect.
#[test]
fn what_changes_its_size_while_it_is_read_is_not_delivered() {
    let [c0, c1, c2, c3] = AbortCode::DEVICE_STATE.0.to_le_bytes();
    let abort = Some([0x80, D0, D1, DS, c0, c1, c2, c3]);
    let mut b = Bench::in_state(State::Upload(true));
    b.od.domain.pop();
    assert_eq!(b.ask([0x70, 0, 0, 0, 0, 0, 0, 0]), abort);
    let mut b = Bench::in_state(State::BlockUpload(1));
    b.od.domain.push(0);
    let frame = b.server.poll(ms(0), &mut b.od);
    assert_eq!(frame.map(|frame| frame.padded()), abort);
    assert!(b.server.is_idle());
}

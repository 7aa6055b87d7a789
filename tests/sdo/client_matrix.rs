//! Every command byte, in every state of a client's channel: only the answer
//! that was asked for leads on, and every transfer ends, once
//! (CiA 301, 7.2.4.3).

use crate::common::{DOMAIN, Memory, NODE, TIMEOUT, ms, request, response};
use canmaster::sdo::{AbortCode, Channel, Crc16, Progress, Protocol, SdoError, Transfer};
use canmaster::{CobId, Frame};

const DATA: &[u8; 20] = b"abcdefghijklmnopqrst";
const SIZE: u8 = DATA.len() as u8;
const D0: u8 = DOMAIN.index.0.to_le_bytes()[0];
const D1: u8 = DOMAIN.index.0.to_le_bytes()[1];
const DS: u8 = DOMAIN.sub.0;

/// What the channel waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Idle,
    Quarantine,
    /// The answer to an expedited download.
    Written,
    /// The answer to the initiate of a segmented download.
    Download,
    /// The answer to the segment with this number, from 0 on.
    Segment(u8),
    /// The answer to the initiate of an upload.
    Upload,
    /// The segment with this number, from 0 on.
    Given(u8),
    BlockDownload,
    /// An acknowledgement; so many segments have been sent.
    Acknowledge(u8),
    BlockDownloadEnd,
    BlockUpload,
    /// Segments of a block; so many have come.
    Block(u8),
    BlockUploadEnd,
    /// Nothing more: the end only has to be told.
    Finished,
}

const STATES: [State; 21] = [
    State::Idle,
    State::Quarantine,
    State::Written,
    State::Download,
    State::Segment(0),
    State::Segment(1),
    State::Segment(2),
    State::Upload,
    State::Given(0),
    State::Given(1),
    State::Given(2),
    State::BlockDownload,
    State::Acknowledge(1),
    State::Acknowledge(2),
    State::Acknowledge(3),
    State::BlockDownloadEnd,
    State::BlockUpload,
    State::Block(0),
    State::Block(2),
    State::BlockUploadEnd,
    State::Finished,
];

struct Bench {
    channel: Channel,
    memory: Memory,
    /// Ends of the transfer so far.
    ends: u32,
}

const BEGUN: [u8; 8] = [0x60, D0, D1, DS, 0, 0, 0, 0];
const FOUND: [u8; 8] = [0x41, D0, D1, DS, SIZE, 0, 0, 0];
const BLOCKS: [u8; 8] = [0xA4, D0, D1, DS, 127, 0, 0, 0];
const SENDS_BLOCKS: [u8; 8] = [0xC6, D0, D1, DS, SIZE, 0, 0, 0];
const GIVEN: [&[u8; 8]; 3] = [b"\x00abcdefg", b"\x10hijklmn", b"\x03opqrst\0"];
const BLOCK: [&[u8; 8]; 3] = [b"\x01abcdefg", b"\x02hijklmn", b"\x83opqrst\0"];

fn end_of_upload() -> [u8; 8] {
    let [low, high] = Crc16::new().update(DATA).get().to_le_bytes();
    [0xC5, low, high, 0, 0, 0, 0, 0]
}

impl Bench {
    fn in_state(state: State) -> Bench {
        let mut b = Bench {
            channel: Channel::new(NODE, TIMEOUT),
            memory: Memory::of(DATA),
            ends: 0,
        };
        let (channel, memory) = (&mut b.channel, &mut b.memory);
        let started = match state {
            State::Idle => return b,
            State::Written => channel.download(DOMAIN, 2, Protocol::Normal, memory, ms(0)),
            State::Download | State::Segment(_) => {
                channel.download(DOMAIN, u32::from(SIZE), Protocol::Normal, memory, ms(0))
            }
            State::BlockDownload | State::Acknowledge(_) | State::BlockDownloadEnd => {
                channel.download(DOMAIN, u32::from(SIZE), Protocol::Block, memory, ms(0))
            }
            State::Upload | State::Given(_) | State::Quarantine => {
                channel.upload(DOMAIN, Protocol::Normal, ms(0))
            }
            State::BlockUpload | State::Block(_) | State::BlockUploadEnd | State::Finished => {
                channel.upload(DOMAIN, Protocol::Block, ms(0))
            }
        };
        started.unwrap();
        match state {
            State::Quarantine => {
                let _ = b.channel.cancel(AbortCode::GENERAL, ms(0));
            }
            State::Segment(n) => {
                for bytes in [
                    BEGUN,
                    [0x20, 0, 0, 0, 0, 0, 0, 0],
                    [0x30, 0, 0, 0, 0, 0, 0, 0],
                ]
                .iter()
                .take(usize::from(n) + 1)
                {
                    b.goes_on(*bytes);
                }
            }
            State::Given(n) => {
                b.goes_on(FOUND);
                for bytes in GIVEN.iter().take(usize::from(n)) {
                    b.goes_on(**bytes);
                }
            }
            State::Acknowledge(_) | State::BlockDownloadEnd => {
                assert_eq!(b.hear(BLOCKS), Progress::Nothing);
                let sent = if let State::Acknowledge(sent) = state {
                    sent
                } else {
                    3
                };
                for _ in 0..sent {
                    assert!(matches!(b.poll(0), Progress::Send(_)));
                }
                if state == State::BlockDownloadEnd {
                    b.goes_on([0xA2, 3, 127, 0, 0, 0, 0, 0]);
                }
            }
            State::Block(_) | State::BlockUploadEnd | State::Finished => {
                b.goes_on(SENDS_BLOCKS);
                let come = if let State::Block(come) = state {
                    come
                } else {
                    3
                };
                for bytes in BLOCK.iter().take(usize::from(come)) {
                    let _ = b.hear(**bytes);
                }
                if state == State::Finished {
                    b.goes_on(end_of_upload());
                }
            }
            _ => {}
        }
        b
    }

    fn hear(&mut self, bytes: [u8; 8]) -> Progress<Transfer> {
        let progress = self
            .channel
            .on_frame(&response(bytes), ms(0), &mut self.memory);
        self.count(progress)
    }

    fn goes_on(&mut self, bytes: [u8; 8]) {
        assert!(matches!(self.hear(bytes), Progress::Send(_)));
    }

    fn poll(&mut self, at: u64) -> Progress<Transfer> {
        let progress = self.channel.poll(ms(at), &mut self.memory);
        self.count(progress)
    }

    fn count(&mut self, progress: Progress<Transfer>) -> Progress<Transfer> {
        if matches!(progress, Progress::Done(_) | Progress::Failed(..)) {
            self.ends += 1;
        }
        progress
    }

    /// Nobody says anything more: the transfer ends, once, and the channel is
    /// free when the timeouts and the quarantine are over.
    fn settle(mut self, state: State, name: &str) {
        let mut now = ms(0);
        for _ in 0..20 {
            now = now.max(self.channel.next_deadline().unwrap_or(now));
            let progress = self.channel.poll(now, &mut self.memory);
            let _ = self.count(progress);
        }
        let over = matches!(state, State::Idle | State::Quarantine);
        assert_eq!(self.ends, u32::from(!over), "{name}");
        assert!(self.channel.is_ready(now), "{name}");
        assert!(now <= ms(1500), "{name}: {now:?}");
    }
}

/// What has to come of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wanted {
    /// Nothing is sent, nothing ends.
    Nothing,
    /// This command is sent.
    Send(u8),
    Done(u32),
    /// The server refused; nothing is sent.
    Refused,
    /// The transfer is ended with this abort.
    Abort(AbortCode),
}

use Wanted::{Abort, Done, Nothing, Refused, Send};

/// An upload begins or, if expedited, is done.
fn found(command: u8) -> Wanted {
    match command & 0x03 {
        2 => Done(4),
        3 => Done(4 - u32::from(command >> 2 & 3)),
        _ => Send(0x60),
    }
}

/// What `bytes` leads to; `own`: they name the entry that was asked for.
fn wanted(state: State, bytes: [u8; 8], own: bool) -> Wanted {
    let [command, b1, b2, _, b4, ..] = bytes;
    let tail = u32::from_le_bytes([b4, bytes[5], bytes[6], bytes[7]]);
    let active = !matches!(state, State::Idle | State::Quarantine | State::Finished);
    if !active {
        return Nothing;
    }
    if let State::Block(_) = state {
        let (sequence, last) = (command & 0x7F, command & 0x80 != 0);
        return match sequence {
            0 if last && own => Refused,
            0 if last => Nothing,
            0 => Abort(AbortCode::SEQUENCE_NUMBER),
            _ if last || sequence == 127 => Send(0xA2),
            _ => Nothing,
        };
    }
    let toggle = command & 0x10 != 0;
    match (command >> 5, state) {
        (4, State::BlockDownload) if own && tail == AbortCode::COMMAND.0 => Send(0x21),
        (4, State::BlockUpload) if own && tail == AbortCode::COMMAND.0 => Send(0x40),
        (4, _) if own => Refused,
        (0, State::Given(n)) => {
            let data = 7 - u32::from(command >> 1 & 7);
            let come = u32::from(n) * 7 + data;
            match (toggle == (n % 2 == 1), command & 1 != 0) {
                (false, _) => Abort(AbortCode::TOGGLE),
                (_, false) if data == 0 => Abort(AbortCode::COMMAND),
                (_, last) if come > u32::from(SIZE) || last && come < u32::from(SIZE) => {
                    Abort(AbortCode::LENGTH_MISMATCH)
                }
                (_, true) => Done(come),
                _ => Send(if toggle { 0x60 } else { 0x70 }),
            }
        }
        (1, State::Segment(n)) => match (toggle == (n % 2 == 1), n) {
            (false, _) => Abort(AbortCode::TOGGLE),
            (_, 0) => Send(0x10),
            (_, 1) => Send(0x03),
            _ => Done(u32::from(SIZE)),
        },
        (2, State::Upload | State::BlockUpload) if own => found(command),
        (3, State::Written) if own => Done(2),
        (3, State::Download) if own => Send(0x00),
        (5, State::BlockDownload) if own && command & 3 == 0 => match b4 {
            1..=127 => Nothing,
            _ => Abort(AbortCode::BLOCK_SIZE),
        },
        (5, State::Acknowledge(sent)) if command & 3 == 2 => match (b1, b2) {
            (sequence, _) if sequence > sent => Abort(AbortCode::SEQUENCE_NUMBER),
            (3, _) => Send(0xC5),
            (_, 1..=127) => Nothing,
            _ => Abort(AbortCode::BLOCK_SIZE),
        },
        (5, State::BlockDownloadEnd) if command & 3 == 1 => Done(u32::from(SIZE)),
        (6, State::BlockUpload) if own && command & 1 == 0 => Send(0xA3),
        (6, State::BlockUploadEnd) if command & 1 == 1 => {
            let used = 7 - (command >> 2 & 7);
            let whole = [&DATA[..14], &b"opqrst\0"[..usize::from(used)]].concat();
            if u16::from_le_bytes([b1, b2]) != Crc16::new().update(&whole).get() {
                Abort(AbortCode::CRC)
            } else if whole.len() != DATA.len() {
                Abort(AbortCode::LENGTH_MISMATCH)
            } else {
                Send(0xA1)
            }
        }
        _ => Nothing,
    }
}

fn check(state: State, bytes: [u8; 8]) {
    let name = std::format!("{state:?}, {bytes:02X?}");
    let own = bytes[1..4] == [D0, D1, DS];
    let mut b = Bench::in_state(state);
    let progress = b.hear(bytes);
    match wanted(state, bytes, own) {
        Nothing => assert_eq!(progress, Progress::Nothing, "{name}"),
        Send(first) => {
            let Progress::Send(frame) = progress else {
                panic!("{name}: {progress:?}");
            };
            assert_eq!(frame.padded()[0], first, "{name}");
        }
        Done(len) => {
            let transfer = Transfer { at: DOMAIN, len };
            assert_eq!(progress, Progress::Done(transfer), "{name}");
        }
        Refused => {
            let code = AbortCode(u32::from_le_bytes([bytes[4], bytes[5], bytes[6], bytes[7]]));
            let error = SdoError::Aborted { at: DOMAIN, code };
            assert_eq!(progress, Progress::Failed(error, None), "{name}");
        }
        Abort(code) => {
            let [a, b4, c, d] = code.0.to_le_bytes();
            let abort = request([0x80, D0, D1, DS, a, b4, c, d]);
            let Progress::Failed(error, sent) = progress else {
                panic!("{name}: {progress:?}");
            };
            assert_eq!((error.code(), sent), (code, Some(abort)), "{name}");
            // Whatever comes now is discarded.
            for bytes in [FOUND, BEGUN, *GIVEN[0], end_of_upload(), bytes] {
                assert_eq!(b.hear(bytes), Progress::Nothing, "{name}");
            }
            assert!(!b.channel.is_ready(ms(499)), "{name}");
        }
    }
    b.settle(state, &name);
}

#[test]
fn every_command_in_every_state() {
    let [c0, c1, c2, c3] = AbortCode::COMMAND.0.to_le_bytes();
    let tails = [
        [0; 4],
        [127, 0, 0, 0],
        [20, 0, 0, 0],
        [c0, c1, c2, c3],
        [0xFF; 4],
    ];
    let places = [
        [D0, D1, DS],
        [D0 + 1, D1, DS],
        [D0, D1 + 1, DS],
        [D0, D1, DS + 1],
        [3, 127, 0],
    ];
    for state in STATES {
        for command in 0..=u8::MAX {
            for [p0, p1, p2] in places {
                for [t0, t1, t2, t3] in tails {
                    check(state, [command, p0, p1, p2, t0, t1, t2, t3]);
                }
            }
        }
    }
}

#[test]
fn every_acknowledgement_of_a_block() {
    for sent in 1..=3 {
        for sequence in 0..=u8::MAX {
            for block_size in [0, 1, 127, 128, 255] {
                check(
                    State::Acknowledge(sent),
                    [0xA2, sequence, block_size, 0, 0, 0, 0, 0],
                );
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
            check(State::BlockUploadEnd, [end, low, high, 0, 0, 0, 0, 0]);
        }
    }
}

/// The rest of the answers; the transfer is done.
fn finish(b: &mut Bench, state: State) {
    let acknowledges = [[0x20, 0, 0, 0, 0, 0, 0, 0], [0x30, 0, 0, 0, 0, 0, 0, 0]];
    let mut rest: Vec<[u8; 8]> = match state {
        State::Idle | State::Quarantine | State::Finished => vec![],
        State::Written => vec![BEGUN],
        State::Download => vec![BEGUN, acknowledges[0], acknowledges[1], acknowledges[0]],
        State::Segment(n) => (n..3).map(|n| acknowledges[usize::from(n % 2)]).collect(),
        State::Upload => [&[FOUND][..], &GIVEN.map(|bytes| *bytes)].concat(),
        State::Given(n) => GIVEN
            .iter()
            .skip(usize::from(n))
            .map(|bytes| **bytes)
            .collect(),
        State::BlockDownload => vec![BLOCKS],
        State::Acknowledge(_) => vec![],
        State::BlockDownloadEnd => vec![[0xA1, 0, 0, 0, 0, 0, 0, 0]],
        State::BlockUpload => [&[SENDS_BLOCKS][..], &BLOCK.map(|bytes| *bytes)].concat(),
        State::Block(n) => BLOCK
            .iter()
            .skip(usize::from(n))
            .map(|bytes| **bytes)
            .collect(),
        State::BlockUploadEnd => vec![],
    };
    if matches!(
        state,
        State::BlockUpload | State::Block(_) | State::BlockUploadEnd
    ) {
        rest.push(end_of_upload());
    }
    for bytes in rest {
        let _ = b.hear(bytes);
    }
    if matches!(state, State::BlockDownload | State::Acknowledge(_)) {
        while matches!(b.poll(0), Progress::Send(_)) {}
        b.goes_on([0xA2, 3, 127, 0, 0, 0, 0, 0]);
        let _ = b.hear([0xA1, 0, 0, 0, 0, 0, 0, 0]);
    }
    let _ = b.poll(0);
    let over = matches!(state, State::Idle | State::Quarantine);
    assert_eq!(b.ends, u32::from(!over), "{state:?}");
    assert_eq!(
        b.channel.is_ready(ms(0)),
        state != State::Quarantine,
        "{state:?}"
    );
    assert_eq!(b.memory.data, DATA, "{state:?}");
}

#[test]
fn frames_of_other_lengths_remote_frames_and_other_identifiers_disturb_no_transfer() {
    for state in STATES {
        let mut b = Bench::in_state(state);
        let mut tell = |frame: Frame| {
            let progress = b.channel.on_frame(&frame, ms(0), &mut b.memory);
            assert_eq!(progress, Progress::Nothing, "{state:?}, {frame:?}");
        };
        for number in 0..0x800 {
            let id = CobId::new(number).unwrap();
            for len in 0..=8 {
                tell(Frame::remote_frame(id, len).unwrap());
                for command in [0x00, 0x01, 0x20, 0x43, 0x60, 0x80, 0xA2, 0xC1, 0xFF] {
                    if number != 0x585 || len != 8 {
                        let data = [command, D0, D1, DS, 1, 0, 0, 0];
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
fn an_empty_segment_that_is_not_the_last_ends_the_transfer() {
    let mut b = Bench::in_state(State::Upload);
    b.goes_on([0x40, D0, D1, DS, 0, 0, 0, 0]);
    let progress = b.hear([0x0E, 0, 0, 0, 0, 0, 0, 0]);
    let Progress::Failed(error, Some(_)) = progress else {
        panic!("{progress:?}");
    };
    assert_eq!(error.code(), AbortCode::COMMAND);
}

#[test]
fn segments_that_are_never_in_sequence_end_the_transfer() {
    let mut b = Bench::in_state(State::Block(0));
    let mut sent = 0;
    while b.ends == 0 {
        sent += 1;
        let _ = b.hear([2 + (sent % 126) as u8, 0, 0, 0, 0, 0, 0, 0]);
    }
    // Four whole blocks, the first and three that were repeated.
    assert_eq!(sent, 4 * 127 + 1);
    assert!(b.channel.is_ready(ms(500)));
}

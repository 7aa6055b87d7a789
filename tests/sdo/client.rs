//! The SDO client, told as conversations, and client against server.

use crate::common::{DOMAIN, Dictionary, NODE, TIMEOUT, ms, request, response};
use canmaster::id::Address;
use canmaster::sdo::{AbortCode, Client, Progress, RESPONSE_MAX, SdoError, Server, StartError};
use canmaster::{CobId, Frame};
use proptest::prelude::*;

const NAME: Address = Address::new(0x1008, 0);
const TYPE: Address = Address::new(0x1000, 0);

fn client() -> Client {
    Client::new(NODE, TIMEOUT)
}

fn done(progress: Progress) -> Vec<u8> {
    match progress {
        Progress::Done(response) => response.data().to_vec(),
        other => panic!("not done: {other:?}"),
    }
}

fn abort(at: [u8; 3], code: AbortCode) -> Option<Frame> {
    let [a, b, c, d] = code.0.to_le_bytes();
    Some(request([0x80, at[0], at[1], at[2], a, b, c, d]))
}

#[test]
fn expedited_upload() {
    let mut c = client();
    assert_eq!(
        c.upload(TYPE, ms(0)),
        Ok(request([0x40, 0, 0x10, 0, 0, 0, 0, 0]))
    );
    assert_eq!(c.upload(TYPE, ms(0)), Err(StartError::Busy));
    let answer = response([0x43, 0, 0x10, 0, 0x92, 0x01, 0x02, 0]);
    let Progress::Done(r) = c.on_frame(&answer, ms(1)) else {
        panic!("not done")
    };
    assert_eq!((r.at, r.as_u32()), (TYPE, Some(0x0002_0192)));
    assert!(c.is_ready(ms(1)));
    // The same answer again completes nothing.
    assert_eq!(c.on_frame(&answer, ms(2)), Progress::Nothing);
}

#[test]
fn expedited_download() {
    let mut c = client();
    let at = Address::new(0x1017, 0);
    assert_eq!(
        c.download(at, &[50, 0], ms(0)),
        Ok(request([0x2B, 0x17, 0x10, 0, 50, 0, 0, 0]))
    );
    assert_eq!(
        done(c.on_frame(&response([0x60, 0x17, 0x10, 0, 0, 0, 0, 0]), ms(1))),
        [50, 0]
    );
}

#[test]
fn segmented_upload() {
    let mut c = client();
    c.upload(NAME, ms(0)).unwrap();
    let progress = c.on_frame(&response([0x41, 0x08, 0x10, 0, 9, 0, 0, 0]), ms(1));
    assert_eq!(
        progress,
        Progress::Send(request([0x60, 0, 0, 0, 0, 0, 0, 0]))
    );
    let progress = c.on_frame(&response(*b"\x00EPOS4 5"), ms(2));
    assert_eq!(
        progress,
        Progress::Send(request([0x70, 0, 0, 0, 0, 0, 0, 0]))
    );
    // The timeout counts from the last request.
    assert_eq!(c.next_deadline(), Some(ms(502)));
    let progress = c.on_frame(&response(*b"\x1B0/\0\0\0\0\0"), ms(3));
    assert_eq!(done(progress), b"EPOS4 50/");
}

#[test]
fn segmented_download() {
    let mut c = client();
    assert_eq!(
        c.download(DOMAIN, b"abcdefghi", ms(0)),
        Ok(request([0x21, 0x22, 0x1F, 1, 9, 0, 0, 0]))
    );
    let progress = c.on_frame(&response([0x60, 0x22, 0x1F, 1, 0, 0, 0, 0]), ms(1));
    assert_eq!(progress, Progress::Send(request(*b"\x00abcdefg")));
    let progress = c.on_frame(&response([0x20, 0, 0, 0, 0, 0, 0, 0]), ms(1));
    assert_eq!(progress, Progress::Send(request(*b"\x1Bhi\0\0\0\0\0")));
    assert_eq!(
        done(c.on_frame(&response([0x30, 0, 0, 0, 0, 0, 0, 0]), ms(1))),
        b"abcdefghi"
    );
}

#[test]
fn an_abort_of_the_server_ends_the_request_and_leaves_the_channel_open() {
    let mut c = client();
    c.upload(TYPE, ms(0)).unwrap();
    let refused = response([0x80, 0, 0x10, 0, 0xC0, 0xFF, 0x00, 0x0F]);
    assert_eq!(
        c.on_frame(&refused, ms(1)),
        Progress::Failed(
            SdoError::Aborted {
                at: TYPE,
                code: AbortCode::EPOS4_NMT_STATE
            },
            None
        )
    );
    assert!(c.upload(TYPE, ms(1)).is_ok());
}

#[test]
fn after_a_timeout_the_late_answer_is_discarded() {
    let mut c = client();
    c.upload(TYPE, ms(0)).unwrap();
    assert_eq!(c.poll(ms(499)), Progress::Nothing);
    let error = SdoError::Timeout {
        at: TYPE,
        waited: TIMEOUT,
    };
    assert_eq!(
        c.poll(ms(500)),
        Progress::Failed(error, abort([0, 0x10, 0], AbortCode::TIMEOUT))
    );
    assert_eq!(
        c.upload(TYPE, ms(999)),
        Err(StartError::Quarantine { until: ms(1000) })
    );
    let late = response([0x43, 0, 0x10, 0, 1, 1, 1, 1]);
    assert_eq!(c.on_frame(&late, ms(700)), Progress::Nothing);
    assert_eq!(c.next_deadline(), Some(ms(1000)));
    assert_eq!(c.poll(ms(1000)), Progress::Nothing);
    assert_eq!(c.next_deadline(), None);
    assert!(c.upload(TYPE, ms(1000)).is_ok());
}

#[test]
fn answers_that_do_not_fit_complete_nothing() {
    let mut c = client();
    c.upload(TYPE, ms(0)).unwrap();
    for bytes in [
        [0x43, 1, 0x10, 0, 1, 1, 1, 1], // another index
        [0x43, 0, 0x10, 1, 1, 1, 1, 1], // another sub-index
        [0x60, 0, 0x10, 0, 0, 0, 0, 0], // of a download
        [0x00, 0, 0x10, 0, 0, 0, 0, 0], // a segment
        [0x20, 0, 0x10, 0, 0, 0, 0, 0], // of a download's segment
        [0xC6, 0, 0x10, 0, 0, 0, 0, 0], // of a block upload
        [0xE3, 0, 0x10, 0, 0, 0, 0, 0], // of nothing known
        [0x80, 1, 0x10, 0, 0, 0, 2, 6], // the abort of another request
    ] {
        assert_eq!(c.on_frame(&response(bytes), ms(1)), Progress::Nothing);
    }
    let id = CobId::new(0x585).unwrap();
    for len in 0..8 {
        let short = Frame::data_frame(id, &[0x43, 0, 0x10, 0, 1, 1, 1, 1][..len]).unwrap();
        assert_eq!(c.on_frame(&short, ms(1)), Progress::Nothing);
    }
    let other = Frame::full(CobId::new(0x586).unwrap(), [0x43, 0, 0x10, 0, 1, 1, 1, 1]);
    assert_eq!(c.on_frame(&other, ms(1)), Progress::Nothing);
    assert_eq!(
        done(c.on_frame(&response([0x4F, 0, 0x10, 0, 7, 0, 0, 0]), ms(2))),
        [7]
    );
}

#[test]
fn a_wrong_toggle_ends_the_transfer() {
    let mut c = client();
    c.upload(NAME, ms(0)).unwrap();
    let _ = c.on_frame(&response([0x41, 0x08, 0x10, 0, 9, 0, 0, 0]), ms(1));
    let error = SdoError::Protocol {
        at: NAME,
        code: AbortCode::TOGGLE,
    };
    assert_eq!(
        c.on_frame(&response(*b"\x10EPOS4 5"), ms(2)),
        Progress::Failed(error, abort([0x08, 0x10, 0], AbortCode::TOGGLE))
    );
    assert!(!c.is_ready(ms(2)));
    assert!(c.is_ready(ms(502)));
}

#[test]
fn sizes_that_lie_end_the_transfer() {
    for (size, last, received) in [(6, 0x00, 7), (8, 0x01, 7)] {
        let mut c = client();
        c.upload(NAME, ms(0)).unwrap();
        let _ = c.on_frame(&response([0x41, 0x08, 0x10, 0, size, 0, 0, 0]), ms(1));
        let error = SdoError::Size {
            at: NAME,
            announced: u32::from(size),
            received,
        };
        assert_eq!(
            c.on_frame(&response([last, 1, 2, 3, 4, 5, 6, 7]), ms(2)),
            Progress::Failed(error, abort([0x08, 0x10, 0], AbortCode::LENGTH_MISMATCH))
        );
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let mut c = client();
    c.upload(NAME, ms(0)).unwrap();
    let error = SdoError::NoRoom { at: NAME, size: 33 };
    assert_eq!(
        c.on_frame(&response([0x41, 0x08, 0x10, 0, 33, 0, 0, 0]), ms(1)),
        Progress::Failed(error, abort([0x08, 0x10, 0], AbortCode::OUT_OF_MEMORY))
    );
    let mut c = client();
    c.upload(NAME, ms(0)).unwrap();
    let _ = c.on_frame(&response([0x40, 0x08, 0x10, 0, 0, 0, 0, 0]), ms(1));
    for toggle in [0x00, 0x10, 0x00, 0x10] {
        assert!(matches!(
            c.on_frame(&response([toggle, 1, 2, 3, 4, 5, 6, 7]), ms(1)),
            Progress::Send(_)
        ));
    }
    assert!(matches!(
        c.on_frame(&response([0x00, 1, 2, 3, 4, 5, 6, 7]), ms(1)),
        Progress::Failed(SdoError::NoRoom { size: 35, .. }, Some(_))
    ));
    let mut c = client();
    assert_eq!(
        c.download(DOMAIN, &[0; 33], ms(0)),
        Err(StartError::Length(33))
    );
    assert_eq!(c.download(DOMAIN, &[], ms(0)), Err(StartError::Length(0)));
}

#[test]
fn the_caller_can_give_up() {
    let mut c = client();
    assert_eq!(c.cancel(AbortCode::GENERAL, ms(0)), Progress::Nothing);
    c.upload(TYPE, ms(0)).unwrap();
    assert!(matches!(
        c.cancel(AbortCode::GENERAL, ms(1)),
        Progress::Failed(SdoError::Cancelled { .. }, Some(_))
    ));
    c.reset();
    assert!(c.is_ready(ms(1)));
}

#[test]
fn errors_say_what_to_do() {
    let timeout = SdoError::Timeout {
        at: TYPE,
        waited: TIMEOUT,
    };
    assert_eq!(
        timeout.to_string(),
        "1000h:00: no answer within 500 ms; check the node's supply, node-ID and bit rate"
    );
    let refused = SdoError::Aborted {
        at: TYPE,
        code: AbortCode::DEVICE_STATE,
    };
    assert_eq!(
        refused.to_string(),
        "1000h:00: refused with 08000022h (data cannot be transferred or stored in the \
         present device state); compare with the node's object dictionary"
    );
}

fn converse(mut first: Frame, c: &mut Client, s: &mut Server, od: &mut Dictionary) -> Progress {
    for _ in 0..100 {
        let answer = s.on_frame(&first, ms(0), od).expect("an answer");
        match c.on_frame(&answer, ms(0)) {
            Progress::Send(next) => first = next,
            end => return end,
        }
    }
    panic!("no end")
}

proptest! {
    #[test]
    fn client_and_server_agree(data in prop::collection::vec(any::<u8>(), 1..=RESPONSE_MAX)) {
        let (c, s, od) = (&mut client(), &mut Server::new(NODE, TIMEOUT), &mut Dictionary::new());
        let first = c.download(DOMAIN, &data, ms(0)).unwrap();
        prop_assert!(matches!(converse(first, c, s, od), Progress::Done(_)));
        prop_assert_eq!(&od.domain, &data);
        let first = c.upload(DOMAIN, ms(0)).unwrap();
        prop_assert_eq!(done(converse(first, c, s, od)), data);
        prop_assert!(s.is_idle());
    }

    /// Whatever arrives, a request ends: with an answer, an abort or a timeout.
    #[test]
    fn no_sequence_of_frames_leaves_it_stuck(
        upload: bool,
        frames in prop::collection::vec((any::<[u8; 8]>(), 0usize..=8, 0u8..8, any::<bool>()), 0..40)
    ) {
        let mut c = client();
        let started = if upload { c.upload(DOMAIN, ms(0)) } else { c.download(DOMAIN, &[7; 32], ms(0)) };
        prop_assert!(started.is_ok());
        let mut ends = 0;
        for (mut bytes, len, command, real) in frames {
            if real {
                bytes[0] = command << 5 | bytes[0] & 0x1F;
                bytes[1..4].copy_from_slice(&[0x22, 0x1F, 1]);
            }
            let len = if real { 8 } else { len };
            let frame = Frame::data_frame(CobId::new(0x585).unwrap(), &bytes[..len]).unwrap();
            if matches!(c.on_frame(&frame, ms(0)), Progress::Done(_) | Progress::Failed(..)) {
                ends += 1;
            }
        }
        if matches!(c.poll(ms(500)), Progress::Failed(..)) {
            ends += 1;
        }
        prop_assert_eq!(ends, 1);
        prop_assert!(c.is_ready(ms(1000)));
    }
}

//! The SDO server, told as conversations: what the client sends and what it
//! must be answered (CiA 301, 7.2.4).

use crate::common::{DOMAIN, Dictionary, NODE, TIMEOUT, ms, request, response};
use canmaster::od::ObjectDictionary;
use canmaster::sdo::{AbortCode, Server};
use canmaster::{CobId, Frame};
use proptest::prelude::*;

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
        answer.map(|frame| {
            assert_eq!(frame.id(), CobId::new(0x585).unwrap());
            assert_eq!(frame.dlc(), 8);
            frame.padded()
        })
    }

    fn expect(&mut self, bytes: [u8; 8], answer: [u8; 8]) {
        assert_eq!(self.ask(bytes), Some(answer), "to {bytes:02X?}");
    }

    fn expect_abort(&mut self, bytes: [u8; 8], at: [u8; 3], code: AbortCode) {
        let [a, b, c, d] = code.0.to_le_bytes();
        self.expect(bytes, [0x80, at[0], at[1], at[2], a, b, c, d]);
        assert!(self.server.is_idle());
    }
}

#[test]
fn expedited_upload() {
    let mut b = Bench::new();
    b.expect(
        [0x40, 0x00, 0x10, 0, 0, 0, 0, 0],
        [0x43, 0x00, 0x10, 0, 0x92, 0x01, 0x02, 0],
    );
    b.expect(
        [0x40, 0x17, 0x10, 0, 0, 0, 0, 0],
        [0x4B, 0x17, 0x10, 0, 0, 0, 0, 0],
    );
    b.expect(
        [0x40, 0x18, 0x10, 0, 0, 0, 0, 0],
        [0x4F, 0x18, 0x10, 0, 4, 0, 0, 0],
    );
    assert!(b.server.is_idle());
}

#[test]
fn expedited_download() {
    let mut b = Bench::new();
    b.expect(
        [0x2B, 0x17, 0x10, 0, 50, 0, 0, 0],
        [0x60, 0x17, 0x10, 0, 0, 0, 0, 0],
    );
    assert_eq!(b.od.values.number(0x1017, 0), 50);
    // Without a size the type decides how many bytes are meant.
    b.expect(
        [0x22, 0x17, 0x10, 0, 0x34, 0x12, 9, 9],
        [0x60, 0x17, 0x10, 0, 0, 0, 0, 0],
    );
    assert_eq!(b.od.values.number(0x1017, 0), 0x1234);
}

#[test]
fn segmented_upload_of_a_device_name() {
    let mut b = Bench::new();
    b.expect(
        [0x40, 0x08, 0x10, 0, 0, 0, 0, 0],
        [0x41, 0x08, 0x10, 0, 5, 0, 0, 0],
    );
    b.expect([0x60, 0, 0, 0, 0, 0, 0, 0], *b"\x05EPOS4\0\0");
    assert!(b.server.is_idle());
}

#[test]
fn segmented_upload_in_several_segments_alternates_the_toggle() {
    let mut b = Bench::new();
    b.od.domain = b"abcdefghijklmnop".to_vec();
    b.expect(
        [0x40, 0x22, 0x1F, 1, 0, 0, 0, 0],
        [0x41, 0x22, 0x1F, 1, 16, 0, 0, 0],
    );
    b.expect([0x60, 0, 0, 0, 0, 0, 0, 0], *b"\x00abcdefg");
    b.expect([0x70, 0, 0, 0, 0, 0, 0, 0], *b"\x10hijklmn");
    b.expect([0x60, 0, 0, 0, 0, 0, 0, 0], *b"\x0Bop\0\0\0\0\0");
}

#[test]
fn an_empty_string_has_one_empty_segment() {
    let mut b = Bench::new();
    b.expect(
        [0x40, 0x09, 0x10, 0, 0, 0, 0, 0],
        [0x41, 0x09, 0x10, 0, 0, 0, 0, 0],
    );
    b.expect([0x60, 0, 0, 0, 0, 0, 0, 0], [0x0F, 0, 0, 0, 0, 0, 0, 0]);
}

#[test]
fn segmented_download() {
    let mut b = Bench::new();
    b.expect(
        [0x21, 0x22, 0x1F, 1, 9, 0, 0, 0],
        [0x60, 0x22, 0x1F, 1, 0, 0, 0, 0],
    );
    b.expect(*b"\x00abcdefg", [0x20, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(b.od.domain, b"");
    b.expect(*b"\x1Bhi\0\0\0\0\0", [0x30, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(b.od.domain, b"abcdefghi");
    assert!(b.server.is_idle());
}

#[test]
fn a_number_may_come_in_segments() {
    let mut b = Bench::new();
    b.expect(
        [0x21, 0x00, 0x21, 0, 8, 0, 0, 0],
        [0x60, 0x00, 0x21, 0, 0, 0, 0, 0],
    );
    b.expect([0x00, 1, 0, 0, 0, 0, 0, 0], [0x20, 0, 0, 0, 0, 0, 0, 0]);
    assert_ne!(b.od.values.number(0x2100, 0), 1);
    b.expect([0x1D, 0, 0, 0, 0, 0, 0, 0], [0x30, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(b.od.values.number(0x2100, 0), 1);
    b.expect(
        [0x20, 0x17, 0x10, 0, 0, 0, 0, 0],
        [0x60, 0x17, 0x10, 0, 0, 0, 0, 0],
    );
    b.expect([0x0B, 7, 0, 0, 0, 0, 0, 0], [0x20, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(b.od.values.number(0x1017, 0), 7);
}

#[test]
fn refusals_name_the_entry_and_the_reason() {
    let mut b = Bench::new();
    for (bytes, code) in [
        ([0x40, 0x01, 0x10, 0, 0, 0, 0, 0], AbortCode::NO_SUCH_OBJECT),
        (
            [0x40, 0x18, 0x10, 9, 0, 0, 0, 0],
            AbortCode::NO_SUCH_SUB_INDEX,
        ),
        ([0x40, 0x00, 0x20, 0, 0, 0, 0, 0], AbortCode::WRITE_ONLY),
        ([0x23, 0x00, 0x10, 0, 1, 2, 3, 4], AbortCode::READ_ONLY),
        ([0x2B, 0x60, 0x60, 0, 1, 0, 0, 0], AbortCode::TOO_LONG),
        ([0x2F, 0x17, 0x10, 0, 1, 0, 0, 0], AbortCode::TOO_SHORT),
        ([0x22, 0x00, 0x21, 0, 1, 0, 0, 0], AbortCode::TOO_SHORT),
        ([0x21, 0x00, 0x21, 0, 9, 0, 0, 0], AbortCode::TOO_LONG),
        ([0x21, 0x00, 0x21, 0, 7, 0, 0, 0], AbortCode::TOO_SHORT),
        ([0x2F, 0x60, 0x60, 0, 11, 0, 0, 0], AbortCode::VALUE_RANGE),
        ([0xE0, 0x60, 0x60, 0, 11, 0, 0, 0], AbortCode::COMMAND),
    ] {
        b.expect_abort(bytes, [bytes[1], bytes[2], bytes[3]], code);
    }
}

#[test]
fn a_wrong_toggle_aborts() {
    let mut b = Bench::new();
    b.ask([0x40, 0x08, 0x10, 0, 0, 0, 0, 0]);
    b.expect_abort(
        [0x70, 0, 0, 0, 0, 0, 0, 0],
        [0x08, 0x10, 0],
        AbortCode::TOGGLE,
    );
    b.ask([0x21, 0x22, 0x1F, 1, 9, 0, 0, 0]);
    b.expect_abort(*b"\x10abcdefg", [0x22, 0x1F, 1], AbortCode::TOGGLE);
    assert_eq!(b.od.cancelled, 1);
}

#[test]
fn a_segment_out_of_place_aborts() {
    let mut b = Bench::new();
    b.expect_abort([0x60, 0, 0, 0, 0, 0, 0, 0], [0, 0, 0], AbortCode::COMMAND);
    b.expect_abort([0x00, 0, 0, 0, 0, 0, 0, 0], [0, 0, 0], AbortCode::COMMAND);
    b.expect_abort([0xA3, 0, 0, 0, 0, 0, 0, 0], [0, 0, 0], AbortCode::COMMAND);
    b.ask([0x40, 0x08, 0x10, 0, 0, 0, 0, 0]);
    b.expect_abort(
        [0x00, 0, 0, 0, 0, 0, 0, 0],
        [0x08, 0x10, 0],
        AbortCode::COMMAND,
    );
}

#[test]
fn sizes_that_lie_abort() {
    let mut b = Bench::new();
    b.ask([0x21, 0x22, 0x1F, 1, 6, 0, 0, 0]);
    b.expect_abort(*b"\x00abcdefg", [0x22, 0x1F, 1], AbortCode::TOO_LONG);
    b.ask([0x21, 0x22, 0x1F, 1, 8, 0, 0, 0]);
    b.expect_abort(*b"\x01abcdefg", [0x22, 0x1F, 1], AbortCode::TOO_SHORT);
    b.ask([0x20, 0x00, 0x21, 0, 0, 0, 0, 0]);
    b.ask([0x00, 1, 2, 3, 4, 5, 6, 7]);
    b.expect_abort(
        [0x11, 8, 9, 0, 0, 0, 0, 0],
        [0x00, 0x21, 0],
        AbortCode::TOO_LONG,
    );
    assert_eq!(b.od.domain, b"");
    assert_eq!(b.od.values.number(0x2100, 0), 0x0807_0605_0403_0201);
}

#[test]
fn a_transfer_that_stands_still_is_aborted() {
    let mut b = Bench::new();
    assert_eq!(b.server.next_deadline(), None);
    b.ask([0x21, 0x22, 0x1F, 1, 9, 0, 0, 0]);
    assert_eq!(b.server.next_deadline(), Some(ms(500)));
    assert_eq!(b.server.poll(ms(499), &mut b.od), None);
    assert_eq!(
        b.server.poll(ms(500), &mut b.od),
        Some(response([0x80, 0x22, 0x1F, 1, 0x00, 0x00, 0x04, 0x05]))
    );
    assert_eq!(b.server.poll(ms(9999), &mut b.od), None);
    assert_eq!(b.od.cancelled, 1);
}

#[test]
fn an_initiate_replaces_the_transfer_of_a_client_that_gave_up() {
    let mut b = Bench::new();
    b.ask([0x21, 0x22, 0x1F, 1, 9, 0, 0, 0]);
    b.expect(
        [0x40, 0x18, 0x10, 0, 0, 0, 0, 0],
        [0x4F, 0x18, 0x10, 0, 4, 0, 0, 0],
    );
    assert_eq!(b.od.cancelled, 1);
    assert!(b.server.is_idle());
}

#[test]
fn an_abort_is_not_answered() {
    let mut b = Bench::new();
    b.ask([0x21, 0x22, 0x1F, 1, 9, 0, 0, 0]);
    assert_eq!(b.ask([0x80, 0x22, 0x1F, 1, 0, 0, 4, 5]), None);
    assert!(b.server.is_idle());
    assert_eq!(b.od.cancelled, 1);
}

#[test]
fn frames_of_other_lengths_and_other_nodes_are_ignored() {
    let mut b = Bench::new();
    let id = CobId::new(0x605).unwrap();
    for len in 0..8 {
        let frame = Frame::data_frame(id, &[0x40; 8][..len]).unwrap();
        assert_eq!(b.server.on_frame(&frame, ms(0), &mut b.od), None);
    }
    let remote = Frame::remote_frame(id, 8).unwrap();
    assert_eq!(b.server.on_frame(&remote, ms(0), &mut b.od), None);
    let other = Frame::full(CobId::new(0x606).unwrap(), [0x40, 0, 0x10, 0, 0, 0, 0, 0]);
    assert_eq!(b.server.on_frame(&other, ms(0), &mut b.od), None);
}

proptest! {
    /// Whatever arrives, the server answers at most once, with eight bytes, and
    /// is of use afterwards.
    #[test]
    fn no_sequence_of_frames_leaves_it_stuck(
        frames in prop::collection::vec((any::<[u8; 8]>(), 0usize..=8, 0u8..8, any::<bool>()), 0..40)
    ) {
        let mut b = Bench::new();
        b.od.domain = (0..100).collect();
        for (mut bytes, len, command, real) in frames {
            if real {
                // Often a real entry and a plausible command.
                bytes[0] = command << 5 | bytes[0] & 0x1F;
                bytes[1..4].copy_from_slice(&[0x22, 0x1F, 1]);
            }
            let len = if real { 8 } else { len };
            let frame = Frame::data_frame(CobId::new(0x605).unwrap(), &bytes[..len]).unwrap();
            let answer = b.server.on_frame(&frame, ms(0), &mut b.od);
            prop_assert!(answer.is_none_or(|f| f.dlc() == 8));
        }
        let mut now = ms(0);
        for _ in 0..1000 {
            now = now.max(b.server.next_deadline().unwrap_or(now));
            b.server.poll(now, &mut b.od);
        }
        prop_assert!(b.server.is_idle());
        b.expect([0x40, 0, 0x10, 0, 0, 0, 0, 0], [0x43, 0, 0x10, 0, 0x92, 1, 2, 0]);
    }

    #[test]
    fn a_domain_of_any_length_comes_back(data in prop::collection::vec(any::<u8>(), 1..200)) {
        let mut b = Bench::new();
        let [s0, s1, s2, s3] = (data.len() as u32).to_le_bytes();
        b.expect([0x21, 0x22, 0x1F, 1, s0, s1, s2, s3], [0x60, 0x22, 0x1F, 1, 0, 0, 0, 0]);
        let count = data.chunks(7).len();
        for (i, chunk) in data.chunks(7).enumerate() {
            let toggle = (i as u8 & 1) << 4;
            let mut bytes = [0; 8];
            bytes[0] = toggle | (7 - chunk.len() as u8) << 1 | u8::from(i + 1 == count);
            bytes[1..=chunk.len()].copy_from_slice(chunk);
            b.expect(bytes, [0x20 | toggle, 0, 0, 0, 0, 0, 0, 0]);
        }
        prop_assert_eq!(&b.od.domain, &data);
        prop_assert!(b.od.entry(DOMAIN).is_ok());
    }
}

//! Golden SDO frames, one for each class of objects.

use crate::rig::{Bench, node};
use canmaster::device::Event;
use canmaster::nmt::{Command, NodeControl};

const READ: u8 = 0x40;

#[test]
fn numbers_are_read_expedited() {
    let mut b = Bench::new();
    for (request, answer) in [
        // 1000h: no profile.
        (
            [READ, 0x00, 0x10, 0, 0, 0, 0, 0],
            [0x43, 0x00, 0x10, 0, 0, 0, 0, 0],
        ),
        // 1001h: no error.
        (
            [READ, 0x01, 0x10, 0, 0, 0, 0, 0],
            [0x4F, 0x01, 0x10, 0, 0, 0, 0, 0],
        ),
        // 1005h: 080h, not yet produced.
        (
            [READ, 0x05, 0x10, 0, 0, 0, 0, 0],
            [0x43, 0x05, 0x10, 0, 0x80, 0, 0, 0],
        ),
        // 1006h: 10 000 us.
        (
            [READ, 0x06, 0x10, 0, 0, 0, 0, 0],
            [0x43, 0x06, 0x10, 0, 0x10, 0x27, 0, 0],
        ),
        // 1014h: 080h + 127.
        (
            [READ, 0x14, 0x10, 0, 0, 0, 0, 0],
            [0x43, 0x14, 0x10, 0, 0xFF, 0, 0, 0],
        ),
        // 1016h:03: node 3, 250 ms.
        (
            [READ, 0x16, 0x10, 3, 0, 0, 0, 0],
            [0x43, 0x16, 0x10, 3, 0xFA, 0, 3, 0],
        ),
        // 1017h: 50 ms.
        (
            [READ, 0x17, 0x10, 0, 0, 0, 0, 0],
            [0x4B, 0x17, 0x10, 0, 50, 0, 0, 0],
        ),
        // 1018h:04
        (
            [READ, 0x18, 0x10, 4, 0, 0, 0, 0],
            [0x43, 0x18, 0x10, 4, 0x78, 0x56, 0x34, 0x12],
        ),
        // 1028h:06 and :07: six nodes.
        (
            [READ, 0x28, 0x10, 6, 0, 0, 0, 0],
            [0x43, 0x28, 0x10, 6, 0x86, 0, 0, 0],
        ),
        (
            [READ, 0x28, 0x10, 7, 0, 0, 0, 0],
            [0x43, 0x28, 0x10, 7, 0, 0, 0, 0x80],
        ),
        // 1029h:01: no change.
        (
            [READ, 0x29, 0x10, 1, 0, 0, 0, 0],
            [0x4F, 0x29, 0x10, 1, 1, 0, 0, 0],
        ),
        // 1200h:01, :02
        (
            [READ, 0x00, 0x12, 1, 0, 0, 0, 0],
            [0x43, 0x00, 0x12, 1, 0x7F, 6, 0, 0],
        ),
        (
            [READ, 0x00, 0x12, 2, 0, 0, 0, 0],
            [0x43, 0x00, 0x12, 2, 0xFF, 5, 0, 0],
        ),
        // 1282h: the channel to node 3.
        (
            [READ, 0x82, 0x12, 1, 0, 0, 0, 0],
            [0x43, 0x82, 0x12, 1, 0x03, 6, 0, 0],
        ),
        (
            [READ, 0x82, 0x12, 2, 0, 0, 0, 0],
            [0x43, 0x82, 0x12, 2, 0x83, 5, 0, 0],
        ),
        (
            [READ, 0x82, 0x12, 3, 0, 0, 0, 0],
            [0x4F, 0x82, 0x12, 3, 3, 0, 0, 0],
        ),
        // 1F80h: master, starts all by broadcast.
        (
            [READ, 0x80, 0x1F, 0, 0, 0, 0, 0],
            [0x43, 0x80, 0x1F, 0, 3, 0, 0, 0],
        ),
        // 1F81h:01: listed, may be started, mandatory.
        (
            [READ, 0x81, 0x1F, 1, 0, 0, 0, 0],
            [0x43, 0x81, 0x1F, 1, 0x0D, 0, 0, 0],
        ),
        // 1F84h:01, 1F85h:01: an EPOS4 of maxon.
        (
            [READ, 0x84, 0x1F, 1, 0, 0, 0, 0],
            [0x43, 0x84, 0x1F, 1, 0x92, 1, 2, 0],
        ),
        (
            [READ, 0x85, 0x1F, 1, 0, 0, 0, 0],
            [0x43, 0x85, 0x1F, 1, 0xFB, 0, 0, 0],
        ),
        // 1F89h: 1500 ms.
        (
            [READ, 0x89, 0x1F, 0, 0, 0, 0, 0],
            [0x43, 0x89, 0x1F, 0, 0xDC, 5, 0, 0],
        ),
    ] {
        b.expect(request, answer);
    }
}

#[test]
fn strings_are_read_in_segments() {
    let mut b = Bench::new();
    b.expect(
        [READ, 0x08, 0x10, 0, 0, 0, 0, 0],
        [0x41, 0x08, 0x10, 0, 9, 0, 0, 0],
    );
    b.expect([0x60, 0, 0, 0, 0, 0, 0, 0], *b"\x00canmast");
    b.expect([0x70, 0, 0, 0, 0, 0, 0, 0], *b"\x1Ber\0\0\0\0\0");
    assert_eq!(b.text(0x1009, 0), "NUCLEO-G474RE");
    assert_eq!(b.text(0x100A, 0), "0.1.0");
}

#[test]
fn numbers_are_written_expedited() {
    let mut b = Bench::new();
    b.expect(
        [0x2B, 0x17, 0x10, 0, 100, 0, 0, 0],
        [0x60, 0x17, 0x10, 0, 0, 0, 0, 0],
    );
    b.expect(
        [READ, 0x17, 0x10, 0, 0, 0, 0, 0],
        [0x4B, 0x17, 0x10, 0, 100, 0, 0, 0],
    );
    assert_eq!(b.device.settings().heartbeat().as_millis(), 100);
}

#[test]
fn what_follows_from_the_design_is_read_only() {
    let mut b = Bench::new();
    // 1000h: 06010002h.
    b.expect(
        [0x23, 0x00, 0x10, 0, 1, 0, 0, 0],
        [0x80, 0x00, 0x10, 0, 0x02, 0, 0x01, 0x06],
    );
    // 1F22h, by segments and by blocks: refused before any data is sent.
    b.expect(
        [0x21, 0x22, 0x1F, 1, 9, 0, 0, 0],
        [0x80, 0x22, 0x1F, 1, 0x02, 0, 0x01, 0x06],
    );
    b.expect(
        [0xC6, 0x22, 0x1F, 1, 9, 0, 0, 0],
        [0x80, 0x22, 0x1F, 1, 0x02, 0, 0x01, 0x06],
    );
}

/// One segment a block: more would be in the way of the RPDOs.
#[test]
fn a_block_download_comes_segment_by_segment() {
    let mut b = Bench::new();
    b.expect(
        [0xC2, 0x0F, 0x20, 0, 100, 0, 0, 0],
        [0xA4, 0x0F, 0x20, 0, 1, 0, 0, 0],
    );
}

#[test]
fn commands_are_writes() {
    let mut b = Bench::new();
    // 1F82h:02 = 5: start node 2.
    b.expect(
        [0x2F, 0x82, 0x1F, 2, 5, 0, 0, 0],
        [0x60, 0x82, 0x1F, 2, 0, 0, 0, 0],
    );
    let start = NodeControl::node(Command::Start, node(2));
    assert_eq!(b.events(), [Event::Nmt(start)]);
    // 1010h:01 = "save".
    b.expect(*b"\x23\x10\x10\x01save", [0x60, 0x10, 0x10, 1, 0, 0, 0, 0]);
    assert!(b.board.saved.is_some());
    b.expect(
        *b"\x23\x10\x10\x01evas",
        [0x80, 0x10, 0x10, 1, 0x20, 0, 0x00, 0x08],
    );
}

/// 1F22h:01 by block upload, and what it decodes to.
#[test]
fn the_concise_dcf_is_what_is_written_to_the_node() {
    use canmaster::network::{plan, sample::SIX_EPOS4_10_MS as SIX_EPOS4};
    let mut b = Bench::new();
    for (n, known) in (1..).zip(SIX_EPOS4.nodes) {
        let dcf = b.read(0x1F22, n).unwrap();
        let mut rest = &dcf[..];
        let mut take = |len: usize| {
            let (head, tail) = rest.split_at(len);
            rest = tail;
            let mut bytes = [0; 4];
            bytes[..len].copy_from_slice(head);
            u32::from_le_bytes(bytes)
        };
        let writes: Vec<_> = plan(&SIX_EPOS4, known).collect();
        assert_eq!(take(4) as usize, writes.len());
        for write in writes {
            assert_eq!(take(2), u32::from(write.at.index.0));
            assert_eq!(take(1), u32::from(write.at.sub.0));
            let len = take(4) as usize;
            assert_eq!(len, write.len());
            assert_eq!(take(len), write.value());
        }
        assert!(rest.is_empty());
    }
    assert_eq!(b.read(0x1F22, 7), Err(canmaster::sdo::AbortCode::NO_DATA));
}

#[test]
fn the_concise_dcf_by_blocks() {
    let mut b = Bench::new();
    let whole = b.read(0x1F22, 1).unwrap();
    let start = b.ask([0xA4, 0x22, 0x1F, 1, 127, 0, 0, 0]).unwrap();
    assert_eq!(start[0], 0xC6);
    assert_eq!(
        u32::from_le_bytes(start[4..].try_into().unwrap()),
        whole.len() as u32
    );
    assert_eq!(b.ask([0xA3, 0, 0, 0, 0, 0, 0, 0]), None);
    let mut data = Vec::new();
    for expected in 1.. {
        let Some(segment) = b.poll() else { break };
        let [sequence, bytes @ ..] = segment.padded();
        assert_eq!(sequence & 0x7F, expected);
        data.extend_from_slice(&bytes);
        if sequence & 0x80 != 0 {
            let end = b.ask([0xA2, expected, 127, 0, 0, 0, 0, 0]).unwrap();
            let unused = usize::from(end[0] >> 2 & 7);
            data.truncate(data.len() - unused);
            break;
        }
    }
    assert_eq!(b.ask([0xA1, 0, 0, 0, 0, 0, 0, 0]), None);
    assert_eq!(data, whole);
}

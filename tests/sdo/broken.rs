//! Transfers cut in the middle, sizes that lie, wrong sequence numbers: one by
//! one, at every position, by every protocol, both ways (CiA 301, 7.2.4.3).

use crate::common::DOMAIN;
use crate::wire::{BLOCK_SIZE, KINDS, Kind, To, Wire, data, frames, ways};
use canmaster::Frame;
use canmaster::sdo::{AbortCode, Protocol, SdoError};

/// Expedited, one segment, one block, and more of both.
const LENGTHS: [usize; 6] = [0, 4, 5, 7, 21, 50];
const OLD: &[u8] = b"what was there before";

fn wire(kind: Kind, whole: &[u8]) -> Wire {
    let mut wire = Wire::new();
    wire.od.domain = if kind.upload { whole } else { OLD }.to_vec();
    wire.begin(kind, whole);
    wire
}

/// The domain holds the old value or the whole new one; a transfer that the
/// client believes done is.
fn assert_whole(wire: &Wire, kind: Kind, whole: &[u8], result: Result<u32, SdoError>, name: &str) {
    if kind.upload {
        if result.is_ok() {
            assert_eq!(wire.memory.data, whole, "{name}");
        }
    } else if result.is_ok() {
        assert_eq!(wire.od.domain, whole, "{name}");
    } else {
        assert!(wire.od.domain == OLD || wire.od.domain == whole, "{name}");
    }
}

/// The same again, undisturbed.
fn again(wire: &mut Wire, kind: Kind, whole: &[u8], name: &str) {
    wire.settle();
    wire.memory.data.clear();
    wire.begin(kind, whole);
    let result = wire.run(|_, _, frame| Some(frame));
    assert_eq!(result, Ok(whole.len() as u32), "{name}");
    assert_whole(wire, kind, whole, result, name);
}

/// From some frame on nothing gets through, one way or both.
#[test]
fn a_transfer_may_be_cut_anywhere() {
    for kind in KINDS {
        for len in LENGTHS {
            let whole = data(len);
            let ways = ways(kind, &whole);
            // The end of a block upload is nobody's to wait for.
            let awaited = match (kind.protocol, kind.upload) {
                (Protocol::Block, true) => ways.len() - 1,
                _ => ways.len(),
            };
            for from in 0..ways.len() {
                for cut in [&[To::Server][..], &[To::Client], &[To::Server, To::Client]] {
                    let name = std::format!("{kind:?}, {len} bytes, {cut:?} from {from} on");
                    let mut wire = wire(kind, &whole);
                    let result = wire.run(|number, to, frame| {
                        (number < from || !cut.contains(&to)).then_some(frame)
                    });
                    assert_whole(&wire, kind, &whole, result, &name);
                    let lost = (from..awaited).any(|number| cut.contains(&ways[number]));
                    let ended = result.map_err(|error| (error.address(), error.code()));
                    let timeout = Err((DOMAIN, AbortCode::TIMEOUT));
                    assert_eq!(ended, if lost { timeout } else { Ok(len as u32) }, "{name}");
                    again(&mut wire, kind, &whole, &name);
                }
            }
        }
    }
}

/// A single frame is lost: the transfer goes on, or ends; it never lies.
#[test]
fn any_single_frame_may_be_lost() {
    for kind in KINDS {
        for len in LENGTHS {
            let whole = data(len);
            for lost in 0..frames(kind, &whole) {
                let name = std::format!("{kind:?}, {len} bytes, without {lost}");
                let mut wire = wire(kind, &whole);
                let result = wire.run(|number, _, frame| (number != lost).then_some(frame));
                assert_whole(&wire, kind, &whole, result, &name);
                again(&mut wire, kind, &whole, &name);
            }
        }
    }
}

/// The client loses interest at every point: its abort ends the server's side.
#[test]
fn the_client_may_give_up_anywhere() {
    for kind in KINDS {
        let whole = data(50);
        for at in 0..frames(kind, &whole) - 1 {
            let name = std::format!("{kind:?}, given up at {at}");
            let mut wire = wire(kind, &whole);
            // The server says no more, so that the client is stopped there.
            let error =
                wire.run(|number, to, frame| (number < at || to == To::Server).then_some(frame));
            assert_eq!(
                error.map_err(|e| e.code()),
                Err(AbortCode::TIMEOUT),
                "{name}"
            );
            again(&mut wire, kind, &whole, &name);
        }
    }
}

fn with_size(frame: Frame, size: u32) -> Frame {
    let [command, b1, b2, b3, ..] = frame.padded();
    let [s0, s1, s2, s3] = size.to_le_bytes();
    Frame::full(frame.id(), [command, b1, b2, b3, s0, s1, s2, s3])
}

#[test]
fn a_size_that_lies_ends_the_transfer() {
    for kind in KINDS {
        for len in [5, 7, 14, 21, 22, 50] {
            let whole = data(len);
            let right = len as u32;
            // Whoever sends the data announces its size.
            let initiate = usize::from(kind.upload);
            for size in (0..64).chain([right + 7 * 127, u32::MAX]) {
                let name = std::format!("{kind:?}, {len} bytes announced as {size}");
                let mut wire = wire(kind, &whole);
                let result = wire.run(|number, _, frame| {
                    let lies = number == initiate;
                    Some(if lies { with_size(frame, size) } else { frame })
                });
                if size == right {
                    assert_eq!(result, Ok(right), "{name}");
                    continue;
                }
                let error = result.expect_err(&name);
                let wanted: &[AbortCode] = if kind.upload {
                    assert!(matches!(error, SdoError::Size { announced, .. } if announced == size));
                    &[AbortCode::LENGTH_MISMATCH]
                } else if size < right {
                    &[AbortCode::TOO_LONG]
                } else {
                    &[AbortCode::TOO_SHORT]
                };
                assert!(wanted.contains(&error.code()), "{name}: {error}");
                assert!(kind.upload || wire.od.domain == OLD, "{name}");
                again(&mut wire, kind, &whole, &name);
            }
        }
    }
}

/// One segment of a block says another number than its own.
#[test]
fn a_wrong_sequence_number_never_corrupts() {
    for kind in KINDS
        .into_iter()
        .filter(|kind| kind.protocol == Protocol::Block)
    {
        let whole = data(50);
        let sender = if kind.upload { To::Client } else { To::Server };
        for wrong in 0..frames(kind, &whole) {
            for number in 1..=127 {
                let name = std::format!("{kind:?}, frame {wrong} numbered {number}");
                let mut wire = wire(kind, &whole);
                let mut touched = false;
                let result = wire.run(|n, to, frame| {
                    let [head, rest @ ..] = frame.padded();
                    let is_segment = (1..=127).contains(&(head & 0x7F)) && n > 2;
                    if n != wrong || to != sender || !is_segment || head & 0x7F > 8 {
                        return Some(frame);
                    }
                    touched = true;
                    let [a, b, c, d, e, f, g] = rest;
                    let head = head & 0x80 | number;
                    Some(Frame::full(frame.id(), [head, a, b, c, d, e, f, g]))
                });
                assert_whole(&wire, kind, &whole, result, &name);
                assert!(touched || result.is_ok(), "{name}");
                again(&mut wire, kind, &whole, &name);
            }
        }
    }
}

/// An acknowledgement of a block says another number, or asks for blocks of
/// another size.
#[test]
fn a_wrong_acknowledgement_never_corrupts() {
    for kind in KINDS
        .into_iter()
        .filter(|kind| kind.protocol == Protocol::Block)
    {
        let whole = data(50);
        for wrong in 0..frames(kind, &whole) {
            for sequence in 0..=BLOCK_SIZE + 2 {
                for block_size in [0, 1, 2, BLOCK_SIZE, 127, 128, 255] {
                    let name = std::format!("{kind:?}, frame {wrong}: {sequence}, {block_size}");
                    let mut wire = wire(kind, &whole);
                    let result = wire.run(|n, to, frame| {
                        let receiver = if kind.upload { To::Server } else { To::Client };
                        let is_acknowledge = to == receiver && frame.padded()[0] == 0xA2;
                        if n != wrong || !is_acknowledge {
                            return Some(frame);
                        }
                        let bytes = [0xA2, sequence, block_size, 0, 0, 0, 0, 0];
                        Some(Frame::full(frame.id(), bytes))
                    });
                    assert_whole(&wire, kind, &whole, result, &name);
                    again(&mut wire, kind, &whole, &name);
                }
            }
        }
    }
}

/// A frame comes twice, as after an error in the last bit of its end of frame
/// (ISO 11898-1: the sender repeats what the receiver has taken).
#[test]
fn a_frame_that_comes_twice_never_corrupts() {
    for kind in KINDS {
        for len in LENGTHS {
            let whole = data(len);
            for twice in 0..frames(kind, &whole) {
                let name = std::format!("{kind:?}, {len} bytes, {twice} twice");
                let mut wire = wire(kind, &whole);
                wire.twice = Some(twice);
                let result = wire.run(|_, _, frame| Some(frame));
                assert_whole(&wire, kind, &whole, result, &name);
                again(&mut wire, kind, &whole, &name);
            }
        }
    }
}

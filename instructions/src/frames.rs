//! The transmit queue, and frames to and from bytes.

use std::hint::black_box;

use canmaster::Frame;
use canmaster::id::CobId;
use canmaster::master::{Burst, TxQueue};
use embedded_can::{Frame as _, Id, StandardId};

const ROOM: usize = 36;
/// A burst: RPDO1 of six axes.
const BURST: u16 = 6;
const RPDO1: u16 = 0x200;
const BYTES: [u8; 8] = [1, 2, 3, 4, 5, 6, 7, 8];

fn frame(id: u16) -> Frame {
    Frame::full(CobId::new(id).unwrap_or(CobId::NMT), BYTES)
}

fn burst() -> TxQueue<ROOM> {
    let mut queue = TxQueue::new();
    fill(&mut queue);
    queue
}

fn fill(queue: &mut TxQueue<ROOM>) {
    for node in 1..=BURST {
        let _ = black_box(queue.put(black_box(frame(RPDO1 + node))));
    }
}

/// RPDO1 of six axes, in the order in which they are sent.
pub(crate) fn put(times: u32) {
    let mut queue = TxQueue::new();
    for _ in 0..times {
        queue.clear();
        fill(&mut queue);
    }
}

/// A newer RPDO takes the place of one that waits.
pub(crate) fn put_latest(times: u32) {
    let mut queue = burst();
    for _ in 0..times {
        let _ = black_box(queue.put_latest(black_box(frame(RPDO1 + BURST))));
    }
}

/// The same, and their way to the controller.
pub(crate) fn next(times: u32) {
    let mut queue = TxQueue::new();
    for _ in 0..times {
        fill(&mut queue);
        while let Some(frame) = queue.next(black_box(&[u16::MAX; 3])) {
            black_box(frame);
        }
    }
}

/// A burst of RPDOs, from the step of the axes to the controller.
pub(crate) fn burst_of_six(times: u32) {
    let mut burst = Burst::<ROOM>::new();
    for _ in 0..times {
        black_box(burst.begin());
        for node in 1..=BURST {
            burst.put(black_box(frame(RPDO1 + node)));
        }
        while let Some(frame) = burst.next(black_box(&[u16::MAX; 3])) {
            black_box(frame);
        }
    }
}

/// As from the controller.
pub(crate) fn from_bytes(times: u32) {
    for _ in 0..times {
        let id = StandardId::new(black_box(RPDO1 + 1)).map(Id::Standard);
        let frame = id.and_then(|id| Frame::new(id, black_box(&BYTES)));
        black_box(frame);
    }
}

/// As to the controller.
pub(crate) fn to_bytes(times: u32) {
    let frame = frame(RPDO1 + 1);
    for _ in 0..times {
        let frame = black_box(&frame);
        black_box((embedded_can::Frame::id(frame), frame.padded(), frame.dlc()));
    }
}

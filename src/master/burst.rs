//! The RPDOs of one cycle on one bus.

use super::tx_queue::{Pending, holds};
use crate::frame::Frame;
use heapless::Vec;

/// Up to `N` RPDOs, sent in the order in which they were put.
#[derive(Debug, Default)]
pub struct Burst<const N: usize> {
    frames: Vec<Frame, N>,
    sent: usize,
}

impl<const N: usize> Burst<N> {
    /// Nothing to be sent.
    pub const fn new() -> Burst<N> {
        Burst {
            frames: Vec::new(),
            sent: 0,
        }
    }

    /// Begins the burst of another cycle, or none. How many frames of the last
    /// were not sent: they never will be.
    pub fn begin(&mut self) -> usize {
        let left = self.frames.len() - self.sent;
        self.frames.clear();
        self.sent = 0;
        left
    }

    /// Puts a frame behind the others. What is more than `N` is left out.
    pub fn put(&mut self, frame: Frame) {
        let _ = self.frames.push(frame);
    }

    /// Whether all are sent.
    #[inline]
    pub fn is_over(&self) -> bool {
        self.sent >= self.frames.len()
    }

    /// The next frame, unless its identifier is one of those that are `pending` in
    /// the controller's buffers, which does not keep the order of equal ones.
    #[inline(always)]
    pub fn next(&mut self, pending: &Pending) -> Option<&Frame> {
        let frame = self.frames.get(self.sent)?;
        if holds(pending, frame.id()) {
            return None;
        }
        self.sent += 1;
        Some(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::id::CobId;

    const FREE: u16 = u16::MAX;

    fn frame(id: u16) -> Frame {
        Frame::empty(CobId::new(id).unwrap())
    }

    #[test]
    fn in_their_order_each_once() {
        let mut burst = Burst::<3>::new();
        assert!(burst.is_over());
        assert_eq!(burst.next(&[FREE; 3]), None);
        for id in [0x203, 0x201, 0x301, 0x302] {
            burst.put(frame(id));
        }
        for id in [0x203, 0x201, 0x301] {
            assert!(!burst.is_over());
            assert_eq!(burst.next(&[FREE, 0x700, FREE]), Some(&frame(id)));
        }
        assert!(burst.is_over());
        assert_eq!(burst.begin(), 0);
    }

    #[test]
    fn never_two_equal_identifiers_in_the_controller() {
        let mut burst = Burst::<3>::new();
        burst.put(frame(0x201));
        assert_eq!(burst.next(&[0x201, FREE, FREE]), None);
        assert_eq!(burst.next(&[FREE; 3]), Some(&frame(0x201)));
    }

    #[test]
    fn what_was_not_sent_is_told() {
        let mut burst = Burst::<3>::new();
        for id in [0x201, 0x202, 0x203] {
            burst.put(frame(id));
        }
        assert!(burst.next(&[FREE; 3]).is_some());
        assert_eq!(burst.begin(), 2);
        assert!(burst.is_over());
    }
}

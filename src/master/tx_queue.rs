//! The frames that wait for one of the controller's transmit buffers.

use crate::{
    frame::Frame,
    id::{CobId, FunctionCode, NodeId},
};
use heapless::Vec;

/// The buffers that frames other than SYNC may occupy. A third stays free, so
/// that a SYNC never waits for more than the frame on the wire.
const SHARED_BUFFERS: u32 = 2;
/// All of them.
const BUFFERS: usize = 3;
/// The identifiers of SDO begin here.
const SDO: u16 = FunctionCode::SdoResponse.base();
/// The bits of an identifier that tell its function.
const FUNCTION: u16 = !(NodeId::MAX.get() as u16);

/// The queue is full: the frame was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Overflow {
    /// The identifier of the frame that was lost.
    pub id: CobId,
}

/// What became of a frame given to [`TxQueue::put_latest`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Put {
    /// It waits its turn.
    Queued,
    /// It took the place of an older one that had not been sent.
    Replaced,
}

/// The identifiers of the frames in the controller's three buffers; numbers above
/// 7FFh stand for buffers without a frame.
pub type Pending = [u16; BUFFERS];

/// How many more frames the controller may be given, bit n of `waiting` being set
/// if its buffer n holds one. A SYNC counts: it leaves soon, and the controller
/// tells when.
#[inline(always)]
pub fn room(waiting: u32) -> u8 {
    const ROOM: [u8; 1 << BUFFERS] = {
        let (mut all, mut waiting) = ([0; 1 << BUFFERS], 0);
        let mut left: &mut [u8] = &mut all;
        while let Some((room, more)) = left.split_first_mut() {
            *room = SHARED_BUFFERS.saturating_sub(u32::count_ones(waiting)) as u8;
            (left, waiting) = (more, waiting + 1);
        }
        all
    };
    ROOM.get(waiting as usize).copied().unwrap_or(0)
}

/// Whether a frame with the identifier `id` is `pending`.
#[inline(always)]
pub fn holds(pending: &Pending, id: CobId) -> bool {
    let [a, b, c] = *pending;
    let id = id.get();
    a == id || b == id || c == id
}

/// Whether it is a heartbeat's or guarding's.
const fn is_error_control(id: u16) -> bool {
    id & FUNCTION == FunctionCode::ErrorControl.base()
}

/// How urgent an identifier is: the lower, the more. Heartbeats come next to NMT:
/// they are rare, and the drives stop without the master's, however much else
/// there is to send. SDO requests and answers are all alike, or those to the highest
/// node-IDs would wait for longer than their timeout while the bus is full of the
/// others, and all of them while a client reads the board's dictionary.
const fn rank(id: CobId) -> u16 {
    let id = id.get();
    if is_error_control(id) {
        CobId::NMT.get() + 1
    } else if id >= SDO {
        SDO
    } else {
        id
    }
}

/// A queue of up to `N` frames: heartbeats first but for NMT, then the lowest
/// identifier; SDO, LSS and equal identifiers first in, first out.
#[derive(Debug, Default)]
pub struct TxQueue<const N: usize> {
    /// The most urgent frame last.
    frames: Vec<Frame, N>,
    overflows: u32,
}

impl<const N: usize> TxQueue<N> {
    /// An empty queue.
    pub const fn new() -> TxQueue<N> {
        TxQueue {
            frames: Vec::new(),
            overflows: 0,
        }
    }

    /// Queues `frame` behind all that are as urgent.
    ///
    /// # Errors
    ///
    /// [`Overflow`], which is also counted.
    pub fn put(&mut self, frame: Frame) -> Result<(), Overflow> {
        self.insert(frame, false).map(|_| ())
    }

    /// Queues `frame`, or lets it take the place of the one with the same
    /// identifier that still waits: for process data, of which only the newest
    /// is worth sending.
    ///
    /// # Errors
    ///
    /// [`Overflow`], which is also counted.
    pub fn put_latest(&mut self, frame: Frame) -> Result<Put, Overflow> {
        self.insert(frame, true)
    }

    #[inline(never)]
    fn insert(&mut self, frame: Frame, replace: bool) -> Result<Put, Overflow> {
        let id = frame.id();
        let mut place = self.frames.len();
        while let Some(before) = place.checked_sub(1)
            && let Some(queued) = self.frames.get_mut(before)
            && rank(queued.id()) <= rank(id)
        {
            if replace && queued.id() == id {
                *queued = frame;
                return Ok(Put::Replaced);
            }
            place = before;
        }
        match self.frames.insert(place, frame) {
            Ok(()) => Ok(Put::Queued),
            Err(_) => {
                self.overflows = self.overflows.saturating_add(1);
                Err(Overflow { id })
            }
        }
    }

    /// Takes the frame to be given to the controller next.
    ///
    /// `None` if nothing waits but identifiers that are `pending` there: the
    /// controller does not keep the order of equal identifiers, so it gets the next
    /// only when the last has left. Whether there is [`room`] is for the caller to
    /// see.
    ///
    /// While a heartbeat is in a buffer, SDO waits here: on a bus full of it no
    /// heartbeat, which has the lowest priority of all, would get through. Once
    /// the answers under way are over, the master's does and, being the last,
    /// lets those of the nodes pass before.
    pub fn next(&mut self, pending: &Pending) -> Option<Frame> {
        self.next_of(pending, |_| true)
    }

    /// The same, of those whose identifier `may` go now.
    pub fn next_of(&mut self, pending: &Pending, may: impl Fn(CobId) -> bool) -> Option<Frame> {
        let [a, b, c] = *pending;
        let beating = is_error_control(a) || is_error_control(b) || is_error_control(c);
        let position = self.frames.iter().rposition(|queued| {
            let id = queued.id();
            may(id) && !holds(pending, id) && !(beating && id.get() >= SDO)
        })?;
        Some(self.frames.remove(position))
    }

    /// How many frames wait.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether none waits.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Drops what waits: after bus-off nothing old may be sent.
    pub fn clear(&mut self) {
        self.frames.clear();
    }

    /// How many frames were lost because the queue was full.
    pub fn overflows(&self) -> u32 {
        self.overflows
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec as StdVec;

    const FREE: u16 = u16::MAX;
    const NONE: Pending = [FREE; 3];

    fn frame(id: u16, tag: u8) -> Frame {
        Frame::data_frame(CobId::new(id).unwrap(), &[tag]).unwrap()
    }

    fn next<const N: usize>(queue: &mut TxQueue<N>, pending: &Pending) -> Option<(u16, u8)> {
        let frame = queue.next(pending)?;
        Some((frame.id().get(), frame.data()[0]))
    }

    #[test]
    fn heartbeats_come_next_to_nmt_and_sdo_waits_until_they_are_sent() {
        let mut queue = TxQueue::<8>::new();
        for id in [0x602, 0x601, 0x5FF, 0x201, 0x77F, 0x000] {
            queue.put(frame(id, 0)).unwrap();
        }
        assert_eq!(next(&mut queue, &NONE), Some((0x000, 0)));
        assert_eq!(next(&mut queue, &NONE), Some((0x77F, 0)));
        let heartbeat = [0x77F, FREE, FREE];
        assert_eq!(next(&mut queue, &heartbeat), Some((0x201, 0)));
        assert_eq!(next(&mut queue, &heartbeat), None);
        // LSS makes pauses by itself.
        let lss = [FREE, 0x7E5, FREE];
        // Whoever came first.
        assert_eq!(next(&mut queue, &lss), Some((0x602, 0)));
        assert_eq!(next(&mut queue, &NONE), Some((0x601, 0)));
        assert_eq!(next(&mut queue, &NONE), Some((0x5FF, 0)));
    }

    #[test]
    fn the_lowest_identifier_goes_first_and_equal_ones_in_order() {
        let mut queue = TxQueue::<8>::new();
        for (id, tag) in [
            (0x601, 1),
            (0x201, 1),
            (0x601, 2),
            (0x77F, 1),
            (0x000, 1),
            (0x201, 2),
        ] {
            queue.put(frame(id, tag)).unwrap();
        }
        let order: StdVec<_> = core::iter::from_fn(|| next(&mut queue, &NONE)).collect();
        let expected = [
            (0, 1),
            (0x77F, 1),
            (0x201, 1),
            (0x201, 2),
            (0x601, 1),
            (0x601, 2),
        ];
        assert_eq!(order, expected);
    }

    #[test]
    fn an_identifier_in_the_controller_is_not_given_again() {
        let mut queue = TxQueue::<8>::new();
        for (id, tag) in [(0x601, 1), (0x601, 2), (0x602, 1)] {
            queue.put(frame(id, tag)).unwrap();
        }
        assert_eq!(next(&mut queue, &[0x601, FREE, FREE]), Some((0x602, 1)));
        assert_eq!(next(&mut queue, &[0x601, FREE, FREE]), None);
        assert_eq!(next(&mut queue, &NONE), Some((0x601, 1)));
    }

    #[test]
    fn some_may_have_to_wait() {
        let mut queue = TxQueue::<8>::new();
        queue.put(frame(0x301, 1)).unwrap();
        queue.put(frame(0x601, 1)).unwrap();
        let sdo = queue.next_of(&NONE, |id| id.get() > 0x580).unwrap();
        assert_eq!(sdo.id().get(), 0x601);
        assert_eq!(queue.next_of(&NONE, |id| id.get() > 0x580), None);
        assert_eq!(queue.len(), 1);
    }

    #[test]
    fn one_buffer_stays_free_for_sync() {
        let rooms: StdVec<_> = (0..9).map(room).collect();
        assert_eq!(rooms, [2, 1, 1, 0, 1, 0, 0, 0, 0]);
    }

    #[test]
    fn overflow_is_told_and_counted() {
        let mut queue = TxQueue::<2>::new();
        queue.put(frame(0x201, 1)).unwrap();
        queue.put(frame(0x202, 1)).unwrap();
        let id = CobId::new(0x203).unwrap();
        assert_eq!(queue.put(frame(0x203, 1)), Err(Overflow { id }));
        assert_eq!(queue.put_latest(frame(0x203, 1)), Err(Overflow { id }));
        assert_eq!(queue.put_latest(frame(0x202, 9)), Ok(Put::Replaced));
        assert_eq!((queue.overflows(), queue.len()), (2, 2));
    }

    #[test]
    fn process_data_is_replaced_by_newer() {
        let mut queue = TxQueue::<4>::new();
        assert_eq!(queue.put_latest(frame(0x201, 1)), Ok(Put::Queued));
        assert_eq!(queue.put_latest(frame(0x201, 2)), Ok(Put::Replaced));
        assert_eq!(next(&mut queue, &NONE), Some((0x201, 2)));
        assert!(queue.is_empty());
    }

    proptest! {
        /// Against a model: stable sort by identifier.
        #[test]
        fn it_is_a_stable_sort(ids in proptest::collection::vec(0_u16..0x10, 0..20)) {
            let mut queue = TxQueue::<32>::new();
            for (tag, id) in ids.iter().enumerate() {
                queue.put(frame(*id, tag as u8)).unwrap();
            }
            let mut model: StdVec<(u16, u8)> =
                ids.iter().enumerate().map(|(tag, id)| (*id, tag as u8)).collect();
            model.sort_by_key(|(id, _)| *id);
            let order: StdVec<_> = core::iter::from_fn(|| next(&mut queue, &NONE)).collect();
            prop_assert_eq!(order, model);
        }
    }
}

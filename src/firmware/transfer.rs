//! 2F12h: moves test data between the board and a node, as fast as it goes.
//!
//! The answers of that node come past the boot-up meanwhile, so that it hears
//! nothing from it. A node that boots again under the test is silent for the
//! boot-up until the test has failed, which it does within its timeout.

use crate::lines::{self, Lines};
use canmaster::{
    Frame, NodeId, design,
    device::TransferTest,
    id::CobId,
    sdo::{AbortCode, Channel, Course, Link, Session, TestData},
    time::{Duration, Instant},
};
use core::sync::atomic::{AtomicU16, Ordering::Relaxed};
use heapless::spsc::Consumer;
use rtic::Mutex;

/// How long the node may take for an answer; and after a failure everything that
/// it may still have to say is waited for as long.
const TIMEOUT: Duration = Duration::from_millis(100);

/// The identifier of the answers that are the test's; 0: none.
static ANSWERS: AtomicU16 = AtomicU16::new(0);

/// Whether the test wants the answers with this identifier.
#[inline(always)]
pub(crate) fn wants(id: CobId) -> bool {
    id.get() == ANSWERS.load(Relaxed)
}

/// The bus and the clock as the test has them.
struct Bus<'a, T> {
    answers: &'a mut Consumer<'static, Frame>,
    lines: &'a mut T,
    now: Instant,
}

impl<T: Mutex<T = Lines>> Link for Bus<'_, T> {
    fn now(&self) -> Instant {
        self.now
    }

    /// Where there is no room, the queue is looked at again in the next
    /// millisecond: it does not run empty before.
    fn send(&mut self, frame: Frame) -> bool {
        lines::send(self.lines, frame, design::OWN_FRAMES)
    }

    fn receive(&mut self) -> Option<Frame> {
        self.answers.dequeue()
    }
}

/// A test under way.
pub(crate) struct Transfer {
    channel: Channel,
    session: Session,
    data: TestData,
    begun: Instant,
}

impl Transfer {
    fn new(test: &TransferTest, now: Instant) -> Transfer {
        // It was checked.
        let node = test.node().unwrap_or(NodeId::MAX);
        let channel = Channel::new(node, TIMEOUT);
        ANSWERS.store(channel.response_id().get(), Relaxed);
        let size = (!test.is_upload()).then_some(test.size());
        Transfer {
            channel,
            session: Session::new(test.at(), size, test.protocol()),
            data: TestData::new(test.seed()),
            begun: now,
        }
    }
}

/// Goes on with the test if one is under way. `Some`: until when nothing is to be
/// done unless an answer comes.
pub(crate) fn go_on(
    transfer: &mut Option<Transfer>,
    test: &mut TransferTest,
    answers: &mut Consumer<'static, Frame>,
    lines: &mut impl Mutex<T = Lines>,
    now: Instant,
) -> Option<Instant> {
    if !test.is_under_way() {
        return None;
    }
    let Transfer {
        channel,
        session,
        data,
        begun,
    } = transfer.get_or_insert_with(|| Transfer::new(test, now));
    let bus = &mut Bus {
        answers,
        lines,
        now,
    };
    let result = match session.go_on(channel, bus, data) {
        Course::Until(until) => return Some(until),
        Course::Over(Ok(transfer)) if transfer.len == test.size() => Ok(()),
        Course::Over(Ok(_)) => Err(AbortCode::LENGTH_MISMATCH),
        Course::Over(Err(error)) => Err(error.code()),
    };
    test.end(data.reached(), (now - *begun).as_micros(), result);
    *transfer = None;
    ANSWERS.store(0, Relaxed);
    None
}

//! What must not happen and is counted if it does. The interrupt tasks count,
//! `network` reports each change.

use canmaster::master::WrongLength;
use core::sync::atomic::{AtomicU32, Ordering};

/// A counter that any task may increment.
pub(crate) struct Counter(AtomicU32);

impl Counter {
    const fn new() -> Counter {
        Counter(AtomicU32::new(0))
    }

    /// Counts `more`.
    #[inline]
    pub(crate) fn add(&self, more: u32) {
        self.0.fetch_add(more, Ordering::Relaxed);
    }

    pub(crate) fn get(&self) -> u32 {
        self.0.load(Ordering::Relaxed)
    }
}

/// SYNCs not sent because the last one was still waiting for the bus.
pub(crate) static SYNC_NOT_SENT: Counter = Counter::new();
/// RPDOs that were still waiting when the next one came, or that came too late
/// for the window of the SYNC.
pub(crate) static RPDO_REPLACED: Counter = Counter::new();
/// Received frames that the controller lost because a FIFO was full.
pub(crate) static RX_OVERRUNS: Counter = Counter::new();
/// Received frames lost because a task's queue was full.
pub(crate) static RX_QUEUE_FULL: Counter = Counter::new();
/// TPDOs shorter than mapped.
pub(crate) static TPDO_LENGTH: Counter = Counter::new();
/// Answers to the background's SDO requests.
pub(crate) static ANSWERS: Counter = Counter::new();

/// Lines that found the queue to the log full.
pub(crate) static LOG_FULL: Counter = Counter::new();

/// All counts at one moment.
#[expect(unreachable_pub, reason = "RTIC wants shared resources to be public")]
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    pub(crate) sync_not_sent: u32,
    pub(crate) rpdo_replaced: u32,
    /// Cycles that `pdo_producer` did not take up before the next SYNC.
    pub(crate) cycle_overruns: u32,
    /// Frames that found the transmit queue full.
    pub(crate) tx_overflows: u32,
    pub(crate) rx_overruns: u32,
    pub(crate) rx_queue_full: u32,
    pub(crate) tpdo_length: u32,
    /// The last TPDO of wrong length since the counts before.
    pub(crate) wrong_length: Option<WrongLength>,
    pub(crate) log_full: u32,
}

impl Counts {
    /// The counters here, and the two that others keep.
    pub(crate) fn now(
        cycle_overruns: u32,
        wrong_length: Option<WrongLength>,
        tx_overflows: u32,
    ) -> Counts {
        Counts {
            sync_not_sent: SYNC_NOT_SENT.get(),
            rpdo_replaced: RPDO_REPLACED.get(),
            cycle_overruns,
            tx_overflows,
            rx_overruns: RX_OVERRUNS.get(),
            rx_queue_full: RX_QUEUE_FULL.get(),
            tpdo_length: TPDO_LENGTH.get(),
            wrong_length,
            log_full: LOG_FULL.get(),
        }
    }
}

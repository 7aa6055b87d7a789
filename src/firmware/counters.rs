//! What must not happen and is counted if it does. The interrupt tasks count,
//! `network` reports each change.

use core::sync::atomic::{AtomicU32, Ordering};

/// A counter that any task may increment.
pub(crate) struct Counter(AtomicU32);

impl Counter {
    const fn new() -> Counter {
        Counter(AtomicU32::new(0))
    }

    /// Counts one.
    #[inline]
    pub(crate) fn count(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    /// So many.
    pub(crate) fn get(&self) -> u32 {
        self.0.load(Ordering::Relaxed)
    }
}

/// SYNCs not sent because the last one was still waiting for the bus.
pub(crate) static SYNC_NOT_SENT: Counter = Counter::new();
/// Received frames that the controller lost because a FIFO was full.
pub(crate) static RX_OVERRUNS: Counter = Counter::new();
/// Received frames lost because a task's queue was full.
pub(crate) static RX_QUEUE_FULL: Counter = Counter::new();
/// TPDOs of a length that is not the mapped one.
pub(crate) static TPDO_LENGTH: Counter = Counter::new();

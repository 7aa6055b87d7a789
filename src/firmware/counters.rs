//! What must not happen and is counted if it does. The interrupt tasks count,
//! `network` reports each change.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// What is counted.
#[derive(Clone, Copy)]
pub(crate) enum Count {
    /// SYNCs not sent because the last one was still waiting for the bus.
    SyncNotSent,
    /// RPDOs that were still waiting when the next one came, or that came too late
    /// for the window of the SYNC.
    RpdoReplaced,
    /// Cycles that `pdo_producer` did not take up before the next SYNC.
    CycleOverruns,
    /// Frames that found the transmit queue full.
    TxOverflows,
    /// Received frames that the controller lost because a FIFO was full.
    RxOverruns,
    /// Received frames lost because a task's queue was full.
    RxQueueFull,
    /// TPDOs shorter than mapped.
    TpdoLength,
    /// Lines that found the queue to the log full.
    LogFull,
    /// Answers to the background's SDO requests. These may happen.
    Answers,
}

/// Those that must not happen.
const ERRORS: usize = Count::Answers as usize;

static COUNTS: [AtomicU32; ERRORS + 1] = [const { AtomicU32::new(0) }; ERRORS + 1];

impl Count {
    /// Counts `more`: any task may.
    #[inline(never)]
    pub(crate) fn add(self, more: u32) {
        if let Some(count) = COUNTS.get(self as usize) {
            count.fetch_add(more, Relaxed);
        }
    }

    /// Takes over a count that is kept elsewhere.
    pub(crate) fn set(self, count: u32) {
        if let Some(place) = COUNTS.get(self as usize) {
            place.store(count, Relaxed);
        }
    }

    #[inline(never)]
    pub(crate) fn get(self) -> u32 {
        let count = COUNTS.get(self as usize);
        count.map_or(0, |count| count.load(Relaxed))
    }
}

/// All that must not happen, modulo 2^32: another number when more of it has.
pub(crate) fn sum() -> u32 {
    let errors = COUNTS.iter().take(ERRORS);
    errors.fold(0, |sum, count| sum.wrapping_add(count.load(Relaxed)))
}

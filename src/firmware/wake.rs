//! When the asynchronous tasks run: `can_irq` wakes them for an answer to one of
//! their SDO requests, `network` when there is something to log and at the time
//! that they asked for.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use rtic_sync::signal::{Signal, SignalReader};

/// Wakes `sdo_configurator`.
pub(crate) static CONFIGURATOR: Wake = Wake::new();
/// Wakes `sdo_transfer`.
pub(crate) static TRANSFER: Wake = Wake::new();

/// Wakes one task.
pub(crate) struct Wake {
    signal: Signal<()>,
    wanted: AtomicBool,
    /// Microseconds modulo 2^32.
    at: AtomicU32,
}

impl Wake {
    const fn new() -> Wake {
        Wake {
            signal: Signal::new(),
            wanted: AtomicBool::new(false),
            at: AtomicU32::new(0),
        }
    }

    /// The waiting end, for one task.
    pub(crate) fn reader(&'static self) -> SignalReader<'static, ()> {
        self.signal.take_reader()
    }

    /// Asks `network` to wake the task at its next run: a store, no more.
    #[inline(always)]
    pub(crate) fn want(&self) {
        self.wanted.store(true, Ordering::Relaxed);
    }

    /// Wakes it at once. Takes two critical sections of some 40 cycles.
    #[inline(never)]
    pub(crate) fn now(&self) {
        self.signal.writer().write(());
    }

    /// Asks for it at a time, in microseconds modulo 2^32.
    pub(crate) fn at(&self, us: u32) {
        self.at.store(us, Ordering::Relaxed);
    }

    /// Wakes the task if it is time, or was asked for.
    #[inline(never)]
    pub(crate) fn if_due(&self, now_us: u32) {
        let late = now_us.wrapping_sub(self.at.load(Ordering::Relaxed));
        let due = late <= u32::MAX / 2;
        if self.wanted.swap(false, Ordering::Relaxed) || due {
            self.now();
        }
    }
}

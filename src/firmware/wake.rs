//! When `sdo_configurator` runs: `can_irq` wakes it for an answer to one of its
//! SDO requests, `network` when there is something to log and at the time that
//! it asked for.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use rtic_sync::signal::{Signal, SignalReader};

static SIGNAL: Signal<()> = Signal::new();
static WANTED: AtomicBool = AtomicBool::new(false);
/// Microseconds modulo 2^32.
static AT: AtomicU32 = AtomicU32::new(0);

/// The waiting end, for one task.
pub(crate) fn reader() -> SignalReader<'static, ()> {
    SIGNAL.take_reader()
}

/// Asks `network` to wake the configurator at its next run: a store, no more.
#[inline(always)]
pub(crate) fn want() {
    WANTED.store(true, Ordering::Relaxed);
}

/// Wakes it at once. Takes two critical sections of some 40 cycles.
pub(crate) fn now() {
    SIGNAL.writer().write(());
}

/// Asks for it at a time, in microseconds modulo 2^32.
pub(crate) fn at(us: u32) {
    AT.store(us, Ordering::Relaxed);
}

/// Wakes the configurator if it is time, or was asked for.
pub(crate) fn if_due(now_us: u32) {
    let late = now_us.wrapping_sub(AT.load(Ordering::Relaxed));
    let due = late <= u32::MAX / 2;
    if WANTED.swap(false, Ordering::Relaxed) || due {
        now();
    }
}

//! When `sdo_configurator` runs: `network` wakes it, at the time that it asked
//! for or when there is something to do.

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

/// Asks `network` to wake the configurator at its next run. For interrupt tasks:
/// a store, no more.
#[inline(always)]
pub(crate) fn want() {
    WANTED.store(true, Ordering::Relaxed);
}

/// Asks for it at a time, in microseconds modulo 2^32.
pub(crate) fn at(us: u32) {
    AT.store(us, Ordering::Relaxed);
}

/// Wakes the configurator if it is time. For `network` alone: the signal takes
/// short critical sections that the interrupt tasks above should not pay for.
pub(crate) fn if_due(now_us: u32) {
    let late = now_us.wrapping_sub(AT.load(Ordering::Relaxed));
    let due = late <= u32::MAX / 2;
    if WANTED.swap(false, Ordering::Relaxed) || due {
        SIGNAL.writer().write(());
    }
}

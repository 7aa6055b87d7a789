//! A panic: says where, and ends in the hard fault, whose handler waits for the
//! watchdog.
//!
//! Not `panic-probe`: it formats the message on the chip, which takes several
//! kilobytes of flash. The place tells as much.

use core::{
    panic::PanicInfo,
    sync::atomic::{AtomicBool, Ordering},
};

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    static PANICKED: AtomicBool = AtomicBool::new(false);
    cortex_m::interrupt::disable();
    // What panics in here is not told any more.
    if !PANICKED.load(Ordering::Relaxed) {
        PANICKED.store(true, Ordering::Relaxed);
        let place = info.location();
        defmt::error!(
            "panic at {=str}:{=u32} {=str}",
            place.map_or("?", |place| place.file()),
            place.map_or(0, |place| place.line()),
            info.message().as_str().unwrap_or_default()
        );
    }
    cortex_m::asm::udf()
}

/// `defmt::unwrap!` and the like have told their own message already.
#[defmt::panic_handler]
fn told() -> ! {
    cortex_m::asm::udf()
}

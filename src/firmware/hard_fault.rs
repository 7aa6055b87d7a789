//! The last resort: says where, and waits for the watchdog.

use cortex_m_rt::{ExceptionFrame, exception};
use panic_probe as _;

/// A fault, or the end of a panic. Nothing runs any more, nobody feeds the
/// watchdog: it resets the board, and the drives stop because the master's
/// heartbeat is gone.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    defmt::error!(
        "hard fault at {=u32:08X}h, called from {=u32:08X}h (a panic, a stack overflow or a wrong address; what failed may stand above): the watchdog resets the board",
        frame.pc(),
        frame.lr()
    );
    loop {
        cortex_m::asm::nop();
    }
}

/// `defmt::unwrap!` and the like have told their own message already.
#[defmt::panic_handler]
fn told() -> ! {
    panic_probe::hard_fault()
}

//! The last resort: says where, and waits for the watchdog.

use cortex_m_rt::{ExceptionFrame, exception};

/// A fault, or the end of a panic. Nothing runs any more, nobody feeds the
/// watchdog: it resets the board, and the drives stop because the master's
/// heartbeat is gone.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    defmt::error!(
        "hard fault at {=u32:08X}h (a panic's message stands above; without one, a stack overflow or a wrong address): the watchdog resets the board",
        frame.pc()
    );
    loop {
        cortex_m::asm::nop();
    }
}

//! The independent watchdog: once started it cannot be stopped.

use stm32g4xx_hal::{independent_watchdog::IndependentWatchdog, pac, time::ExtU32};

/// The watchdog, running on its own 32 kHz oscillator (29.5 .. 34 kHz over
/// temperature and voltage).
pub struct Watchdog(IndependentWatchdog);

impl Watchdog {
    /// Starts the time anew.
    pub fn feed(&mut self) {
        self.0.feed();
    }
}

/// The longest time that its smallest prescaler gives.
const MAX_MS: u32 = 500;

/// Starts it. It stands still while a debugger holds the core.
///
/// # Panics
///
/// If `ms` is not in 1..=500.
pub(crate) fn start(iwdg: pac::IWDG, debug: &pac::DBGMCU, ms: u32) -> Watchdog {
    assert!((1..=MAX_MS).contains(&ms));
    debug.apb1l_fz().modify(|_, w| w.dbg_iwdg_stop().set_bit());
    // Keeps the debug port's clock on in sleep: the log is read while the core
    // waits for interrupts.
    debug.cr().modify(|_, w| w.dbg_sleep().set_bit());
    let mut watchdog = IndependentWatchdog::new(iwdg);
    watchdog.start(ms.millis());
    Watchdog(watchdog)
}

//! The independent watchdog: once started it cannot be stopped.

use stm32g4xx_hal::pac;

/// The watchdog, running on its own 32 kHz oscillator (29.5 .. 34 kHz over
/// temperature and voltage).
pub struct Watchdog(pac::IWDG);

impl Watchdog {
    /// Starts the time anew.
    pub fn feed(&mut self) {
        self.0.kr().write(|w| w.key().feed());
    }
}

/// The longest time that its smallest prescaler gives.
const MAX_MS: u32 = 500;
/// 32 kHz divided by four, which is the prescaler after a reset.
const COUNTS_PER_MS: u32 = 32 / 4;

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
    iwdg.kr().write(|w| w.key().start());
    iwdg.kr().write(|w| w.key().unlock());
    // SAFETY: any count of twelve bits; `ms` was checked.
    iwdg.rlr()
        .write(|w| unsafe { w.rl().bits((ms * COUNTS_PER_MS) as u16) });
    // Its clock is slow: until then the time after a reset counts.
    while iwdg.sr().read().rvu().bit_is_set() {}
    let mut watchdog = Watchdog(iwdg);
    watchdog.feed();
    watchdog
}

//! Why the board started.

use stm32g4xx_hal::rcc::ResetReason;

/// The cause of the last reset.
///
/// Every reset also pulls the NRST pin, so the pin is the cause only if nothing
/// else is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetCause {
    /// Power came up, or fell below the brown-out level.
    Power,
    /// The NRST pin: the reset button or the debugger.
    Pin,
    /// The independent watchdog was not fed in time.
    Watchdog,
    /// The window watchdog.
    WindowWatchdog,
    /// Software or the debugger asked for it.
    Software,
    /// A low-power mode was entered against the option bytes.
    LowPower,
    /// The option bytes were loaded.
    OptionBytes,
    /// No flag was set.
    Unknown,
}

impl From<ResetReason> for ResetCause {
    fn from(reason: ResetReason) -> ResetCause {
        if reason.independent_watchdog {
            ResetCause::Watchdog
        } else if reason.window_watchdog {
            ResetCause::WindowWatchdog
        } else if reason.software {
            ResetCause::Software
        } else if reason.low_power {
            ResetCause::LowPower
        } else if reason.option_byte {
            ResetCause::OptionBytes
        } else if reason.brown_out {
            ResetCause::Power
        } else if reason.reset_pin {
            ResetCause::Pin
        } else {
            ResetCause::Unknown
        }
    }
}

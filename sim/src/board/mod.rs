//! The emulated NUCLEO-G474RE: an STM32G474 that runs the image that would be
//! flashed.
//!
//! The core is `rsemu`'s Cortex-M4F with its stated timing model (one cycle an
//! instruction, one more a data access, two a taken branch, twelve to enter and
//! ten to leave an exception; no flash wait states). The peripherals are models
//! of what the image touches, register by register; a use of them that the
//! hardware would not take becomes a [`Diagnostic`].
//!
//! What it cannot tell: analogue behaviour, transceivers, real oscillators
//! starting up, flash wait states. The address 0, where the hardware shows an
//! alias of the flash, holds nothing, so that a null pointer faults.
//!
//! `rsemu` is built without its `std` feature: its locks are then plain flags
//! that never wait, which is all that a board, owned by one thread at a time,
//! needs, and a tenth faster.
//!
//! A board does not run by itself: [`Board::run_until`] lets it, up to a moment
//! of virtual time or until what it offers to a CAN bus changes.

mod api;
mod clock;
mod diagnostics;
mod exti;
mod fault;
mod fdcan;
mod flash;
mod gpio;
mod image;
mod irq;
mod iwdg;
mod machine;
mod measure;
mod memory;
mod pwr;
mod rcc;
mod rtt;
mod soc;
mod sync_probe;
mod timer;

#[cfg(test)]
mod tests;

pub use api::{BoardOptions, Led, Stop};
pub use diagnostics::{Diagnostic, DiagnosticKind};
pub use fault::{FaultKind, FaultReport};
pub use fdcan::REQUEST_TO_START_CLOCKS;
pub use flash::{BankContents, FlashFigures, FlashOptions};
pub use image::{BoardError, ImageSize};
pub use machine::Board;
pub use measure::{BoardStats, IrqStats, ResetRecord};
pub use rcc::ResetCause;
pub use sync_probe::SyncFigures;

/// Interrupt numbers of the STM32G474 for fault injection and figures.
pub mod irqs {
    /// FLASH: end of operation, error.
    pub const FLASH: u8 = 4;
    /// FDCAN1, line 0.
    pub const FDCAN1_IT0: u8 = 21;
    /// FDCAN1, line 1.
    pub const FDCAN1_IT1: u8 = 22;
    /// TIM2: the SYNC timer.
    pub const TIM2: u8 = 28;
    /// TIM3: the deadline timer.
    pub const TIM3: u8 = 29;
    /// TIM5: the free-running clock.
    pub const TIM5: u8 = 50;
    /// UART4: dispatches the firmware's software task.
    pub const UART4: u8 = 52;
    /// TIM7: the network tick.
    pub const TIM7: u8 = 55;
}

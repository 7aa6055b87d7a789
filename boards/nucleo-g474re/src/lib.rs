//! The NUCLEO-G474RE (STM32G474RE, 24 MHz crystal) as a CAN master uses it.
//!
//! [`setup`] consumes the peripherals once and hands back configured devices:
//! clocks at 170 MHz, FDCAN1 on PA11/PA12, FDCAN2 on PB12/PB13, FDCAN3 on PA8/PA15, a period timer with a compare, a
//! millisecond tick, a microsecond clock, two LEDs, the button, the watchdog,
//! the second bank of the flash as storage, and what caused the last reset.
//!
//! The crate knows nothing of any protocol above CAN: frames are
//! `embedded_can::Frame`. It is the only place with `unsafe` code; each block
//! says why it is sound. On the host it compiles to nothing.
#![no_std]
#![cfg(target_os = "none")]

pub mod can;
pub mod clock;
pub mod flash;
pub mod pins;
pub mod reset_cause;
mod serial_number;
pub mod timers;
pub mod watchdog;

mod memory;
mod message_ram;

pub use serial_number::serial_number;
pub use stm32g4xx_hal::pac;

use can::Controller;
use pins::uses;
use stm32g4xx_hal::{gpio::GpioExt, rcc::RccExt};

/// How fast the core and the timers run.
pub const CORE_HZ: u32 = 170_000_000;

/// What a user of the board may choose.
#[derive(Clone, Copy)]
pub struct Config {
    /// The period of [`Devices::period`], in microseconds, 1..=65 535.
    pub period_us: u16,
    /// When in each period [`Devices::deadline`] comes due, in microseconds
    /// after its start; less than `period_us`.
    pub deadline_us: u16,
    /// The same for a second event of [`Devices::deadline`]; 0: there is none.
    pub second_us: u16,
    /// After how long without [`watchdog::Watchdog::feed`] the board resets,
    /// in milliseconds, 1..=500.
    pub watchdog_ms: u32,
    /// FDCAN1, 2 and 3. Those that `setup` is not for are not looked at.
    pub can: [can::Settings; 3],
}

/// The board, ready to be used.
pub struct Devices {
    /// Why the board started.
    pub reset_cause: reset_cause::ResetCause,
    /// Sends, by all controllers.
    pub can_tx: can::Tx,
    /// Receives and tells what the controller has to report.
    pub can_rx: can::Rx,
    /// TIM2: its update event starts a period.
    pub period: timers::Period,
    /// TIM3: runs with TIM2; its compare event comes at the deadline.
    pub deadline: timers::Deadline,
    /// Changes the period of both.
    pub sync_period: timers::SyncPeriod,
    /// TIM3's count.
    pub phase: timers::Phase,
    /// TIM7: every millisecond.
    pub tick: timers::Tick,
    /// TIM5: free-running microseconds.
    pub microseconds: timers::Microseconds,
    /// LD2, green.
    pub run_led: pins::RunLed,
    /// The red LED to be wired to PB0.
    pub error_led: pins::ErrorLed,
    /// B1, the blue button.
    pub button: pins::Button,
    /// Bank 2 of the flash, or why nothing can be stored in it.
    pub storage: Result<flash::Storage, flash::Unavailable>,
    /// The independent watchdog, already running.
    pub watchdog: watchdog::Watchdog,
}

/// Configures the board with the CAN controllers that the bits of `CAN` stand for,
/// FDCAN1 being bit 0. The timers run on return; their interrupts come as
/// soon as the interrupt controller lets them through.
///
/// # Panics
///
/// If `config` is outside the ranges that its fields state: a mistake of the
/// firmware's author, found the first time that it runs.
pub fn setup<const CAN: u8>(peripherals: pac::Peripherals, config: &Config) -> Devices {
    // First of all, so that whatever hangs below ends in a reset, too.
    let watchdog = watchdog::start(peripherals.IWDG, &peripherals.DBGMCU, config.watchdog_ms);

    let mut rcc = peripherals.RCC.constrain();
    let reset_cause = reset_cause::ResetCause::from(rcc.get_reset_reason());
    rcc.clear_reset_reason();
    // Nothing of it is used before the clock is there, which takes milliseconds.
    rcc.apb1enr1().write(|w| {
        w.tim2en().set_bit().tim3en().set_bit();
        w.tim5en().set_bit().tim7en().set_bit();
        w.fdcanen().set_bit().pwren().set_bit()
    });
    clock::setup(&rcc, &peripherals.PWR, &peripherals.FLASH);

    let pins = pins::setup::<CAN>(
        peripherals.GPIOA.split(&mut rcc),
        peripherals.GPIOB.split(&mut rcc),
        peripherals.GPIOC.split(&mut rcc),
    );
    let [first, second, third] = &config.can;
    if uses(CAN, 0) {
        can::setup(Controller::FDCAN1, first);
    }
    if uses(CAN, 1) {
        can::setup(Controller::FDCAN2, second);
    }
    if uses(CAN, 2) {
        can::setup(Controller::FDCAN3, third);
    }
    let timers = timers::setup(
        timers::Peripherals {
            tim2: peripherals.TIM2,
            tim3: peripherals.TIM3,
            tim5: peripherals.TIM5,
            tim7: peripherals.TIM7,
        },
        config.period_us,
        config.deadline_us,
        config.second_us,
    );
    Devices {
        reset_cause,
        can_tx: can::Tx::new(),
        can_rx: can::Rx::new(),
        period: timers.period,
        deadline: timers.deadline,
        sync_period: timers.sync_period,
        phase: timers.phase,
        tick: timers.tick,
        microseconds: timers.microseconds,
        run_led: pins.run_led,
        error_led: pins.error_led,
        button: pins.button,
        storage: flash::setup(peripherals.FLASH),
        watchdog,
    }
}

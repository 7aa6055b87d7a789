//! Clocks: everything from the 24 MHz crystal, the core at 170 MHz.

use stm32g4xx_hal::pac;

/// AHB prescaler: divided by two, and not at all (RM0440, 7.4.3).
const HALF: u8 = 0b1000;
const WHOLE: u8 = 0;
/// The source of the system clock, and the crystal as that of the PLL.
const SW_PLL: u8 = 0b11;
const PLL_OF_HSE: u8 = 0b11;
/// Multiplier, divider less one.
const PLL_N: u8 = 85;
const PLL_M: u8 = 6 - 1;
/// For 136 .. 170 MHz in boost mode (RM0440, 3.3.3).
const WAIT_STATES: u8 = 4;
/// More than the microsecond after which the core may go from half its frequency to
/// all of it (RM0440, 6.1.5).
const SETTLING_CYCLES: u32 = 2 * 85;

/// 24 MHz / 6 * 85 / 2 = 170 MHz. The CAN controller runs on the crystal itself, as
/// after a reset: 24 MHz divides into 1 Mbit/s without a rest, and the PLL's jitter
/// stays out of the bit timing.
///
/// Register by register, in the order of RM0440, 6.1.5: the HAL can go from any clock
/// to any other, which takes twice the flash. What it does not touch is as the reset
/// made it.
pub(crate) fn setup(rcc: &pac::RCC, power: &pac::PWR, flash: &pac::FLASH) {
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    while rcc.cr().read().hserdy().bit_is_clear() {}
    // SAFETY: values of their fields, after RM0440, 7.4.4: R divides by two.
    rcc.pllcfgr().write(|w| unsafe {
        w.pllsrc().bits(PLL_OF_HSE);
        w.pllm().bits(PLL_M).plln().bits(PLL_N).pllren().set_bit()
    });
    rcc.cr().modify(|_, w| w.pllon().set_bit());
    while rcc.cr().read().pllrdy().bit_is_clear() {}
    // 170 MHz needs boost mode: set at half the frequency.
    power.cr5().modify(|_, w| w.r1mode().clear_bit());
    // SAFETY: a number of wait states.
    flash
        .acr()
        .modify(|_, w| unsafe { w.latency().bits(WAIT_STATES) });
    while flash.acr().read().latency().bits() != WAIT_STATES {}
    // SAFETY: values of their fields.
    rcc.cfgr()
        .write(|w| unsafe { w.hpre().bits(HALF).sw().bits(SW_PLL) });
    while rcc.cfgr().read().sws().bits() != SW_PLL {}
    cortex_m::asm::delay(SETTLING_CYCLES);
    // SAFETY: as above.
    rcc.cfgr()
        .write(|w| unsafe { w.hpre().bits(WHOLE).sw().bits(SW_PLL) });
}

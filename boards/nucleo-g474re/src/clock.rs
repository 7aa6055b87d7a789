//! Clocks: everything from the 24 MHz crystal, the core at 170 MHz.

use stm32g4xx_hal::{
    pwr::{PowerConfiguration, Pwr, VoltageScale},
    rcc::{
        Config, FdCanClockSource, PllConfig, PllMDiv, PllNMul, PllRDiv, PllSrc, Rcc, SysClockSrc,
    },
    time::Hertz,
};

/// The crystal X3 of the board.
pub const CRYSTAL: Hertz = Hertz::MHz(24);

/// 170 MHz needs boost mode; asked for through the clock configuration alone it
/// would be ignored. The HAL reads PWR's registers but does not switch on its
/// clock.
pub(crate) fn power(rcc: &Rcc, power: Pwr) -> PowerConfiguration {
    rcc.apb1enr1().modify(|_, w| w.pwren().set_bit());
    power
        .vos(VoltageScale::Range1 { enable_boost: true })
        .freeze()
}

/// 24 MHz / 6 * 85 / 2 = 170 MHz. The CAN controller runs on the crystal
/// itself: 24 MHz divides into 1 Mbit/s without a rest, and the PLL's jitter
/// stays out of the bit timing.
pub(crate) fn config() -> Config {
    Config::new(SysClockSrc::PLL)
        .pll_cfg(PllConfig {
            mux: PllSrc::HSE(CRYSTAL),
            m: PllMDiv::DIV_6,
            n: PllNMul::MUL_85,
            r: Some(PllRDiv::DIV_2),
            q: None,
            p: None,
        })
        .fdcan_src(FdCanClockSource::HSE)
}

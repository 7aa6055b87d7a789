use super::*;

fn rcc() -> Rcc {
    let oscillators = Oscillators {
        hse: Frequency::from_hz(24_000_000),
        hsi: Frequency::from_hz(HSI_HZ),
        lsi: Frequency::from_hz(LSI_HZ),
    };
    Rcc::new(oscillators, ResetCause::PowerOn, 0)
}

#[test]
fn runs_from_hsi_after_reset() {
    let mut rcc = rcc();
    assert_eq!(rcc.hclk().hz(), 16_000_000);
    assert_eq!(rcc.read(CR, 0), Some(0x563));
    assert_eq!(rcc.read(CFGR, 0), Some(0x5));
    assert_eq!(rcc.read(CSR, 0), Some(0x0C00_0000));
    assert_eq!(rcc.fdcan_clock(), None);
}

#[test]
fn the_clock_tree_of_the_firmware() {
    let mut rcc = rcc();
    rcc.write(CR, HSEON, 100);
    assert_eq!(rcc.read(CR, 200).map(|cr| cr & HSERDY), Some(0));
    assert_eq!(rcc.read(CR, 40_000).map(|cr| cr & HSERDY), Some(HSERDY));
    // M = 6, N = 85, R = 2 from HSE: 24 / 6 * 85 / 2 = 170 MHz.
    rcc.write(PLLCFGR, 0b11 | 5 << 4 | 85 << 8 | PLLREN, 40_000);
    rcc.write(CR, HSEON | PLLON, 40_000);
    rcc.write(CFGR, 0b11, 40_001);
    assert_eq!(
        rcc.read(CFGR, 40_002),
        Some(0b0111),
        "not switched before the PLL locks"
    );
    assert_eq!(rcc.read(CFGR, 50_000), Some(0b1111));
    assert_eq!(rcc.hclk().hz(), 170_000_000);
    assert_eq!(rcc.fdcan_clock().map(Frequency::hz), Some(24_000_000));
    // FDCANSEL = PCLK1, APB1 by 4: timers then run at twice PCLK1.
    rcc.write(CCIPR, 0b10 << 24, 50_000);
    rcc.write(CFGR, 0b11 | 0b101 << 8, 50_000);
    assert_eq!(rcc.fdcan_clock().map(Frequency::hz), Some(42_500_000));
    assert_eq!(rcc.timer_divisor(), 2);
}

#[test]
fn reset_flags_gather_until_cleared() {
    let first = rcc();
    let mut second = Rcc::new(first.oscillators, ResetCause::Watchdog, first.reset_flags());
    assert_eq!(second.read(CSR, 0), Some(0x2C00_0000));
    second.write(CSR, RMVF, 0);
    assert_eq!(second.read(CSR, 0), Some(0));
}

#[test]
fn the_system_clock_cannot_be_switched_off() {
    let mut rcc = rcc();
    rcc.write(CR, 0, 0);
    assert_eq!(rcc.read(CR, 0).map(|cr| cr & HSION), Some(HSION));
}

//! RCC: oscillators, PLL, clock tree, enables, resets and reset causes
//! (RM0440, 7).

use super::clock::Frequency;

const CR: u32 = 0x00;
const CFGR: u32 = 0x08;
const PLLCFGR: u32 = 0x0C;
const AHB1RSTR: u32 = 0x28;
const APB2RSTR: u32 = 0x40;
const AHB1ENR: u32 = 0x48;
const APB2ENR: u32 = 0x60;
const CCIPR: u32 = 0x88;
const BDCR: u32 = 0x90;
const CSR: u32 = 0x94;
const CRRCR: u32 = 0x98;
const LAST: u32 = 0x9C;
const WORDS: usize = (LAST / 4 + 1) as usize;

/// From an RSTR register to the ENR register of the same bus.
const RSTR_TO_ENR: u32 = AHB1ENR - AHB1RSTR;

const HSION: u32 = 1 << 8;
const HSIRDY: u32 = 1 << 10;
const HSEON: u32 = 1 << 16;
const HSERDY: u32 = 1 << 17;
const PLLON: u32 = 1 << 24;
const PLLRDY: u32 = 1 << 25;
const PLLQEN: u32 = 1 << 20;
const PLLREN: u32 = 1 << 24;
const READY_FLAGS: u32 = HSIRDY | HSERDY | PLLRDY;
/// Bits of CSR that tell why the last reset was.
const RESET_FLAGS: u32 = 0xFE00_0000;
const RMVF: u32 = 1 << 23;
const ON: u32 = 1 << 0;
const READY: u32 = 1 << 1;
/// HSI16 divided by nothing: what the core runs on after reset.
pub(crate) const HSI_HZ: u32 = 16_000_000;
/// LSI, which clocks the watchdog.
pub(crate) const LSI_HZ: u32 = 32_000;

/// Start-up times in HCLK cycles at 16 MHz: the crystal's 2 ms and the PLL's
/// 40 us (data sheet, typical and maximum).
const HSE_START_CYCLES: u64 = 32_000;
const PLL_LOCK_CYCLES: u64 = 640;

/// Why the microcontroller was reset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum ResetCause {
    /// Supply switched on (or browned out).
    PowerOn,
    /// NRST pulled low from outside.
    Pin,
    /// SYSRESETREQ by the program.
    Software,
    /// The independent watchdog was not fed in time.
    Watchdog,
}

impl ResetCause {
    /// The flags that it sets in CSR. Every internal reset drives NRST, so
    /// PINRSTF is always among them.
    const fn flags(self) -> u32 {
        const PIN: u32 = 1 << 26;
        const BOR: u32 = 1 << 27;
        const SFT: u32 = 1 << 28;
        const IWDG: u32 = 1 << 29;
        PIN | match self {
            Self::PowerOn => BOR,
            Self::Pin => 0,
            Self::Software => SFT,
            Self::Watchdog => IWDG,
        }
    }
}

/// What drives a bus: the register that enables and the bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Gate {
    /// Offset of the enable register.
    pub register: u32,
    /// Bit in it.
    pub bit: u32,
}

impl Gate {
    /// AHB1ENR.
    #[must_use]
    pub(crate) const fn ahb1(bit: u32) -> Self {
        Self {
            register: AHB1ENR,
            bit,
        }
    }
    /// AHB2ENR.
    #[must_use]
    pub(crate) const fn ahb2(bit: u32) -> Self {
        Self {
            register: 0x4C,
            bit,
        }
    }
    /// APB1ENR1.
    #[must_use]
    pub(crate) const fn apb1(bit: u32) -> Self {
        Self {
            register: 0x58,
            bit,
        }
    }
    /// APB2ENR.
    #[must_use]
    pub(crate) const fn apb2(bit: u32) -> Self {
        Self {
            register: APB2ENR,
            bit,
        }
    }
}

/// The oscillators as they are, errors included.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Oscillators {
    /// The 24 MHz crystal.
    pub hse: Frequency,
    /// The internal 16 MHz oscillator.
    pub hsi: Frequency,
    /// The internal 32 kHz oscillator.
    pub lsi: Frequency,
}

/// The reset and clock controller.
#[derive(Debug, Clone)]
pub(crate) struct Rcc {
    oscillators: Oscillators,
    registers: [u32; WORDS],
    hse_ready: Option<u64>,
    pll_ready: Option<u64>,
}

impl Rcc {
    /// In its state after a reset for `cause`; `flags` are the causes not yet
    /// cleared by the program.
    #[must_use]
    pub(crate) fn new(oscillators: Oscillators, cause: ResetCause, flags: u32) -> Self {
        let mut rcc = Self {
            oscillators,
            registers: [0; WORDS],
            hse_ready: None,
            pll_ready: None,
        };
        for (offset, value) in [
            (CR, 0x0000_0063 | HSION | HSIRDY),
            (0x04, 0x4000_0000),
            (CFGR, 0x0000_0005),
            (PLLCFGR, 0x0000_1000),
            (AHB1ENR, 0x0000_0100),
            (0x58, 0x0000_0400),
            (0x68, 0x0000_130F),
            (0x6C, 0x050F_667F),
            (0x70, 0x0000_0101),
            (0x78, 0xD2FE_CD3F),
            (0x7C, 0x0000_0103),
            (0x80, 0x0437_F801),
            (CSR, flags & RESET_FLAGS | cause.flags()),
        ] {
            rcc.set(offset, value);
        }
        rcc
    }

    /// The oscillators as they are.
    #[must_use]
    pub(crate) const fn oscillators(&self) -> Oscillators {
        self.oscillators
    }

    /// The causes of resets that the program has not cleared.
    #[must_use]
    pub(crate) fn reset_flags(&self) -> u32 {
        self.get(CSR) & RESET_FLAGS
    }

    fn get(&self, offset: u32) -> u32 {
        self.registers
            .get((offset / 4) as usize)
            .copied()
            .unwrap_or(0)
    }

    fn set(&mut self, offset: u32, value: u32) {
        if let Some(register) = self.registers.get_mut((offset / 4) as usize) {
            *register = value;
        }
    }

    /// Updates the ready flags to `cycle`.
    fn settle(&mut self, cycle: u64) {
        let cr = self.get(CR);
        let mut ready = if cr & HSION != 0 { HSIRDY } else { 0 };
        if cr & HSEON != 0 && self.hse_ready.is_some_and(|at| at <= cycle) {
            ready |= HSERDY;
        }
        let source = match self.get(PLLCFGR) & 0b11 {
            0b10 => HSIRDY,
            0b11 => HSERDY,
            _ => 0,
        };
        if cr & PLLON != 0 && ready & source != 0 && self.pll_ready.is_some_and(|at| at <= cycle) {
            ready |= PLLRDY;
        }
        self.set(CR, cr & !READY_FLAGS | ready);
        self.settle_switch();
    }

    /// CFGR.SWS follows SW once the wanted clock is there.
    fn settle_switch(&mut self) {
        const SWS_SHIFT: u32 = 2;
        let cfgr = self.get(CFGR);
        let wanted = cfgr & 0b11;
        let cr = self.get(CR);
        let there = match wanted {
            0b01 => cr & HSIRDY != 0,
            0b10 => cr & HSERDY != 0,
            0b11 => cr & PLLRDY != 0 && self.get(PLLCFGR) & PLLREN != 0,
            _ => false,
        };
        if there {
            self.set(CFGR, cfgr & !(0b11 << SWS_SHIFT) | wanted << SWS_SHIFT);
        }
    }

    /// Reads a register; `None` where there is none.
    pub(crate) fn read(&mut self, offset: u32, cycle: u64) -> Option<u32> {
        if offset > LAST || matches!(offset, 0x10 | 0x14 | 0x24 | 0x34 | 0x44 | 0x54 | 0x64) {
            return None;
        }
        self.settle(cycle);
        Some(self.get(offset))
    }

    /// Writes a register; false where there is none.
    pub(crate) fn write(&mut self, offset: u32, value: u32, cycle: u64) -> bool {
        if offset > LAST || matches!(offset, 0x10 | 0x14 | 0x24 | 0x34 | 0x44 | 0x54 | 0x64) {
            return false;
        }
        self.settle(cycle);
        let old = self.get(offset);
        let value = match offset {
            CR => {
                if value & HSEON != 0 && old & HSEON == 0 {
                    self.hse_ready = Some(cycle + HSE_START_CYCLES);
                }
                if value & PLLON != 0 && old & PLLON == 0 {
                    self.pll_ready = Some(cycle + PLL_LOCK_CYCLES);
                }
                // What feeds the system clock cannot be switched off.
                let held = match self.system_source() {
                    0b01 => HSION,
                    0b10 => HSEON,
                    _ => PLLON,
                };
                value & !READY_FLAGS | old & READY_FLAGS | held
            }
            CFGR => value & !(0b11 << 2) | old & (0b11 << 2),
            BDCR | CRRCR => with_ready(value),
            CSR => {
                let flags = if value & RMVF != 0 {
                    0
                } else {
                    old & RESET_FLAGS
                };
                with_ready(value & 0x1) | flags
            }
            _ => value,
        };
        self.set(offset, value);
        self.settle(cycle);
        true
    }

    /// PLLCFGR written while the PLL runs: the hardware ignores it.
    #[must_use]
    pub(crate) fn is_pll_locked_register(&self, offset: u32) -> bool {
        offset == PLLCFGR && self.get(CR) & PLLON != 0
    }

    /// CFGR.SWS.
    fn system_source(&self) -> u32 {
        self.get(CFGR) >> 2 & 0b11
    }

    fn pll_vco(&self) -> Option<Frequency> {
        let pllcfgr = self.get(PLLCFGR);
        let source = match pllcfgr & 0b11 {
            0b10 => self.oscillators.hsi,
            0b11 => self.oscillators.hse,
            _ => return None,
        };
        let m = (pllcfgr >> 4 & 0xF) + 1;
        let n = pllcfgr >> 8 & 0x7F;
        Some(source.scaled(n, m))
    }

    /// PLL output R, which may be the system clock.
    fn pll_r(&self) -> Option<Frequency> {
        let pllcfgr = self.get(PLLCFGR);
        let divider = ((pllcfgr >> 25 & 0b11) + 1) * 2;
        (pllcfgr & PLLREN != 0)
            .then(|| self.pll_vco())
            .flatten()
            .map(|vco| vco.scaled(1, divider))
    }

    fn pll_q(&self) -> Option<Frequency> {
        let pllcfgr = self.get(PLLCFGR);
        let divider = ((pllcfgr >> 21 & 0b11) + 1) * 2;
        (pllcfgr & PLLQEN != 0 && self.get(CR) & PLLRDY != 0)
            .then(|| self.pll_vco())
            .flatten()
            .map(|vco| vco.scaled(1, divider))
    }

    /// HCLK, which clocks the core.
    #[must_use]
    pub(crate) fn hclk(&self) -> Frequency {
        let system = match self.system_source() {
            0b10 => self.oscillators.hse,
            0b11 => self.pll_r().unwrap_or(self.oscillators.hsi),
            _ => self.oscillators.hsi,
        };
        let divider = match self.get(CFGR) >> 4 & 0xF {
            code @ 0b1000..=0b1011 => 2 << (code - 0b1000),
            code @ 0b1100.. => 64 << (code - 0b1100),
            _ => 1,
        };
        system.scaled(1, divider)
    }

    /// HCLK cycles per PCLK1 cycle.
    fn apb1_divider(&self) -> u32 {
        match self.get(CFGR) >> 8 & 0b111 {
            code @ 0b100.. => 2 << (code - 0b100),
            _ => 1,
        }
    }

    /// HCLK cycles per clock of TIM2..TIM7: twice PCLK1 unless that is HCLK.
    #[must_use]
    pub(crate) fn timer_divisor(&self) -> u64 {
        u64::from((self.apb1_divider() / 2).max(1))
    }

    /// The FDCAN kernel clock that CCIPR.FDCANSEL selects, if it runs.
    #[must_use]
    pub(crate) fn fdcan_clock(&self) -> Option<Frequency> {
        match self.get(CCIPR) >> 24 & 0b11 {
            0b00 => (self.get(CR) & HSERDY != 0).then_some(self.oscillators.hse),
            0b01 => self.pll_q(),
            0b10 => Some(self.hclk().scaled(1, self.apb1_divider())),
            _ => None,
        }
    }

    /// Whether a peripheral's clock is enabled.
    #[must_use]
    pub(crate) fn is_enabled(&self, gate: Gate) -> bool {
        self.get(gate.register) & 1 << gate.bit != 0
    }

    /// If `offset` is a reset register: the gate register of the same bus.
    #[must_use]
    pub(crate) fn reset_register(offset: u32) -> Option<u32> {
        (AHB1RSTR..=APB2RSTR)
            .contains(&offset)
            .then_some(offset + RSTR_TO_ENR)
    }
}

/// LSE, LSI and HSI48: the ready flag follows the enable bit.
const fn with_ready(value: u32) -> u32 {
    if value & ON != 0 {
        value | READY
    } else {
        value & !READY
    }
}

#[cfg(test)]
mod tests;

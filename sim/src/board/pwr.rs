//! PWR: voltage range and boost mode (RM0440, 6).

const CR1: u32 = 0x00;
const SR1: u32 = 0x10;
const SR2: u32 = 0x14;
const SCR: u32 = 0x18;
const CR5: u32 = 0x80;
const LAST: u32 = 0x80;
const WORDS: usize = (LAST / 4 + 1) as usize;
/// CR5.R1MODE: clear = range 1 boost.
const R1MODE: u32 = 1 << 8;

/// The core's voltage range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum VoltageRange {
    /// Range 1 with boost: up to 170 MHz.
    Boost,
    /// Range 1: up to 150 MHz.
    Normal,
    /// Range 2: up to 26 MHz.
    Low,
}

impl VoltageRange {
    /// The highest HCLK in hertz.
    #[must_use]
    pub(crate) const fn max_hz(self) -> u64 {
        match self {
            Self::Boost => 170_000_000,
            Self::Normal => 150_000_000,
            Self::Low => 26_000_000,
        }
    }

    /// HCLK in hertz that one more flash wait state allows.
    #[must_use]
    pub(crate) const fn hz_per_wait_state(self) -> u64 {
        match self {
            Self::Boost => 34_000_000,
            Self::Normal => 30_000_000,
            Self::Low => 12_000_000,
        }
    }
}

/// The power controller.
#[derive(Debug, Clone)]
pub(crate) struct Pwr {
    registers: [u32; WORDS],
}

impl Default for Pwr {
    fn default() -> Self {
        let mut registers = [0; WORDS];
        for (offset, value) in [(CR1, 0x208), (0x08, 0x8000), (CR5, 0x100)] {
            registers[(offset / 4) as usize] = value;
        }
        Self { registers }
    }
}

impl Pwr {
    /// Reads a register; `None` where there is none.
    #[must_use]
    pub(crate) fn read(&self, offset: u32) -> Option<u32> {
        if !exists(offset) {
            return None;
        }
        self.registers.get((offset / 4) as usize).copied()
    }

    /// Writes a register; false where there is none.
    pub(crate) fn write(&mut self, offset: u32, value: u32) -> bool {
        if !exists(offset) {
            return false;
        }
        // The status registers are read-only, SCR is write-only.
        if !matches!(offset, SR1 | SR2 | SCR)
            && let Some(register) = self.registers.get_mut((offset / 4) as usize)
        {
            *register = value;
        }
        true
    }

    /// The range that CR1.VOS and CR5.R1MODE select.
    #[must_use]
    pub(crate) fn range(&self) -> VoltageRange {
        const VOS_SHIFT: u32 = 9;
        const RANGE_2: u32 = 0b10;
        if self.registers[0] >> VOS_SHIFT & 0b11 == RANGE_2 {
            VoltageRange::Low
        } else if self.registers[(CR5 / 4) as usize] & R1MODE == 0 {
            VoltageRange::Boost
        } else {
            VoltageRange::Normal
        }
    }
}

/// CR1..SCR, the pull-up and pull-down registers of ports A..G, CR5.
const fn exists(offset: u32) -> bool {
    offset <= SCR || (offset >= 0x20 && offset < 0x58) || offset == CR5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boost_is_off_after_reset() {
        let mut pwr = Pwr::default();
        assert_eq!(pwr.read(CR1), Some(0x208));
        assert_eq!(pwr.read(CR5), Some(0x100));
        assert_eq!(pwr.range(), VoltageRange::Normal);
        assert!(pwr.write(CR5, 0));
        assert_eq!(pwr.range(), VoltageRange::Boost);
        assert!(pwr.write(CR1, 0x408));
        assert_eq!(pwr.range(), VoltageRange::Low);
        assert_eq!(pwr.read(0x60), None);
        assert!(!pwr.write(0x84, 1));
    }
}

//! FLASH: wait states and the lock of the control register (RM0440, 3).
//!
//! Erasing and programming are not modelled; trying to is noted.

use super::pwr::VoltageRange;

const ACR: u32 = 0x00;
const KEYR: u32 = 0x08;
const SR: u32 = 0x10;
const CR: u32 = 0x14;
const OPTR: u32 = 0x20;
const LAST: u32 = 0x74;
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
const CR_LOCK: u32 = 1 << 31;
const CR_RESET: u32 = 0xC000_0000;
const CR_START: u32 = 1 << 16;
const ACR_RESET: u32 = 0x0004_0600;
/// Option bytes as delivered: dual bank (DBANK = 1).
const OPTR_RESET: u32 = 0xFFEF_F8AA;
const LATENCY: u32 = 0xF;

/// The flash interface.
#[derive(Debug, Clone)]
pub(crate) struct Flash {
    acr: u32,
    cr: u32,
    keys: usize,
}

impl Default for Flash {
    fn default() -> Self {
        Self {
            acr: ACR_RESET,
            cr: CR_RESET,
            keys: 0,
        }
    }
}

impl Flash {
    /// Reads a register; `None` where there is none.
    #[must_use]
    pub(crate) const fn read(&self, offset: u32) -> Option<u32> {
        match offset {
            ACR => Some(self.acr),
            CR => Some(self.cr),
            OPTR => Some(OPTR_RESET),
            _ if offset <= LAST => Some(0),
            _ => None,
        }
    }

    /// Writes a register. `Err` says what is wrong with it.
    pub(crate) fn write(&mut self, offset: u32, value: u32) -> Result<bool, &'static str> {
        match offset {
            ACR => self.acr = value,
            KEYR => {
                if KEYS.get(self.keys) == Some(&value) {
                    self.keys += 1;
                    if self.keys == KEYS.len() {
                        self.cr &= !CR_LOCK;
                    }
                } else {
                    return Err("wrong key: the flash stays locked until reset");
                }
            }
            SR => {}
            CR => {
                if self.cr & CR_LOCK != 0 {
                    return Err("CR written while locked: ignored");
                }
                self.cr = value;
                if value & CR_LOCK != 0 {
                    self.keys = 0;
                }
                if value & CR_START != 0 {
                    self.cr &= !CR_START;
                    return Err("erasing is not modelled");
                }
            }
            _ if offset <= LAST => return Err("a register that is not modelled was written"),
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Says what is wrong with HCLK at `hz` in `range`, if something is.
    #[must_use]
    pub(crate) fn check(&self, hz: u64, range: VoltageRange) -> Option<String> {
        /// Clock errors of the oscillator must not count as overclocking.
        const TOLERANCE_HZ: u64 = 200_000;
        const MHZ: u64 = 1_000_000;
        let nominal = hz.saturating_sub(TOLERANCE_HZ);
        if nominal > range.max_hz() {
            return Some(format!(
                "HCLK is {} MHz, but {range:?} range allows {} MHz (PWR_CR5.R1MODE, PWR_CR1.VOS)",
                hz / MHZ,
                range.max_hz() / MHZ
            ));
        }
        let needed = nominal / range.hz_per_wait_state();
        let set = u64::from(self.acr & LATENCY);
        (set < needed).then(|| {
            format!(
                "HCLK is {} MHz with {set} flash wait states, {needed} are needed (FLASH_ACR.LATENCY)",
                hz / MHZ
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wait_states_follow_the_table_of_the_reference_manual() {
        let mut flash = Flash::default();
        assert_eq!(flash.check(16_000_000, VoltageRange::Normal), None);
        assert!(flash.check(170_000_000, VoltageRange::Normal).is_some());
        assert!(flash.check(170_000_000, VoltageRange::Boost).is_some());
        for (latency, boost, normal) in [
            (0, 34, 30),
            (1, 68, 60),
            (2, 102, 90),
            (3, 136, 120),
            (4, 170, 150),
        ] {
            assert_eq!(flash.write(ACR, latency), Ok(true));
            assert_eq!(flash.check(boost * 1_000_000, VoltageRange::Boost), None);
            assert_eq!(flash.check(normal * 1_000_000, VoltageRange::Normal), None);
            assert!(
                flash
                    .check(boost * 1_000_000 + 500_000, VoltageRange::Boost)
                    .is_some()
            );
            assert!(
                flash
                    .check(normal * 1_000_000 + 500_000, VoltageRange::Normal)
                    .is_some()
            );
        }
        assert_eq!(
            flash.check(170_017_000, VoltageRange::Boost),
            None,
            "+100 ppm is no mistake"
        );
    }

    #[test]
    fn the_control_register_is_locked() {
        let mut flash = Flash::default();
        assert_eq!(flash.read(CR), Some(CR_RESET));
        assert!(flash.write(CR, 0).is_err());
        assert_eq!(flash.write(KEYR, KEYS[0]), Ok(true));
        assert_eq!(flash.write(KEYR, KEYS[1]), Ok(true));
        assert_eq!(flash.read(CR), Some(CR_RESET & !CR_LOCK));
        assert_eq!(flash.write(CR, 0), Ok(true));
    }
}

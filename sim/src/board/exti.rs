//! EXTI lines of the GPIO pins and SYSCFG's choice of the port
//! (RM0440, 16 and 10).

use super::gpio::PORTS;

const IMR1: u32 = 0x00;
const RTSR1: u32 = 0x08;
const FTSR1: u32 = 0x0C;
const SWIER1: u32 = 0x10;
const PR1: u32 = 0x14;
const LAST: u32 = 0x34;
const WORDS: usize = (LAST / 4 + 1) as usize;
const IMR1_RESET: u32 = 0xFF82_0000;
const IMR2: u32 = 0x20;
const IMR2_RESET: u32 = 0xFFFF_FF87;
/// Lines 0..=15 belong to the pins.
const PINS: u32 = 0xFFFF;

const EXTICR1: u32 = 0x08;
const EXTICR4: u32 = 0x14;
const SYSCFG_LAST: u32 = 0x24;
const SYSCFG_WORDS: usize = (SYSCFG_LAST / 4 + 1) as usize;
const CFGR1: u32 = 0x04;
const CFGR1_RESET: u32 = 0x7C00_0001;

/// Interrupt of each pin line.
const fn irq_of(line: u32) -> u8 {
    match line {
        0..=4 => 6 + line as u8,
        5..=9 => 23,
        _ => 40,
    }
}

/// EXTI and SYSCFG.
#[derive(Debug, Clone)]
pub(crate) struct Exti {
    registers: [u32; WORDS],
    syscfg: [u32; SYSCFG_WORDS],
    pending: u32,
    levels: u32,
}

impl Default for Exti {
    fn default() -> Self {
        let mut registers = [0; WORDS];
        registers[(IMR1 / 4) as usize] = IMR1_RESET;
        registers[(IMR2 / 4) as usize] = IMR2_RESET;
        let mut syscfg = [0; SYSCFG_WORDS];
        syscfg[(CFGR1 / 4) as usize] = CFGR1_RESET;
        Self {
            registers,
            syscfg,
            pending: 0,
            levels: 0,
        }
    }
}

impl Exti {
    fn register(&self, offset: u32) -> u32 {
        self.registers
            .get((offset / 4) as usize)
            .copied()
            .unwrap_or(0)
    }

    /// Reads an EXTI register; `None` where there is none.
    #[must_use]
    pub(crate) fn read(&self, offset: u32) -> Option<u32> {
        match offset {
            PR1 => Some(self.pending),
            0..=LAST => Some(self.register(offset)),
            _ => None,
        }
    }

    /// Writes an EXTI register; false where there is none.
    pub(crate) fn write(&mut self, offset: u32, value: u32) -> bool {
        match offset {
            PR1 => self.pending &= !value,
            SWIER1 => self.pending |= value & PINS,
            0..=LAST => {
                if let Some(register) = self.registers.get_mut((offset / 4) as usize) {
                    *register = value;
                }
            }
            _ => return false,
        }
        true
    }

    /// Reads a SYSCFG register; `None` where there is none.
    #[must_use]
    pub(crate) fn read_syscfg(&self, offset: u32) -> Option<u32> {
        self.syscfg.get((offset / 4) as usize).copied()
    }

    /// Writes a SYSCFG register; false where there is none.
    pub(crate) fn write_syscfg(&mut self, offset: u32, value: u32) -> bool {
        let Some(register) = self.syscfg.get_mut((offset / 4) as usize) else {
            return false;
        };
        *register = if (EXTICR1..=EXTICR4).contains(&offset) {
            value & PINS
        } else {
            value
        };
        true
    }

    /// The port that EXTICR selects for a line.
    fn port_of(&self, line: u32) -> usize {
        let register = self.syscfg[(EXTICR1 / 4 + line / 4) as usize];
        (register >> (4 * (line % 4)) & 0xF) as usize
    }

    /// Takes the levels of all ports; edges set pending bits.
    pub(crate) fn sample(&mut self, inputs: &[u32; PORTS]) {
        let levels = (0..16).fold(0, |levels, line| {
            let input = inputs.get(self.port_of(line)).copied().unwrap_or(0);
            levels | input & 1 << line
        });
        let rising = levels & !self.levels & self.register(RTSR1);
        let falling = !levels & self.levels & self.register(FTSR1);
        self.pending |= (rising | falling) & PINS;
        self.levels = levels;
    }

    /// Calls `raise` with each interrupt that is active.
    pub(crate) fn irqs(&self, mut raise: impl FnMut(u8)) {
        let active = self.pending & self.register(IMR1) & PINS;
        for line in 0..16 {
            if active & 1 << line != 0 {
                raise(irq_of(line));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rising_edge_on_pc13_raises_exti15_10() {
        let mut exti = Exti::default();
        // EXTICR4.EXTI13 = port C.
        assert!(exti.write_syscfg(EXTICR4, 2 << 4));
        exti.write(RTSR1, 1 << 13);
        exti.write(IMR1, 1 << 13);
        let mut inputs = [0; PORTS];
        exti.sample(&inputs);
        inputs[2] = 1 << 13;
        exti.sample(&inputs);
        let mut irqs = Vec::new();
        exti.irqs(|irq| irqs.push(irq));
        assert_eq!(irqs, [40]);
        assert_eq!(exti.read(PR1), Some(1 << 13));
        exti.write(PR1, 1 << 13);
        exti.irqs(|_| panic!("cleared"));
        inputs[2] = 0;
        exti.sample(&inputs);
        exti.irqs(|_| panic!("falling edges are not selected"));
        assert_eq!(exti.read(0x38), None);
        assert_eq!(exti.read_syscfg(0x28), None);
    }
}

//! GPIO ports A..G (RM0440, 9).

const MODER: u32 = 0x00;
const OTYPER: u32 = 0x04;
const OSPEEDR: u32 = 0x08;
const PUPDR: u32 = 0x0C;
const IDR: u32 = 0x10;
const ODR: u32 = 0x14;
const BSRR: u32 = 0x18;
const LCKR: u32 = 0x1C;
const AFRL: u32 = 0x20;
const AFRH: u32 = 0x24;
const BRR: u32 = 0x28;

const MODE_OUTPUT: u32 = 0b01;
const MODE_ALTERNATE: u32 = 0b10;
const MODE_ANALOG: u32 = 0b11;
const PULL_UP: u32 = 0b01;
/// Ports of the STM32G474RE: A..G.
pub(crate) const PORTS: usize = 7;

/// A pin: port (0 = A) and number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Pin {
    /// 0 = port A.
    pub port: usize,
    /// 0..=15.
    pub number: u32,
}

impl Pin {
    /// Pin `number` of port `letter`, a capital.
    #[must_use]
    pub(crate) const fn new(letter: char, number: u32) -> Self {
        Self {
            port: letter as usize - 'A' as usize,
            number,
        }
    }
}

/// One port.
#[derive(Debug, Clone)]
pub(crate) struct Port {
    moder: u32,
    otyper: u32,
    ospeedr: u32,
    pupdr: u32,
    odr: u32,
    lckr: u32,
    afr: [u32; 2],
    /// Levels that something outside drives, and which pins it drives.
    driven: u32,
    levels: u32,
}

impl Port {
    /// Port `index` (0 = A) in its reset state.
    #[must_use]
    pub(crate) fn new(index: usize) -> Self {
        let (moder, ospeedr, pupdr) = match index {
            0 => (0xABFF_FFFF, 0x0C00_0000, 0x6400_0000),
            1 => (0xFFFF_FEBF, 0x0000_00C0, 0x0000_0100),
            _ => (0xFFFF_FFFF, 0, 0),
        };
        Self {
            moder,
            otyper: 0,
            ospeedr,
            pupdr,
            odr: 0,
            lckr: 0,
            afr: [0; 2],
            driven: 0,
            levels: 0,
        }
    }

    /// Reset of the port; what is wired to it stays.
    pub(crate) fn reset(&mut self, index: usize) {
        let (driven, levels) = (self.driven, self.levels);
        *self = Self::new(index);
        self.driven = driven;
        self.levels = levels;
    }

    /// Drives a pin from outside.
    pub(crate) fn drive(&mut self, number: u32, high: bool) {
        self.driven |= 1 << number;
        if high {
            self.levels |= 1 << number;
        } else {
            self.levels &= !(1 << number);
        }
    }

    const fn mode(&self, number: u32) -> u32 {
        self.moder >> (2 * number) & 0b11
    }

    /// Whether the program drives a pin high as an output.
    #[must_use]
    pub(crate) const fn is_output_high(&self, number: u32) -> bool {
        self.mode(number) == MODE_OUTPUT && self.odr & 1 << number != 0
    }

    /// The alternate function that a pin is switched to.
    #[must_use]
    pub(crate) fn alternate_function(&self, number: u32) -> Option<u32> {
        if self.mode(number) != MODE_ALTERNATE {
            return None;
        }
        let register = self.afr[usize::from(number > 7)];
        Some(register >> (4 * (number % 8)) & 0xF)
    }

    /// IDR: outputs read back, inputs what drives or pulls them.
    #[must_use]
    pub(crate) fn input(&self) -> u32 {
        (0..16).fold(0, |levels, number| {
            let bit = 1 << number;
            let pulled_up = self.pupdr >> (2 * number) & 0b11 == PULL_UP;
            let high = match self.mode(number) {
                MODE_ANALOG => false,
                MODE_OUTPUT => self.odr & bit != 0,
                _ if self.driven & bit != 0 => self.levels & bit != 0,
                _ => pulled_up,
            };
            levels | if high { bit } else { 0 }
        })
    }

    /// Reads a register; `None` where there is none.
    #[must_use]
    pub(crate) fn read(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            MODER => self.moder,
            OTYPER => self.otyper,
            OSPEEDR => self.ospeedr,
            PUPDR => self.pupdr,
            IDR => self.input(),
            ODR => self.odr,
            BSRR | BRR => 0,
            LCKR => self.lckr,
            AFRL => self.afr[0],
            AFRH => self.afr[1],
            _ => return None,
        })
    }

    /// Writes a register; false where there is none.
    pub(crate) fn write(&mut self, offset: u32, value: u32) -> bool {
        const PINS: u32 = 0xFFFF;
        match offset {
            MODER => self.moder = value,
            OTYPER => self.otyper = value & PINS,
            OSPEEDR => self.ospeedr = value,
            PUPDR => self.pupdr = value,
            IDR => {}
            ODR => self.odr = value & PINS,
            // Setting wins over clearing.
            BSRR => self.odr = self.odr & !(value >> 16) | value & PINS,
            LCKR => self.lckr = value,
            AFRL => self.afr[0] = value,
            AFRH => self.afr[1] = value,
            BRR => self.odr &= !(value & PINS),
            _ => return false,
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reset_values() {
        assert_eq!(Port::new(0).read(MODER), Some(0xABFF_FFFF));
        assert_eq!(Port::new(1).read(MODER), Some(0xFFFF_FEBF));
        assert_eq!(Port::new(2).read(MODER), Some(0xFFFF_FFFF));
        assert_eq!(Port::new(2).read(0x2C), None);
    }

    #[test]
    fn an_output_follows_bsrr_and_brr() {
        let mut port = Port::new(0);
        port.write(MODER, 0b01 << 10);
        port.write(BSRR, 1 << 5);
        assert!(port.is_output_high(5));
        // PA13 and PA15 are pulled up after reset (SWD and JTAG).
        assert_eq!(port.input(), 1 << 15 | 1 << 13 | 1 << 5);
        port.write(BSRR, 1 << 5 | 1 << 21);
        assert!(port.is_output_high(5), "set wins");
        port.write(BSRR, 1 << 21);
        assert!(!port.is_output_high(5));
        port.write(ODR, 1 << 5);
        port.write(BRR, 1 << 5);
        assert!(!port.is_output_high(5));
    }

    #[test]
    fn inputs_read_what_drives_them_and_pulls_otherwise() {
        let mut port = Port::new(2);
        port.drive(13, true);
        assert_eq!(port.input(), 0, "analog after reset");
        port.write(MODER, 0);
        assert_eq!(port.input(), 1 << 13);
        port.write(PUPDR, 0b01);
        assert_eq!(port.input(), 1 << 13 | 1);
        port.drive(13, false);
        port.reset(2);
        port.write(MODER, 0);
        assert_eq!(port.input(), 0);
    }

    #[test]
    fn alternate_functions() {
        let mut port = Port::new(0);
        port.write(MODER, 0b10 << 22 | 0b10 << 24);
        port.write(AFRH, 9 << 12 | 9 << 16);
        assert_eq!(port.alternate_function(11), Some(9));
        assert_eq!(port.alternate_function(12), Some(9));
        assert_eq!(port.alternate_function(13), None);
    }
}

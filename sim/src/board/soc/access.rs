//! Register accesses: which peripheral, is it clocked, does the register exist.

use super::super::fdcan::ram;
use super::super::iwdg::Fed;
use super::super::rcc::Gate;
use super::{Access, DBGMCU_WORDS, DiagnosticKind, IDCODE, ResetCause, Soc, TIMER_KINDS};

/// Peripherals occupy multiples of this.
const BLOCK: u32 = 0x400;
const APB1: u32 = 0x4000_0000;
const IWDG: u32 = 0x4000_3000;
const FDCAN1: u32 = 0x4000_6400;
const FDCAN3: u32 = 0x4000_6C00;
const PWR: u32 = 0x4000_7000;
const CAN_RAM: u32 = 0x4000_A400;
const CAN_RAM_BYTES: u32 = 0x350;
const CAN_RAM_END: u32 = CAN_RAM + 3 * CAN_RAM_BYTES;
const SYSCFG: u32 = 0x4001_0000;
const EXTI: u32 = 0x4001_0400;
const RCC: u32 = 0x4002_1000;
const FLASH: u32 = 0x4002_2000;
const GPIOA: u32 = 0x4800_0000;
const GPIOG_END: u32 = 0x4800_1C00;
const DBGMCU: u32 = 0xE004_2000;
const GPIO_MODER: u32 = 0x00;
const GPIO_AFRL: u32 = 0x20;
const GPIO_AFRH: u32 = 0x24;

/// What lies at an address.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Block {
    Timer(usize),
    Iwdg,
    Can(usize),
    CanRam(usize),
    Pwr,
    Syscfg,
    Exti,
    Rcc,
    Flash,
    Gpio(usize),
    Dbgmcu,
}

impl Block {
    fn at(address: u32) -> Option<(Self, u32)> {
        if (CAN_RAM..CAN_RAM_END).contains(&address) {
            let offset = address - CAN_RAM;
            return Some((
                Self::CanRam((offset / CAN_RAM_BYTES) as usize),
                offset % CAN_RAM_BYTES,
            ));
        }
        let offset = address % BLOCK;
        let block = match address - offset {
            base @ APB1..=0x4000_1400 => Self::Timer(((base - APB1) / BLOCK) as usize),
            IWDG => Self::Iwdg,
            base @ FDCAN1..=FDCAN3 => Self::Can(((base - FDCAN1) / BLOCK) as usize),
            PWR => Self::Pwr,
            SYSCFG => Self::Syscfg,
            EXTI => Self::Exti,
            RCC => Self::Rcc,
            FLASH => Self::Flash,
            base @ GPIOA..GPIOG_END => Self::Gpio(((base - GPIOA) / BLOCK) as usize),
            DBGMCU => Self::Dbgmcu,
            _ => return None,
        };
        Some((block, offset))
    }

    /// The clock gate; `None` for what always runs.
    const fn gate(self) -> Option<Gate> {
        match self {
            Self::Timer(k) => Some(Gate::apb1(k as u32)),
            Self::Can(_) | Self::CanRam(_) => Some(CAN_GATE),
            Self::Pwr => Some(Gate::apb1(28)),
            Self::Syscfg => Some(Gate::apb2(0)),
            Self::Flash => Some(Gate::ahb1(8)),
            Self::Gpio(port) => Some(Gate::ahb2(port as u32)),
            Self::Iwdg | Self::Exti | Self::Rcc | Self::Dbgmcu => None,
        }
    }

    fn name(self) -> String {
        match self {
            Self::Timer(k) => TIMER_KINDS[k].2.to_string(),
            Self::Can(k) => format!("FDCAN{}", k + 1),
            Self::CanRam(k) => format!("message RAM of FDCAN{}", k + 1),
            Self::Gpio(port) => format!("GPIO{}", char::from(b'A' + port as u8)),
            Self::Iwdg => "IWDG".to_string(),
            Self::Pwr => "PWR".to_string(),
            Self::Syscfg => "SYSCFG".to_string(),
            Self::Exti => "EXTI".to_string(),
            Self::Rcc => "RCC".to_string(),
            Self::Flash => "FLASH".to_string(),
            Self::Dbgmcu => "DBGMCU".to_string(),
        }
    }

    /// What can be reset through RCC.
    const ALL_GATED: [Self; 20] = [
        Self::Timer(0),
        Self::Timer(1),
        Self::Timer(2),
        Self::Timer(3),
        Self::Timer(4),
        Self::Timer(5),
        Self::Can(0),
        Self::Can(1),
        Self::Can(2),
        Self::Pwr,
        Self::Syscfg,
        Self::Flash,
        Self::Gpio(0),
        Self::Gpio(1),
        Self::Gpio(2),
        Self::Gpio(3),
        Self::Gpio(4),
        Self::Gpio(5),
        Self::Gpio(6),
        Self::Exti,
    ];
}

/// FDCANEN is common to the three instances.
pub(super) const CAN_GATE: Gate = Gate::apb1(25);

impl Soc {
    fn locate(&mut self, address: u32, verb: &str, access: Access) -> Option<(Block, u32)> {
        let Some((block, offset)) = Block::at(address) else {
            let text = format!("{verb} of 0x{address:08x}: nothing modelled there");
            self.note(access, DiagnosticKind::Unmodelled, text);
            return None;
        };
        if block.gate().is_some_and(|gate| !self.rcc.is_enabled(gate)) {
            let text = format!(
                "{verb} of {} (0x{address:08x}) without its clock: enable it in RCC first",
                block.name()
            );
            self.note(access, DiagnosticKind::Unclocked, text);
            return None;
        }
        Some((block, offset))
    }

    /// Reads the word at a peripheral address.
    pub(crate) fn read(&mut self, address: u32, access: Access) -> u32 {
        let Some((block, offset)) = self.locate(address, "read", access) else {
            return 0;
        };
        let now = access.cycle;
        let value = match block {
            Block::Timer(k) => self.timers[k].read(offset, now),
            Block::Iwdg => self.iwdg.read(offset, self.clock.time_of(now)),
            Block::Can(k) => self.read_can(k, offset, access),
            Block::CanRam(k) => Some(self.can[k].ram.word((offset / 4) as usize)),
            Block::Pwr => self.pwr.read(offset),
            Block::Syscfg => self.exti.read_syscfg(offset),
            Block::Exti => self.exti.read(offset),
            Block::Rcc => {
                let value = self.rcc.read(offset, now);
                // A pending switch of the system clock shows with this read.
                if self.rcc.hclk() != self.clock.frequency() {
                    self.clocks_changed(access);
                }
                value
            }
            Block::Flash => self.read_flash_register(offset, access),
            Block::Gpio(port) => self.ports[port].read(offset),
            Block::Dbgmcu => match offset / 4 {
                0 => Some(IDCODE),
                word => self.dbgmcu.get(word as usize).copied(),
            },
        };
        value.unwrap_or_else(|| {
            self.note_unmodelled(block, address, "read", access);
            0
        })
    }

    /// Writes the word at a peripheral address. True if interrupts, deadlines
    /// or the bus may be concerned.
    pub(crate) fn write(&mut self, address: u32, value: u32, access: Access) -> bool {
        let Some((block, offset)) = self.locate(address, "write", access) else {
            return false;
        };
        let mut concerned = true;
        let known = match block {
            Block::Timer(k) => match self.timers[k].write(offset, value, access.cycle) {
                Ok(known) => known,
                Err(words) => {
                    let text = format!("{} {words}", block.name());
                    self.note(access, DiagnosticKind::Timer, text);
                    true
                }
            },
            Block::Iwdg => self.write_iwdg(offset, value, access),
            Block::Can(k) => self.write_can(k, offset, value, access),
            Block::CanRam(k) => {
                concerned = false;
                self.write_can_ram(k, (offset / 4) as usize, value, access);
                true
            }
            Block::Pwr => {
                let known = self.pwr.write(offset, value);
                self.check_clocks(access);
                known
            }
            Block::Syscfg => {
                let known = self.exti.write_syscfg(offset, value);
                self.sample_pins();
                known
            }
            Block::Exti => self.exti.write(offset, value),
            Block::Rcc => self.write_rcc(offset, value, access),
            Block::Flash => self.write_flash_register(offset, value, access),
            Block::Gpio(port) => {
                let known = self.ports[port].write(offset, value);
                if matches!(offset, GPIO_MODER | GPIO_AFRL | GPIO_AFRH) {
                    self.can.iter_mut().for_each(super::Fdcan::mark_changed);
                }
                self.sample_pins();
                known
            }
            Block::Dbgmcu => {
                concerned = false;
                let word = (offset / 4) as usize;
                if word != 0 && word < DBGMCU_WORDS {
                    self.dbgmcu[word] = value;
                }
                word < DBGMCU_WORDS
            }
        };
        if !known {
            self.note_unmodelled(block, address, "write", access);
        }
        concerned
    }

    fn note_unmodelled(&mut self, block: Block, address: u32, verb: &str, access: Access) {
        let text = format!(
            "{verb} of 0x{address:08x}: {} has no such register",
            block.name()
        );
        self.note(access, DiagnosticKind::Unmodelled, text);
    }

    fn write_iwdg(&mut self, offset: u32, value: u32, access: Access) -> bool {
        let now = self.clock.time_of(access.cycle);
        match self.iwdg.write(offset, value, now) {
            None => return false,
            Some(Ok(Fed::InTime)) => {}
            Some(Ok(Fed::TooEarly)) => self.reset_request = Some(ResetCause::Watchdog),
            Some(Err(words)) => {
                self.note(access, DiagnosticKind::Watchdog, format!("IWDG: {words}"));
            }
        }
        true
    }

    fn write_rcc(&mut self, offset: u32, value: u32, access: Access) -> bool {
        if self.rcc.is_pll_locked_register(offset) {
            let text = "RCC_PLLCFGR written while the PLL runs";
            self.note(access, DiagnosticKind::Clocks, text);
        }
        let known = self.rcc.write(offset, value, access.cycle);
        if let Some(register) = super::Rcc::reset_register(offset) {
            for block in Block::ALL_GATED {
                if block
                    .gate()
                    .is_some_and(|gate| gate.register == register && value & 1 << gate.bit != 0)
                {
                    self.reset_block(block, access);
                }
            }
        }
        self.clocks_changed(access);
        known
    }

    fn reset_block(&mut self, block: Block, access: Access) {
        match block {
            Block::Timer(k) => {
                self.timers[k] = super::Timer::new(TIMER_KINDS[k].0, access.cycle);
            }
            Block::Can(k) => self.can[k].reset(),
            Block::Pwr => self.pwr = super::Pwr::default(),
            Block::Syscfg => self.exti = super::Exti::default(),
            Block::Gpio(port) => self.ports[port].reset(port),
            Block::CanRam(_)
            | Block::Iwdg
            | Block::Exti
            | Block::Rcc
            | Block::Flash
            | Block::Dbgmcu => {}
        }
    }

    /// Notes an access of a width that a peripheral does not take: the message
    /// RAM and the registers of FDCAN take words only.
    pub(crate) fn check_width(&mut self, address: u32, bytes: usize, access: Access) {
        let block = Block::at(address).map(|(block, _)| block);
        if bytes != 4 && matches!(block, Some(Block::Can(_) | Block::CanRam(_))) {
            let text =
                format!("access of {bytes} bytes to 0x{address:08x}: FDCAN takes words only");
            self.note(access, DiagnosticKind::Width, text);
        }
    }
}

const _: () = assert!(ram::WORDS * 4 == CAN_RAM_BYTES as usize);

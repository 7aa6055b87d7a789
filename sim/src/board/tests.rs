//! The whole board with programs of a few hand-assembled instructions.

mod faults;
mod flash;
mod on_the_bus;
mod rsemu_defects;
mod running;
mod three_buses;

use super::api::{BoardOptions, Stop};
use super::image::{Image, ImageSize};
use super::machine::Board;
use super::memory::FLASH_BASE;
use crate::time::Time;

const STACK_TOP: u32 = 0x2000_2000;
const CODE: usize = 0x200;
const HANDLER_STEP: usize = 0x200;
const NOP: u16 = 0xBF00;
const WFI: u16 = 0xBF30;
const BX_LR: u16 = 0x4770;
const CPSID_I: u16 = 0xB672;
const CPSIE_I: u16 = 0xB662;
const UDF: u16 = 0xDE00;
const BRANCH_TO_SELF: u16 = 0xE7FE;
/// MSR BASEPRI, r1.
const MSR_BASEPRI_R1: [u16; 2] = [0xF381, 0x8811];

const RCC_AHB2ENR: u32 = 0x4002_104C;
const RCC_APB1ENR1: u32 = 0x4002_1058;
const RCC_CSR: u32 = 0x4002_1094;
const TIM2: u32 = 0x4000_0000;
const TIM_CR1: u32 = 0x00;
const TIM_DIER: u32 = 0x0C;
const TIM_SR: u32 = 0x10;
const TIM_ARR: u32 = 0x2C;
const IWDG: u32 = 0x4000_3000;
const GPIOA: u32 = 0x4800_0000;
const GPIOC: u32 = 0x4800_0800;
const NVIC_ISER0: u32 = 0xE000_E100;
const NVIC_ISPR0: u32 = 0xE000_E200;
const NVIC_IPR_TIM2: u32 = 0xE000_E400 + 28;
const AIRCR: u32 = 0xE000_ED0C;
const SYST_CSR: u32 = 0xE000_E010;
const SYST_RVR: u32 = 0xE000_E014;
const SRAM: u32 = 0x2000_3000;
const TIM2_EXCEPTION: usize = 16 + 28;
const SYSTICK_EXCEPTION: usize = 15;

/// A program being put together.
#[derive(Default)]
struct Program {
    code: Vec<u16>,
    handlers: Vec<(usize, Vec<u16>)>,
}

/// MOVW and MOVT of `value` into register `rd`.
fn load(rd: u16, value: u32) -> [u16; 4] {
    let half = |opcode: u16, v: u16| {
        [
            opcode | (v >> 11 & 1) << 10 | v >> 12,
            (v >> 8 & 7) << 12 | rd << 8 | v & 0xFF,
        ]
    };
    let [a, b] = half(0xF240, value as u16);
    let [c, d] = half(0xF2C0, (value >> 16) as u16);
    [a, b, c, d]
}

/// Writes `value` to the word at `address`.
fn store(address: u32, value: u32) -> Vec<u16> {
    const STR_R1_R0: u16 = 0x6001;
    let mut code = load(0, address).to_vec();
    code.extend(load(1, value));
    code.push(STR_R1_R0);
    code
}

/// Copies the word at `from` to the word at `to`.
fn copy(from: u32, to: u32) -> Vec<u16> {
    const LDR_R1_R0: u16 = 0x6801;
    const STR_R1_R0: u16 = 0x6001;
    let mut code = load(0, from).to_vec();
    code.push(LDR_R1_R0);
    code.extend(load(0, to));
    code.push(STR_R1_R0);
    code
}

/// Adds one to the word at `address`.
fn count(address: u32) -> Vec<u16> {
    const LDR_R1_R0: u16 = 0x6801;
    const ADDS_R1_1: u16 = 0x3101;
    const STR_R1_R0: u16 = 0x6001;
    let mut code = load(0, address).to_vec();
    code.extend([LDR_R1_R0, ADDS_R1_1, STR_R1_R0]);
    code
}

impl Program {
    fn then(mut self, code: impl AsRef<[u16]>) -> Self {
        self.code.extend_from_slice(code.as_ref());
        self
    }

    fn store(self, address: u32, value: u32) -> Self {
        self.then(store(address, value))
    }

    /// Sleeps for ever.
    fn sleeps(self) -> Self {
        // WFI; B back to it.
        self.then([WFI, 0xE7FD])
    }

    /// What `exception` does before it returns.
    fn handler(mut self, exception: usize, code: impl AsRef<[u16]>) -> Self {
        let mut code = code.as_ref().to_vec();
        code.push(BX_LR);
        self.handlers.push((exception, code));
        self
    }

    /// TIM2 with an update every `cycles`, its interrupt enabled, running.
    fn tim2_every(self, cycles: u32) -> Self {
        self.store(RCC_APB1ENR1, 1)
            .store(TIM2 + TIM_ARR, cycles - 1)
            .store(TIM2 + TIM_DIER, 1)
            .store(NVIC_ISER0, 1 << 28)
            .store(TIM2 + TIM_CR1, 1)
    }

    fn image(self) -> Image {
        const VECTORS: usize = 128;
        let mut flash = vec![0xFF; 0x2000];
        let mut put = |at: usize, bytes: &[u8]| flash[at..at + bytes.len()].copy_from_slice(bytes);
        let default = FLASH_BASE + 0x1F00 + 1;
        put(0x1F00, &BRANCH_TO_SELF.to_le_bytes());
        put(0, &STACK_TOP.to_le_bytes());
        put(4, &(FLASH_BASE + CODE as u32 + 1).to_le_bytes());
        for vector in 2..VECTORS {
            put(4 * vector, &default.to_le_bytes());
        }
        let bytes = |code: &[u16]| {
            code.iter()
                .flat_map(|h| h.to_le_bytes())
                .collect::<Vec<u8>>()
        };
        assert!(2 * self.code.len() <= 2 * HANDLER_STEP);
        put(CODE, &bytes(&self.code));
        for (k, (exception, code)) in self.handlers.iter().enumerate() {
            let at = CODE + (k + 2) * HANDLER_STEP;
            put(at, &bytes(code));
            put(4 * exception, &(FLASH_BASE + at as u32 + 1).to_le_bytes());
        }
        Image::bare(vec![(FLASH_BASE, flash)], ImageSize::default())
    }

    fn board(self) -> Board {
        Board::from_image(self.image(), &BoardOptions::default()).expect("the board can be made")
    }
}

impl Board {
    /// Runs on whatever the buses are told, but not over a fault.
    fn run(&mut self, t: Time) -> Stop {
        loop {
            match self.run_until(t) {
                Stop::CanChanged => {}
                stop => return stop,
            }
        }
    }
}

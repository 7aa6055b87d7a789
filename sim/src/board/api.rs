//! What a simulation does with a board: wires, buttons, faults, figures.

use std::sync::atomic::Ordering;

use super::diagnostics::Diagnostic;
use super::fault::FaultReport;
use super::flash::{BankContents, FlashOptions};
use super::gpio::Pin;
use super::image::ImageSize;
use super::machine::Board;
use super::measure::BoardStats;
use super::memory::{FLASH_BASE, POWER_ON_WORD, lock};
use super::rcc::ResetCause;
use crate::bus::{BitTiming, Event, Offer};

/// How a board is made.
#[derive(Debug, Clone)]
pub struct BoardOptions {
    /// Error of the 24 MHz crystal in parts per million; the core and the CAN
    /// bit follow it.
    pub clock_error_ppm: f64,
    /// Error of the internal 16 MHz oscillator in percent (start-up only).
    pub hsi_error_percent: f64,
    /// Error of the internal 32 kHz oscillator in percent (the watchdog).
    pub lsi_error_percent: f64,
    /// COB-ID whose request after TIM2's update is timed.
    pub sync_cob_id: u16,
    /// The flash: its option bytes and what bank 2 holds.
    pub flash: FlashOptions,
}

impl Default for BoardOptions {
    fn default() -> Self {
        const SYNC: u16 = 0x080;
        Self {
            clock_error_ppm: 0.0,
            hsi_error_percent: 0.0,
            lsi_error_percent: 0.0,
            sync_cob_id: SYNC,
            flash: FlashOptions::default(),
        }
    }
}

/// Why [`Board::run_until`] came back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Stop {
    /// The moment is reached.
    Reached,
    /// What the board offers to a bus, or its bit timing, may have changed;
    /// ask [`Board::can_timing`] and [`Board::can_offer`], then go on.
    CanChanged,
    /// The program has come to a bad end. Going on is possible: the watchdog
    /// may still reset it.
    Fault(Box<FaultReport>),
}

/// A light on the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Led {
    /// LD2 on PA5: the RUN LED.
    Run,
    /// The ERR LED on PB0 (Arduino A3).
    Error,
}

/// One half-word of a program.
pub(super) type Code = [u8; 2];

const LD2: Pin = Pin::new('A', 5);
const ERR: Pin = Pin::new('B', 0);
const B1: Pin = Pin::new('C', 13);

impl Board {
    /// Pulls NRST low: core and peripherals are in reset until
    /// [`release_reset`](Self::release_reset); RAM keeps its content.
    pub fn hold_in_reset(&mut self) {
        self.hold(ResetCause::Pin);
    }

    /// Lets go of NRST, or switches the supply on again.
    pub fn release_reset(&mut self) {
        if let Some((at, cause)) = self.held.take() {
            self.reset(cause, at);
        }
    }

    /// Takes the supply away until [`release_reset`](Self::release_reset): RAM
    /// loses its content.
    pub fn power_off(&mut self) {
        self.hold(ResetCause::PowerOn);
    }

    fn hold(&mut self, cause: ResetCause) {
        if self.held.is_none() {
            let at = self.now();
            self.read_rtt();
            lock(&self.soc).reset(cause, self.cycle, at);
            self.held = Some((at, cause));
        }
    }

    /// Whether NRST is held low or the supply is off.
    #[must_use]
    pub const fn is_held(&self) -> bool {
        self.held.is_some()
    }

    /// Bit timing of FDCAN`instance + 1` as the board's clocks give it; `None`
    /// while it takes no part in the bus.
    #[must_use]
    pub fn can_timing(&self, instance: usize) -> Option<BitTiming> {
        lock(&self.soc).can_timing(instance)
    }

    /// What FDCAN`instance + 1` would send next.
    #[must_use]
    pub fn can_offer(&self, instance: usize) -> Option<Offer> {
        lock(&self.soc).can_offer(instance)
    }

    /// Hands an event of the bus to FDCAN`instance + 1`.
    pub fn can_event(&mut self, instance: usize, event: &Event) {
        lock(&self.soc).can_event(instance, event, self.cycle);
        self.shared.dirty.store(true, Ordering::Relaxed);
    }

    /// Presses or releases B1.
    pub fn set_button(&mut self, pressed: bool) {
        lock(&self.soc).drive(B1, pressed);
        self.shared.dirty.store(true, Ordering::Relaxed);
    }

    /// Whether a light is on.
    #[must_use]
    pub fn led(&self, led: Led) -> bool {
        lock(&self.soc).is_high(match led {
            Led::Run => LD2,
            Led::Error => ERR,
        })
    }

    /// Appends what the program has written to RTT up-channel 0.
    pub fn drain_rtt(&mut self, out: &mut Vec<u8>) {
        self.read_rtt();
        out.append(&mut self.rtt_out);
    }

    /// Delivers interrupt `irq` late from now on: by a random number of cycles
    /// up to `max_cycles`, from `seed`. 0 ends it.
    pub fn delay_irq(&mut self, irq: u8, max_cycles: u64, seed: u64) {
        self.irq.delay(irq, max_cycles, seed);
    }

    /// The task of interrupt `irq` hangs: until the next reset the interrupt is
    /// not taken any more, whether hardware or program asks for it.
    pub fn hang_irq(&mut self, irq: u8) {
        /// Interrupt clear-enable registers of the NVIC (ARMv7-M, B3.4.5).
        const ICER: u32 = 0xE000_E180;
        self.write_nvic(ICER, irq);
    }

    /// The task of interrupt `irq` hangs no longer: it is taken again.
    pub fn resume_irq(&mut self, irq: u8) {
        /// Interrupt set-enable registers of the NVIC (ARMv7-M, B3.4.4).
        const ISER: u32 = 0xE000_E100;
        self.write_nvic(ISER, irq);
        // It may have waited for that: a core that sleeps wakes.
        self.poke = true;
        self.shared.dirty.store(true, Ordering::Relaxed);
    }

    /// Writes the bit of an interrupt in one of the NVIC's sets of registers.
    fn write_nvic(&mut self, first: u32, irq: u8) {
        const BITS: u32 = 32;
        let (word, bit) = (u32::from(irq) / BITS, u32::from(irq) % BITS);
        self.core.with_sys(|sys| {
            sys.write_word(first + word * 4, 1 << bit);
        });
    }

    /// The task of interrupt `irq` never ends: until the next reset its handler
    /// begins with a branch to itself.
    pub fn spin_irq(&mut self, irq: u8) {
        /// `b .`
        const BRANCH_TO_ITSELF: Code = [0xFE, 0xE7];
        self.begin_with(irq, BRANCH_TO_ITSELF);
    }

    /// The task of interrupt `irq` ends as a panic does: until the next reset its
    /// handler begins with an undefined instruction.
    pub fn crash_irq(&mut self, irq: u8) {
        /// `udf #0`
        const UNDEFINED: Code = [0x00, 0xDE];
        self.begin_with(irq, UNDEFINED);
    }

    fn begin_with(&mut self, irq: u8, instruction: Code) {
        /// Exceptions of the core come first in the vector table.
        const FIRST: u32 = 16;
        const VECTOR_BYTES: u32 = 4;
        /// Of a vector: Thumb code.
        const THUMB: u32 = 1;
        let vector = FLASH_BASE + (FIRST + u32::from(irq)) * VECTOR_BYTES;
        let Some(handler) = self.memory.word(vector).map(|entry| entry & !THUMB) else {
            return;
        };
        let mut code = Code::default();
        if self.memory.read(handler, &mut code) && self.memory.patch(handler, &instruction) {
            self.spinning.push((handler, code));
        }
    }

    /// Puts back what [`spin_irq`](Self::spin_irq) and [`crash_irq`](Self::crash_irq)
    /// have taken away.
    pub(super) fn stop_spinning(&mut self) {
        for (handler, code) in self.spinning.drain(..).rev() {
            // It could be written before.
            let _ = self.memory.patch(handler, &code);
        }
    }

    /// Does not deliver interrupt `irq` from now on, or delivers it again.
    pub fn block_irq(&mut self, irq: u8, blocked: bool) {
        self.irq.block(irq, blocked);
        self.shared.dirty.store(true, Ordering::Relaxed);
    }

    /// Mistakes of the program, in the order of first occurrence.
    #[must_use]
    pub fn diagnostics(&self) -> &[Diagnostic] {
        &self.diagnostics
    }

    /// Sizes of the image.
    #[must_use]
    pub const fn image_size(&self) -> ImageSize {
        self.image.size
    }

    /// The function that a program address lies in, with the offset.
    #[must_use]
    pub fn function_at(&self, address: u32) -> Option<String> {
        self.image.function_at(address)
    }

    /// The word of flash or RAM at `address`, as a debug probe reads it.
    #[must_use]
    pub fn word(&self, address: u32) -> Option<u32> {
        self.memory.word(address)
    }

    /// What bank 2 of the flash holds, for the [`FlashOptions`] of another
    /// board: it outlives resets and the supply. What is being erased or
    /// programmed shows as it was before.
    #[must_use]
    pub fn bank2(&self) -> BankContents {
        lock(&self.soc).bank2()
    }

    /// Starts all figures anew, except the stack's and the resets.
    pub fn clear_stats(&mut self) {
        self.measure.clear();
        self.stats_from = self.cycle;
        let mut soc = lock(&self.soc);
        soc.sync.clear();
        soc.clear_flash_figures();
    }

    /// What has been measured.
    #[must_use]
    pub fn stats(&self) -> BoardStats {
        let mut stats = BoardStats {
            cycles: self.cycle - self.stats_from,
            ..BoardStats::default()
        };
        self.measure.report(&mut stats);
        {
            let soc = lock(&self.soc);
            stats.sync = soc.sync.figures();
            stats.rx_overruns = soc.can_lost();
            stats.flash = soc.flash_figures();
        }
        let top = self.memory.word(FLASH_BASE).unwrap_or(0);
        let bottom = self.image.stack_bottom(top);
        stats.stack_size_bytes = top - bottom;
        let untouched = (bottom..top)
            .step_by(4)
            .take_while(|&at| self.memory.word(at) == Some(POWER_ON_WORD))
            .count();
        stats.stack_high_water_bytes = stats.stack_size_bytes - 4 * untouched as u32;
        stats
    }
}

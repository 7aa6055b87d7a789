//! What the emulated board measures of the program that runs on it.

use std::collections::BTreeMap;

use rsemu::cpu::arm::v7m::sys::Exception;
use rsemu::cpu::arm::v7m::{ArmV7m, Regs};

use super::flash::FlashFigures;
use super::irq::IrqRouter;
use super::rcc::ResetCause;
use super::soc::{TIM2_IRQ, irq_name};
use super::sync_probe::SyncFigures;
use crate::time::Time;

const EXCEPTION_MASK: u32 = 0x1FF;
/// Exception number of interrupt 0.
const FIRST_IRQ: u32 = 16;
/// A step that ends at the same handler's entry and took at least this long
/// is a tail-chained entry, not a loop.
const TAIL_CHAIN_CYCLES: u64 = 7;

/// Figures of one interrupt.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct IrqStats {
    /// Its number.
    pub irq: u8,
    /// Its name.
    pub name: String,
    /// Entries into its handler.
    pub count: u64,
    /// Worst time from the peripheral's request to the handler's first
    /// instruction; entries pended by software are not timed.
    pub worst_latency_cycles: u64,
    /// Worst time in the handler including entry and return, without what
    /// preempted it.
    pub worst_cycles: u64,
    /// Sum of the same.
    pub total_cycles: u64,
}

/// A reset that happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ResetRecord {
    /// When.
    pub at: Time,
    /// Why.
    pub cause: ResetCause,
}

/// What the board has measured since power-on, or since
/// [`Board::clear_stats`](super::Board::clear_stats).
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct BoardStats {
    /// Core cycles, asleep or not.
    pub cycles: u64,
    /// Core cycles in which an instruction ran or an exception was entered.
    pub busy_cycles: u64,
    /// Instructions and exception entries.
    pub steps: u64,
    /// Longest section with PRIMASK or FAULTMASK set, start-up left out.
    pub irq_off_max_cycles: u64,
    /// Where that section ended.
    pub irq_off_max_pc: u32,
    /// Longest section with PRIMASK or FAULTMASK set before the first
    /// interrupt.
    pub startup_irq_off_cycles: u64,
    /// Longest section in which BASEPRI held back TIM2's interrupt: a frame handed to
    /// a controller, under the ceiling of the SYNC task.
    pub sync_masked_max_cycles: u64,
    /// Where that section ended.
    pub sync_masked_max_pc: u32,
    /// Each interrupt that was taken.
    pub irqs: Vec<IrqStats>,
    /// From TIM2's update to the SYNC's request.
    pub sync: SyncFigures,
    /// Bytes of stack ever used, from the RAM's power-on pattern.
    pub stack_high_water_bytes: u32,
    /// Bytes that the stack may use.
    pub stack_size_bytes: u32,
    /// Frames lost in full Rx FIFOs of FDCAN1..3.
    pub rx_overruns: [u64; 3],
    /// What the flash has been through.
    pub flash: FlashFigures,
    /// Resets, power-on included.
    pub resets: Vec<ResetRecord>,
}

impl BoardStats {
    /// Busy cycles over all cycles.
    #[must_use]
    pub fn cpu_load(&self) -> f64 {
        self.busy_cycles as f64 / self.cycles.max(1) as f64
    }

    /// The figures of interrupt `irq`, if it was ever taken.
    #[must_use]
    pub fn irq(&self, irq: u8) -> Option<&IrqStats> {
        self.irqs.iter().find(|stats| stats.irq == irq)
    }
}

/// An exception that is active.
#[derive(Debug, Clone, Copy)]
struct Frame {
    exception: u32,
    entry: u32,
    own_cycles: u64,
}

/// A section during which something is held back.
#[derive(Debug, Clone, Copy, Default)]
struct Section {
    since: Option<u64>,
    startup: bool,
}

impl Section {
    /// Follows the condition; gives the length and whether the section began
    /// during start-up when it ends.
    fn follow(&mut self, on: bool, cycle: u64, startup: bool) -> Option<(u64, bool)> {
        match (self.since, on) {
            (None, true) => {
                self.since = Some(cycle);
                self.startup = startup;
                None
            }
            (Some(since), false) => {
                self.since = None;
                Some((cycle - since, self.startup))
            }
            _ => None,
        }
    }
}

/// Follows the core step by step.
#[derive(Debug, Default)]
pub(super) struct Measure {
    stack: Vec<Frame>,
    masked: Section,
    sync_masked: Section,
    any_irq_taken: bool,
    busy: u64,
    steps: u64,
    irq_off_max: (u64, u32),
    startup_irq_off: u64,
    sync_masked_max: (u64, u32),
    irqs: BTreeMap<u8, IrqStats>,
    resets: Vec<ResetRecord>,
}

impl Measure {
    /// After a reset: nothing is active or held back.
    pub(super) fn reset(&mut self, record: ResetRecord) {
        self.stack.clear();
        self.masked = Section::default();
        self.sync_masked = Section::default();
        self.any_irq_taken = false;
        self.resets.push(record);
    }

    /// Forgets the figures, not the resets.
    pub(super) fn clear(&mut self) {
        let kept = std::mem::take(self);
        self.stack = kept.stack;
        self.masked = kept.masked;
        self.sync_masked = kept.sync_masked;
        self.any_irq_taken = kept.any_irq_taken;
        self.resets = kept.resets;
    }

    /// The core sleeps: a section with interrupts off does not grow, since the
    /// wake-up ends the sleep at once.
    pub(super) fn slept(&mut self, cycles: u64) {
        for section in [&mut self.masked, &mut self.sync_masked] {
            if let Some(since) = &mut section.since {
                *since += cycles;
            }
        }
    }

    /// The core waits for the flash within the step that it made last.
    pub(super) fn stalled(&mut self, cycles: u64) {
        self.busy += cycles;
        if let Some(frame) = self.stack.last_mut() {
            frame.own_cycles += cycles;
        }
    }

    /// The core made a step of `used` cycles that ended at `cycle` with `regs`.
    /// `sync_priority` is TIM2's in the NVIC.
    #[inline]
    pub(super) fn step(
        &mut self,
        cycle: u64,
        used: u64,
        regs: &Regs,
        irqs: &mut IrqRouter,
        core: &ArmV7m,
        sync_priority: u8,
    ) {
        self.busy += used;
        self.steps += 1;
        let exception = regs.xpsr & EXCEPTION_MASK;
        let top = self.stack.last().map_or(0, |frame| frame.exception);
        let chained = exception == top
            && exception != 0
            && used >= TAIL_CHAIN_CYCLES
            && self
                .stack
                .last()
                .is_some_and(|frame| frame.entry == regs.r[15]);
        if exception != top || chained {
            if chained && let Some(frame) = self.stack.pop() {
                self.finish(frame, cycle, irqs);
            }
            self.switch(exception, cycle, used, regs.r[15], irqs, core);
        } else if let Some(frame) = self.stack.last_mut() {
            frame.own_cycles += used;
        }
        let off = regs.primask || regs.faultmask;
        if off || self.masked.since.is_some() {
            let startup = !self.any_irq_taken;
            if let Some((length, startup)) = self.masked.follow(off, cycle, startup) {
                if startup {
                    self.startup_irq_off = self.startup_irq_off.max(length);
                } else if length > self.irq_off_max.0 {
                    self.irq_off_max = (length, regs.r[15]);
                }
            }
        }
        // Within its own task there is nobody to be held back.
        let holds = regs.basepri != 0
            && regs.basepri <= sync_priority
            && exception != FIRST_IRQ + u32::from(TIM2_IRQ);
        if (holds || self.sync_masked.since.is_some())
            && let Some((length, false)) =
                self.sync_masked.follow(holds, cycle, !self.any_irq_taken)
            && length > self.sync_masked_max.0
        {
            self.sync_masked_max = (length, regs.r[15]);
        }
    }

    /// The active exception changed.
    #[cold]
    fn switch(
        &mut self,
        to: u32,
        cycle: u64,
        used: u64,
        pc: u32,
        irqs: &mut IrqRouter,
        core: &ArmV7m,
    ) {
        let still_active =
            |frame: &Frame| core.with_sys(|sys| sys.is_active(Exception(frame.exception as u16)));
        while let Some(mut frame) = self.stack.pop_if(|frame| !still_active(frame)) {
            frame.own_cycles += used;
            self.finish(frame, cycle, irqs);
        }
        let top = self.stack.last().map_or(0, |frame| frame.exception);
        if to == top {
            return;
        }
        self.enter(to, cycle, used, pc, irqs);
    }

    fn enter(&mut self, exception: u32, cycle: u64, used: u64, pc: u32, irqs: &mut IrqRouter) {
        self.stack.push(Frame {
            exception,
            entry: pc,
            own_cycles: used,
        });
        let Some(irq) = exception.checked_sub(FIRST_IRQ) else {
            return;
        };
        let irq = irq as u8;
        self.any_irq_taken = true;
        let stats = self.irqs.entry(irq).or_insert_with(|| IrqStats {
            irq,
            name: irq_name(irq),
            ..IrqStats::default()
        });
        stats.count += 1;
        if let Some(raised) = irqs.raised_at(irq) {
            let latency = cycle.saturating_sub(raised);
            stats.worst_latency_cycles = stats.worst_latency_cycles.max(latency);
        }
    }

    fn finish(&mut self, frame: Frame, cycle: u64, irqs: &mut IrqRouter) {
        let Some(irq) = frame.exception.checked_sub(FIRST_IRQ) else {
            return;
        };
        irqs.served(irq as u8, cycle);
        if let Some(stats) = self.irqs.get_mut(&(irq as u8)) {
            stats.worst_cycles = stats.worst_cycles.max(frame.own_cycles);
            stats.total_cycles += frame.own_cycles;
        }
    }

    /// Fills in what was followed here.
    pub(super) fn report(&self, stats: &mut BoardStats) {
        stats.busy_cycles = self.busy;
        stats.steps = self.steps;
        (stats.irq_off_max_cycles, stats.irq_off_max_pc) = self.irq_off_max;
        stats.startup_irq_off_cycles = self.startup_irq_off;
        (stats.sync_masked_max_cycles, stats.sync_masked_max_pc) = self.sync_masked_max;
        stats.irqs = self.irqs.values().cloned().collect();
        stats.resets.clone_from(&self.resets);
    }
}

//! The board: core, memories and peripherals run together.

mod context;
mod pause;
mod reset;
mod routing;

use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};

use rsemu::cpu::arm::v7m::sys::Exception;
use rsemu::cpu::arm::v7m::{ArmV7m, Config, Regs};

use super::api::{BoardOptions, Code, Stop};
use super::clock::CoreClock;
use super::diagnostics::Diagnostic;
use super::fault::{FaultKind, FaultReport};
use super::flash::Flash;
use super::image::{BoardError, Image};
use super::irq::IrqRouter;
use super::measure::{Measure, ResetRecord};
use super::memory::{FLASH_BASE, Memory, Shared, lock};
use super::rcc::ResetCause;
use super::rtt;
use super::soc::{ClockErrors, Soc, TIM2_IRQ};
use crate::time::Time;

/// STM32G4 implements four priority bits.
const PRIORITY_BITS: u8 = 4;
/// How often a busy core is looked at for SYSRESETREQ, and the RTT buffer is
/// emptied, in cycles.
const POLL_CYCLES: u64 = 3_400;
const RTT_CYCLES: u64 = 85_000;
/// The emulator charges the eight data accesses of stacking on top of the
/// twelve cycles that stacking takes as a whole, and those of unstacking on top
/// of the ten; a step that changes the active exception and takes this long
/// stacked or unstacked (a tail-chained one takes less).
const STACKING_STEP_CYCLES: u64 = 18;
const STACKING_EXCESS_CYCLES: u64 = 8;
const LOCKED_PC: u32 = 0xFFFF_FFFE;
const HARD_FAULT: u32 = 3;
const EXCEPTION_MASK: u32 = 0x1FF;
/// Bits of xPSR that hold the state of an IF-THEN block.
const IF_THEN_MASK: u32 = 0x0600_FC00;

/// The emulated board.
#[derive(Debug)]
pub struct Board {
    pub(super) core: ArmV7m,
    pub(super) soc: Arc<Mutex<Soc>>,
    pub(super) shared: Arc<Shared>,
    pub(super) memory: Memory,
    pub(super) image: Image,
    clock: CoreClock,
    pub(super) cycle: u64,
    /// The peripherals need nothing before this cycle.
    next_event: u64,
    next_poll: u64,
    next_rtt: u64,
    asleep: bool,
    /// The core waits for the flash until this cycle.
    stalled_until: u64,
    locked: bool,
    /// Something may have woken the core.
    pub(super) poke: bool,
    in_fault: bool,
    /// Held in reset (or without power) since then.
    pub(super) held: Option<(Time, ResetCause)>,
    pub(super) irq: IrqRouter,
    unrouted: Vec<(u8, u64)>,
    /// Code that a branch to itself stands in for, with its address.
    pub(super) spinning: Vec<(u32, Code)>,
    pub(super) measure: Measure,
    exception: u32,
    /// The IF-THEN bits of xPSR after the last step.
    if_then: u32,
    /// FPSCR after the last step of a context that uses the FPU.
    fpscr: u32,
    basepri: u8,
    sync_priority: u8,
    pub(super) stats_from: u64,
    pub(super) rtt_out: Vec<u8>,
    pub(super) diagnostics: Vec<Diagnostic>,
    diagnostics_total: u64,
    pc: u32,
}

impl Board {
    /// Flashes the ELF image `elf` into a board and switches it on.
    ///
    /// # Errors
    ///
    /// If the file is not an image for this microcontroller.
    pub fn new(elf: &[u8], options: BoardOptions) -> Result<Self, BoardError> {
        Self::from_image(Image::parse(elf)?, &options)
    }

    pub(super) fn from_image(image: Image, options: &BoardOptions) -> Result<Self, BoardError> {
        const PPB_PER_PPM: f64 = 1e3;
        const PPB_PER_PERCENT: f64 = 1e7;
        let errors = ClockErrors {
            hse_ppb: (options.clock_error_ppm * PPB_PER_PPM) as i64,
            hsi_ppb: (options.hsi_error_percent * PPB_PER_PERCENT) as i64,
            lsi_ppb: (options.lsi_error_percent * PPB_PER_PERCENT) as i64,
        };
        let mut soc = Soc::new(errors, options.sync_cob_id, Flash::new(&options.flash));
        for (address, bytes) in &image.segments {
            if !soc.load_flash(address - FLASH_BASE, bytes) {
                return Err(BoardError::Segment {
                    address: *address,
                    len: bytes.len(),
                });
            }
        }
        let clock = soc.clock;
        let soc = Arc::new(Mutex::new(soc));
        let shared = Arc::new(Shared::default());
        let memory = Memory::new(&soc, &shared)?;
        let config = Config::CORTEX_M4F
            .with_reset_vtor(FLASH_BASE)
            .with_priority_bits(PRIORITY_BITS);
        let core = ArmV7m::new(config);
        core.attach_space(memory.space());
        let mut board = Self {
            core,
            soc,
            shared,
            memory,
            image,
            clock,
            cycle: 0,
            next_event: 0,
            next_poll: 0,
            next_rtt: 0,
            asleep: false,
            stalled_until: 0,
            locked: false,
            poke: false,
            in_fault: false,
            held: None,
            irq: IrqRouter::new(),
            unrouted: Vec::new(),
            spinning: Vec::new(),
            measure: Measure::default(),
            exception: 0,
            if_then: 0,
            fpscr: 0,
            basepri: 0,
            sync_priority: 0,
            stats_from: 0,
            rtt_out: Vec::new(),
            diagnostics: Vec::new(),
            diagnostics_total: 0,
            pc: 0,
        };
        board.measure.reset(ResetRecord {
            at: Time::ZERO,
            cause: ResetCause::PowerOn,
        });
        Ok(board)
    }

    /// The moment that the board has reached.
    #[must_use]
    pub fn now(&self) -> Time {
        match self.held {
            Some((since, _)) => since,
            None => self.clock.time_of(self.cycle),
        }
    }

    /// Lets the board run until `t` (it may overshoot by one instruction), or
    /// until what it offers to a bus changes, or until it faults.
    pub fn run_until(&mut self, t: Time) -> Stop {
        if let Some((now, _)) = &mut self.held {
            *now = t.max(*now);
            return if lock(&self.soc).take_can_changed() {
                Stop::CanChanged
            } else {
                Stop::Reached
            };
        }
        let mut target = self.clock.cycle_at(t);
        loop {
            if self.cycle >= self.next_event || self.shared.dirty.load(Ordering::Relaxed) {
                let changed = self.service();
                target = self.clock.cycle_at(t);
                if changed {
                    return Stop::CanChanged;
                }
            }
            if self.cycle >= target {
                return Stop::Reached;
            }
            if self.cycle < self.stalled_until {
                self.stall_to(self.next_event.min(target));
                continue;
            }
            if self.asleep && !self.poke {
                self.sleep_to(self.next_event.min(target));
                continue;
            }
            if let Some(stop) = self.step() {
                return stop;
            }
        }
    }

    /// One instruction or exception entry.
    #[inline]
    fn step(&mut self) -> Option<Stop> {
        let mut used = self.core.step();
        let regs = self.core.regs();
        let pc = regs.r[15];
        let exception = regs.xpsr & EXCEPTION_MASK;
        self.keep_fpscr(used, &regs);
        if exception != self.exception {
            if self.if_then != 0 {
                self.keep_if_then(&regs);
            }
            self.exception = exception;
            if used >= STACKING_STEP_CYCLES {
                used -= STACKING_EXCESS_CYCLES;
            }
        }
        self.if_then = regs.xpsr & IF_THEN_MASK;
        self.cycle += used;
        self.shared.cycle.store(self.cycle, Ordering::Relaxed);
        self.shared.pc.store(pc, Ordering::Relaxed);
        if self.shared.stall.load(Ordering::Relaxed) != 0 {
            self.begin_stall(used);
        }
        if regs.basepri != self.basepri {
            self.basepri = regs.basepri;
            let exception = Exception(u16::from(TIM2_IRQ) + Exception::IRQ0.0);
            self.sync_priority = self
                .core
                .with_sys(|sys| sys.priority[usize::from(exception.0)]);
        }
        if pc == self.pc && used == 1 {
            return self.stands_still(&regs);
        }
        self.pc = pc;
        self.asleep = false;
        self.poke = false;
        self.measure.step(
            self.cycle,
            used,
            &regs,
            &mut self.irq,
            &self.core,
            self.sync_priority,
        );
        if (exception == HARD_FAULT) != self.in_fault || pc == LOCKED_PC {
            return self.fault(&regs, exception);
        }
        None
    }

    /// The program counter did not move in a step of one cycle: the core
    /// sleeps, or it is locked up.
    #[cold]
    fn stands_still(&mut self, regs: &Regs) -> Option<Stop> {
        self.asleep = self.core.is_asleep() || self.locked;
        self.poke = false;
        if !self.asleep && self.core.is_locked_up() {
            return self.fault(regs, regs.xpsr & EXCEPTION_MASK);
        }
        None
    }

    #[cold]
    fn fault(&mut self, regs: &Regs, exception: u32) -> Option<Stop> {
        let kind = if self.core.is_locked_up() {
            self.locked = true;
            self.asleep = true;
            FaultKind::LockUp
        } else {
            self.in_fault = exception == HARD_FAULT;
            if !self.in_fault {
                return None;
            }
            FaultKind::HardFault
        };
        let at = self.now();
        let report = FaultReport::of(&self.core, regs, &self.memory, &self.image, at, kind);
        Some(Stop::Fault(Box::new(report)))
    }

    /// Brings the peripherals up to date and the core's interrupt inputs with
    /// them. True if a bus may be concerned.
    fn service(&mut self) -> bool {
        self.shared.dirty.store(false, Ordering::Relaxed);
        let mut soc = lock(&self.soc);
        soc.advance(self.cycle);
        let request = if self.cycle >= self.next_poll && self.core.reset_requested() {
            Some(ResetCause::Software)
        } else {
            None
        };
        if let Some(cause) = soc.take_reset_request().or(request) {
            drop(soc);
            let at = self.now();
            self.reset(cause, at);
            return lock(&self.soc).take_can_changed();
        }
        let raised = self.cycle.min(self.next_event.max(1));
        let up = self
            .irq
            .update(soc.irq_levels(), self.cycle, raised, &self.core);
        self.poke |= up != 0;
        if soc.take_nmi() {
            self.core
                .with_sys(|sys| sys.set_pending(Exception::NMI, true));
            self.poke = true;
        }
        self.memory.set_bank1_plain(soc.flash().bank1_is_plain());
        self.clock = soc.clock;
        self.next_event = soc.next_event().min(self.irq.next_delivery());
        let changed = soc.take_can_changed();
        drop(soc);
        self.watch_routing(up);
        self.read_diagnostics();
        let deadline = self.unrouted.iter().map(|&(_, deadline)| deadline).min();
        self.next_event = self.next_event.min(deadline.unwrap_or(u64::MAX));
        if self.cycle >= self.next_rtt {
            self.next_rtt = self.cycle + RTT_CYCLES;
            self.read_rtt();
        }
        if !self.asleep {
            self.next_poll = self.cycle + POLL_CYCLES;
            self.next_event = self.next_event.min(self.next_poll);
        }
        changed
    }

    fn read_diagnostics(&mut self) {
        let soc = lock(&self.soc);
        let total = soc.log.total();
        if total != self.diagnostics_total {
            self.diagnostics_total = total;
            self.diagnostics.clear();
            self.diagnostics.extend_from_slice(soc.log.entries());
        }
    }

    pub(super) fn read_rtt(&mut self) {
        if let Some(block) = self.image.rtt {
            rtt::drain(&self.memory, block, &mut self.rtt_out);
        }
    }
}

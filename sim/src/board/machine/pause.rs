//! Time in which the core does not step: it sleeps, or waits for the flash.

use std::sync::atomic::Ordering;

use rsemu::cpu::arm::v7m::sys::Exception;

use super::super::memory::lock;
use super::Board;

impl Board {
    /// Passes over the cycles in which the core sleeps.
    pub(super) fn sleep_to(&mut self, cycle: u64) {
        let cycles = cycle.saturating_sub(self.cycle);
        if self.locked {
            self.cycle += cycles;
            return;
        }
        let (woken, skipped) = self.tick_systick(cycles);
        self.cycle += skipped;
        self.measure.slept(skipped);
        self.shared.cycle.store(self.cycle, Ordering::Relaxed);
        self.poke |= woken;
    }

    /// The step that has just been made, of `used` cycles, waits for the flash.
    #[cold]
    pub(super) fn begin_stall(&mut self, used: u64) {
        // The wait began within the step.
        let stall = self.shared.stall.swap(0, Ordering::Relaxed);
        self.stalled_until = self.cycle.saturating_sub(used) + stall;
        lock(&self.soc).note_flash_stall(stall);
    }

    /// Passes over cycles in which the core waits for the flash. They are busy
    /// ones: nothing else runs, and no interrupt is taken.
    #[cold]
    pub(super) fn stall_to(&mut self, cycle: u64) {
        let cycles = cycle.min(self.stalled_until).saturating_sub(self.cycle);
        let (_, skipped) = self.tick_systick(cycles);
        self.cycle += skipped;
        self.measure.stalled(skipped);
        self.shared.cycle.store(self.cycle, Ordering::Relaxed);
    }

    /// SysTick counts on while the core does not step; the core only ticks it
    /// while it does. Up to `cycles`, but not past an interrupt of it: whether
    /// there is one, and how many cycles that were.
    fn tick_systick(&self, mut cycles: u64) -> (bool, u64) {
        const ENABLE: u32 = 1 << 0;
        const TICKINT: u32 = 1 << 1;
        self.core.with_sys(|sys| {
            if sys.syst_csr & ENABLE == 0 {
                return (false, cycles);
            }
            let wraps = sys.syst_csr & TICKINT != 0;
            let left = match sys.syst_cvr {
                0 => u64::from(sys.syst_rvr) + 1,
                value => u64::from(value),
            };
            if wraps {
                cycles = cycles.min(left);
            }
            let wrapped = sys.tick_systick(cycles) && wraps;
            if wrapped {
                sys.set_pending(Exception::SYSTICK, true);
            }
            (wrapped, cycles)
        })
    }
}

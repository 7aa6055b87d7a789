//! Resets of the board.

use std::sync::atomic::Ordering;

use rsemu::core::device::{Device as _, ResetKind};

use super::super::measure::ResetRecord;
use super::super::memory::lock;
use super::super::rcc::ResetCause;
use super::Board;
use crate::time::Time;

/// From the reset condition to the first instruction (data sheet, reset
/// temporisation), in cycles of HSI.
const RESET_CYCLES: u64 = 800;

impl Board {
    /// Resets core and peripherals at `at`.
    pub(in super::super) fn reset(&mut self, cause: ResetCause, at: Time) {
        self.read_rtt();
        if cause == ResetCause::PowerOn {
            self.memory.power_on();
        }
        let mut soc = lock(&self.soc);
        soc.reset(cause, self.cycle, at);
        self.clock = soc.clock;
        drop(soc);
        // A warm reset of the core leaves NVIC enables, priorities and SCB as
        // they were; the hardware resets them. A cold one starts afresh.
        self.core.reset(ResetKind::Cold);
        self.irq.reset();
        self.unrouted.clear();
        self.stop_spinning();
        self.measure.reset(ResetRecord { at, cause });
        self.cycle += RESET_CYCLES;
        self.shared.cycle.store(self.cycle, Ordering::Relaxed);
        self.next_event = self.cycle;
        self.next_poll = 0;
        self.asleep = false;
        self.stalled_until = 0;
        self.shared.stall.store(0, Ordering::Relaxed);
        self.locked = false;
        self.in_fault = false;
        self.exception = 0;
        self.if_then = 0;
        self.fpscr = 0;
        self.basepri = 0;
        self.pc = 0;
    }
}

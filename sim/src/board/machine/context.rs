//! What an interrupted program keeps, where the emulator loses it.

use rsemu::cpu::arm::v7m::Regs;

use super::{Board, EXCEPTION_MASK, IF_THEN_MASK};

/// The link register holds at least this in a handler that was just entered.
const EXC_RETURN: u32 = 0xFFFF_FFE0;
/// CONTROL: the program that runs has used the FPU since it began.
const CONTROL_FPCA: u32 = 1 << 2;
/// FPCCR: the FPU still holds the registers of the program that was interrupted.
const FPCCR_LSPACT: u32 = 1;
/// The shortest step that enters a handler: a return to another that waits.
const ENTRY_CYCLES: u64 = 7;

impl Board {
    /// An exception was taken within an IF-THEN block: its state belongs into
    /// the stacked xPSR (DDI 0403, B1.5.6), where the emulator writes zeros, so
    /// that the rest of the block would run unconditionally after the return.
    #[cold]
    pub(super) fn keep_if_then(&mut self, regs: &Regs) {
        /// Places in the exception frame.
        const RETURN_ADDRESS: u32 = 24;
        const XPSR: u32 = 28;
        let frame = regs.r[13];
        let Some(xpsr) = self.memory.word(frame.wrapping_add(XPSR)) else {
            return;
        };
        // A return from an exception, within such a block, stacks nothing.
        let entered = self.memory.word(frame.wrapping_add(RETURN_ADDRESS)) == Some(self.pc)
            && xpsr & EXCEPTION_MASK == self.exception
            && regs.r[14] >= EXC_RETURN;
        if entered && xpsr & IF_THEN_MASK == 0 {
            self.memory
                .poke(frame.wrapping_add(XPSR), xpsr | self.if_then);
        }
    }

    /// FPSCR is one of the registers that are stacked when a handler first uses the
    /// FPU, if it ever does (DDI 0403, B1.5.7). The emulator clears it at the entry, so
    /// that a comparison that was interrupted before its flags are read comes out wrong.
    #[inline]
    pub(super) fn keep_fpscr(&mut self, used: u64, regs: &Regs) {
        if regs.control & CONTROL_FPCA != 0 {
            self.fpscr = self.core.fpscr();
        } else if used >= ENTRY_CYCLES
            && self.fpscr != 0
            && self.core.with_sys(|sys| sys.fpccr) & FPCCR_LSPACT != 0
        {
            self.core.set_fpscr(self.fpscr);
        }
    }
}

//! Interrupts that nobody serves.

use rsemu::cpu::arm::v7m::sys::Exception;

use super::super::diagnostics::DiagnosticKind;
use super::super::irq::bits;
use super::super::memory::lock;
use super::super::soc::irq_name;
use super::Board;

/// A line that is high for this long without being enabled in the NVIC is
/// taken for a mistake.
const ROUTING_CYCLES: u64 = 1_700_000;

impl Board {
    /// Notes lines that stay high while the NVIC does not enable them.
    pub(super) fn watch_routing(&mut self, up: u128) {
        let enabled = |irq: u8| {
            let exception = Exception(u16::from(irq) + Exception::IRQ0.0);
            self.core.with_sys(|sys| sys.is_enabled(exception))
        };
        for irq in bits(up) {
            if !enabled(irq) && !self.unrouted.iter().any(|(known, _)| *known == irq) {
                self.unrouted.push((irq, self.cycle + ROUTING_CYCLES));
            }
        }
        if self.unrouted.is_empty() {
            return;
        }
        let (cycle, driven) = (self.cycle, self.irq.driven());
        self.unrouted
            .retain(|&(irq, _)| driven & 1 << irq != 0 && !enabled(irq));
        let at = self.clock.time_of(cycle);
        for &(irq, deadline) in &self.unrouted {
            if deadline <= cycle {
                let text = format!(
                    "interrupt {} is requested, but the NVIC does not enable it: nobody serves it",
                    irq_name(irq)
                );
                lock(&self.soc)
                    .log
                    .note(at, 0, DiagnosticKind::InterruptRouting, text);
            }
        }
        self.unrouted.retain(|&(_, deadline)| deadline > cycle);
    }
}

//! Reception: filters, FIFOs, lost messages.

use super::bits::{field, ir, rxgfc};
use super::filter;
use super::ram::Acceptance;
use super::{DiagnosticKind, Env, Fdcan};
use crate::frame::WireFrame;
use crate::time::Time;

const FIFO_LOST: u32 = 1 << 25;

impl Fdcan {
    /// A valid frame from the bus.
    pub(super) fn receive(&mut self, frame: &WireFrame, sof: Time, env: &mut Env<'_>) {
        let verdict = filter::accept(&self.ram, self.rxgfc, self.xidam, frame);
        let timestamp = self.timestamp(sof, env);
        let why = Acceptance {
            filter: verdict.filter,
            timestamp,
        };
        let stored = verdict
            .fifo
            .map(|fifo| (fifo, self.store(fifo, frame, why, env)));
        if verdict.priority {
            self.note_priority(frame, verdict.filter, stored);
            self.raise(ir::HPM, env);
        }
    }

    /// Puts a frame into a FIFO; `None` if it was lost.
    fn store(
        &mut self,
        fifo: usize,
        frame: &WireFrame,
        why: Acceptance,
        env: &mut Env<'_>,
    ) -> Option<usize> {
        let step = fifo as u32 * ir::FIFO_STEP;
        let overwrite = self.rxgfc & if fifo == 0 { rxgfc::F0OM } else { rxgfc::F1OM } != 0;
        let index = if overwrite {
            Some(self.rx[fifo].put_over())
        } else {
            self.rx[fifo].put()
        };
        let Some(index) = index else {
            self.lost += 1;
            let text = format!(
                "FDCAN{}: Rx FIFO {fifo} is full, a frame was lost (RF{fifo}L)",
                self.number
            );
            env.log
                .note(env.at, env.pc, DiagnosticKind::CanOverrun, text);
            self.raise(ir::RF0L << step, env);
            return None;
        };
        self.ram.store_rx(fifo, index, frame, why);
        let mut flags = ir::RF0N;
        if self.rx[fifo].is_full() {
            flags |= ir::RF0F;
        }
        self.raise(flags << step, env);
        Some(index)
    }

    /// HPMS: which message had priority and where it went.
    fn note_priority(
        &mut self,
        frame: &WireFrame,
        filter: Option<u8>,
        stored: Option<(usize, Option<usize>)>,
    ) {
        const EXTENDED_LIST: u32 = 1 << 15;
        let (storage, index) = match stored {
            None => (0b00, 0),
            Some((_, None)) => (0b01, 0),
            Some((0, Some(index))) => (0b10, index),
            Some((_, Some(index))) => (0b11, index),
        };
        let list = match frame.id {
            crate::frame::WireId::Standard(_) => 0,
            crate::frame::WireId::Extended(_) => EXTENDED_LIST,
        };
        self.hpms = index as u32 | storage << 6 | u32::from(filter.unwrap_or(0)) << 8 | list;
    }

    /// RXFxS.
    pub(super) fn rx_status(&self, fifo: usize) -> u32 {
        let lost = self.ir & ir::RF0L << (fifo as u32 * ir::FIFO_STEP) != 0;
        self.rx[fifo].status() | if lost { FIFO_LOST } else { 0 }
    }

    /// RXFxA: the element was read.
    pub(super) fn acknowledge_rx(&mut self, fifo: usize, value: u32, env: &mut Env<'_>) {
        let index = field(value, 0, 3) as usize;
        if !self.rx[fifo].acknowledge(index) {
            let text = format!(
                "FDCAN{}.RXF{fifo}A: element {index} acknowledged, but it holds nothing unread",
                self.number
            );
            env.log
                .note(env.at, env.pc, DiagnosticKind::CanRegister, text);
        }
    }
}

//! Transmission: Tx FIFO and queue, cancellation, Tx events.

use super::bits::{TXBC_TFQM, cccr, field, ir};
use super::ram::{DEPTH, MessageRam, TxElement};
use super::{DiagnosticKind, Env, Fdcan, Request};
use crate::frame::WireId;
use crate::time::Time;

const EVENT_LOST: u32 = 1 << 25;

impl Fdcan {
    /// TXBRP.
    pub(super) fn requests(&self) -> u32 {
        self.pending
            .iter()
            .enumerate()
            .filter(|(_, request)| request.is_some())
            .fold(0, |bits, (buffer, _)| bits | 1 << buffer)
    }

    const fn is_queue(&self) -> bool {
        self.txbc & TXBC_TFQM != 0
    }

    /// The buffer that the next frame is to be written to: the put index moves
    /// on, cyclically, to the next free buffer.
    pub(super) fn put_index(&self) -> Option<usize> {
        if self.is_queue() {
            (0..DEPTH)
                .map(|k| (self.put + k) % DEPTH)
                .find(|&buffer| self.pending[buffer].is_none())
        } else {
            self.pending[self.put].is_none().then_some(self.put)
        }
    }

    /// FIFO order: the oldest request, counting from the put index.
    fn get_index(&self) -> usize {
        (0..DEPTH)
            .map(|k| (self.put + k) % DEPTH)
            .find(|&buffer| self.pending[buffer].is_some())
            .unwrap_or(self.put)
    }

    /// TXFQS.
    pub(super) fn queue_status(&self) -> u32 {
        const FULL: u32 = 1 << 21;
        const GET_SHIFT: u32 = 8;
        const PUT_SHIFT: u32 = 16;
        let put = self.put_index();
        let full = if put.is_none() { FULL } else { 0 };
        let put = put.unwrap_or(self.put) as u32;
        // Free level and get index read as zero in queue mode.
        let (level, get) = if self.is_queue() {
            (0, 0)
        } else {
            let used = self.requests().count_ones();
            (DEPTH as u32 - used, self.get_index() as u32)
        };
        level | get << GET_SHIFT | put << PUT_SHIFT | full
    }

    /// Software writes a word of the message RAM.
    pub(crate) fn write_ram(&mut self, index: usize, value: u32, env: &mut Env<'_>) {
        if let Some(buffer) = MessageRam::tx_buffer_of(index)
            && self.cccr & cccr::INIT == 0
        {
            let number = self.number;
            if self.pending[buffer].is_some() {
                let text = format!(
                    "FDCAN{number}: Tx buffer {buffer} written while its request is pending"
                );
                env.log
                    .note(env.at, env.pc, DiagnosticKind::CanTxElement, text);
                self.changed = true;
            } else if self.put_index() != Some(buffer) {
                let put = self.put_index().unwrap_or(self.put);
                let text = format!(
                    "FDCAN{number}: Tx buffer {buffer} written, but TXFQS.TFQPI names {put}"
                );
                env.log
                    .note(env.at, env.pc, DiagnosticKind::CanTxElement, text);
            }
        }
        self.ram.set_word(index, value);
    }

    /// TXBAR.
    pub(super) fn add_requests(&mut self, value: u32, env: &mut Env<'_>) {
        if self.cccr & cccr::CCE != 0 {
            let text = format!("{} while CCCR.CCE is set: ignored", self.name("TXBAR"));
            env.log
                .note(env.at, env.pc, DiagnosticKind::CanTxElement, text);
            return;
        }
        for buffer in 0..DEPTH {
            if value & 1 << buffer == 0 || self.pending[buffer].is_some() {
                continue;
            }
            if self.put_index() != Some(buffer) {
                let text = format!(
                    "FDCAN{}: Tx buffer {buffer} requested, but TXFQS.TFQPI names {}",
                    self.number,
                    self.put_index().unwrap_or(self.put)
                );
                env.log
                    .note(env.at, env.pc, DiagnosticKind::CanTxElement, text);
            }
            self.check_element(buffer, env);
            self.pending[buffer] = Some(Request { at: env.at });
            self.cancelling[buffer] = false;
            self.txbto &= !(1 << buffer);
            self.txbcf &= !(1 << buffer);
            self.put = (buffer + 1) % DEPTH;
            self.changed = true;
        }
    }

    /// What a bus trace would not show to be unintended.
    fn check_element(&self, buffer: usize, env: &mut Env<'_>) {
        const ERROR_CONTROL: std::ops::RangeInclusive<u16> = 0x701..=0x77F;
        let element = self.ram.tx_element(buffer);
        let frame = element.frame;
        let guarding = matches!(frame.id, WireId::Standard(id) if ERROR_CONTROL.contains(&id));
        if frame.rtr && !guarding {
            let text = format!(
                "FDCAN{}: Tx buffer {buffer} asks for a remote frame ({}, DLC {}): RTR is set",
                self.number,
                id_text(frame.id),
                frame.dlc
            );
            env.log
                .note(env.at, env.pc, DiagnosticKind::CanRemoteFrame, text);
        }
        if element.fd && self.cccr & cccr::FDOE != 0 {
            let text = format!("FDCAN{}: the FD format is not modelled", self.number);
            env.log
                .note(env.at, env.pc, DiagnosticKind::CanTxElement, text);
        }
        let twin = (0..DEPTH).any(|other| {
            other != buffer
                && self.pending[other].is_some()
                && self.ram.tx_element(other).frame.id == frame.id
        });
        if twin && self.is_queue() {
            let text = format!(
                "FDCAN{}: two frames with {} are pending in queue mode: their order is that of \
                 the buffer numbers",
                self.number,
                id_text(frame.id)
            );
            env.log
                .note(env.at, env.pc, DiagnosticKind::CanTxElement, text);
        }
    }

    /// TXBCR. A frame on the wire is left to its fate.
    pub(super) fn cancel_requests(&mut self, value: u32, env: &mut Env<'_>) {
        for buffer in 0..DEPTH {
            if value & 1 << buffer == 0 || self.pending[buffer].is_none() {
                continue;
            }
            if self.active == Some(buffer) {
                self.cancelling[buffer] = true;
            } else {
                self.finish_cancelled(buffer, env);
            }
        }
    }

    fn finish_cancelled(&mut self, buffer: usize, env: &mut Env<'_>) {
        self.pending[buffer] = None;
        self.cancelling[buffer] = false;
        self.txbcf |= 1 << buffer;
        if self.txbcie & 1 << buffer != 0 {
            self.raise(ir::TCF, env);
        }
        self.changed = true;
    }

    /// The buffer to send next: queue mode takes the lowest identifier, among
    /// equal ones the lowest buffer number; FIFO mode the oldest.
    pub(super) fn next_buffer(&self) -> Option<(usize, Request)> {
        let waiting = (0..DEPTH).filter_map(|k| self.pending[k].map(|request| (k, request)));
        if self.is_queue() {
            waiting.min_by_key(|&(k, _)| (self.ram.tx_element(k).frame.arbitration_key(), k))
        } else {
            let get = self.get_index();
            waiting.filter(|&(k, _)| k == get).min_by_key(|&(k, _)| k)
        }
    }

    /// The frame in `buffer` went out.
    pub(super) fn sent(&mut self, buffer: usize, sof: Time, env: &mut Env<'_>) {
        let element = self.ram.tx_element(buffer);
        let cancelled = std::mem::take(&mut self.cancelling[buffer]);
        self.pending[buffer] = None;
        self.txbto |= 1 << buffer;
        if cancelled {
            self.txbcf |= 1 << buffer;
        }
        let mut flags = 0;
        if self.txbtie & 1 << buffer != 0 {
            flags |= ir::TC;
        }
        if cancelled && self.txbcie & 1 << buffer != 0 {
            flags |= ir::TCF;
        }
        if self.requests() == 0 && !self.is_queue() {
            flags |= ir::TFE;
        }
        if element.event {
            flags |= self.store_event(&element, cancelled, sof, env);
        }
        self.raise(flags, env);
        self.changed = true;
    }

    /// The frame in `buffer` was not sent. It stays requested unless it was
    /// cancelled or automatic retransmission is off.
    pub(super) fn not_sent(&mut self, buffer: usize, env: &mut Env<'_>) {
        if self.cancelling[buffer] || self.cccr & cccr::DAR != 0 {
            self.finish_cancelled(buffer, env);
        }
        self.changed = true;
    }

    fn store_event(
        &mut self,
        element: &TxElement,
        cancelled: bool,
        sof: Time,
        env: &Env<'_>,
    ) -> u32 {
        let timestamp = self.timestamp(sof, env);
        let Some(index) = self.events.put() else {
            return ir::TEFL;
        };
        self.ram.store_event(index, element, cancelled, timestamp);
        if self.events.is_full() {
            ir::TEFN | ir::TEFF
        } else {
            ir::TEFN
        }
    }

    /// TXEFS.
    pub(super) fn events_status(&self) -> u32 {
        let lost = if self.ir & ir::TEFL != 0 {
            EVENT_LOST
        } else {
            0
        };
        self.events.status() | lost
    }

    /// TXEFA.
    pub(super) fn acknowledge_event(&mut self, value: u32, env: &mut Env<'_>) {
        let index = field(value, 0, 2) as usize;
        if !self.events.acknowledge(index) {
            let text = format!(
                "{}: event {index} acknowledged, but it holds nothing unread",
                self.name("TXEFA")
            );
            env.log
                .note(env.at, env.pc, DiagnosticKind::CanRegister, text);
        }
    }
}

fn id_text(id: WireId) -> String {
    match id {
        WireId::Standard(id) => format!("identifier 0x{id:03X}"),
        WireId::Extended(id) => format!("identifier 0x{id:08X}"),
    }
}

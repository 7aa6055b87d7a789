//! FDCAN: one instance of the controller (RM0440, 44).
//!
//! Classic CAN only: register block, message RAM, filters, Rx FIFOs, Tx FIFO
//! and queue, Tx events, timestamps, interrupts, error counters, bus-off. What
//! goes over the wire is the [bus](crate::bus)'s business: this model offers it
//! the frame that the hardware would send next and takes its events.
//!
//! Not modelled, and noted when used: the FD format, loop-back, the timeout
//! counter, transmit pause. In bus monitoring mode nothing is sent, but the bus
//! still acknowledges for this node.

mod bits;
mod control;
mod fifo;
mod filter;
mod interrupts;
pub(crate) mod ram;
mod rx;
mod tx;
mod wire;

#[cfg(test)]
mod tests;

use self::bits::{
    CCCR, CKDIV, CREL, CREL_VALUE, DBTP, DBTP_RESET, ECR, ENDN, ENDN_VALUE, HPMS, IE, ILE, ILS, IR,
    LEC_NO_CHANGE, NBTP, NBTP_RESET, PSR, RWD, RXF0A, RXF0S, RXF1A, RXF1S, RXGFC, TDCR, TEST,
    TEST_RX, TOCC, TOCC_RESET, TOCV, TOCV_RESET, TSCC, TSCV, TXBAR, TXBC, TXBCF, TXBCIE, TXBCR,
    TXBRP, TXBTIE, TXBTO, TXEFA, TXEFS, TXFQS, XIDAM, XIDAM_RESET, cccr, field, ir,
};
use self::fifo::Fifo;
use self::ram::{DEPTH, MessageRam};
use super::clock::Frequency;
use super::diagnostics::{DiagnosticKind, DiagnosticLog};
use crate::bus::ErrorState;
use crate::time::Time;

pub use self::wire::REQUEST_TO_START_CLOCKS;

/// What an access or an event finds around the controller.
#[derive(Debug)]
pub(crate) struct Env<'a> {
    /// The moment.
    pub at: Time,
    /// The instruction that accesses; 0 for events.
    pub pc: u32,
    /// The kernel clock, if it runs.
    pub kernel: Option<Frequency>,
    /// Both pins are switched to this controller.
    pub pins: bool,
    /// TIM3's counter at the start of the frame (for the external timestamp).
    pub external_count: u16,
    /// Where mistakes are noted.
    pub log: &'a mut DiagnosticLog,
}

/// The Tx request of a buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Request {
    at: Time,
}

/// One FDCAN instance.
#[derive(Debug, Clone)]
pub(crate) struct Fdcan {
    /// 1, 2 or 3.
    number: usize,
    /// The message RAM; it keeps its content over a reset.
    pub ram: MessageRam,
    cccr: u32,
    test: u32,
    nbtp: u32,
    dbtp: u32,
    rwd: u32,
    tscc: u32,
    tocc: u32,
    tdcr: u32,
    xidam: u32,
    rxgfc: u32,
    txbc: u32,
    ckdiv: u32,
    /// The internal timestamp counter was zero here.
    tscv_zero: Time,
    /// It has wrapped this often since then.
    tscv_wraps: u64,

    ir: u32,
    ie: u32,
    ils: u32,
    ile: u32,

    rx: [Fifo; 2],
    events: Fifo,
    hpms: u32,

    /// TXBRP with the time of each request.
    pending: [Option<Request>; DEPTH],
    cancelling: [bool; DEPTH],
    put: usize,
    txbto: u32,
    txbcf: u32,
    txbtie: u32,
    txbcie: u32,
    /// The buffer whose frame is on the wire.
    active: Option<usize>,

    tec: u16,
    rec: u16,
    cel: u32,
    state: ErrorState,
    lec: u32,

    /// What is offered to the bus, or the bit timing, may have changed.
    changed: bool,
    lost: u64,
}

impl Fdcan {
    /// Instance `number` (1..=3) in its reset state.
    #[must_use]
    pub(crate) fn new(number: usize) -> Self {
        Self {
            number,
            ram: MessageRam::default(),
            cccr: cccr::INIT,
            test: 0,
            nbtp: NBTP_RESET,
            dbtp: DBTP_RESET,
            rwd: 0,
            tscc: 0,
            tocc: TOCC_RESET,
            tdcr: 0,
            xidam: XIDAM_RESET,
            rxgfc: 0,
            txbc: 0,
            ckdiv: 0,
            tscv_zero: Time::ZERO,
            tscv_wraps: 0,
            ir: 0,
            ie: 0,
            ils: 0,
            ile: 0,
            rx: [Fifo::default(); 2],
            events: Fifo::default(),
            hpms: 0,
            pending: [None; DEPTH],
            cancelling: [false; DEPTH],
            put: 0,
            txbto: 0,
            txbcf: 0,
            txbtie: 0,
            txbcie: 0,
            active: None,
            tec: 0,
            rec: 0,
            cel: 0,
            state: ErrorState::Active,
            lec: LEC_NO_CHANGE,
            changed: true,
            lost: 0,
        }
    }

    /// Reset of the peripheral: registers go, the message RAM stays.
    pub(crate) fn reset(&mut self) {
        let ram = std::mem::take(&mut self.ram);
        let lost = self.lost;
        *self = Self::new(self.number);
        self.ram = ram;
        self.lost = lost;
    }

    /// Frames lost in full FIFOs since power-on.
    #[must_use]
    pub(crate) const fn lost(&self) -> u64 {
        self.lost
    }

    /// CKDIV, which divides the kernel clock of all instances (FDCAN1's counts).
    #[must_use]
    pub(crate) const fn clock_divider(&self) -> u32 {
        let pdiv = field(self.ckdiv, 0, 4);
        if pdiv == 0 { 1 } else { pdiv * 2 }
    }

    /// Takes the mark that offer or timing may have changed.
    pub(crate) fn take_changed(&mut self) -> bool {
        std::mem::take(&mut self.changed)
    }

    /// Marks offer and timing as changed (clocks or pins are new).
    pub(crate) fn mark_changed(&mut self) {
        self.changed = true;
    }

    fn configurable(&self) -> bool {
        const BOTH: u32 = cccr::INIT | cccr::CCE;
        self.cccr & BOTH == BOTH
    }

    fn name(&self, register: &str) -> String {
        format!("FDCAN{}.{register}", self.number)
    }

    /// Reads a register; `None` where there is none. PSR and ECR change by it.
    pub(crate) fn read(&mut self, offset: u32, env: &mut Env<'_>) -> Option<u32> {
        Some(match offset {
            CREL => CREL_VALUE,
            ENDN => ENDN_VALUE,
            DBTP => self.dbtp,
            TEST => self.test | TEST_RX,
            RWD => self.rwd,
            CCCR => self.cccr,
            NBTP => self.nbtp,
            TSCC => self.tscc,
            TSCV => u32::from(self.timestamp(env.at, env)),
            TOCC => self.tocc,
            TOCV => TOCV_RESET,
            ECR => self.read_ecr(),
            PSR => self.read_psr(),
            TDCR => self.tdcr,
            IR => self.ir,
            IE => self.ie,
            ILS => self.ils,
            ILE => self.ile,
            RXGFC => self.rxgfc,
            XIDAM => self.xidam,
            HPMS => self.hpms,
            RXF0S => self.rx_status(0),
            RXF1S => self.rx_status(1),
            RXF0A | RXF1A | TXEFA | TXBAR | TXBCR => 0,
            TXBC => self.txbc,
            TXFQS => self.queue_status(),
            TXBRP => self.requests(),
            TXBTO => self.txbto,
            TXBCF => self.txbcf,
            TXBTIE => self.txbtie,
            TXBCIE => self.txbcie,
            TXEFS => self.events_status(),
            CKDIV if self.number == 1 => self.ckdiv,
            _ => return None,
        })
    }

    /// Writes a register; false where there is none.
    pub(crate) fn write(&mut self, offset: u32, value: u32, env: &mut Env<'_>) -> bool {
        match offset {
            CCCR => self.write_cccr(value, env),
            IR => self.clear_flags(value),
            IE => {
                self.ie = value & ir::ALL;
                self.check_routing(self.ir, env);
            }
            ILS => self.ils = value & 0x7F,
            ILE => {
                self.ile = value & 0b11;
                self.check_routing(self.ir, env);
            }
            RXF0A => self.acknowledge_rx(0, value, env),
            RXF1A => self.acknowledge_rx(1, value, env),
            TXBAR => self.add_requests(value, env),
            TXBCR => self.cancel_requests(value, env),
            TXBTIE => self.txbtie = value & 0b111,
            TXBCIE => self.txbcie = value & 0b111,
            TXEFA => self.acknowledge_event(value, env),
            TSCV => {
                self.tscv_zero = env.at;
                self.tscv_wraps = 0;
            }
            TOCV => {}
            CREL | ENDN | ECR | PSR | HPMS | RXF0S | RXF1S | TXFQS | TXBRP | TXBTO | TXBCF
            | TXEFS => self.note_read_only(offset, env),
            DBTP | TEST | RWD | NBTP | TSCC | TOCC | TDCR | RXGFC | XIDAM | TXBC => {
                self.write_protected(offset, value, env);
            }
            CKDIV if self.number == 1 => self.write_protected(offset, value, env),
            _ => return false,
        }
        true
    }
}

//! CCCR and the registers it protects: initialisation, clock stop, modes.

use super::bits::{
    DBTP, NBTP, RWD, RXGFC, TDCR, TEST, TEST_LBCK, TEST_RX, TOCC, TSCC, TXBC, TXBC_TFQM, XIDAM,
    XIDAM_RESET, cccr, field, rxgfc,
};
use super::fifo::Fifo;
use super::ram::DEPTH;
use super::{DiagnosticKind, Env, Fdcan};

impl Fdcan {
    /// Registers that take a value only while CCCR.INIT and CCE are set.
    pub(super) fn write_protected(&mut self, offset: u32, value: u32, env: &mut Env<'_>) {
        let number = self.number;
        if offset == TEST && self.cccr & cccr::TEST == 0 {
            // TEST is written only in test mode; clearing it then is harmless.
            if value & !TEST_RX != 0 {
                let text = format!(
                    "{} written while CCCR.TEST is clear: ignored",
                    self.name("TEST")
                );
                env.log
                    .note(env.at, env.pc, DiagnosticKind::CanRegister, text);
            }
            return;
        }
        let register = match offset {
            DBTP => &mut self.dbtp,
            TEST => &mut self.test,
            RWD => &mut self.rwd,
            NBTP => &mut self.nbtp,
            TSCC => &mut self.tscc,
            TOCC => &mut self.tocc,
            TDCR => &mut self.tdcr,
            RXGFC => &mut self.rxgfc,
            XIDAM => &mut self.xidam,
            TXBC => &mut self.txbc,
            _ => &mut self.ckdiv,
        };
        const BOTH: u32 = cccr::INIT | cccr::CCE;
        if self.cccr & BOTH != BOTH {
            if *register != value {
                let text = format!(
                    "FDCAN{number}: write to protected register 0x{offset:03x} ignored: \
                     set CCCR.INIT and CCCR.CCE first"
                );
                env.log
                    .note(env.at, env.pc, DiagnosticKind::CanRegister, text);
            }
            return;
        }
        *register = match offset {
            RXGFC => value & rxgfc::WRITABLE,
            XIDAM => value & XIDAM_RESET,
            TXBC => value & TXBC_TFQM,
            _ => value,
        };
        let unmodelled = match offset {
            TEST if value & TEST_LBCK != 0 => Some("loop-back is not modelled"),
            TOCC if value & 1 != 0 => Some("the timeout counter is not modelled"),
            RXGFC if value & rxgfc::WRITABLE != value => Some("reserved bits of RXGFC written"),
            _ => None,
        };
        if offset == TSCC {
            self.tscv_zero = env.at;
            self.tscv_wraps = 0;
        }
        if let Some(words) = unmodelled {
            let text = format!("FDCAN{number}: {words}");
            env.log
                .note(env.at, env.pc, DiagnosticKind::CanRegister, text);
        }
        self.changed = true;
    }

    pub(super) fn note_read_only(&self, offset: u32, env: &mut Env<'_>) {
        let text = format!(
            "FDCAN{}: write to read-only register 0x{offset:03x}",
            self.number
        );
        env.log
            .note(env.at, env.pc, DiagnosticKind::CanRegister, text);
    }

    pub(super) fn write_cccr(&mut self, value: u32, env: &mut Env<'_>) {
        let value = value & cccr::WRITABLE;
        let old = self.cccr;
        let init = value & cccr::INIT;
        // CCE follows INIT: it can be set only while INIT is, and falls with it.
        let cce = if init != 0 && old & cccr::INIT != 0 {
            value & cccr::CCE
        } else {
            if value & cccr::CCE != 0 && init != 0 {
                let text = format!(
                    "{} written before INIT was set: ignored",
                    self.name("CCCR.CCE")
                );
                env.log
                    .note(env.at, env.pc, DiagnosticKind::CanRegister, text);
            }
            0
        };
        let mut settings = value & cccr::PROTECTED;
        if !self.configurable() {
            let kept = old & cccr::PROTECTED;
            let cleared = kept & !settings & cccr::CLEARABLE;
            if settings != kept & !cleared {
                let text = format!(
                    "{}: bits that need CCE were written without it: ignored",
                    self.name("CCCR")
                );
                env.log
                    .note(env.at, env.pc, DiagnosticKind::CanRegister, text);
            }
            settings = kept & !cleared;
        }
        let stop = value & cccr::CSR;
        let acknowledge = if stop != 0 { cccr::CSA } else { 0 };
        // A clock stop request sets INIT before it is acknowledged.
        let init = if stop != 0 { cccr::INIT } else { init };
        self.cccr = init | cce | settings | stop | acknowledge;
        if cce != 0 && old & cccr::CCE == 0 {
            self.reset_message_handler();
        }
        if init != 0 {
            self.active = None;
        } else if old & cccr::INIT != 0 {
            self.joins(env);
        }
        if self.cccr & cccr::TEST == 0 {
            self.test = 0;
        }
        if self.cccr & cccr::TXP != 0 {
            let text = format!("{}: transmit pause is not modelled", self.name("CCCR.TXP"));
            env.log
                .note(env.at, env.pc, DiagnosticKind::CanRegister, text);
        }
        self.changed = true;
    }

    /// INIT was cleared: the controller is to take part in the bus.
    fn joins(&mut self, env: &mut Env<'_>) {
        if env.kernel.is_none() {
            let text = format!(
                "FDCAN{}: INIT cleared, but the kernel clock that RCC_CCIPR selects does not run",
                self.number
            );
            env.log.note(env.at, env.pc, DiagnosticKind::Clocks, text);
        }
        if !env.pins {
            let text = format!(
                "FDCAN{}: INIT cleared, but its two pins are not switched to it",
                self.number
            );
            env.log.note(env.at, env.pc, DiagnosticKind::CanPins, text);
        }
        const STANDARD_LAYOUT: u32 = 28;
        if field(self.rxgfc, rxgfc::LSS_SHIFT, 5) > STANDARD_LAYOUT {
            let text = format!("{} is above 28", self.name("RXGFC.LSS"));
            env.log
                .note(env.at, env.pc, DiagnosticKind::CanRegister, text);
        }
    }

    /// Setting CCE resets the state of FIFOs and buffers.
    fn reset_message_handler(&mut self) {
        self.rx = [Fifo::default(); 2];
        self.events = Fifo::default();
        self.hpms = 0;
        self.pending = [None; DEPTH];
        self.cancelling = [false; DEPTH];
        self.put = 0;
        self.txbto = 0;
        self.txbcf = 0;
    }
}

//! Between the controller and the bus: bit timing, offers, events, error
//! counters, timestamps.

use super::bits::{LEC_NO_CHANGE, PSR_DLEC_NO_CHANGE, TEST_LBCK, cccr, field, ir};
use super::{Env, Fdcan};
use crate::board::clock::Frequency;
use crate::bus::{BitTiming, ErrorState, Event, EventKind, Offer, WireError};
use crate::time::Time;

/// From the write of TXBAR to the moment a start of frame may go out, in
/// periods of the kernel clock: the message handler scans the buffers and
/// fetches the first words. A stated assumption; the reference manual gives no
/// figure.
pub const REQUEST_TO_START_CLOCKS: u64 = 12;

const PERMILLE: u64 = 1000;

impl Fdcan {
    /// Bit timing as the kernel clock gives it; `None` while the controller
    /// takes no part in the bus.
    #[must_use]
    pub(crate) fn timing(&self, kernel: Option<Frequency>, pins: bool) -> Option<BitTiming> {
        let kernel = kernel?;
        if !pins || self.cccr & cccr::INIT != 0 || self.test & TEST_LBCK != 0 {
            return None;
        }
        let (prescaler, before, after, jump) = self.bit_segments();
        let quanta = u64::from(before + after);
        Some(BitTiming {
            bit_time_ps: kernel.duration_ps(quanta * u64::from(prescaler)),
            sample_point_permille: (u64::from(before) * PERMILLE / quanta) as u16,
            sjw_permille: (u64::from(jump) * PERMILLE / quanta) as u16,
        })
    }

    /// NBTP: prescaler, quanta before and after the sample point, jump width.
    fn bit_segments(&self) -> (u32, u32, u32, u32) {
        let segment1 = field(self.nbtp, 8, 8) + 1;
        let segment2 = field(self.nbtp, 0, 7) + 1;
        let prescaler = field(self.nbtp, 16, 9) + 1;
        let jump = field(self.nbtp, 25, 7) + 1;
        (prescaler, 1 + segment1, segment2, jump)
    }

    /// Length of a nominal bit; of a microsecond where no clock runs.
    fn bit_time(&self, kernel: Option<Frequency>) -> Time {
        let (prescaler, before, after, _) = self.bit_segments();
        let clocks = u64::from((before + after) * prescaler);
        kernel.map_or(Time::from_us(1), |kernel| {
            Time(kernel.duration_ps(clocks).max(1))
        })
    }

    /// The timestamp counter at `at` (TSCC.TSS: off, internal, TIM3).
    pub(super) fn timestamp(&self, at: Time, env: &Env<'_>) -> u16 {
        match field(self.tscc, 0, 2) {
            1 => self.internal_count(at, env.kernel) as u16,
            2 => env.external_count,
            _ => 0,
        }
    }

    fn internal_count(&self, at: Time, kernel: Option<Frequency>) -> u64 {
        let bits_per_tick = u64::from(field(self.tscc, 16, 4)) + 1;
        at.since(self.tscv_zero).0 / (self.bit_time(kernel).0 * bits_per_tick)
    }

    /// The next wrap of the internal timestamp counter, if its interrupt is
    /// enabled.
    #[must_use]
    pub(crate) fn next_wrap(&self, kernel: Option<Frequency>) -> Option<Time> {
        const SPAN: u64 = 0x1_0000;
        if field(self.tscc, 0, 2) != 1 || self.ie & !self.ir & ir::TSW == 0 {
            return None;
        }
        let bits_per_tick = u64::from(field(self.tscc, 16, 4)) + 1;
        let tick = self.bit_time(kernel) * bits_per_tick;
        Some(self.tscv_zero + tick * (SPAN * (self.tscv_wraps + 1)))
    }

    /// Sets TSW for wraps that have come.
    pub(crate) fn tick(&mut self, env: &mut Env<'_>) {
        const SPAN_BITS: u32 = 16;
        if field(self.tscc, 0, 2) != 1 {
            return;
        }
        let wraps = self.internal_count(env.at, env.kernel) >> SPAN_BITS;
        if wraps > self.tscv_wraps {
            self.tscv_wraps = wraps;
            self.raise(ir::TSW, env);
        }
    }

    /// What this controller would send next.
    #[must_use]
    pub(crate) fn offer(&self, kernel: Option<Frequency>, pins: bool) -> Option<Offer> {
        self.timing(kernel, pins)?;
        if self.active.is_some() || self.cccr & (cccr::MON | cccr::ASM) != 0 {
            return None;
        }
        let (buffer, request) = self.next_buffer()?;
        let delay = Time(kernel?.duration_ps(REQUEST_TO_START_CLOCKS));
        Some(Offer {
            frame: self.ram.tx_element(buffer).frame,
            ready_at: request.at + delay,
            tag: buffer as u32,
        })
    }

    /// Takes an event from the bus.
    pub(crate) fn on_event(&mut self, event: &Event, env: &mut Env<'_>) {
        if self.cccr & cccr::INIT != 0 && !matches!(event.kind, EventKind::Counters { .. }) {
            return;
        }
        match event.kind {
            EventKind::TxStarted { tag } => self.active = Some(tag as usize),
            EventKind::TxDone { tag, sof } => {
                self.active = None;
                self.lec = 0;
                self.sent(tag as usize, sof, env);
            }
            EventKind::ArbitrationLost { tag } => {
                self.active = None;
                self.not_sent(tag as usize, env);
            }
            EventKind::TxError { tag, error } => {
                self.active = None;
                self.protocol_error(error, env);
                self.not_sent(tag as usize, env);
            }
            EventKind::RxError { error } => self.protocol_error(error, env),
            EventKind::Rx { frame, sof } => {
                self.lec = 0;
                self.receive(&frame, sof, env);
            }
            EventKind::Counters { tec, rec, state } => self.counters(tec, rec, state, env),
        }
    }

    fn protocol_error(&mut self, error: WireError, env: &mut Env<'_>) {
        self.lec = match error {
            WireError::Stuff => 1,
            WireError::Form => 2,
            WireError::Ack => 3,
            WireError::Bit1 => 4,
            WireError::Bit0 => 5,
            WireError::Crc => 6,
        };
        self.raise(ir::PEA, env);
    }

    fn counters(&mut self, tec: u16, rec: u16, state: ErrorState, env: &mut Env<'_>) {
        const CEL_MAX: u32 = 0xFF;
        let before = (self.warning(), self.passive(), self.bus_off());
        if tec > self.tec || rec > self.rec {
            self.cel += 1;
            if self.cel > CEL_MAX {
                self.cel = CEL_MAX;
                self.raise(ir::ELO, env);
            }
        }
        self.tec = tec;
        self.rec = rec;
        self.state = state;
        let now = (self.warning(), self.passive(), self.bus_off());
        let mut flags = 0;
        if before.0 != now.0 {
            flags |= ir::EW;
        }
        if before.1 != now.1 {
            flags |= ir::EP;
        }
        if before.2 != now.2 {
            flags |= ir::BO;
        }
        if !before.2 && now.2 {
            // Bus-off stops the controller: software has to clear INIT.
            self.cccr |= cccr::INIT;
            self.active = None;
            self.changed = true;
        }
        self.raise(flags, env);
    }

    fn warning(&self) -> bool {
        const LIMIT: u16 = 96;
        self.tec >= LIMIT || self.rec >= LIMIT
    }

    fn passive(&self) -> bool {
        matches!(self.state, ErrorState::Passive | ErrorState::BusOff)
    }

    fn bus_off(&self) -> bool {
        matches!(self.state, ErrorState::BusOff)
    }

    /// ECR: reading clears CEL.
    pub(super) fn read_ecr(&mut self) -> u32 {
        const RP: u32 = 1 << 15;
        const TEC_MAX: u16 = 0xFF;
        const REC_MAX: u16 = 0x7F;
        let passive = if self.rec > REC_MAX { RP } else { 0 };
        let tec = u32::from(self.tec.min(TEC_MAX));
        let rec = u32::from(self.rec.min(REC_MAX));
        let cel = std::mem::take(&mut self.cel);
        tec | rec << 8 | passive | cel << 16
    }

    /// PSR: reading sets LEC to "no change".
    pub(super) fn read_psr(&mut self) -> u32 {
        const ACT_IDLE: u32 = 0b01 << 3;
        const ACT_TRANSMITTER: u32 = 0b11 << 3;
        const EP: u32 = 1 << 5;
        const EW: u32 = 1 << 6;
        const BO: u32 = 1 << 7;
        let activity = if self.cccr & cccr::INIT != 0 {
            0
        } else if self.active.is_some() {
            ACT_TRANSMITTER
        } else {
            ACT_IDLE
        };
        let mut value = PSR_DLEC_NO_CHANGE | activity | self.lec;
        self.lec = LEC_NO_CHANGE;
        for (on, bit) in [
            (self.passive(), EP),
            (self.warning(), EW),
            (self.bus_off(), BO),
        ] {
            if on {
                value |= bit;
            }
        }
        value
    }
}

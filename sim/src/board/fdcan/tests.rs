//! The controller register by register, without a bus.

mod reception;
mod registers;
mod transmission;

use super::bits::*;
use super::ram::{ELEMENT_WORDS, RX_FIFO, TX_BUFFERS};
use super::*;
use crate::bus::{Event, EventKind, PortId};
use crate::frame::{WireFrame, WireId};

/// A controller with what surrounds it.
struct Bench {
    can: Fdcan,
    log: DiagnosticLog,
    now: Time,
    kernel: Option<Frequency>,
    pins: bool,
}

/// 1 Mbit/s from 24 MHz: prescaler 1, 20 + 3 quanta, sample point 87.5 %.
const NBTP_1M: u32 = 2 << 25 | 19 << 8 | 2;
const SJW_PERMILLE: u16 = 125;

impl Bench {
    /// As after reset, clocks and pins in order.
    fn new() -> Self {
        Self {
            can: Fdcan::new(1),
            log: DiagnosticLog::default(),
            now: Time::ZERO,
            kernel: Some(Frequency::from_hz(24_000_000)),
            pins: true,
        }
    }

    /// Configured as the fdcan crate does it and on the bus.
    fn running() -> Self {
        let mut bench = Self::new();
        bench.configure();
        bench.write(TXBC, TXBC_TFQM);
        bench.start();
        bench
    }

    fn configure(&mut self) {
        self.write(CCCR, cccr::INIT);
        self.write(CCCR, cccr::INIT | cccr::CCE);
        self.write(NBTP, NBTP_1M);
        self.write(RXGFC, 28 << 16 | 8 << 24 | 0b11_1111);
    }

    fn start(&mut self) {
        self.write(CCCR, self.can.cccr & !(cccr::INIT | cccr::CCE));
    }

    fn with_env<T>(&mut self, f: impl FnOnce(&mut Fdcan, &mut Env<'_>) -> T) -> T {
        let mut env = Env {
            at: self.now,
            pc: 0x0800_1234,
            kernel: self.kernel,
            pins: self.pins,
            external_count: 4711,
            log: &mut self.log,
        };
        f(&mut self.can, &mut env)
    }

    fn read(&mut self, offset: u32) -> u32 {
        self.with_env(|can, env| can.read(offset, env))
            .expect("register exists")
    }

    fn write(&mut self, offset: u32, value: u32) {
        assert!(self.with_env(|can, env| can.write(offset, value, env)));
    }

    fn ram(&mut self, index: usize, value: u32) {
        self.with_env(|can, env| can.write_ram(index, value, env));
    }

    fn event(&mut self, kind: EventKind) {
        let event = Event {
            at: self.now,
            port: PortId(0),
            kind,
        };
        self.with_env(|can, env| can.on_event(&event, env));
    }

    fn receive(&mut self, frame: WireFrame) {
        let sof = self.now;
        self.event(EventKind::Rx { frame, sof });
    }

    /// Writes a standard data frame into `buffer` and requests it.
    fn request(&mut self, buffer: usize, id: u16, data: &[u8]) {
        let base = TX_BUFFERS + buffer * ELEMENT_WORDS;
        self.ram(base, u32::from(id) << 18);
        self.ram(base + 1, (data.len() as u32) << 16);
        for (k, chunk) in data.chunks(4).enumerate() {
            let mut word = [0; 4];
            word[..chunk.len()].copy_from_slice(chunk);
            self.ram(base + 2 + k, u32::from_le_bytes(word));
        }
        self.write(TXBAR, 1 << buffer);
    }

    fn offered(&self) -> Option<(u32, WireFrame)> {
        let offer = self.can.offer(self.kernel, self.pins)?;
        Some((offer.tag, offer.frame))
    }

    /// Lets the bus send what is offered.
    fn send(&mut self) -> WireFrame {
        let (tag, frame) = self.offered().expect("something is offered");
        self.event(EventKind::TxStarted { tag });
        assert_eq!(self.offered(), None, "one frame at a time");
        let sof = self.now;
        self.event(EventKind::TxDone { tag, sof });
        frame
    }

    fn complaints(&self) -> Vec<(DiagnosticKind, String)> {
        self.log
            .entries()
            .iter()
            .map(|entry| (entry.kind, entry.text.clone()))
            .collect()
    }

    fn kinds(&self) -> Vec<DiagnosticKind> {
        self.log.entries().iter().map(|entry| entry.kind).collect()
    }
}

fn standard(id: u16, data: &[u8]) -> WireFrame {
    WireFrame::standard(id, data)
}

//! The FDCAN instances among clocks, pins, timers and the bus.

use super::super::fdcan::Env;
use super::access::CAN_GATE;
use super::{Access, Frequency, Pin, Soc, TIM3};
use crate::bus::{BitTiming, Event, EventKind, Offer};
use crate::time::Time;

/// The pins that the board's connectors take to a transceiver: RX, TX and the
/// alternate function that makes them FDCAN's.
const WIRED: [([Pin; 2], u32); 3] = [
    ([Pin::new('A', 11), Pin::new('A', 12)], 9),
    ([Pin::new('B', 12), Pin::new('B', 13)], 9),
    ([Pin::new('A', 8), Pin::new('A', 15)], 11),
];
/// FDCAN register TXBAR.
const TXBAR: u32 = 0x0CC;

/// The environment of instance `$k`, borrowing field by field.
macro_rules! env {
    ($soc:ident, $k:expr, $at:expr, $pc:expr, $count:expr) => {
        Env {
            at: $at,
            pc: $pc,
            kernel: $soc.can_kernel(),
            pins: $soc.can_pins($k),
            external_count: $count,
            log: &mut $soc.log,
        }
    };
}

impl Soc {
    /// The kernel clock after CKDIV, while the peripheral is enabled.
    fn can_kernel(&self) -> Option<Frequency> {
        if !self.rcc.is_enabled(CAN_GATE) {
            return None;
        }
        let divider = self.can[0].clock_divider();
        self.rcc.fdcan_clock().map(|clock| clock.scaled(1, divider))
    }

    fn can_pins(&self, instance: usize) -> bool {
        let (pins, function) = WIRED[instance];
        pins.iter()
            .all(|pin| self.ports[pin.port].alternate_function(pin.number) == Some(function))
    }

    fn tim3_at(&mut self, time: Time, now: u64) -> u16 {
        let cycle = self.clock.cycle_at(time).min(now);
        self.timers[TIM3].count_at(cycle, now) as u16
    }

    pub(super) fn read_can(&mut self, k: usize, offset: u32, access: Access) -> Option<u32> {
        let at = self.clock.time_of(access.cycle);
        let count = self.timers[TIM3].count_at(access.cycle, access.cycle) as u16;
        let mut env = env!(self, k, at, access.pc, count);
        self.can[k].read(offset, &mut env)
    }

    pub(super) fn write_can(&mut self, k: usize, offset: u32, value: u32, access: Access) -> bool {
        let at = self.clock.time_of(access.cycle);
        if offset == TXBAR {
            // The update may be newer than the last look at the timer.
            self.timers[super::TIM2].sync(access.cycle);
            let (updates, last) = self.timers[super::TIM2].updates();
            self.sync.note_updates(updates, last);
            for buffer in 0..super::super::fdcan::ram::DEPTH {
                if value & 1 << buffer != 0 {
                    let frame = self.can[k].ram.tx_element(buffer).frame;
                    self.sync.note_request(&frame, access.cycle);
                }
            }
        }
        let mut env = env!(self, k, at, access.pc, 0);
        self.can[k].write(offset, value, &mut env)
    }

    pub(super) fn write_can_ram(&mut self, k: usize, index: usize, value: u32, access: Access) {
        let at = self.clock.time_of(access.cycle);
        let mut env = env!(self, k, at, access.pc, 0);
        self.can[k].write_ram(index, value, &mut env);
    }

    pub(super) fn tick_can(&mut self, cycle: u64) {
        let at = self.clock.time_of(cycle);
        for k in 0..self.can.len() {
            let mut env = env!(self, k, at, 0, 0);
            self.can[k].tick(&mut env);
        }
    }

    pub(super) fn next_can_event(&self) -> Option<Time> {
        let kernel = self.can_kernel();
        self.can
            .iter()
            .filter_map(|can| can.next_wrap(kernel))
            .min()
    }

    /// Bit timing of an instance; `None` while it takes no part in the bus.
    #[must_use]
    pub(crate) fn can_timing(&self, instance: usize) -> Option<BitTiming> {
        let can = self.can.get(instance)?;
        can.timing(self.can_kernel(), self.can_pins(instance))
    }

    /// What an instance would send next.
    #[must_use]
    pub(crate) fn can_offer(&self, instance: usize) -> Option<Offer> {
        let can = self.can.get(instance)?;
        can.offer(self.can_kernel(), self.can_pins(instance))
    }

    /// Hands an event of the bus to an instance; `cycle` is the core's.
    pub(crate) fn can_event(&mut self, instance: usize, event: &Event, cycle: u64) {
        if instance >= self.can.len() {
            return;
        }
        let count = match event.kind {
            EventKind::Rx { sof, .. } | EventKind::TxDone { sof, .. } => self.tim3_at(sof, cycle),
            _ => 0,
        };
        let mut env = env!(self, instance, event.at, 0, count);
        self.can[instance].on_event(event, &mut env);
    }

    /// Whether offer or timing of any instance may have changed since the last
    /// call.
    pub(crate) fn take_can_changed(&mut self) -> bool {
        let mut changed = false;
        for can in &mut self.can {
            changed |= can.take_changed();
        }
        changed
    }

    /// Frames that each instance lost in full FIFOs.
    #[must_use]
    pub(crate) fn can_lost(&self) -> [u64; 3] {
        std::array::from_fn(|k| self.can[k].lost())
    }
}

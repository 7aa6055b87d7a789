//! What `can_irq` does with what it receives on one bus.

use crate::{
    asking,
    counters::Count,
    derived::{AXES, BUSES, CONTROLLERS},
    filters::{self, Handler},
    lines::{self, Line, Lines, PRODUCING, SYNCS, Sender},
    measured::{self, Figure},
    transfer, wake,
};
use canmaster::{
    Frame,
    master::{AxisMap, MasterOd, Reception, TpdoSlot},
};
use core::sync::atomic::Ordering::Relaxed;
use heapless::spsc::Producer;
use nucleo_g474re::{can, pac::Interrupt, timers::Phase};
use rtic::Mutex;

/// What all of its runs share.
#[expect(unreachable_pub, reason = "RTIC wants shared resources to be public")]
pub struct Receiver {
    pub(crate) rx: can::Rx,
    pub(crate) phase: Phase,
    pub(crate) axis_map: AxisMap,
    pub(crate) to_network: Producer<'static, Frame>,
    pub(crate) answers_to: Producer<'static, Frame>,
    pub(crate) transfer_to: Producer<'static, Frame>,
    pub(crate) requests_to: Producer<'static, Frame>,
}

/// The controllers' error states; of all, the worst counts.
#[expect(unreachable_pub, reason = "RTIC wants shared resources to be public")]
pub type States = [can::ErrorState; BUSES];

impl Receiver {
    /// One run for the bus `bus`.
    #[inline(always)]
    pub(crate) fn serve(
        &mut self,
        bus: usize,
        od: &mut impl Mutex<T = MasterOd<AXES>>,
        sender: &mut impl Mutex<T = Sender>,
        lines: &mut impl Mutex<T = Lines>,
        states: &mut impl Mutex<T = States>,
    ) {
        let Some(&controller) = CONTROLLERS.get(bus) else {
            return;
        };
        let begun = measured::ticks(self.phase);
        let flags = self.rx.take_flags(controller);
        if flags.rare() {
            if flags.message_lost() {
                Count::RxOverruns.add(1);
            }
            self.error_state(bus, sender, lines, states);
        }
        // First of all, so that the bus is not idle for longer than it must.
        if lines::take_wanted(bus) || flags.sent() {
            lines::refill(bus, lines, sender, self.phase);
        }
        if measured::ON && flags.sent_at() {
            while let Some(at) = self.rx.take_sent_at(controller) {
                measured::sync_began(bus, at);
            }
        }
        if flags.received(can::Fifo::Fifo0) {
            while let Some(element) = self.rx.receive(controller, can::Fifo::Fifo0) {
                measured::add_bits(bus, element.len() as u32);
                self.tpdo(&element, od);
            }
        }
        if flags.received(can::Fifo::Fifo1) {
            while let Some(element) = self.rx.receive(controller, can::Fifo::Fifo1) {
                measured::add_bits(bus, element.len() as u32);
                self.other(&element, bus);
            }
        }
        measured::ran(Figure::CanIrq, self.phase, begun);
    }

    #[inline(never)]
    fn error_state(
        &mut self,
        bus: usize,
        sender: &mut impl Mutex<T = Sender>,
        lines: &mut impl Mutex<T = Lines>,
        states: &mut impl Mutex<T = States>,
    ) {
        let Some(&controller) = CONTROLLERS.get(bus) else {
            return;
        };
        let state = self.rx.error_state(controller);
        states.lock(|states| {
            if let Some(known) = states.get_mut(bus) {
                *known = state;
            }
        });
        if state == can::ErrorState::BusOff {
            // Nothing that waits now may be sent when the bus is back, and
            // SYNC has to wait until the nodes are booted again.
            PRODUCING.store(false, Relaxed);
            lines.lock(|lines| lines.iter_mut().for_each(Line::clear));
            sender.lock(|sender| sender.tx.cancel_all(controller));
        }
    }

    /// FIFO 0: TPDOs.
    #[inline(always)]
    fn tpdo(&mut self, element: &can::RxElement, od: &mut impl Mutex<T = MasterOd<AXES>>) {
        let number = usize::from(element.filter());
        let id = element.identifier();
        let axis = id.and_then(|id| self.axis_map.axis(id.as_raw()));
        let slot = axis.and_then(|axis| TpdoSlot::new(axis, number));
        let (Some(slot), false) = (slot, element.is_remote()) else {
            return;
        };
        let (data, length) = (element.bytes(), element.len());
        let syncs = SYNCS.load(Relaxed);
        match od.lock(|od| {
            od.follow(syncs);
            od.store(slot, data, length)
        }) {
            Reception::Stored => {}
            Reception::Last => rtic::pend(Interrupt::TIM3),
            Reception::TooShort => Count::TpdoLength.add(1),
        }
    }

    /// FIFO 1: everything else.
    #[inline(never)]
    fn other(&mut self, element: &can::RxElement, bus: usize) {
        let (Some(handler), Some(frame)) = (
            filters::HANDLERS.get(usize::from(element.filter())),
            element.frame::<Frame>(),
        ) else {
            return;
        };
        let to = match handler {
            Handler::Answer if asking::is_answer(&frame) => return,
            Handler::Answer if transfer::wants(frame.id()) => &mut self.transfer_to,
            Handler::Answer => &mut self.answers_to,
            Handler::Request => {
                lines::client_on(bus);
                &mut self.requests_to
            }
            _ => &mut self.to_network,
        };
        queue(to, frame);
        if matches!(handler, Handler::Answer | Handler::Request) {
            wake::now();
        }
    }
}

/// Hands a frame on; a full queue is counted.
pub(crate) fn queue(to: &mut Producer<'static, Frame>, frame: Frame) {
    if to.enqueue(frame).is_err() {
        Count::RxQueueFull.add(1);
    }
}

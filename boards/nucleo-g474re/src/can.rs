//! FDCAN1, 2 and 3, with the bit timing and the interrupts of the fdcan crate.
//!
//! Not through that crate's own transmit and receive calls: they turn a frame
//! without data into a remote frame, drop a frame when the buffers are full, and
//! take hundreds of cycles where the SYNC has 170.

mod element;
mod setup;

pub use element::{Element, RxElement};
pub(crate) use setup::setup;
pub use setup::{BitTiming, Settings};

use crate::message_ram::{self, DEPTH};
use core::sync::atomic::{AtomicU16, Ordering::Relaxed};
use stm32g4xx_hal::pac::{self, fdcan::RegisterBlock};

/// How many range filters the controller has for standard identifiers.
pub const FILTERS: usize = 28;

/// How many frames wait in the controller at most.
pub const BUFFERS: usize = DEPTH;

/// In the place of an identifier: there is no frame. No identifier is that large.
pub const FREE: u16 = u16::MAX;

/// The two receive FIFOs, three frames deep each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fifo {
    /// Rx FIFO 0.
    Fifo0,
    /// Rx FIFO 1.
    Fifo1,
}

/// Standard identifiers from `first` to `last`, both included, go to `fifo`.
#[derive(Clone, Copy, Debug)]
pub struct RangeFilter {
    /// The lowest identifier.
    pub first: u16,
    /// The highest identifier.
    pub last: u16,
    /// Where the frames go.
    pub fifo: Fifo,
}

/// One of the chip's controllers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Controller(usize);

impl Controller {
    /// On PA11 and PA12.
    pub const FDCAN1: Controller = Controller(0);
    /// On PB12 and PB13.
    pub const FDCAN2: Controller = Controller(1);
    /// On PA8 and PA15.
    pub const FDCAN3: Controller = Controller(2);

    /// FDCAN1, FDCAN2 or FDCAN3.
    pub const fn fdcan(number: u8) -> Option<Controller> {
        match number {
            1..=CONTROLLERS => Some(Controller(number as usize - 1)),
            _ => None,
        }
    }

    /// Counted from 0.
    pub(crate) const fn index(self) -> usize {
        self.0
    }
}

const CONTROLLERS: u8 = 3;
/// From the registers of one controller to those of the next.
const NEXT: usize = 0x400;

#[inline(always)]
fn registers(of: Controller) -> &'static RegisterBlock {
    let address = pac::FDCAN1::ptr() as usize + of.index() * NEXT;
    // SAFETY: the registers of the three controllers exist for the whole run, all
    // accesses to them are volatile, and who may write which is divided below:
    // `Tx` owns the TX* registers and CCCR, `Rx` all others. Each of them exists
    // once, made by `setup`, which consumed the peripherals.
    unsafe { &*(address as *const RegisterBlock) }
}

/// The identifier that each buffer was last filled with.
static IDENTIFIERS: [[AtomicU16; DEPTH]; CONTROLLERS as usize] =
    [const { [const { AtomicU16::new(FREE) }; DEPTH] }; CONTROLLERS as usize];

/// The transmitting half of all controllers.
///
/// A controller sends the frame with the lowest identifier first. Frames with
/// *equal* identifiers would go by buffer number, so never have two of them
/// there: [`pending`].
pub struct Tx {
    /// Made by `setup` alone.
    _only: (),
}

/// The transmit buffers of a controller, looked up.
#[derive(Clone, Copy)]
pub struct Buffers {
    registers: *const RegisterBlock,
    elements: *mut u32,
    held: *const [AtomicU16; DEPTH],
}

impl Buffers {
    /// Those of a controller. `None`: there is no such controller.
    #[inline(always)]
    pub fn of(controller: Controller) -> Option<Buffers> {
        Some(Buffers {
            registers: registers(controller),
            elements: message_ram::tx_buffers(controller),
            held: IDENTIFIERS.get(controller.index())?,
        })
    }

    /// The same, looked up here: see [`Element::made`].
    #[inline(always)]
    pub fn made(self) -> Buffers {
        let Buffers {
            mut registers,
            mut elements,
            mut held,
        } = self;
        // SAFETY: no instruction; the compiler takes it for one that needs the three
        // pointers, which are the same afterwards.
        unsafe {
            core::arch::asm!(
                "/* {0} {1} {2} */",
                inout(reg) registers,
                inout(reg) elements,
                inout(reg) held,
                options(readonly, nostack, preserves_flags)
            );
        }
        Buffers {
            registers,
            elements,
            held,
        }
    }
}

/// Which buffers hold a frame that waits to be sent: bit n for buffer n. For any
/// task: a frame that is requested meanwhile may be missing.
#[inline(always)]
pub fn waiting(of: Controller) -> u32 {
    // A request shows in TXBRP only when the controller's scan is done.
    registers(of).txbrp().read().bits() | registers(of).txbar().read().bits()
}

/// The identifiers of the frames that wait to be sent, of those buffers that
/// [`waiting`] names; [`FREE`] for the others.
#[inline(always)]
pub fn pending(of: Controller, waiting: u32) -> [u16; BUFFERS] {
    let mut pending = [FREE; BUFFERS];
    let (Some(held), true) = (IDENTIFIERS.get(of.index()), waiting != 0) else {
        // The way of almost every SYNC.
        return pending;
    };
    // One by one: at this place iterators cost more than what they save.
    if waiting & 0b001 != 0 {
        pending[0] = held[0].load(Relaxed);
    }
    if waiting & 0b010 != 0 {
        pending[1] = held[1].load(Relaxed);
    }
    if waiting & 0b100 != 0 {
        pending[2] = held[2].load(Relaxed);
    }
    pending
}

impl Tx {
    /// Requests the transmission of `element`. The number of the buffer that it is
    /// in; [`BUFFERS`]: all hold frames, and nothing was changed.
    #[inline(always)]
    pub fn transmit(&mut self, by: Buffers, element: &Element) -> usize {
        // SAFETY: both were made of references that are valid for ever.
        let (registers, held) = unsafe { (&*by.registers, &*by.held) };
        let status = registers.txfqs().read();
        let index = status.tfqpi().bits() as usize;
        let (false, Some(held)) = (status.tfqf().bit_is_set(), held.get(index)) else {
            return BUFFERS;
        };
        held.store(element.identifier(), Relaxed);
        // SAFETY: the clock was switched on by `setup`; the index was checked
        // against three above; the put index names a buffer without a request;
        // `&mut self` is the only way to Tx buffers.
        unsafe { message_ram::write_tx(by.elements, index, element) };
        // SAFETY: a request bit of a buffer that has just been filled.
        registers.txbar().write(|w| unsafe { w.bits(1 << index) });
        index
    }

    /// Takes back every frame that has not started, so that none goes out late:
    /// for use after bus-off.
    pub fn cancel_all(&mut self, of: Controller) {
        // SAFETY: cancel bits of the three buffers.
        registers(of)
            .txbcr()
            .write(|w| unsafe { w.bits((1 << DEPTH) - 1) });
    }

    /// Lets the controller take part in the traffic again after bus-off, as soon
    /// as the bus was idle 129 times (ISO 11898-1). Nothing that waited to be sent
    /// before is left.
    pub fn restart(&mut self, controller: Controller) {
        let control = registers(controller).cccr();
        // Bus-off has set INIT; setting CCE forgets all requests.
        control.modify(|_, w| w.init().set_bit());
        while control.read().init().bit_is_clear() {}
        control.modify(|_, w| w.cce().set_bit());
        control.modify(|_, w| w.cce().clear_bit());
        control.modify(|_, w| w.init().clear_bit());
    }
}

/// The controller's error state (ISO 11898-1, fault confinement), the worst last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ErrorState {
    /// Both error counters below 96.
    Active,
    /// A counter has reached 96.
    Warning,
    /// A counter has reached 128.
    Passive,
    /// The transmit error counter has reached 256: the controller takes no part
    /// in the traffic until it is restarted.
    BusOff,
}

/// What the controller reported.
#[derive(Clone, Copy, Debug)]
pub struct Flags(u32);

const FLAG_FIFO_0: u32 = 1 << 0;
const FLAG_FIFO_0_LOST: u32 = 1 << 2;
const FLAG_FIFO_1: u32 = 1 << 3;
const FLAG_FIFO_1_LOST: u32 = 1 << 5;
const FLAG_SENT: u32 = 1 << 7;
const FLAG_TX_EVENT: u32 = 1 << 10;
const FLAG_ERROR_PASSIVE: u32 = 1 << 17;
const FLAG_ERROR_WARNING: u32 = 1 << 18;
const FLAG_BUS_OFF: u32 = 1 << 19;

/// Flags that are seldom set.
const FLAGS_RARE: u32 =
    FLAG_FIFO_0_LOST | FLAG_FIFO_1_LOST | FLAG_ERROR_PASSIVE | FLAG_ERROR_WARNING | FLAG_BUS_OFF;

impl Flags {
    /// Frames came into that FIFO since the flags were last taken.
    #[inline(always)]
    pub fn received(self, fifo: Fifo) -> bool {
        let flag = match fifo {
            Fifo::Fifo0 => FLAG_FIFO_0,
            Fifo::Fifo1 => FLAG_FIFO_1,
        };
        self.0 & flag != 0
    }

    /// Frames were sent: there is room for others.
    #[inline(always)]
    pub fn sent(self) -> bool {
        self.0 & FLAG_SENT != 0
    }

    /// A frame was sent of which the controller tells when.
    #[inline(always)]
    pub fn sent_at(self) -> bool {
        self.0 & FLAG_TX_EVENT != 0
    }

    /// Something that needs a closer look: a frame lost, the error state.
    #[inline(always)]
    pub fn rare(self) -> bool {
        self.0 & FLAGS_RARE != 0
    }

    /// A frame found its receive FIFO full and was lost.
    pub fn message_lost(self) -> bool {
        self.0 & (FLAG_FIFO_0_LOST | FLAG_FIFO_1_LOST) != 0
    }

    /// The error state changed: see [`Rx::error_state`].
    pub fn error_state_changed(self) -> bool {
        self.0 & (FLAG_ERROR_PASSIVE | FLAG_ERROR_WARNING | FLAG_BUS_OFF) != 0
    }
}

/// The receiving half of all controllers, which also tells what they have to
/// report.
pub struct Rx {
    /// Made by `setup` alone.
    _only: (),
}

impl Rx {
    /// Reads and clears the interrupt flags. To be called before the FIFOs are
    /// drained, so that a frame that comes meanwhile raises the interrupt again.
    #[inline(always)]
    pub fn take_flags(&mut self, of: Controller) -> Flags {
        let flags = registers(of).ir().read().bits();
        // SAFETY: ones clear exactly the flags that were read.
        registers(of).ir().write(|w| unsafe { w.bits(flags) });
        Flags(flags)
    }

    /// The next frame of a FIFO, with the index of the filter that let it in.
    #[inline(always)]
    pub fn receive(&mut self, from: Controller, fifo: Fifo) -> Option<RxElement> {
        let registers = registers(from);
        // Both FIFOs have the same fields.
        let status = match fifo {
            Fifo::Fifo0 => registers.rxf0s().read().bits(),
            Fifo::Fifo1 => registers.rxf1s().read().bits(),
        };
        let index = (status >> GET_INDEX_SHIFT & GET_INDEX_MASK) as usize;
        if status & FILL_LEVEL_MASK == 0 || index >= DEPTH {
            return None;
        }
        // SAFETY: the clock was switched on by `setup`; the index was checked
        // against three; the FIFO is not empty, so its get index names a frame.
        let element = unsafe { message_ram::read_rx(from, fifo, index) };
        // SAFETY: acknowledges the element that has just been read.
        match fifo {
            Fifo::Fifo0 => registers.rxf0a().write(|w| unsafe { w.bits(index as u32) }),
            Fifo::Fifo1 => registers.rxf1a().write(|w| unsafe { w.bits(index as u32) }),
        };
        Some(element)
    }

    /// When the frame of the oldest event began on the bus: what TIM3 counted
    /// then. Only frames that asked for it have an event.
    #[inline(always)]
    pub fn take_sent_at(&mut self, by: Controller) -> Option<u16> {
        let registers = registers(by);
        let status = registers.txefs().read().bits();
        let index = (status >> GET_INDEX_SHIFT & GET_INDEX_MASK) as usize;
        if status & FILL_LEVEL_MASK == 0 || index >= DEPTH {
            return None;
        }
        // SAFETY: as in `receive`.
        let at = unsafe { message_ram::read_tx_event(by, index) };
        // SAFETY: acknowledges the event that has just been read.
        registers.txefa().write(|w| unsafe { w.bits(index as u32) });
        Some(at)
    }

    /// The error state.
    pub fn error_state(&self, of: Controller) -> ErrorState {
        let status = registers(of).psr().read();
        if status.bo().bit_is_set() {
            ErrorState::BusOff
        } else if status.ep().bit_is_set() {
            ErrorState::Passive
        } else if status.ew().bit_is_set() {
            ErrorState::Warning
        } else {
            ErrorState::Active
        }
    }
}

/// Fields of RXF0S, RXF1S and TXEFS.
const FILL_LEVEL_MASK: u32 = 0b1111;
const GET_INDEX_SHIFT: u32 = 8;
const GET_INDEX_MASK: u32 = 0b11;

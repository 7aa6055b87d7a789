//! The controllers' message RAM (RM0440, 44.3.3): layout and element formats.

use crate::can::{Controller, Element, Fifo, RangeFilter, RxElement};

const BASE: usize = 0x4000_A400;
/// Bytes of each controller.
const SIZE: usize = 0x350;
const RX_FIFO_0: usize = 0x0B0;
const RX_FIFO_1: usize = 0x188;
const TX_EVENTS: usize = 0x260;
const TX_EVENT_WORDS: usize = 2;
const TX_BUFFERS: usize = 0x278;
const WORD: usize = 4;
const ELEMENT_WORDS: usize = 18;
/// Tx buffers, and elements of each Rx FIFO.
pub(crate) const DEPTH: usize = 3;
/// Words of an element that a classical frame uses.
pub(crate) const USED_WORDS: usize = 4;

const FILTER_STORE_IN_FIFO_0: u32 = 0b001 << 27;
const FILTER_STORE_IN_FIFO_1: u32 = 0b010 << 27;
const FILTER_ID1_SHIFT: u32 = 16;

#[inline(always)]
const fn base(of: Controller) -> usize {
    BASE + of.index() * SIZE
}

/// Writes the standard filter `index` as a range filter (type 00).
///
/// By hand, because fdcan 0.2.1 writes the bounds of a range in the wrong order
/// (the upper one into SFID1), and such an element matches nothing.
///
/// # Safety
///
/// The controllers' clock must be on, `index` below 28, and nobody else may access that
/// filter element.
pub(crate) unsafe fn write_filter(of: Controller, index: usize, filter: &RangeFilter) {
    let action = match filter.fifo {
        Fifo::Fifo0 => FILTER_STORE_IN_FIFO_0,
        Fifo::Fifo1 => FILTER_STORE_IN_FIFO_1,
    };
    let word = action | u32::from(filter.first) << FILTER_ID1_SHIFT | u32::from(filter.last);
    // SAFETY: in the message RAM by the caller's promise on `index`;
    // aligned, since base and offset are multiples of four.
    unsafe { ((base(of) + index * WORD) as *mut u32).write_volatile(word) }
}

/// The first of the Tx buffers.
#[inline(always)]
pub(crate) const fn tx_buffers(of: Controller) -> *mut u32 {
    (base(of) + TX_BUFFERS) as *mut u32
}

/// Writes the Tx buffer `index`, the first one being at `first`.
///
/// # Safety
///
/// `first` must be from [`tx_buffers`], the controllers' clock on, `index` below 3, no
/// transmission of that buffer may be requested, and nobody else may write Tx buffers
/// meanwhile.
#[inline(always)]
pub(crate) unsafe fn write_tx(first: *mut u32, index: usize, element: &Element) {
    let address = first.wrapping_add(index * ELEMENT_WORDS);
    let words = element.words();
    // SAFETY: in the message RAM by the caller's promise on `index`;
    // aligned.
    unsafe {
        address.write_volatile(words[0]);
        address.add(1).write_volatile(words[1]);
        address.add(2).write_volatile(words[2]);
        address.add(3).write_volatile(words[3]);
    }
}

/// Reads the element `index` of an Rx FIFO.
///
/// # Safety
///
/// The controllers' clock must be on, `index` below 3, and the element must hold a
/// frame that is not yet acknowledged.
#[inline(always)]
pub(crate) unsafe fn read_rx(of: Controller, fifo: Fifo, index: usize) -> RxElement {
    let first = match fifo {
        Fifo::Fifo0 => RX_FIFO_0,
        Fifo::Fifo1 => RX_FIFO_1,
    };
    let address = (base(of) + first + index * ELEMENT_WORDS * WORD) as *const u32;
    // SAFETY: in the message RAM by the caller's promise on `index`;
    // aligned; the controller writes no element before it is acknowledged.
    let words: [u32; USED_WORDS] = unsafe {
        [
            address.read_volatile(),
            address.add(1).read_volatile(),
            address.add(2).read_volatile(),
            address.add(3).read_volatile(),
        ]
    };
    RxElement::new(words)
}

/// Reads the time stamp of the Tx event `index`.
///
/// # Safety
///
/// As [`read_rx`].
#[inline(always)]
pub(crate) unsafe fn read_tx_event(of: Controller, index: usize) -> u16 {
    let address = (base(of) + TX_EVENTS + index * TX_EVENT_WORDS * WORD) as *const u32;
    // SAFETY: in the message RAM by the caller's promise on `index`; aligned.
    unsafe { address.add(1).read_volatile() as u16 }
}

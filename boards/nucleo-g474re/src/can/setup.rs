//! Configuration: bit timing, filters, interrupts.

use super::{Controller, FILTERS, RangeFilter, Rx, Tx, registers};
use crate::message_ram::{self, DEPTH};
use core::num::{NonZeroU8, NonZeroU16};
use fdcan::{config::NominalBitTiming, interrupt::Interrupts};

/// How the controller makes a bit of its clock, the 24 MHz of the crystal. The
/// jump width is all of segment 2: the wider, the more clock error between the
/// nodes is tolerated.
#[derive(Clone, Copy)]
pub struct BitTiming(NominalBitTiming);

impl BitTiming {
    /// `prescaler` clocks are a quantum; a bit is one quantum, `seg1` quanta up to
    /// the sample point, and `seg2` after it: 1 .. 512, 1 .. 255, 1 .. 128. 1, 20
    /// and 3 are 1 Mbit/s, sampled at (1 + 20) / 24 = 87.5 %, as CiA 301
    /// recommends. `None` if one is outside its range.
    pub const fn new(prescaler: u16, seg1: u16, seg2: u16) -> Option<BitTiming> {
        if prescaler > PRESCALER_MAX || seg1 > u8::MAX as u16 || seg2 > SEG2_MAX {
            return None;
        }
        let (Some(prescaler), Some(seg1), Some(seg2)) = (
            NonZeroU16::new(prescaler),
            NonZeroU8::new(seg1 as u8),
            NonZeroU8::new(seg2 as u8),
        ) else {
            return None;
        };
        Some(BitTiming(NominalBitTiming {
            prescaler,
            seg1,
            seg2,
            sync_jump_width: seg2,
        }))
    }
}

const PRESCALER_MAX: u16 = 512;
const SEG2_MAX: u16 = 128;

/// What a controller is told.
#[derive(Clone, Copy)]
pub struct Settings {
    /// How it makes a bit.
    pub timing: BitTiming,
    /// What it receives: at most [`FILTERS`] ranges, the index of the first that
    /// matches comes with each frame.
    pub filters: &'static [RangeFilter],
}

impl Tx {
    pub(crate) const fn new() -> Tx {
        Tx { _only: () }
    }
}

impl Rx {
    pub(crate) const fn new() -> Rx {
        Rx { _only: () }
    }
}

/// Configures a controller whose clock is on, and lets it take part in the traffic.
///
/// Register by register: the fdcan crate would first write all 848 bytes of the
/// message RAM, of which only the filters have to be, and its `into_normal` loses the
/// global filter, so that every frame that no filter wants, extended and remote ones
/// too, would end in FIFO 0. What it leaves as the reset made it is left here, too.
///
/// # Panics
///
/// If there are more than [`FILTERS`] filters.
pub(crate) fn setup(controller: Controller, settings: &Settings) {
    let filters = settings.filters;
    assert!(filters.len() <= FILTERS);
    let registers = registers(controller);
    let control = registers.cccr();
    control.write(|w| w.init().set_bit());
    while control.read().init().bit_is_clear() {}
    control.write(|w| w.init().set_bit().cce().set_bit());
    let timing = settings.timing.0;
    // SAFETY: one less than what was found to be in the range of each field.
    registers.nbtp().write(|w| unsafe {
        w.nbrp()
            .bits(timing.prescaler.get() - 1)
            .ntseg1()
            .bits(timing.seg1.get() - 1)
            .ntseg2()
            .bits(timing.seg2.get() - 1)
            .nsjw()
            .bits(timing.sync_jump_width.get() - 1)
    });
    for (index, filter) in filters.iter().enumerate() {
        // SAFETY: the clock is on, as the caller says; the number of filters was
        // checked; the controller does not run yet.
        unsafe { message_ram::write_filter(controller, index, filter) };
    }
    // SAFETY: as many standard filters as were written, no extended one; `REJECT` is
    // a value of both fields.
    registers.rxgfc().write(|w| unsafe {
        w.rrfe()
            .set_bit()
            .rrfs()
            .set_bit()
            .anfe()
            .bits(REJECT)
            .anfs()
            .bits(REJECT)
            .lss()
            .bits(filters.len() as u8)
    });
    // The lowest identifier first.
    registers.txbc().write(|w| w.tfqm().set_bit());
    // SAFETY: the flags that `Flags` knows, and the completion of any of the three
    // buffers.
    registers
        .ie()
        .write(|w| unsafe { w.bits(INTERRUPTS.bits()) });
    // SAFETY: the enable bits of the three buffers.
    registers
        .txbtie()
        .write(|w| unsafe { w.bits((1 << DEPTH) - 1) });
    // Line 0, to which ILS routes every group after a reset.
    registers.ile().write(|w| w.eint0().set_bit());
    // Time stamps are TIM3's count: the microseconds of the period.
    // SAFETY: one of the three sources.
    registers
        .tscc()
        .write(|w| unsafe { w.bits(TIME_STAMPS_BY_TIM3) });
    control.write(|w| w.init().clear_bit());
    while control.read().init().bit_is_set() {}
}

/// ANFE, ANFS: what no filter wants is not received.
const REJECT: u8 = 0b11;
const TIME_STAMPS_BY_TIM3: u32 = 0b10;
const INTERRUPTS: Interrupts = Interrupts::RX_FIFO0_NEW_MSG
    .union(Interrupts::RX_FIFO0_MSG_LOST)
    .union(Interrupts::RX_FIFO1_NEW_MSG)
    .union(Interrupts::RX_FIFO1_MSG_LOST)
    .union(Interrupts::TX_COMPLETE)
    .union(Interrupts::ERR_PASSIVE)
    .union(Interrupts::WARNING_STATUS)
    .union(Interrupts::BUS_OFF);

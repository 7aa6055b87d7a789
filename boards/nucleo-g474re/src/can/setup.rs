//! Configuration: bit timing, filters, interrupts.

use super::{Controller, FILTERS, RangeFilter, Rx, Tx, registers};
use crate::message_ram::{self, DEPTH};
use core::num::{NonZeroU8, NonZeroU16};
use fdcan::{
    ConfigMode, FdCan,
    config::{FdCanConfig, FrameTransmissionConfig, GlobalFilter, NominalBitTiming},
    interrupt::Interrupts,
};
use stm32g4xx_hal::pac::fdcan::RegisterBlock;

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

/// # Panics
///
/// If there are more than [`FILTERS`] filters, or the controller is not the
/// one that is expected.
pub(crate) fn setup<I: fdcan::Instance>(
    mut can: FdCan<I, ConfigMode>,
    controller: Controller,
    settings: &Settings,
) {
    let filters = settings.filters;
    assert!(filters.len() <= FILTERS);
    can.apply_config(
        FdCanConfig::default()
            .set_nominal_bit_timing(settings.timing.0)
            .set_frame_transmit(FrameTransmissionConfig::ClassicCanOnly)
            .set_global_filter(GlobalFilter::reject_all()),
    );
    for (index, filter) in filters.iter().enumerate() {
        // SAFETY: the clock is on since the controller was taken; the number of
        // filters was checked; the controller does not run yet.
        unsafe { message_ram::write_filter(controller, index, filter) };
    }
    can.enable_interrupts(
        Interrupts::RX_FIFO0_NEW_MSG
            | Interrupts::RX_FIFO0_MSG_LOST
            | Interrupts::RX_FIFO1_NEW_MSG
            | Interrupts::RX_FIFO1_MSG_LOST
            | Interrupts::TX_COMPLETE
            | Interrupts::ERR_PASSIVE
            | Interrupts::WARNING_STATUS
            | Interrupts::BUS_OFF,
    );
    let registers = registers(controller);
    // The completion of any of the three buffers raises TX_COMPLETE.
    // SAFETY: the enable bits of the three buffers.
    registers
        .txbtie()
        .write(|w| unsafe { w.bits((1 << DEPTH) - 1) });
    // Line 0, by register: the crate has the two enable bits swapped. ILS was
    // left 0 above, which routes every group there.
    registers.ile().write(|w| w.eint0().set_bit());
    // Time stamps are TIM3's count: the microseconds of the period.
    // SAFETY: one of the three sources.
    registers
        .tscc()
        .write(|w| unsafe { w.bits(TIME_STAMPS_BY_TIM3) });
    start(registers);
}

const TIME_STAMPS_BY_TIM3: u32 = 0b10;

/// Leaves configuration mode. Not by the crate's `into_normal`: that applies the
/// configuration anew from a copy that lacks the global filter, and every frame
/// that no filter wants, extended and remote ones too, would end in FIFO 0.
fn start(registers: &RegisterBlock) {
    let control = registers.cccr();
    control.modify(|_, w| w.cce().clear_bit());
    control.modify(|_, w| w.init().clear_bit());
    while control.read().init().bit_is_set() {}
}

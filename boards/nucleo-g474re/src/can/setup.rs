//! Configuration: bit timing, filters, interrupts.

use super::{FILTERS, RangeFilter, Rx, Tx, registers};
use crate::message_ram::{self, DEPTH};
use core::num::{NonZeroU8, NonZeroU16};
use fdcan::{
    config::{FdCanConfig, FrameTransmissionConfig, GlobalFilter, NominalBitTiming},
    interrupt::Interrupts,
};
use stm32g4xx_hal::{
    can::CanExt,
    gpio::{AF9, PA11, PA12},
    pac,
    rcc::Rcc,
};

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

/// # Panics
///
/// If there are more than [`FILTERS`] filters, or the controller is not the
/// one that is expected.
pub(crate) fn setup(
    peripheral: pac::FDCAN1,
    tx: PA12<AF9>,
    rx: PA11<AF9>,
    rcc: &mut Rcc,
    timing: BitTiming,
    filters: &[RangeFilter],
) -> (Tx, Rx) {
    assert!(filters.len() <= FILTERS);
    let mut can = peripheral.fdcan(tx, rx, rcc);
    can.apply_config(
        FdCanConfig::default()
            .set_nominal_bit_timing(timing.0)
            .set_frame_transmit(FrameTransmissionConfig::ClassicCanOnly)
            .set_global_filter(GlobalFilter::reject_all()),
    );
    for (index, filter) in filters.iter().enumerate() {
        // SAFETY: the clock is on since `fdcan`; the number of filters was
        // checked; the controller does not run yet.
        unsafe { message_ram::write_filter(index, filter) };
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
    // The completion of any of the three buffers raises TX_COMPLETE.
    // SAFETY: the enable bits of the three buffers.
    registers()
        .txbtie()
        .write(|w| unsafe { w.bits((1 << DEPTH) - 1) });
    // Line 0, by register: the crate has the two enable bits swapped. ILS was
    // left 0 above, which routes every group there.
    registers().ile().write(|w| w.eint0().set_bit());
    start();
    (
        Tx {
            identifiers: [0; DEPTH],
        },
        Rx { _configured: can },
    )
}

/// Leaves configuration mode. Not by the crate's `into_normal`: that applies the
/// configuration anew from a copy that lacks the global filter, and every frame
/// that no filter wants, extended and remote ones too, would end in FIFO 0.
fn start() {
    let control = registers().cccr();
    control.modify(|_, w| w.cce().clear_bit());
    control.modify(|_, w| w.init().clear_bit());
    while control.read().init().bit_is_set() {}
}

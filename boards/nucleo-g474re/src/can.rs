//! FDCAN1: the fdcan crate configures it, the way of each frame is
//! here.
//!
//! Not through that crate's own transmit and receive calls: they turn a frame
//! without data into a remote frame, drop a frame when the buffers are full, and
//! take hundreds of cycles where the SYNC has 170.

mod element;
mod setup;

pub use element::{Element, RxElement};
pub use setup::BitTiming;
pub(crate) use setup::setup;

use crate::message_ram::{self, DEPTH};
use embedded_can::StandardId;
use stm32g4xx_hal::{
    can::Can,
    pac::{self, fdcan::RegisterBlock},
};

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

fn registers() -> &'static RegisterBlock {
    // SAFETY: FDCAN1's registers exist for the whole run, all accesses to them
    // are volatile, and who may write which is divided below: `Tx` owns the
    // TX* registers and CCCR, `Rx` all others. Each of them exists once, made by `setup`,
    // which consumed the peripheral.
    unsafe { &*pac::FDCAN1::ptr() }
}

/// Why a frame was not accepted for transmission.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransmitError {
    /// All three buffers hold frames.
    Full,
}

/// The transmitting half.
///
/// The controller sends the frame with the lowest identifier first. Frames with
/// *equal* identifiers would go by buffer number, so never have two of them
/// here: [`Tx::holds`].
pub struct Tx {
    /// The identifier that each buffer was last filled with.
    identifiers: [u16; DEPTH],
}

impl Tx {
    /// Requests the transmission of `element`.
    ///
    /// # Errors
    ///
    /// [`TransmitError::Full`]: nothing was changed.
    #[inline(always)]
    pub fn transmit(&mut self, element: &Element) -> Result<(), TransmitError> {
        let status = registers().txfqs().read();
        if status.tfqf().bit_is_set() {
            return Err(TransmitError::Full);
        }
        let index = status.tfqpi().bits() as usize;
        let Some(identifier) = self.identifiers.get_mut(index) else {
            return Err(TransmitError::Full);
        };
        *identifier = element.identifier();
        // SAFETY: the clock was switched on by `setup`; the index was checked
        // against three above; the put index names a buffer without a request;
        // `&mut self` is the only way to Tx buffers.
        unsafe { message_ram::write_tx(index, element) };
        // SAFETY: a request bit of a buffer that has just been filled.
        registers().txbar().write(|w| unsafe { w.bits(1 << index) });
        Ok(())
    }

    /// The buffers that wait to be sent, as a mask.
    #[inline(always)]
    fn waiting(&self) -> u32 {
        // A request shows in TXBRP only when the controller's scan is done.
        registers().txbrp().read().bits() | registers().txbar().read().bits()
    }

    /// Whether a frame with this identifier waits to be sent.
    #[inline(always)]
    pub fn holds(&self, identifier: StandardId) -> bool {
        let waiting = self.waiting();
        if waiting == 0 {
            // The way of almost every SYNC.
            return false;
        }
        let raw = identifier.as_raw();
        let mut found = false;
        for (index, held) in self.identifiers.iter().enumerate() {
            found |= waiting & (1 << index) != 0 && *held == raw;
        }
        found
    }

    /// The identifiers of the frames that wait to be sent; [`FREE`] for a buffer
    /// without one.
    #[inline(always)]
    pub fn pending(&self) -> [u16; BUFFERS] {
        let mut waiting = self.waiting();
        let mut pending = [FREE; BUFFERS];
        for (place, held) in pending.iter_mut().zip(&self.identifiers) {
            if waiting & 1 != 0 {
                *place = *held;
            }
            waiting >>= 1;
        }
        pending
    }

    /// Takes back every frame that has not started, so that none goes out late:
    /// for use after bus-off.
    pub fn cancel_all(&mut self) {
        // SAFETY: cancel bits of the three buffers.
        registers()
            .txbcr()
            .write(|w| unsafe { w.bits((1 << DEPTH) - 1) });
    }

    /// Lets the controller take part in the traffic again after bus-off, as soon
    /// as the bus was idle 129 times (ISO 11898-1). Nothing that waited to be sent
    /// before is left.
    pub fn restart(&mut self) {
        let control = registers().cccr();
        // Bus-off has set INIT; setting CCE forgets all requests.
        control.modify(|_, w| w.init().set_bit());
        while control.read().init().bit_is_clear() {}
        control.modify(|_, w| w.cce().set_bit());
        control.modify(|_, w| w.cce().clear_bit());
        control.modify(|_, w| w.init().clear_bit());
    }
}

/// The controller's error state (ISO 11898-1, fault confinement).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

const FLAG_FIFO_0_LOST: u32 = 1 << 2;
const FLAG_FIFO_1_LOST: u32 = 1 << 5;
const FLAG_ERROR_PASSIVE: u32 = 1 << 17;
const FLAG_ERROR_WARNING: u32 = 1 << 18;
const FLAG_BUS_OFF: u32 = 1 << 19;

impl Flags {
    /// A frame found its receive FIFO full and was lost.
    pub fn message_lost(self) -> bool {
        self.0 & (FLAG_FIFO_0_LOST | FLAG_FIFO_1_LOST) != 0
    }

    /// The error state changed: see [`Rx::error_state`].
    pub fn error_state_changed(self) -> bool {
        self.0 & (FLAG_ERROR_PASSIVE | FLAG_ERROR_WARNING | FLAG_BUS_OFF) != 0
    }
}

/// The receiving half, which also tells what the controller has to report.
pub struct Rx {
    /// Proof that the controller is configured and nobody else's.
    _configured: fdcan::FdCan<Can<pac::FDCAN1>, fdcan::ConfigMode>,
}

impl Rx {
    /// Reads and clears the interrupt flags. To be called before the FIFOs are
    /// drained, so that a frame that comes meanwhile raises the interrupt again.
    #[inline(always)]
    pub fn take_flags(&mut self) -> Flags {
        let flags = registers().ir().read().bits();
        // SAFETY: ones clear exactly the flags that were read.
        registers().ir().write(|w| unsafe { w.bits(flags) });
        Flags(flags)
    }

    /// The next frame of a FIFO, with the index of the filter that let it in.
    #[inline(always)]
    pub fn receive(&mut self, fifo: Fifo) -> Option<RxElement> {
        let (level, index) = match fifo {
            Fifo::Fifo0 => {
                let status = registers().rxf0s().read();
                (status.f0fl().bits(), status.f0gi().bits())
            }
            Fifo::Fifo1 => {
                let status = registers().rxf1s().read();
                (status.f1fl().bits(), status.f1gi().bits())
            }
        };
        if level == 0 || usize::from(index) >= DEPTH {
            return None;
        }
        // SAFETY: the clock was switched on by `setup`; the index was checked
        // against three; the FIFO is not empty, so its get index names a frame.
        let element = unsafe { message_ram::read_rx(fifo, index.into()) };
        // SAFETY: acknowledges the element that has just been read.
        match fifo {
            Fifo::Fifo0 => registers()
                .rxf0a()
                .write(|w| unsafe { w.bits(index.into()) }),
            Fifo::Fifo1 => registers()
                .rxf1a()
                .write(|w| unsafe { w.bits(index.into()) }),
        };
        Some(element)
    }

    /// The error state.
    pub fn error_state(&self) -> ErrorState {
        let status = registers().psr().read();
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

    /// The transmit and the receive error counter.
    pub fn error_counters(&self) -> (u8, u8) {
        let counters = registers().ecr().read();
        (counters.tec().bits(), counters.rec().bits())
    }
}

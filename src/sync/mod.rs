//! SYNC: its COB-ID, counter and frame (CiA 301, 7.2.5, 7.5.2.5 .. 7.5.2.7,
//! 7.5.2.22).

mod parameters;

pub use parameters::{SyncLimits, SyncParameters};

use crate::frame::Frame;
use crate::id::CobId;
use crate::sdo::AbortCode;

/// COB-ID of the SYNC, object 1005h (CiA 301, 7.5.2.5).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SyncCobId(pub u32);

impl SyncCobId {
    const PRODUCER: u32 = 1 << 30;
    const EXTENDED: u32 = 1 << 29;
    const ID_MASK: u32 = 0x7FF;

    /// The predefined identifier 080h, as a consumer.
    pub const DEFAULT: SyncCobId = SyncCobId(CobId::SYNC.get() as u32);

    /// Whether the device generates SYNCs: bit 30.
    pub const fn is_producer(self) -> bool {
        self.0 & SyncCobId::PRODUCER != 0
    }

    /// The same with bit 30 set or cleared.
    pub const fn producer(self, on: bool) -> SyncCobId {
        SyncCobId(if on {
            self.0 | SyncCobId::PRODUCER
        } else {
            self.0 & !SyncCobId::PRODUCER
        })
    }

    /// The identifier; `None` if it is an extended one.
    pub const fn id(self) -> Option<CobId> {
        if self.0 & SyncCobId::EXTENDED != 0 {
            return None;
        }
        CobId::new((self.0 & SyncCobId::ID_MASK) as u16)
    }
}

/// The SYNC counter (CiA 301, 7.2.5.3.1) with its overflow value, object 1019h
/// (CiA 301, 7.5.2.22).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SyncCounter {
    overflow: u8,
    last: u8,
}

impl SyncCounter {
    /// SYNC without a data byte: overflow value 0.
    pub const NONE: SyncCounter = SyncCounter {
        overflow: 0,
        last: 0,
    };
    const OVERFLOW_MIN: u8 = 2;
    const OVERFLOW_MAX: u8 = 240;

    /// Counts 1..=`overflow`, or not at all if it is 0.
    ///
    /// # Errors
    /// 06090030h for 1 and 241..=255; 08000022h while `period`, object 1006h
    /// in microseconds, is not 0.
    pub const fn new(overflow: u8, period: u32) -> Result<SyncCounter, AbortCode> {
        if period != 0 {
            return Err(AbortCode::DEVICE_STATE);
        }
        match overflow {
            0 | SyncCounter::OVERFLOW_MIN..=SyncCounter::OVERFLOW_MAX => {
                Ok(SyncCounter { overflow, last: 0 })
            }
            _ => Err(AbortCode::VALUE_RANGE),
        }
    }

    /// The value of 1019h.
    pub const fn overflow(&self) -> u8 {
        self.overflow
    }

    /// Starts again with 1: NMT stopped clears the counter.
    pub fn reset(&mut self) {
        self.last = 0;
    }

    /// What the next SYNC carries; `None`: no data.
    #[inline]
    pub fn count(&mut self) -> Option<u8> {
        if self.overflow == 0 {
            return None;
        }
        self.last = if self.last >= self.overflow {
            1
        } else {
            self.last + 1
        };
        Some(self.last)
    }

    /// The next SYNC: a data frame, without data if there is no counter.
    pub fn frame(&mut self, id: CobId) -> Frame {
        match self.count() {
            // One byte always fits.
            Some(count) => Frame::data_frame(id, &[count]).unwrap_or(Frame::empty(id)),
            None => Frame::empty(id),
        }
    }
}

/// A received SYNC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Sync {
    /// Without data.
    Plain,
    /// With a counter.
    Counted(u8),
    /// With more than one byte: reported as emergency 8240h.
    WrongLength(u8),
}

impl Sync {
    /// `None` unless `frame` is a data frame with the identifier `id`.
    pub fn decode(frame: &Frame, id: CobId) -> Option<Sync> {
        if frame.id() != id || frame.is_remote() {
            return None;
        }
        Some(match *frame.data() {
            [] => Sync::Plain,
            [counter] => Sync::Counted(counter),
            _ => Sync::WrongLength(frame.dlc()),
        })
    }

    /// The counter, if there is one.
    pub const fn counter(self) -> Option<u8> {
        match self {
            Sync::Counted(counter) => Some(counter),
            _ => None,
        }
    }
}

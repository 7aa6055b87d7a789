//! TIME: time of day on the bus (CiA 301, 7.2.6, 7.5.2.15).

mod producer;

pub use producer::{Clock, Producer};

use crate::frame::Frame;
use crate::id::CobId;
use crate::sdo::AbortCode;

/// The bytes of TIME_OF_DAY.
const SIZE: usize = 6;
/// 28 bits of milliseconds.
const MS_MASK: u32 = 0x0FFF_FFFF;
/// A day.
pub(crate) const MS_PER_DAY: u32 = 86_400_000;

/// TIME_OF_DAY (CiA 301, 7.1.6.5).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TimeOfDay {
    /// Days since 1984-01-01.
    pub days: u16,
    /// Milliseconds after midnight, below 86 400 000.
    pub ms: u32,
}

impl TimeOfDay {
    /// `None` if `ms` is a day or more.
    pub const fn new(days: u16, ms: u32) -> Option<TimeOfDay> {
        if ms < MS_PER_DAY {
            Some(TimeOfDay { days, ms })
        } else {
            None
        }
    }

    /// The time this much later, at most a day. 65536 days end in 2163; then the
    /// count starts again, as it does on the wire.
    const fn after_ms(self, ms: u32) -> TimeOfDay {
        let ms = self.ms + ms;
        if ms < MS_PER_DAY {
            return TimeOfDay { ms, ..self };
        }
        TimeOfDay {
            days: self.days.wrapping_add(1),
            ms: ms - MS_PER_DAY,
        }
    }

    /// As it stands on the wire and in the object dictionary.
    pub const fn encode(self) -> [u8; SIZE] {
        let [a, b, c, d, low, high, ..] = self.number().to_le_bytes();
        [a, b, c, d, low, high]
    }

    /// Its bytes as a little-endian number.
    pub(crate) const fn number(self) -> u64 {
        (self.days as u64) << u32::BITS | (self.ms & MS_MASK) as u64
    }

    /// As [`decode`](Self::decode), from the first bytes of a little-endian number.
    pub(crate) const fn of_number(number: u64) -> Option<TimeOfDay> {
        TimeOfDay::new((number >> u32::BITS) as u16, number as u32 & MS_MASK)
    }

    /// `None` if the milliseconds are a day or more. The four reserved bits are
    /// ignored.
    pub const fn decode(bytes: [u8; SIZE]) -> Option<TimeOfDay> {
        let [a, b, c, d, low, high] = bytes;
        TimeOfDay::of_number(u64::from_le_bytes([a, b, c, d, low, high, 0, 0]))
    }

    /// The frame to send.
    pub fn frame(self, id: CobId) -> Frame {
        Frame::of_padded(id, SIZE as u8, self.number().to_le_bytes())
    }

    /// `None` unless `frame` is a data frame of six bytes with the identifier
    /// `id` and a time that exists.
    pub fn from_frame(frame: &Frame, id: CobId) -> Option<TimeOfDay> {
        if frame.id() != id || frame.data().len() != SIZE {
            return None;
        }
        TimeOfDay::of_number(u64::from_le_bytes(frame.padded()))
    }
}

/// COB-ID of TIME, object 1012h (CiA 301, 7.5.2.15).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TimeCobId(pub u32);

impl TimeCobId {
    const CONSUMER: u32 = 1 << 31;
    const PRODUCER: u32 = 1 << 30;
    const ID_MASK: u32 = 0x7FF;

    /// The predefined identifier 100h, neither produced nor consumed.
    pub const DEFAULT: TimeCobId = TimeCobId(CobId::TIME.get() as u32);

    /// Whether the device takes its time from the bus: bit 31.
    pub const fn is_consumer(self) -> bool {
        self.0 & TimeCobId::CONSUMER != 0
    }

    /// Whether the device sends the time: bit 30.
    pub const fn is_producer(self) -> bool {
        self.0 & TimeCobId::PRODUCER != 0
    }

    /// The identifier; `None` if it is an extended one.
    pub const fn id(self) -> Option<CobId> {
        let flags = TimeCobId::CONSUMER | TimeCobId::PRODUCER;
        if self.0 & !(flags | TimeCobId::ID_MASK) != 0 {
            return None;
        }
        CobId::new((self.0 & TimeCobId::ID_MASK) as u16)
    }

    /// Whether `self` may replace `old`: no extended or restricted identifier,
    /// and the identifier does not change while the device produces or consumes
    /// TIME before and after.
    ///
    /// # Errors
    /// 06090030h.
    pub fn may_replace(self, old: TimeCobId) -> Result<(), AbortCode> {
        let id = self.id().ok_or(AbortCode::VALUE_RANGE)?;
        let in_use = |cob_id: TimeCobId| cob_id.is_producer() || cob_id.is_consumer();
        let moved = in_use(self) && in_use(old) && Some(id) != old.id();
        if moved || id.is_restricted() {
            Err(AbortCode::VALUE_RANGE)
        } else {
            Ok(())
        }
    }
}

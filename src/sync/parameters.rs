//! The parameters of the SYNC as the object dictionary has them: 1005h, 1006h,
//! 1007h, 1019h (CiA 301, 7.5.2.5 .. 7.5.2.7, 7.5.2.22).

use super::{SyncCobId, SyncCounter};
use crate::sdo::AbortCode;

/// What a device can do, in microseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SyncLimits {
    /// The shortest period that it can keep.
    pub shortest_period: u32,
    /// The longest period that its timers can count.
    pub longest_period: u32,
    /// The shortest window in which its synchronous PDOs are sent.
    pub shortest_window: u32,
}

impl SyncLimits {
    /// A device that can do anything.
    pub const NONE: SyncLimits = SyncLimits {
        shortest_period: 0,
        longest_period: u32::MAX,
        shortest_window: 0,
    };
}

/// COB-ID, period, window and counter of the SYNC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SyncParameters {
    cob_id: SyncCobId,
    period: u32,
    window: u32,
    overflow: u8,
}

impl SyncParameters {
    /// SYNC on the predefined identifier every `period` microseconds, not yet
    /// produced, without counter or window.
    pub const fn new(period: u32) -> SyncParameters {
        SyncParameters {
            cob_id: SyncCobId::DEFAULT,
            period,
            window: 0,
            overflow: 0,
        }
    }

    /// The parameters with these values of 1005h, 1006h, 1007h and 1019h, each of
    /// which was accepted.
    pub(crate) const fn of(
        cob_id: SyncCobId,
        period: u32,
        window: u32,
        overflow: u8,
    ) -> SyncParameters {
        SyncParameters {
            cob_id,
            period,
            window,
            overflow,
        }
    }

    /// 1005h.
    pub const fn cob_id(&self) -> SyncCobId {
        self.cob_id
    }

    /// 1006h, microseconds; 0: no SYNC.
    pub const fn period(&self) -> u32 {
        self.period
    }

    /// 1007h, microseconds after the SYNC; 0: no window.
    pub const fn window(&self) -> u32 {
        self.window
    }

    /// 1019h.
    pub const fn overflow(&self) -> u8 {
        self.overflow
    }

    /// Whether SYNCs are to be sent: bit 30 of 1005h is set and 1006h is not 0.
    pub const fn is_producing(&self) -> bool {
        self.cob_id.is_producer() && self.period != 0
    }

    /// A counter that begins with 1.
    pub const fn counter(&self) -> SyncCounter {
        match SyncCounter::new(self.overflow, 0) {
            Ok(counter) => counter,
            Err(_) => SyncCounter::NONE,
        }
    }

    /// Writes 1005h: bit 30 switches the producer. The identifier is the
    /// predefined one, for that is what the nodes of the network listen to.
    ///
    /// # Errors
    /// 06090030h for another identifier or a reserved bit.
    pub fn set_cob_id(&mut self, cob_id: SyncCobId) -> Result<(), AbortCode> {
        if cob_id.producer(false) != SyncCobId::DEFAULT {
            return Err(AbortCode::VALUE_RANGE);
        }
        self.cob_id = cob_id;
        Ok(())
    }

    /// Writes 1006h; 0 stops the SYNC.
    ///
    /// # Errors
    /// 06090032h or 06090031h for a period that the device cannot keep; 06040043h
    /// for one that ends before the window does.
    pub fn set_period(&mut self, period: u32, limits: &SyncLimits) -> Result<(), AbortCode> {
        if period == 0 {
            self.period = 0;
            return Ok(());
        }
        if period < limits.shortest_period {
            return Err(AbortCode::VALUE_TOO_LOW);
        }
        if period > limits.longest_period {
            return Err(AbortCode::VALUE_TOO_HIGH);
        }
        if self.window > period {
            return Err(AbortCode::PARAMETER_INCOMPATIBLE);
        }
        self.period = period;
        Ok(())
    }

    /// Writes 1007h; 0: no window.
    ///
    /// # Errors
    /// 06090031h for a window longer than the period, 06090032h for one that ends
    /// before the device has sent its PDOs.
    pub fn set_window(&mut self, window: u32, limits: &SyncLimits) -> Result<(), AbortCode> {
        if window != 0 && window < limits.shortest_window {
            return Err(AbortCode::VALUE_TOO_LOW);
        }
        if self.period != 0 && window > self.period {
            return Err(AbortCode::VALUE_TOO_HIGH);
        }
        self.window = window;
        Ok(())
    }

    /// Writes 1019h.
    ///
    /// # Errors
    /// 08000022h while 1006h is not 0; 06090030h for 1 and above 240.
    pub fn set_overflow(&mut self, overflow: u32) -> Result<(), AbortCode> {
        let overflow = u8::try_from(overflow).map_err(|_| AbortCode::VALUE_RANGE)?;
        self.overflow = SyncCounter::new(overflow, self.period)?.overflow();
        Ok(())
    }
}

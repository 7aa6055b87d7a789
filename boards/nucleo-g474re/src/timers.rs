//! Timers, programmed register by register: the HAL's count-down timer loads one
//! tick too many and uses 16 bits only.

use crate::CORE_HZ;
use stm32g4xx_hal::pac;

const MICROSECONDS_PER_SECOND: u32 = 1_000_000;
/// Ticks of the core's clock in a microsecond.
const TICKS_PER_US: u32 = CORE_HZ / MICROSECONDS_PER_SECOND;
/// The prescaler that makes a timer count microseconds.
const MICROSECOND_PRESCALER: u16 = (TICKS_PER_US - 1) as u16;
const TICK_US: u32 = 1000;

/// TIM2: an update event at the start of each period, to the clock tick.
pub struct Period(pac::TIM2);

impl Period {
    /// Acknowledges the update event.
    #[inline(always)]
    pub fn acknowledge(&mut self) {
        self.0.sr().write(|w| w.uif().clear());
    }
}

/// TIM3: counts the microseconds of the period; a compare event at the deadline.
pub struct Deadline(pac::TIM3);

impl Deadline {
    /// Whether the deadline of *this* period has passed since the last call. A
    /// compare event that was not looked at before its period was over is
    /// forgotten.
    pub fn take(&mut self) -> bool {
        if self.0.sr().read().cc1if().bit_is_clear() {
            return false;
        }
        self.0.sr().write(|w| w.cc1if().clear_bit());
        self.elapsed_us() >= self.0.ccr1().read().ccr().bits() as u16
    }

    /// Whether the second event has come since the last call.
    pub fn take_second(&mut self) -> bool {
        let come = self.0.sr().read().cc2if().bit_is_set();
        if come {
            self.0.sr().write(|w| w.cc2if().clear_bit());
        }
        come
    }

    /// Microseconds since the period began.
    pub fn elapsed_us(&self) -> u16 {
        self.0.cnt().read().cnt().bits()
    }
}

/// Where in the period it is, by TIM3. May be copied: it only reads.
#[derive(Clone, Copy)]
pub struct Phase(());

impl Phase {
    /// Microseconds since the period began.
    #[inline(always)]
    pub fn elapsed_us(self) -> u32 {
        // SAFETY: reading the counter has no effect on it. A `Phase` exists only
        // after TIM3's clock was switched on.
        unsafe { (*pac::TIM3::ptr()).cnt().read().bits() }
    }

    /// Cycles of the core since the period began, by TIM2.
    #[inline(always)]
    pub fn ticks(self) -> u32 {
        // SAFETY: as above, of TIM2.
        unsafe { (*pac::TIM2::ptr()).cnt().read().bits() }
    }

    /// Cycles of the core since [`ticks`](Phase::ticks) were `begun`, less than a
    /// period ago.
    #[inline(always)]
    pub fn ticks_since(self, begun: u32) -> u32 {
        let now = self.ticks();
        let passed = now.wrapping_sub(begun);
        if now >= begun {
            return passed;
        }
        // SAFETY: as above.
        let last = unsafe { (*pac::TIM2::ptr()).arr().read().bits() };
        passed.wrapping_add(last).wrapping_add(1)
    }

    /// Microseconds until it ends.
    #[inline(always)]
    pub fn left_us(self) -> u32 {
        // SAFETY: as above.
        let last = unsafe { (*pac::TIM3::ptr()).arr().read().bits() };
        (last + 1).saturating_sub(self.elapsed_us())
    }
}

/// Changes the period of [`Period`] and [`Deadline`] together.
pub struct SyncPeriod(());

/// Ticks around the end of a period in which its length is left alone.
const NEAR_THE_END: u32 = 50 * TICKS_PER_US;

impl SyncPeriod {
    /// From the next period on it takes `us` microseconds, which have to be more
    /// than the deadline: less is left alone. Waits some microseconds if a period
    /// is about to end.
    pub fn set_us(&mut self, us: u16) {
        // SAFETY: only the preload registers are written, each with one aligned
        // access, and nobody else writes them after `setup`.
        let (tim2, tim3) = unsafe { (&*pac::TIM2::ptr(), &*pac::TIM3::ptr()) };
        if u32::from(us) <= tim3.ccr1().read().ccr().bits() {
            return;
        }
        let write = |_: &cortex_m::interrupt::CriticalSection| {
            // Both have to take it over at the end of the same period.
            let left = tim2
                .arr()
                .read()
                .bits()
                .wrapping_sub(tim2.cnt().read().bits());
            if left < NEAR_THE_END {
                return false;
            }
            tim2.arr()
                .write(|w| w.arr().set(u32::from(us) * TICKS_PER_US - 1));
            tim3.arr().write(|w| w.arr().set(u32::from(us) - 1));
            true
        };
        while !cortex_m::interrupt::free(write) {}
    }
}

/// TIM7: an update event every millisecond.
pub struct Tick(pac::TIM7);

impl Tick {
    /// Acknowledges the update event.
    pub fn acknowledge(&mut self) {
        self.0.sr().write(|w| w.uif().clear_bit());
    }
}

/// TIM5: microseconds since the start, modulo 2^32. May be copied: it only
/// reads.
#[derive(Clone, Copy)]
pub struct Microseconds(());

impl Microseconds {
    /// Microseconds since the start, modulo 2^32.
    #[inline(always)]
    pub fn now(self) -> u32 {
        // SAFETY: reading the counter has no effect on it and cannot tear: one
        // aligned 32-bit access. A `Microseconds` exists only after TIM5's
        // clock was switched on, and nobody else holds the peripheral.
        unsafe { (*pac::TIM5::ptr()).cnt().read().bits() }
    }
}

pub(crate) struct Peripherals {
    pub(crate) tim2: pac::TIM2,
    pub(crate) tim3: pac::TIM3,
    pub(crate) tim5: pac::TIM5,
    pub(crate) tim7: pac::TIM7,
}

pub(crate) struct Timers {
    pub(crate) period: Period,
    pub(crate) deadline: Deadline,
    pub(crate) sync_period: SyncPeriod,
    pub(crate) phase: Phase,
    pub(crate) tick: Tick,
    pub(crate) microseconds: Microseconds,
}

/// Their clocks are on, and they are as the reset made them.
///
/// # Panics
///
/// If `period_us` is 0 or `deadline_us` does not lie within the period.
pub(crate) fn setup(p: Peripherals, period_us: u16, deadline_us: u16, second_us: u16) -> Timers {
    assert!(period_us > 0 && deadline_us < period_us);
    // URS everywhere: the forced update that loads the prescaler raises no flag.
    // ARPE: a new period begins when the old one has ended.
    p.tim2
        .cr1()
        .write(|w| w.urs().counter_only().arpe().enabled());
    p.tim2.psc().write(|w| w.psc().set(0));
    p.tim2
        .arr()
        .write(|w| w.arr().set(u32::from(period_us) * TICKS_PER_US - 1));
    p.tim2.egr().write(|w| w.ug().update());
    p.tim2.dier().write(|w| w.uie().enabled());

    p.tim3
        .cr1()
        .write(|w| w.urs().counter_only().arpe().enabled());
    p.tim3.psc().write(|w| w.psc().set(MICROSECOND_PRESCALER));
    p.tim3
        .arr()
        .write(|w| w.arr().set(u32::from(period_us) - 1));
    p.tim3.ccr1().write(|w| w.ccr().set(deadline_us.into()));
    p.tim3.egr().write(|w| w.ug().update());
    p.tim3.ccr2().write(|w| w.ccr().set(second_us.into()));
    p.tim3
        .dier()
        .write(|w| w.cc1ie().enabled().cc2ie().bit(second_us != 0));

    p.tim5.cr1().write(|w| w.urs().counter_only());
    p.tim5.psc().write(|w| w.psc().set(MICROSECOND_PRESCALER));
    p.tim5.arr().write(|w| w.arr().set(u32::MAX));
    p.tim5.egr().write(|w| w.ug().update());

    p.tim7.cr1().write(|w| w.urs().counter_only());
    p.tim7.psc().write(|w| w.psc().set(MICROSECOND_PRESCALER));
    p.tim7.arr().write(|w| w.arr().set(TICK_US - 1));
    p.tim7.egr().write(|w| w.ug().update());
    p.tim7.dier().write(|w| w.uie().enabled());

    // TIM2 and TIM3 start within a few ticks of each other and run on one
    // clock, so they stay that close for ever.
    p.tim5.cr1().modify(|_, w| w.cen().enabled());
    p.tim7.cr1().modify(|_, w| w.cen().enabled());
    p.tim2.cr1().modify(|_, w| w.cen().enabled());
    p.tim3.cr1().modify(|_, w| w.cen().enabled());

    Timers {
        period: Period(p.tim2),
        deadline: Deadline(p.tim3),
        sync_period: SyncPeriod(()),
        phase: Phase(()),
        tick: Tick(p.tim7),
        microseconds: Microseconds(()),
    }
}

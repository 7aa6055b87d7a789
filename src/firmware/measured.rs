//! What the firmware measures of itself: 2F20h, and the log.
//!
//! When a SYNC began the controller tells, by TIM3's count; how long a task took
//! is what TIM2 counted, with what preempted it; the CPU's load is the time that
//! it did not sleep.

use crate::{
    counters::Count,
    derived::{BUSES, NETWORK},
};
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use nucleo_g474re::timers::Phase;

/// Off in the image that shows what all this costs: `cargo xtask bench
/// self-measurement`.
pub(crate) const ON: bool = !cfg!(feature = "unmeasured");

/// A figure: the greatest since the start, or since a client began anew.
#[derive(Clone, Copy)]
#[repr(u8)]
pub(crate) enum Figure {
    /// The latest that a SYNC began after its tick, microseconds.
    Latest,
    /// From the tick until the RPDOs were handed over, microseconds.
    Cycle,
    /// Cycles of the core that a task took.
    SyncTick,
    CanIrq,
    PdoProducer,
    Network,
    /// Bits on a bus in a cycle, stuff bits left out.
    Bits,
    /// The earliest that a SYNC began: how long that was before [`NEVER`].
    Earliest,
}

const FIGURES: usize = Figure::Earliest as usize + 1;

/// No count of microseconds in a period is larger.
const NEVER: u32 = u16::MAX as u32;

static FIGURE: [AtomicU32; FIGURES] = [const { AtomicU32::new(0) }; FIGURES];
/// CPU load of the last second, per mille.
static LOAD: AtomicU32 = AtomicU32::new(0);
/// Microseconds asleep, modulo 2^32.
static ASLEEP: AtomicU32 = AtomicU32::new(0);
/// Cycles that were not taken up.
static OVERRUNS: AtomicU32 = AtomicU32::new(0);
/// Of the cycle under way.
static BITS: [AtomicU32; BUSES] = [const { AtomicU32::new(0) }; BUSES];

/// Of a frame without data, with the space behind it.
const FRAME_BITS: u32 = 47;
const PER_MILLE: u32 = 1000;
/// The bits that a cycle has.
const CYCLE_BITS: u32 = NETWORK.cycle.as_micros() * (NETWORK.bit_rate / PER_MILLE) / PER_MILLE;

fn get(figure: Figure) -> u32 {
    let value = FIGURE.get(figure as usize);
    value.map_or(0, |value| value.load(Relaxed))
}

/// A value of a figure. If two tasks give one at once the lesser may remain.
#[inline(always)]
pub(crate) fn give(figure: Figure, value: u32) {
    if ON
        && let Some(greatest) = FIGURE.get(figure as usize)
        && value > greatest.load(Relaxed)
    {
        greatest.store(value, Relaxed);
    }
}

/// A SYNC began so many microseconds after its tick, and with it a cycle of the bus.
pub(crate) fn sync_began(bus: usize, at: u16) {
    if let Some(bits) = BITS.get(bus) {
        // What came before the first SYNC was no cycle.
        if get(Figure::Earliest) != 0 {
            give(Figure::Bits, bits.load(Relaxed));
        }
        // The SYNC itself.
        bits.store(FRAME_BITS, Relaxed);
    }
    give(Figure::Latest, at.into());
    give(Figure::Earliest, NEVER - u32::from(at));
}

/// A frame of so many bytes is on a bus.
#[inline(always)]
pub(crate) fn add_bits(bus: usize, bytes: u32) {
    if ON && let Some(bits) = BITS.get(bus) {
        let more = FRAME_BITS + bytes * u8::BITS;
        bits.store(bits.load(Relaxed).wrapping_add(more), Relaxed);
    }
}

/// The cycles of the core since the period began.
#[inline(always)]
pub(crate) fn ticks(phase: Phase) -> u32 {
    if ON { phase.ticks() } else { 0 }
}

/// A task has run since it `began`, by [`ticks`].
#[inline(always)]
pub(crate) fn ran(figure: Figure, phase: Phase, began: u32) {
    if ON {
        give(figure, phase.ticks_since(began));
    }
}

/// The CPU has slept for so many microseconds in all, modulo 2^32.
#[inline(always)]
pub(crate) fn slept(us: u32) {
    ASLEEP.store(us, Relaxed);
}

/// A second is over; `asleep` is kept from one to the next.
pub(crate) fn second(asleep: &mut u32, overruns: u32) {
    let now = ASLEEP.load(Relaxed);
    let slept = now.wrapping_sub(*asleep) / PER_MILLE;
    *asleep = now;
    LOAD.store(PER_MILLE.saturating_sub(slept), Relaxed);
    OVERRUNS.store(overruns, Relaxed);
}

/// All figures begin anew.
pub(crate) fn anew() {
    for figure in &FIGURE {
        figure.store(0, Relaxed);
    }
}

/// What it is read by.
pub(crate) const INDEX: u16 = 0x2F20;

/// The entry `sub` of 2F20h.
pub(crate) fn entry(sub: u8) -> u32 {
    match sub {
        1 => (get(Figure::Latest) + get(Figure::Earliest)).saturating_sub(NEVER),
        2 => get(Figure::Latest),
        3 => get(Figure::Cycle),
        4 => get(Figure::SyncTick),
        5 => get(Figure::CanIrq),
        6 => get(Figure::PdoProducer),
        7 => get(Figure::Network),
        8 => get(Figure::Bits) * PER_MILLE / CYCLE_BITS,
        9 => LOAD.load(Relaxed),
        10 => OVERRUNS.load(Relaxed),
        11 => Count::RpdoReplaced.get(),
        12 => Count::SyncNotSent.get(),
        _ => Count::Answers.get(),
    }
}

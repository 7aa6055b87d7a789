//! What is wanted of the one planned frame that a cycle has room for.

use super::US_PER_MS;
use super::demand::Demand;
use crate::frame::{SDO_BYTES, longest_bits};

/// Frames in a cycle are counted in parts of one: so many are a frame.
pub(crate) const PARTS: u64 = 1_000_000;
/// The firmware sends RPDOs on change again at least every so many cycles, one at a
/// time, without a change: `canmaster::master::RAMPS_AGAIN`.
pub const RAMPS_AGAIN: u64 = 16;

/// Frames in a cycle, on the average, in parts of [`PARTS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Wanted {
    /// The master's heartbeat.
    pub(crate) heartbeat: u64,
    /// Requests, and answers that have the slot of a later cycle.
    pub(crate) sdo: u64,
    /// RPDOs on change while nothing changes.
    pub(crate) on_change: u64,
}

impl Wanted {
    pub(crate) fn all(&self) -> u64 {
        self.heartbeat + self.sdo + self.on_change
    }
}

impl Demand {
    /// What is wanted of the planned slot in a cycle; `None`: there is none, and frames
    /// come when they come.
    pub(crate) fn wanted(&self, cycle_us: u32) -> Option<Wanted> {
        if !self.is_planned() {
            return None;
        }
        let beat_us = u64::from(self.master_heartbeat_ms()) * u64::from(US_PER_MS);
        let slots = 1 + u64::from(self.answers_next_cycle());
        Some(Wanted {
            heartbeat: (u64::from(cycle_us) * PARTS)
                .checked_div(beat_us)
                .unwrap_or(0),
            sdo: (slots * PARTS)
                .checked_div(self.sdo_every.into())
                .unwrap_or(0),
            on_change: match self.on_change.is_empty() {
                true => 0,
                false => PARTS / RAMPS_AGAIN,
            },
        })
    }

    /// Whether the planned slot of such a cycle holds what is wanted of it.
    pub(crate) fn holds_what_is_wanted(&self, cycle_us: u32) -> bool {
        let wanted = self.wanted(cycle_us);
        wanted.is_none_or(|wanted| wanted.all() < PARTS)
    }

    fn master_heartbeat_ms(&self) -> u16 {
        self.heartbeats.first().map_or(0, |(_, ms)| *ms)
    }

    /// The longest from one heartbeat of the master to the next, in microseconds: it is
    /// due every period, or once in a cycle where that is longer, and waits for its slot,
    /// which the answer of an SDO server may have in the first cycle.
    pub(crate) fn master_beat_us(&self, cycle_us: u32) -> u32 {
        let period_us = u32::from(self.master_heartbeat_ms()) * US_PER_MS;
        let slots = 1 + u32::from(self.answers_next_cycle());
        period_us.max(cycle_us) + slots * cycle_us
    }

    /// The longest from an SDO request that the master makes to its answer, in
    /// microseconds: two cycles pass until its window, and the answer has its slot.
    pub(crate) fn exchange_us(&self, slowest_us: u32, cycle_us: u32) -> u32 {
        const FRAMES: u32 = 2;
        const CYCLES: u32 = 2;
        let frames = self.us(FRAMES * longest_bits(SDO_BYTES));
        slowest_us + frames + CYCLES * cycle_us
    }
}

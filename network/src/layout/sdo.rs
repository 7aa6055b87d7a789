//! When an SDO request may be handed over, so that neither it nor its answer is in
//! the way of the next SYNC.

use super::demand::{Demand, RpdoOrder};
use super::{Layout, NS_PER_US};
use crate::frame::{SDO_BYTES, SYNC_BYTES, longest_bits, shortest_bits};

/// When requests may be handed over, in microseconds from the start of the cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Not sooner.
    pub from_us: u32,
    /// Not later.
    pub until_us: u32,
    /// The answer comes in the cycle after that of the request.
    pub next_cycle: bool,
}

/// Longer than any cycle.
const NEVER_US: u32 = 2_000_000;
/// An interframe space, in bits.
const INTERFRAME: u32 = 3;
/// How much sooner than SYNC an answer may be ready by the clocks' differences.
const CLOCKS_US: u32 = 2;

impl Demand {
    /// Whether a planned exchange has one frame in a cycle: its request goes at the
    /// end of one, so that the answer comes in the next.
    pub fn answers_next_cycle(&self) -> bool {
        self.is_planned() && self.sdo_frames == 1
    }

    /// Until when a frame that is handed over goes directly after SYNC, ahead of all
    /// TPDOs, and has ended when the slowest is ready, in microseconds.
    pub fn after_sync_us(&self) -> u32 {
        let shortest = (self.bits_ns(shortest_bits(SYNC_BYTES)) / NS_PER_US) as u32;
        let ready = self.us(longest_bits(SYNC_BYTES)) + self.latency_us;
        let latest = ready.saturating_sub(self.us(longest_bits(SDO_BYTES)));
        (shortest + self.earliest_us).min(latest.max(shortest))
    }

    /// Whether there is any cycle that a planned exchange fits into.
    pub fn sdo_can_be_planned(&self) -> bool {
        self.least_for_sdo_us() < NEVER_US
    }

    /// The shortest cycle that a planned exchange fits into, in microseconds.
    pub(crate) fn least_for_sdo_us(&self) -> u32 {
        let (Some((least, most)), true) = (self.sdo_latency_us, self.sdo_frames > 0) else {
            return 0;
        };
        let frame = self.us(longest_bits(SDO_BYTES));
        if !self.answers_next_cycle() {
            return self.request_end_us() + most + frame + self.guard_us;
        }
        let sync = self.us(longest_bits(SYNC_BYTES));
        if self.sooner_us(least) < frame + self.guard_us {
            // The answer to the latest request would come too soon.
            return NEVER_US;
        }
        (most + frame).max(sync + self.sooner_us(least))
    }

    /// When the request of an exchange in one cycle has been sent at the latest.
    fn request_end_us(&self) -> u32 {
        let sum = |frames: &[super::demand::Cyclic]| -> u32 {
            frames.iter().map(|(_, _, n)| longest_bits(*n)).sum()
        };
        let (rpdos, ramps) = (sum(&self.rpdos), sum(&self.ramps));
        let ahead = match self.order {
            RpdoOrder::AfterTpdos => ramps,
            RpdoOrder::AfterSync => ramps + rpdos,
        };
        let request = longest_bits(SDO_BYTES);
        let sync = longest_bits(SYNC_BYTES);
        if ahead == 0 {
            return self.after_sync_us().max(self.us(sync)) + self.us(request);
        }
        // Everything else may be ready before its turn comes.
        let cyclic = sync + ramps + sum(&self.tpdos) + rpdos;
        self.latency_us + self.compute_us + self.us(cyclic + request)
    }

    /// How long before the end of a cycle a request may begin whose answer comes
    /// after it.
    fn sooner_us(&self, least: u32) -> u32 {
        // Without the interframe space: the answer's latency begins before it.
        let request = self.bits_ns(shortest_bits(SDO_BYTES) - INTERFRAME) / NS_PER_US;
        (request as u32 + least).saturating_sub(CLOCKS_US)
    }
}

impl Layout {
    /// When SDO requests may be handed over; `None`: not at all.
    pub fn sdo_window(&self) -> Option<Window> {
        let demand = &self.demand;
        if demand.sdo_frames == 0 {
            return None;
        }
        let Some((least, _)) = demand.sdo_latency_us else {
            return Some(Window {
                from_us: 0,
                until_us: self.cycle_us,
                next_cycle: false,
            });
        };
        if demand.least_for_sdo_us() > self.cycle_us {
            return None;
        }
        let next_cycle = demand.answers_next_cycle();
        let (from_us, until_us) = match next_cycle {
            true => {
                let frame = demand.us(longest_bits(SDO_BYTES));
                let until = self.cycle_us - demand.guard_us - frame;
                (self.cycle_us - demand.sooner_us(least), until)
            }
            false => (0, demand.after_sync_us()),
        };
        Some(Window {
            from_us,
            until_us,
            next_cycle,
        })
    }
}

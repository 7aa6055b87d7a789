//! The SYNC periods that a bus keeps its check with: what 1006h may become while
//! the machine runs.

use std::ops::RangeInclusive;

use crate::layout::Layout;
use crate::model::{Bus, Machine};
use crate::resolve::{CYCLE_MAX_US, CYCLE_MIN_US};

const US_PER_MS: u32 = 1000;
const MIN_US: u32 = CYCLE_MIN_US as u32;
const MAX_US: u32 = CYCLE_MAX_US as u32;

/// The last number of a range that passes a test, which those before it do, too. The
/// first, if none does.
fn last(range: RangeInclusive<u32>, passes: impl Fn(u32) -> bool) -> u32 {
    let (mut low, mut high) = range.into_inner();
    while low < high {
        let middle = low + (high - low).div_ceil(2);
        if passes(middle) {
            low = middle;
        } else {
            high = middle - 1;
        }
    }
    low
}

impl Machine {
    /// The cycles that all buses pass their check with, in microseconds, and with which
    /// every node hears the master's heartbeat in time.
    pub fn cycles(&self) -> RangeInclusive<u32> {
        let of = |bus: &Bus| bus.cycles().into_inner();
        let shortest = self.buses.iter().map(|bus| of(bus).0).max();
        let longest = self.buses.iter().map(|bus| of(bus).1).min();
        let (shortest, longest) = (shortest.unwrap_or(MIN_US), longest.unwrap_or(MAX_US));
        shortest..=last(shortest..=longest, |cycle| self.is_heard_with(cycle))
    }

    /// Whether every node hears the master's heartbeat in time.
    fn is_heard_with(&self, cycle_us: u32) -> bool {
        self.nodes.iter().all(|node| {
            let bus = self.buses.get(node.bus);
            let beat_us = bus.map_or(0, |bus| bus.layout.demand.master_beat_us(cycle_us));
            let timeout = u32::from(node.master_timeout_ms);
            timeout == 0 || beat_us.div_ceil(US_PER_MS) < timeout
        })
    }
}

impl Bus {
    /// All cycles around the described one that pass the same check, in
    /// microseconds: the frames fit, the planned ones get their turn, and the TPDOs are
    /// in before the deadline and the RPDOs out after it. A longer cycle may fail where more heartbeats fall
    /// into it.
    pub fn cycles(&self) -> RangeInclusive<u32> {
        let demand = &self.layout.demand;
        let range = self.shortest()..=self.longest();
        let holds = |cycle| demand.holds_what_is_wanted(cycle);
        *range.start()..=last(range, holds)
    }

    fn layout_of(&self, cycle_us: u32) -> Layout {
        self.layout.demand.layout(cycle_us)
    }

    /// The shortest cycle with as many heartbeats in it as in this one.
    fn least(&self, cycle_us: u32) -> u32 {
        let layout = self.layout_of(cycle_us);
        let whole = self.tpdo_deadline_us + layout.after_tpdos_us();
        layout.least_cycle_us().max(whole).max(MIN_US)
    }

    fn is_kept_with(&self, cycle_us: u32) -> bool {
        let in_time = self.layout_of(cycle_us).tpdos_us() <= self.tpdo_deadline_us;
        in_time && self.least(cycle_us) <= cycle_us
    }

    fn periods_us(&self) -> impl Iterator<Item = u32> {
        let heartbeats = self.layout.demand.heartbeats.iter();
        heartbeats
            .map(|(_, ms)| u32::from(*ms) * US_PER_MS)
            .filter(|us| *us != 0)
    }

    fn shortest(&self) -> u32 {
        let mut cycle = self.cycle_us;
        loop {
            let least = self.least(cycle);
            // The longest cycle in which there are fewer heartbeats.
            let fewer = self.periods_us().map(|us| (cycle - 1) / us * us).max();
            match fewer {
                Some(fewer) if least <= fewer + 1 && self.is_kept_with(fewer) => cycle = fewer,
                Some(fewer) => return least.max(fewer + 1),
                None => return least,
            }
        }
    }

    fn longest(&self) -> u32 {
        let mut cycle = self.cycle_us;
        loop {
            // The longest cycle in which there are no more of them.
            let same = self.periods_us().map(|us| cycle.div_ceil(us) * us).min();
            match same {
                Some(same) if same < MAX_US && self.is_kept_with(same + 1) => cycle = same + 1,
                Some(same) => return same.min(MAX_US),
                None => return MAX_US,
            }
        }
    }
}

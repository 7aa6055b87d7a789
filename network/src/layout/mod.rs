//! The cycle of a bus, slot by slot, at its worst: every frame with the most
//! stuff bits, and every node as slow as it may be.
//!
//! | time | RPDOs after the TPDOs | RPDOs after SYNC |
//! |---|---|---|
//! | | SYNC | SYNC |
//! | while the nodes prepare their TPDOs | ramps, the planned frame | all RPDOs |
//! | | TPDOs | TPDOs, then what is left of the RPDOs |
//! | | frames that come when they come | the same, the planned frame |
//! | | the master computes, its RPDOs | the master computes: for the next SYNC |
//! | | guard | guard |
//!
//! After the TPDOs, an RPDO acts one cycle after the values that it answers to;
//! after SYNC it is two cycles, but the wire is never idle in between, so that
//! more fits. Where a frame without a fixed place comes does not change the end of
//! the cycle, only what it delays.

mod demand;
mod sdo;
mod timeline;
mod wanted;

#[cfg(test)]
mod tests;

pub use demand::{Cyclic, Demand, RpdoOrder};
pub use sdo::Window;
pub(crate) use wanted::PARTS;
pub use wanted::RAMPS_AGAIN;

use crate::resolve::CYCLE_MIN_US;

/// What a slot is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlotKind {
    /// SYNC
    Sync,
    /// The rest of the slowest node's time from SYNC to its TPDOs.
    Latency,
    /// A TPDO of a node.
    Tpdo,
    /// The one frame that the master may add: an RPDO on change, an SDO frame, its
    /// heartbeat, NMT or TIME.
    Planned,
    /// A frame that comes when it comes: heartbeat, EMCY, SDO.
    Other,
    /// The master computes; the wire may be busy meanwhile.
    Compute,
    /// An RPDO of a node.
    Rpdo,
    /// The end of the cycle in which nothing may be on the wire.
    Guard,
}

/// A piece of the cycle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slot {
    /// What for.
    pub kind: SlotKind,
    /// In words.
    pub what: String,
    /// From the start of the cycle, in nanoseconds.
    pub start_ns: u64,
    /// How long, in nanoseconds.
    pub length_ns: u64,
    /// Bits on the wire; 0 where there are none.
    pub bits: u32,
}

impl Slot {
    /// From the start of the cycle, in nanoseconds.
    pub fn end_ns(&self) -> u64 {
        self.start_ns + self.length_ns
    }
}

/// A cycle of a bus.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Layout {
    /// What it was made from.
    pub demand: Demand,
    /// The cycle.
    pub cycle_us: u32,
    /// In the order of their starts.
    pub slots: Vec<Slot>,
    /// When every TPDO is there at the latest, in nanoseconds.
    tpdos_ns: u64,
}

pub(crate) const NS_PER_S: u64 = 1_000_000_000;
pub(crate) const NS_PER_US: u64 = 1000;
pub(crate) const US_PER_MS: u32 = 1000;
pub(crate) const PER_MILLE: u64 = 1000;
/// The longest cycle that is looked for: a second.
const LONGEST_US: u32 = 1_000_000;

impl Demand {
    /// The layout of a cycle.
    pub fn layout(&self, cycle_us: u32) -> Layout {
        timeline::layout(self, cycle_us)
    }

    /// The smallest cycle that fits, in microseconds, and that the firmware is made
    /// for; `None` if a second is not enough.
    pub fn smallest_cycle(&self) -> Option<u32> {
        let mut cycle = CYCLE_MIN_US as u32;
        // A longer cycle may hold more heartbeats, so it is tried again.
        while cycle <= LONGEST_US {
            let layout = self.layout(cycle);
            let least = layout.least_cycle_us();
            if least <= cycle {
                return Some(cycle);
            }
            cycle = least;
        }
        None
    }
}

impl Layout {
    /// Bits on the wire in the cycle.
    pub fn bits(&self) -> u32 {
        self.slots.iter().map(|slot| slot.bits).sum()
    }

    /// Bits that the cycle has.
    pub fn room(&self) -> u32 {
        (u64::from(self.cycle_us) * NS_PER_US / self.demand.bit_ns()) as u32
    }

    /// The part of the cycle that is taken, per mille, rounded up.
    pub fn load(&self) -> u32 {
        let bits = u64::from(self.bits()) * PER_MILLE;
        bits.div_ceil(u64::from(self.room().max(1))) as u32
    }

    /// The end of the last slot of a kind, in microseconds, rounded up.
    pub fn end_us(&self, kind: SlotKind) -> u32 {
        let ends = self.slots.iter().filter(|slot| slot.kind == kind);
        let end = ends.map(Slot::end_ns).max();
        end.unwrap_or(0).div_ceil(NS_PER_US) as u32
    }

    /// When every TPDO is there at the latest, in microseconds: a frame without
    /// a fixed place may have delayed them.
    pub fn tpdos_us(&self) -> u32 {
        self.tpdos_ns.div_ceil(NS_PER_US) as u32
    }

    /// How long the master computes and sends, guard included, in microseconds.
    /// RPDOs that wait for the next SYNC have until then.
    pub fn after_tpdos_us(&self) -> u32 {
        match self.demand.order {
            RpdoOrder::AfterTpdos => {
                let compute = self.slots.iter().find(|s| s.kind == SlotKind::Compute);
                let start = compute.map_or(self.tpdos_ns, |slot| slot.start_ns);
                self.end_us(SlotKind::Guard) - start.div_ceil(NS_PER_US) as u32
            }
            RpdoOrder::AfterSync => self.demand.compute_us,
        }
    }

    /// From a TPDO's values to the SYNC at which an RPDO that answers to them
    /// acts, in microseconds: the dead time of the control.
    pub fn dead_time_us(&self) -> u32 {
        match self.demand.order {
            RpdoOrder::AfterTpdos => self.cycle_us,
            RpdoOrder::AfterSync => 2 * self.cycle_us,
        }
    }

    /// Whether the cycle is long enough, and the load below its limit.
    pub fn fits(&self) -> bool {
        self.least_cycle_us() <= self.cycle_us
    }

    /// The shortest cycle with as many heartbeats in it.
    pub(crate) fn least_cycle_us(&self) -> u32 {
        let bits_ns = u64::from(self.bits()) * self.demand.bit_ns();
        let limit = u64::from(self.demand.load_limit.max(1));
        let by_load = (bits_ns * PER_MILLE).div_ceil(limit).div_ceil(NS_PER_US) as u32;
        by_load
            .max(self.end_us(SlotKind::Guard))
            .max(self.demand.least_for_sdo_us())
    }

    /// Whether only the place for SDO requests is missing.
    pub(crate) fn lacks_only_sdo(&self) -> bool {
        let without = Demand {
            sdo_latency_us: None,
            ..self.demand.clone()
        };
        !self.fits() && without.layout(self.cycle_us).fits()
    }

    /// The kind of slot that takes the most time, to say what to change.
    pub fn largest(&self) -> SlotKind {
        use SlotKind::{Compute, Guard, Latency, Other, Planned, Rpdo, Tpdo};
        let of = |kind| -> u64 {
            let slots = self.slots.iter().filter(|slot| slot.kind == kind);
            slots.map(|slot| slot.length_ns).sum()
        };
        [Planned, Tpdo, Rpdo, Other, Latency, Compute, Guard]
            .into_iter()
            .max_by_key(|kind| of(*kind))
            .unwrap_or(Tpdo)
    }
}

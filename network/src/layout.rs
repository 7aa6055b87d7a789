//! The cycle of a bus, slot by slot, at its worst: every frame with the most
//! stuff bits, every node as slow as it may be, and every heartbeat in the same
//! cycle.
//!
//! The order is that in which the master works: SYNC, the nodes' TPDOs, the
//! frames that come when they come, the master's computation, its RPDOs, and a
//! guard before the next SYNC. Where a frame without a fixed place comes does not
//! change the end of the cycle, only what it delays.

use crate::frame::{HEARTBEAT_BYTES, SDO_BYTES, SYNC_BYTES, longest_bits};
use crate::model::{Node, Pdo};

/// What a slot is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlotKind {
    /// SYNC
    Sync,
    /// The slowest node's time from SYNC to its TPDOs.
    Latency,
    /// A TPDO of a node.
    Tpdo,
    /// A frame that comes when it comes: heartbeat, SDO.
    Other,
    /// The master computes.
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

/// What a layout is made from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Demand {
    /// bit/s; a whole number of nanoseconds each.
    pub bit_rate: u32,
    /// The greatest part of the cycle that may be taken, per mille.
    pub load_limit: u32,
    /// From the last TPDO to the first RPDO, in microseconds.
    pub compute_us: u32,
    /// Before the next SYNC, in microseconds.
    pub guard_us: u32,
    /// SDO frames in one cycle.
    pub sdo_frames: u32,
    /// The slowest node's time from SYNC to its TPDOs, in microseconds.
    pub latency_us: u32,
    /// Producer heartbeat times, in milliseconds: who, how often.
    pub heartbeats: Vec<(String, u16)>,
    /// The PDOs of every cycle: COB-ID, whose, bytes.
    pub tpdos: Vec<(u16, String, u8)>,
    /// The same of the master's.
    pub rpdos: Vec<(u16, String, u8)>,
}

/// A cycle of a bus.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Layout {
    /// What it was made from.
    pub demand: Demand,
    /// The cycle.
    pub cycle_us: u32,
    /// In their order.
    pub slots: Vec<Slot>,
}

const NS_PER_S: u64 = 1_000_000_000;
const NS_PER_US: u64 = 1000;
const US_PER_MS: u32 = 1000;
const PER_MILLE: u64 = 1000;
/// Cycles are looked for in steps of 50 us.
const STEP_US: u32 = 50;
/// The longest cycle that is looked for: a second.
const LONGEST_US: u32 = 1_000_000;

impl Demand {
    /// The nodes of one bus and the master's heartbeat.
    pub fn of<'a>(
        nodes: impl Iterator<Item = &'a Node>,
        master_heartbeat_ms: u16,
        bit_rate: u32,
    ) -> Demand {
        let mut demand = Demand {
            bit_rate,
            load_limit: PER_MILLE as u32,
            compute_us: 0,
            guard_us: 0,
            sdo_frames: 0,
            latency_us: 0,
            heartbeats: vec![("master".to_string(), master_heartbeat_ms)],
            tpdos: Vec::new(),
            rpdos: Vec::new(),
        };
        for node in nodes {
            let of = |pdo: &Pdo| {
                let what = format!("{}{} of {}", pdo.direction.word(), pdo.number, node.name);
                (pdo.cob_id(node.id), what, pdo.bytes())
            };
            demand.tpdos.extend(node.tpdos.iter().map(of));
            demand.rpdos.extend(node.rpdos.iter().map(of));
            demand
                .heartbeats
                .push((node.name.clone(), node.heartbeat_ms));
            demand.latency_us = demand.latency_us.max(node.tpdo_latency_us);
        }
        // The order in which they win the bus.
        demand.tpdos.sort();
        demand.rpdos.sort();
        demand
    }

    fn bit_ns(&self) -> u64 {
        NS_PER_S / u64::from(self.bit_rate.max(1))
    }

    /// The layout of a cycle.
    pub fn layout(&self, cycle_us: u32) -> Layout {
        let mut slots = Vec::new();
        let mut at = 0;
        let mut add = |kind, what: String, length_ns, bits| {
            slots.push(Slot {
                kind,
                what,
                start_ns: at,
                length_ns,
                bits,
            });
            at += length_ns;
        };
        let bit = self.bit_ns();
        let us = |us: u32| u64::from(us) * NS_PER_US;
        let mut frame = |kind, what: String, bytes| {
            let bits = longest_bits(bytes);
            add(kind, what, u64::from(bits) * bit, bits);
        };
        frame(SlotKind::Sync, "SYNC".to_string(), SYNC_BYTES);
        let tpdos = &self.tpdos;
        add(
            SlotKind::Latency,
            "slowest node answers".to_string(),
            if tpdos.is_empty() {
                0
            } else {
                us(self.latency_us)
            },
            0,
        );
        let mut frame = |kind, what: String, bytes| {
            let bits = longest_bits(bytes);
            add(kind, what, u64::from(bits) * bit, bits);
        };
        for (_, what, bytes) in tpdos {
            frame(SlotKind::Tpdo, what.clone(), *bytes);
        }
        for (who, ms) in &self.heartbeats {
            let period_us = u32::from(*ms) * US_PER_MS;
            let times = if period_us == 0 {
                0
            } else {
                cycle_us.div_ceil(period_us)
            };
            for _ in 0..times {
                frame(
                    SlotKind::Other,
                    format!("heartbeat of {who}"),
                    HEARTBEAT_BYTES,
                );
            }
        }
        for _ in 0..self.sdo_frames {
            frame(SlotKind::Other, "SDO".to_string(), SDO_BYTES);
        }
        add(
            SlotKind::Compute,
            "master computes".to_string(),
            us(self.compute_us),
            0,
        );
        let mut frame = |kind, what: String, bytes| {
            let bits = longest_bits(bytes);
            add(kind, what, u64::from(bits) * bit, bits);
        };
        for (_, what, bytes) in &self.rpdos {
            frame(SlotKind::Rpdo, what.clone(), *bytes);
        }
        add(SlotKind::Guard, "guard".to_string(), us(self.guard_us), 0);
        Layout {
            demand: self.clone(),
            cycle_us,
            slots,
        }
    }

    /// The smallest cycle that fits, in microseconds, in steps of 50; `None` if
    /// a second is not enough.
    pub fn smallest_cycle(&self) -> Option<u32> {
        let mut cycle = STEP_US;
        // A longer cycle may hold more heartbeats, so it is tried again.
        while cycle <= LONGEST_US {
            let layout = self.layout(cycle);
            let least = layout.least_cycle_us().next_multiple_of(STEP_US);
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
        let end = ends.map(|slot| slot.start_ns + slot.length_ns).max();
        end.unwrap_or(0).div_ceil(NS_PER_US) as u32
    }

    /// When every TPDO is there at the latest, in microseconds: a frame without
    /// a fixed place may have delayed them.
    pub fn tpdos_us(&self) -> u32 {
        self.end_us(SlotKind::Latency)
            .max(self.end_us(SlotKind::Tpdo))
            .max(self.end_us(SlotKind::Other))
    }

    /// How long the master computes and sends, guard included, in microseconds.
    pub fn after_tpdos_us(&self) -> u32 {
        self.end_us(SlotKind::Guard) - self.tpdos_us()
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
        by_load.max(self.end_us(SlotKind::Guard))
    }

    /// The kind of slot that takes the most time, to say what to change.
    pub fn largest(&self) -> SlotKind {
        use SlotKind::{Compute, Guard, Latency, Other, Rpdo, Tpdo};
        let of = |kind| -> u64 {
            let slots = self.slots.iter().filter(|slot| slot.kind == kind);
            slots.map(|slot| slot.length_ns).sum()
        };
        [Tpdo, Rpdo, Other, Latency, Compute, Guard]
            .into_iter()
            .max_by_key(|kind| of(*kind))
            .unwrap_or(Tpdo)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn demand(axes: u16, rpdo: u8, tpdo: u8) -> Demand {
        let pdos = |base: u16, bytes| {
            (1..=axes)
                .map(|n| (base + n, format!("{n}"), bytes))
                .collect()
        };
        Demand {
            bit_rate: 1_000_000,
            load_limit: 1000,
            compute_us: 0,
            guard_us: 0,
            sdo_frames: 0,
            latency_us: 0,
            heartbeats: Vec::new(),
            tpdos: pdos(0x180, tpdo),
            rpdos: pdos(0x200, rpdo),
        }
    }

    /// The table of worst-case loads with SYNC, in tenths of a percent.
    #[test]
    fn worst_case_loads() {
        for (rpdo, tpdo, loads) in [
            (6, 6, [745, 975, 718, 1435]),
            (6, 8, [805, 1055, 778, 1555]),
            (7, 7, [805, 1055, 778, 1555]),
            (8, 8, [865, 1135, 838, 1675]),
        ] {
            let cases = [(3, 1000), (4, 1000), (6, 2000), (6, 1000)];
            let found = cases.map(|(axes, cycle)| demand(axes, rpdo, tpdo).layout(cycle).load());
            assert_eq!(found, loads);
        }
    }

    #[test]
    fn six_axes_fit_two_milliseconds_and_not_one() {
        let demand = demand(6, 6, 6);
        assert!(demand.layout(2000).fits());
        assert!(!demand.layout(1000).fits());
        assert_eq!(demand.layout(2000).bits(), 1435);
        assert_eq!(demand.smallest_cycle(), Some(1450));
        let limited = Demand {
            load_limit: 900,
            ..demand
        };
        assert_eq!(limited.smallest_cycle(), Some(1600));
    }

    #[test]
    fn slots_follow_each_other_without_a_gap() {
        let mut demand = demand(2, 8, 6);
        demand.latency_us = 250;
        demand.compute_us = 40;
        demand.guard_us = 135;
        demand.sdo_frames = 1;
        demand.heartbeats = vec![("master".to_string(), 50), ("silent".to_string(), 0)];
        let layout = demand.layout(2000);
        let mut at = 0;
        for slot in &layout.slots {
            assert_eq!(slot.start_ns, at);
            at += slot.length_ns;
        }
        assert_eq!(layout.tpdos_us(), 55 + 250 + 2 * 115 + 65 + 135);
        assert_eq!(layout.after_tpdos_us(), 40 + 2 * 135 + 135);
        assert_eq!(layout.bits(), 55 + 2 * 115 + 65 + 135 + 2 * 135);
    }

    #[test]
    fn a_cycle_longer_than_a_heartbeat_holds_two() {
        let mut demand = demand(1, 8, 8);
        demand.bit_rate = 10_000;
        demand.heartbeats = vec![("node".to_string(), 10)];
        let cycle = demand.smallest_cycle().unwrap();
        let layout = demand.layout(cycle);
        let beats = layout.slots.iter().filter(|s| s.kind == SlotKind::Other);
        assert_eq!(beats.count() as u32, cycle.div_ceil(10_000));
        assert!(layout.fits());
        demand.heartbeats = vec![("node".to_string(), 1)];
        assert_eq!(demand.smallest_cycle(), None);
    }
}

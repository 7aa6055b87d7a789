//! The slots one behind the other.

use super::demand::{Cyclic, Demand, RpdoOrder};
use super::{Layout, NS_PER_US, Slot, SlotKind};
use crate::frame::{EMCY_BYTES, SYNC_BYTES, longest_bits};

struct Timeline<'d> {
    demand: &'d Demand,
    slots: Vec<Slot>,
    /// Where the wire is free again.
    at: u64,
}

impl Timeline<'_> {
    fn add(&mut self, kind: SlotKind, what: &str, length_ns: u64, bits: u32) {
        self.slots.push(Slot {
            kind,
            what: what.to_string(),
            start_ns: self.at,
            length_ns,
            bits,
        });
        self.at += length_ns;
    }

    fn frame(&mut self, kind: SlotKind, what: &str, bytes: u8) {
        let bits = longest_bits(bytes);
        self.add(kind, what, self.demand.bits_ns(bits), bits);
    }

    fn frames(&mut self, kind: SlotKind, frames: &[Cyclic]) {
        for (_, what, bytes) in frames {
            self.frame(kind, what, *bytes);
        }
    }

    /// Nothing is on the wire until the slowest node's TPDOs are ready.
    fn wait(&mut self, until_ns: u64) {
        let idle = match self.demand.tpdos.is_empty() {
            true => 0,
            false => until_ns.saturating_sub(self.at),
        };
        self.add(SlotKind::Latency, "slowest node answers", idle, 0);
    }

    fn planned(&mut self) {
        if let Some(bytes) = self.demand.planned_bytes() {
            let what = match self.demand.is_planned() {
                true => "RPDO on change, SDO, heartbeat, NMT or TIME",
                false => "RPDO on change",
            };
            self.frame(SlotKind::Planned, what, bytes);
        }
    }

    fn others(&mut self, cycle_us: u32) {
        for (what, bytes) in self.demand.others(cycle_us) {
            self.frame(SlotKind::Other, &what, bytes);
        }
    }
}

pub(super) fn layout(demand: &Demand, cycle_us: u32) -> Layout {
    let mut line = Timeline {
        demand,
        slots: Vec::new(),
        at: 0,
    };
    line.frame(SlotKind::Sync, "SYNC", SYNC_BYTES);
    let ready = line.at + u64::from(demand.latency_us) * NS_PER_US;
    let tpdos_ns = match demand.order {
        RpdoOrder::AfterTpdos => after_tpdos(&mut line, ready, cycle_us),
        RpdoOrder::AfterSync => after_sync(&mut line, ready, cycle_us),
    };
    let guard = u64::from(demand.guard_us) * NS_PER_US;
    line.add(SlotKind::Guard, "guard", guard, 0);
    line.slots.sort_by_key(|slot| slot.start_ns);
    Layout {
        demand: demand.clone(),
        cycle_us,
        slots: line.slots,
        tpdos_ns,
    }
}

/// When the TPDOs are there.
fn after_tpdos(line: &mut Timeline<'_>, ready: u64, cycle_us: u32) -> u64 {
    let demand = line.demand;
    line.frames(SlotKind::Rpdo, &demand.ramps);
    // An answer that comes a cycle after its request may come at any time.
    let early = !demand.answers_next_cycle();
    if early {
        line.planned();
    }
    line.wait(ready);
    line.frames(SlotKind::Tpdo, &demand.tpdos);
    if !early {
        line.planned();
    }
    line.others(cycle_us);
    let tpdos = line.at;
    line.at = tpdos.max(u64::from(demand.elsewhere_us) * NS_PER_US);
    let compute = u64::from(demand.compute_us) * NS_PER_US;
    line.add(SlotKind::Compute, "master computes", compute, 0);
    line.frames(SlotKind::Rpdo, &demand.rpdos);
    tpdos
}

/// When the TPDOs are there.
fn after_sync(line: &mut Timeline<'_>, ready: u64, cycle_us: u32) -> u64 {
    let demand = line.demand;
    // All of them wait for the wire; a TPDO that is ready wins it.
    let mut waiting = demand.rpdos.iter().chain(&demand.ramps).peekable();
    while let Some((_, what, bytes)) = waiting.next_if(|_| line.at < ready) {
        line.frame(SlotKind::Rpdo, what, *bytes);
    }
    line.wait(ready);
    line.frames(SlotKind::Tpdo, &demand.tpdos);
    for (_, what, bytes) in waiting {
        line.frame(SlotKind::Rpdo, what, *bytes);
    }
    line.planned();
    line.others(cycle_us);
    let wire = line.at;
    // Only one frame that is less urgent gets before a TPDO that is ready.
    let blocking = blocking_bits(demand, cycle_us);
    let urgent: u32 = demand.tpdos.iter().map(|(_, _, n)| longest_bits(*n)).sum();
    let urgent = urgent + demand.emcy_frames * longest_bits(EMCY_BYTES);
    let tpdos = wire.min(ready + demand.bits_ns(blocking + urgent));
    line.at = tpdos.max(u64::from(demand.elsewhere_us) * NS_PER_US);
    let compute = u64::from(demand.compute_us) * NS_PER_US;
    line.add(SlotKind::Compute, "master computes", compute, 0);
    line.at = line.at.max(wire);
    tpdos
}

/// The longest frame that is less urgent than a TPDO.
fn blocking_bits(demand: &Demand, cycle_us: u32) -> u32 {
    let cyclic = demand.rpdos.iter().chain(&demand.ramps);
    let others = demand.others(cycle_us).into_iter();
    cyclic
        .map(|(_, _, bytes)| *bytes)
        .chain(others.map(|(_, bytes)| bytes))
        .chain(demand.planned_bytes())
        .map(longest_bits)
        .max()
        .unwrap_or(0)
}

//! The layout of a cycle: against figures by hand, and against a bus on which
//! frames of random length compete as they may.

use std::path::Path;

use canmaster_network::frame::{longest_bits, shortest_bits};
use canmaster_network::layout::{Cyclic, Demand, Layout, RpdoOrder, SlotKind, Window};
use canmaster_network::load;
use canmaster_network::model::Machine;
use proptest::prelude::*;

fn described(name: &str) -> Machine {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../networks");
    let outcome = load(&path.join(format!("{name}.toml")));
    assert!(outcome.problems.is_empty(), "{:?}", outcome.problems);
    outcome.machine.unwrap()
}

fn window(from_us: u32, until_us: u32, next_cycle: bool) -> Option<Window> {
    Some(Window {
        from_us,
        until_us,
        next_cycle,
    })
}

/// SYNC 55, TPDOs ready after another 250, six of 115; an answer of 135; computation
/// of 120; six RPDOs of 115; guard of 20 us.
#[test]
fn one_bus_at_two_milliseconds() {
    let machine = described("one_bus_2ms");
    let layout = &machine.buses[0].layout;
    assert_eq!(layout.demand.order, RpdoOrder::AfterTpdos);
    assert_eq!(layout.tpdos_us(), 55 + 250 + 6 * 115 + 135);
    assert_eq!(layout.after_tpdos_us(), 120 + 6 * 115 + 20);
    assert_eq!(layout.end_us(SlotKind::Guard), 1960);
    assert_eq!(layout.bits(), 55 + 12 * 115 + 2 * 135);
    assert_eq!((layout.load(), layout.demand.load_limit), (853, 900));
    assert_eq!(layout.demand.wire_bound_us(), 1435);
    assert_eq!(layout.demand.smallest_cycle(), Some(1960));
    assert_eq!(layout.dead_time_us(), 2000);
    // Ahead of the TPDOs: the shortest SYNC and 50 us.
    assert_eq!(layout.sdo_window(), window(0, 97, false));
    assert_eq!(machine.buses[0].tpdo_deadline_us, 1130);
}

/// RPDOs fill the time in which the drives prepare: 55, 3 * 115 and 3 * 115 and one
/// planned frame. A TPDO that is ready waits for one frame of 135.
#[test]
fn two_buses_at_a_millisecond() {
    let machine = described("two_bus_1ms");
    assert_eq!(machine.buses.len(), 2);
    for bus in &machine.buses {
        let layout = &bus.layout;
        assert_eq!(layout.demand.order, RpdoOrder::AfterSync);
        assert_eq!(layout.bits(), 55 + 6 * 115 + 135);
        assert_eq!(layout.tpdos_us(), 55 + 250 + 135 + 3 * 115);
        assert_eq!(layout.end_us(SlotKind::Compute), 785 + 120);
        assert_eq!(layout.load(), 880);
        assert_eq!(layout.demand.wire_bound_us(), 745);
        assert_eq!(layout.dead_time_us(), 2000);
        // Until: guard and the longest frame before SYNC. From: the soonest answer,
        // 200 us after the shortest request's 108 bits, is 2 us after SYNC.
        let until = 1000 - 20 - 135;
        assert_eq!(layout.sdo_window(), window(1000 - 306, until, true));
        assert_eq!(bus.tpdo_deadline_us, 785);
    }
    // RPDOs after the TPDOs would need more than that.
    let after_tpdos = Demand {
        order: RpdoOrder::AfterTpdos,
        ..machine.buses[0].layout.demand.clone()
    };
    let least = 55 + 250 + 3 * 115 + 135 + 120 + 3 * 115 + 20;
    assert_eq!(after_tpdos.layout(1000).end_us(SlotKind::Guard), least);
}

/// Two RPDOs of 6 and 8 bytes to each of two drives, and a planned frame.
#[test]
fn three_buses_at_a_millisecond_with_both_rpdos() {
    let machine = described("three_bus_1ms_full");
    assert_eq!(machine.buses.len(), 3);
    for bus in &machine.buses {
        let layout = &bus.layout;
        assert_eq!(layout.bits(), 55 + 2 * (115 + 115 + 135) + 135);
        assert_eq!(layout.end_us(SlotKind::Guard), 940);
        assert_eq!(layout.load(), 920);
        assert_eq!(layout.demand.wire_bound_us(), 785);
    }
}

/// Besides the planned frame, two EMCYs and a heartbeat: six every 100 ms are less
/// than one in a cycle.
#[test]
fn one_bus_with_room_for_what_nobody_plans() {
    let machine = described("one_bus_2ms_disturbed");
    let layout = &machine.buses[0].layout;
    assert_eq!(layout.bits(), 1435 + 135 + 2 * 135 + 65);
    assert_eq!(layout.tpdos_us(), 55 + 250 + 135 + 6 * 115 + 2 * 135);
    assert_eq!(layout.demand.order, RpdoOrder::AfterSync);
    assert_eq!(layout.sdo_window(), window(1694, 1845, true));
}

/// What a frame on the simulated bus is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Sync,
    Tpdo,
    Rpdo,
    Planned,
    Answer,
    Other,
}

#[derive(Clone, Copy, Debug)]
struct Waiting {
    ready_ns: u64,
    id: u16,
    bits: u32,
    kind: Kind,
}

/// Numbers between 0 and 1, without end.
struct Draw(Vec<f64>, usize);

impl Draw {
    fn next(&mut self) -> f64 {
        self.1 += 1;
        self.0[self.1 % self.0.len()]
    }

    fn between(&mut self, least: u64, most: u64) -> u64 {
        least + ((most - least) as f64 * self.next()) as u64
    }

    fn bits(&mut self, bytes: u8) -> u32 {
        let most = longest_bits(bytes);
        self.between(shortest_bits(bytes).into(), most.into()) as u32
    }
}

const US: u64 = 1000;

/// One cycle of a bus with priorities. When the last TPDO, the last RPDO and the last
/// planned frame ended.
fn cycle(layout: &Layout, draw: &mut Draw, disturbed: bool) -> [u64; 3] {
    let demand = &layout.demand;
    let bit = 1_000_000_000 / u64::from(demand.bit_rate);
    let mut waiting = Vec::new();
    let mut add = |ready_ns, id, bits, kind| {
        waiting.push(Waiting {
            ready_ns,
            id,
            bits,
            kind,
        });
    };
    let sync = draw.bits(0);
    add(0, 0x80, sync, Kind::Sync);
    let sync_ns = u64::from(sync) * bit;
    for (id, _, bytes) in &demand.tpdos {
        let (least, most) = (demand.earliest_us, demand.latency_us);
        let after = draw.between(u64::from(least) * US, u64::from(most) * US);
        add(sync_ns + after, *id, draw.bits(*bytes), Kind::Tpdo);
    }
    let late: &[Cyclic] = match demand.order {
        RpdoOrder::AfterTpdos => &demand.rpdos,
        RpdoOrder::AfterSync => &[],
    };
    let at_once = demand.rpdos.iter().filter(|_| late.is_empty());
    for (id, _, bytes) in demand.ramps.iter().chain(at_once) {
        add(0, *id, draw.bits(*bytes), Kind::Rpdo);
    }
    let window = layout.sdo_window().filter(|_| demand.is_planned());
    let mut request_until = None;
    match (draw.between(0, 4), window) {
        (0, _) => {
            let bytes = demand.on_change.iter().map(|(_, _, n)| *n).max();
            if let Some(bytes) = bytes {
                add(0, 0x301, draw.bits(bytes), Kind::Planned);
            }
        }
        (1, Some(window)) if window.next_cycle => {
            // The answer to a request of the cycle before.
            let (_, most) = demand.sdo_latency_us.unwrap_or_default();
            let ready = draw.between(0, u64::from(most - demand.guard_us) * US);
            add(ready, 0x581, draw.bits(8), Kind::Answer);
        }
        (_, Some(window)) if window.next_cycle => request_until = Some(window),
        (_, Some(window)) => {
            let at = draw.between(0, u64::from(window.until_us) * US);
            add(at, 0x601, draw.bits(8), Kind::Planned);
        }
        _ => {}
    }
    if disturbed {
        let end = u64::from(layout.cycle_us) * US;
        for _ in 0..demand.emcy_frames {
            add(draw.between(0, end), 0x81, draw.bits(8), Kind::Other);
        }
        for (place, (_, ms)) in demand.heartbeats.iter().enumerate() {
            // The master's own is planned here.
            if *ms != 0 && place != 0 && !demand.heartbeats_wait {
                add(draw.between(0, end), 0x701, draw.bits(1), Kind::Other);
            }
        }
    }
    let mut at = 0;
    let mut ends = [0; 3];
    let mut tpdos = demand.tpdos.len();
    let mut rpdos = demand.rpdos.len() + demand.ramps.len();
    loop {
        if waiting.is_empty() {
            return ends;
        }
        let first = waiting.iter().map(|w| w.ready_ns).min().unwrap_or(at);
        at = at.max(first);
        let ready = waiting.iter().enumerate().filter(|(_, w)| w.ready_ns <= at);
        let (place, _) = ready.min_by_key(|(_, w)| w.id).unwrap();
        let sent = waiting.swap_remove(place);
        at += u64::from(sent.bits) * bit;
        match sent.kind {
            Kind::Tpdo => {
                ends[0] = at;
                tpdos -= 1;
                if tpdos == 0 {
                    let ready_ns = at + u64::from(demand.compute_us) * US;
                    for (id, _, bytes) in late {
                        let bits = draw.bits(*bytes);
                        waiting.push(Waiting {
                            ready_ns,
                            id: *id,
                            bits,
                            kind: Kind::Rpdo,
                        });
                    }
                }
            }
            Kind::Rpdo => {
                ends[1] = at;
                rpdos -= 1;
            }
            Kind::Planned => {
                ends[2] = at;
                if let (0x601, Some((least, most))) = (sent.id, demand.sdo_latency_us)
                    && request_until.is_none()
                {
                    let latency = draw.between(u64::from(least) * US, u64::from(most) * US);
                    waiting.push(Waiting {
                        ready_ns: at - 3 * bit + latency,
                        id: 0x581,
                        bits: draw.bits(8),
                        kind: Kind::Answer,
                    });
                }
            }
            Kind::Answer => ends[2] = at,
            Kind::Sync | Kind::Other => {}
        }
        if let (0, 0, Some(window)) = (tpdos, rpdos, request_until) {
            // Nothing of the master waits any more: a request may go.
            request_until = None;
            let from = at.max(u64::from(window.from_us) * US);
            if from <= u64::from(window.until_us) * US {
                let bits = draw.bits(8);
                let end = from + u64::from(bits) * bit;
                ends[2] = ends[2].max(end);
                let (least, _) = demand.sdo_latency_us.unwrap_or_default();
                let soonest = end - 3 * bit + u64::from(least) * US;
                let cycle = u64::from(layout.cycle_us) * US;
                assert!(soonest > cycle, "an answer before SYNC: {soonest}");
            }
        }
    }
}

prop_compose! {
    fn demands()(
        axes in 1_u16..=12,
        (rpdo, ramps, tpdo) in (1_u8..=8, 0_u8..=8, 1_u8..=8),
        on_change in any::<bool>(),
        after_sync in any::<bool>(),
        (earliest, spread) in (0_u32..=100, 0_u32..=900),
        (compute, guard) in (0_u32..=300, 1_u32..=135),
        (sdo, soonest, more) in (0_u32..=2, 160_u32..=400, 0_u32..=1000),
        (emcy, waits) in (0_u32..=3, any::<bool>()),
        beat in prop_oneof![Just(0_u16), 20_u16..=1000],
        bit_rate in prop_oneof![Just(1_000_000_u32), Just(500_000), Just(250_000)],
    ) -> Demand {
        let pdos = |base: u16, bytes: u8| -> Vec<Cyclic> {
            let all = (1..=axes).filter(|_| bytes > 0);
            all.map(|n| (base + n, format!("{n}"), bytes)).collect()
        };
        let latency_us = earliest + spread;
        let mut demand = Demand {
            load_limit: 1000,
            compute_us: compute,
            guard_us: guard,
            order: if after_sync { RpdoOrder::AfterSync } else { RpdoOrder::AfterTpdos },
            sdo_frames: sdo,
            sdo_latency_us: Some((soonest, soonest + more)),
            emcy_frames: emcy,
            heartbeats_wait: waits,
            earliest_us: earliest,
            latency_us,
            heartbeats: (0..=axes).map(|n| (format!("{n}"), beat)).collect(),
            tpdos: pdos(0x180, tpdo),
            rpdos: pdos(0x200, rpdo),
            ..Demand::of(std::iter::empty(), 0, bit_rate)
        };
        if on_change {
            demand.on_change = pdos(0x300, ramps);
        } else {
            demand.ramps = pdos(0x300, ramps);
        }
        demand
    }
}

proptest! {
    /// Slots on the wire never overlap, nothing is shorter than the pure wire bound,
    /// and the smallest cycle fits while a shorter one does not.
    #[test]
    fn slots_never_overlap_and_the_wire_bound_holds(demand in demands()) {
        let smallest = demand.smallest_cycle().filter(|us| *us <= 65_535);
        let Some(cycle_us) = smallest else {
            prop_assert!(!demand.layout(65_535).fits());
            return Ok(());
        };
        let layout = demand.layout(cycle_us);
        let mut free = 0;
        for slot in layout.slots.iter().filter(|slot| slot.kind != SlotKind::Compute) {
            prop_assert!(slot.start_ns >= free, "{:?}", layout.slots);
            free = slot.end_ns();
        }
        prop_assert!(free <= u64::from(cycle_us) * US);
        prop_assert!(cycle_us >= demand.wire_bound_us());
        prop_assert!(layout.fits());
        if cycle_us > 500 {
            prop_assert!(!demand.layout(cycle_us - 1).fits());
        }
        prop_assert!(layout.tpdos_us() + layout.after_tpdos_us() <= cycle_us);
        let compute = layout.slots.iter().find(|slot| slot.kind == SlotKind::Compute).unwrap();
        prop_assert!(compute.start_ns.div_ceil(US) >= u64::from(layout.tpdos_us()));
    }

    /// Whatever frames do within their limits, TPDOs are in when the layout says, and
    /// RPDOs and planned frames have ended before the guard.
    #[test]
    fn no_bus_is_slower_than_its_layout(
        demand in demands(),
        numbers in proptest::collection::vec(prop_oneof![Just(1.0), 0.0..=1.0], 7..60),
        disturbed in any::<bool>(),
    ) {
        let Some(cycle_us) = demand.smallest_cycle() else {
            return Ok(());
        };
        let layout = demand.layout(cycle_us);
        let mut draw = Draw(numbers, 0);
        for _ in 0..20 {
            let [tpdos, rpdos, planned] = cycle(&layout, &mut draw, disturbed);
            prop_assert!(tpdos <= u64::from(layout.tpdos_us()) * US, "{tpdos} {}", layout.tpdos_us());
            let end = u64::from(cycle_us - demand.guard_us) * US;
            prop_assert!(rpdos <= end, "{rpdos} {end}");
            // What drives send of their own accord may be in the way of a request.
            prop_assert!(disturbed || planned <= end, "{planned} {end}");
        }
    }
}

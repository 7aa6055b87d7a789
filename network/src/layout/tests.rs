//! Against figures by hand.

use super::*;

fn demand(axes: u16, rpdo: u8, tpdo: u8) -> Demand {
    let pdos = |base: u16, bytes| -> Vec<_> {
        (1..=axes)
            .map(|n| (base + n, format!("{n}"), bytes))
            .collect()
    };
    Demand {
        load_limit: 1000,
        heartbeats: Vec::new(),
        tpdos: pdos(0x180, tpdo),
        rpdos: pdos(0x200, rpdo),
        ..Demand::of(std::iter::empty(), 0, 1_000_000)
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
    assert_eq!(demand.smallest_cycle(), Some(1435));
    let limited = Demand {
        load_limit: 900,
        ..demand
    };
    assert_eq!(limited.smallest_cycle(), Some(1595));
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

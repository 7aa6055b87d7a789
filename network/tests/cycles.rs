//! The SYNC periods that the firmware takes for 1006h are those that the check of the
//! description lets through.

use std::ops::RangeInclusive;
use std::path::Path;

use canmaster_network::{Source, read_for_firmware};

/// The 10 ms description with other lines; the cycles of its bus. `None`: it is refused.
fn cycles(changes: &[(&str, &str)]) -> Option<RangeInclusive<u32>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../networks");
    let text = std::fs::read_to_string(folder.join("one_bus_10ms.toml")).unwrap();
    // The order is the firmware's, and no write to 1006h changes it.
    let order = "load_limit = 90\nrpdos = \"after TPDOs\"";
    let mut text = text.replace("load_limit = 90", order);
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    let source = Source::new("network.toml", text.as_bytes());
    let outcome = read_for_firmware(&source, &mut |file| std::fs::read(folder.join(file)));
    Some(outcome.machine?.buses[0].cycles())
}

/// Whether the check takes exactly the cycles of `range` near its ends.
fn agrees(range: &RangeInclusive<u32>, changes: &[(&str, &str)]) {
    let (shortest, longest) = (*range.start(), *range.end());
    for (cycle, taken) in [
        (shortest - 1, false),
        (shortest, true),
        (shortest + (longest - shortest) / 3, true),
        (longest, true),
        (longest + 1, false),
    ] {
        let line = format!("cycle_us = {cycle}");
        let mut changes = changes.to_vec();
        changes.push(("cycle_us = 10_000", &line));
        let found = cycles(&changes);
        assert_eq!(found.is_some(), taken, "{cycle}");
        // From wherever one looks.
        assert!(found.is_none_or(|found| found == *range), "{cycle}");
    }
}

#[test]
fn a_cycle_may_go_down_to_its_deadline_and_what_comes_after_it() {
    let range = cycles(&[]).unwrap();
    // Deadline, computation, RPDOs, guard; and what the timer counts.
    assert_eq!(range, 5_000 + 200 + 690 + 135..=65_535);
    agrees(&range, &[]);
}

#[test]
fn an_earlier_deadline_allows_a_shorter_cycle_until_the_frames_do_not_fit() {
    let early = [("tpdo_deadline_us = 5_000", "tpdo_deadline_us = 3_160")];
    let range = cycles(&early).unwrap();
    // As laid out: `cargo xtask check` shows it. Beyond 50 ms the master sends two
    // heartbeats.
    assert_eq!(range, 3_160 + 1_025..=50_000);
    agrees(&range, &early);
    let limited = [early[0], ("load_limit = 90", "load_limit = 50")];
    // 2985 bits may take half of the cycle.
    assert_eq!(cycles(&limited).unwrap(), 5_970..=50_000);
    agrees(&cycles(&limited).unwrap(), &limited);
}

#[test]
fn a_cycle_in_which_more_heartbeats_come_late_is_no_longer_taken() {
    // All TPDOs, heartbeats and SDO are in at 3160 us; with the master's heartbeat
    // twice, beyond 50 ms, at 3225 us.
    let tight = [("tpdo_deadline_us = 5_000", "tpdo_deadline_us = 3_200")];
    let range = cycles(&tight).unwrap();
    assert_eq!(range, 4_225..=50_000);
    agrees(&range, &tight);
}

/// A description of `networks` with other lines.
fn described(name: &str, changes: &[(&str, &str)]) -> Option<canmaster_network::model::Machine> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../networks");
    let mut text = std::fs::read_to_string(folder.join(name)).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    let source = Source::new(name, text.as_bytes());
    let outcome = read_for_firmware(&source, &mut |file| std::fs::read(folder.join(file)));
    outcome.machine
}

/// What a message calls the smallest cycle is the shortest that 1006h may become, where
/// the deadline follows from the layout.
#[test]
fn the_smallest_cycle_that_fits_is_the_shortest_of_1006h() {
    for name in [
        "one_bus_2ms",
        "two_bus_1ms",
        "three_bus_1ms_full",
        "one_bus_2ms_disturbed",
    ] {
        let machine = described(&format!("{name}.toml"), &[]).unwrap();
        let smallest = machine.buses.iter().map(|bus| {
            let demand = &bus.layout.demand;
            demand.smallest_cycle().unwrap()
        });
        assert_eq!(smallest.max(), Some(*machine.cycles().start()), "{name}");
    }
}

/// One planned frame in a cycle: the master's heartbeat each 50 ms, SDO in every eighth
/// cycle and RPDO2 in every 16th leave off at 13/16 of 50 ms.
#[test]
fn a_cycle_in_which_the_heartbeat_has_no_slot_is_not_taken() {
    let name = "one_bus_2ms.toml";
    let (from, to) = ("cycle_us = 2_000", "cycle_us = 40_624");
    let longest = |changes: &[(&str, &str)]| described(name, changes).map(|m| *m.cycles().end());
    assert_eq!(longest(&[]), Some(40_624));
    assert_eq!(longest(&[(from, to)]), Some(40_624));
    assert_eq!(longest(&[(from, "cycle_us = 40_625")]), None);
    // A node that waits for 100 ms hears it in 50 ms and a cycle.
    let sooner = ("master_timeout_ms = 200", "master_timeout_ms = 80");
    assert_eq!(longest(&[sooner]), Some(29_000));
    assert_eq!(longest(&[sooner, (from, "cycle_us = 30_001")]), None);
}

//! The sample of the workspace: it has no problem, and what is derived from it is
//! what the firmware is built from.

use std::path::{Path, PathBuf};

use canmaster::motion::experiment::{GROUP, Motor};
use canmaster::network::sample::SIX_EPOS4;
use canmaster::network::{self, Network};
use canmaster_network::derive::{concise_dcf, dbc, picture, rust};
use canmaster_network::eds::Eds;
use canmaster_network::model::Machine;
use canmaster_network::plan::plan;
use canmaster_network::{Source, load};

/// What [`rust`] makes of the sample, compiled.
#[allow(
    unreachable_pub,
    reason = "the firmware makes it public, and a test has nobody to show it to"
)]
mod generated {
    include!("golden/six_epos4.rs");
}

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn sample() -> Machine {
    let outcome = load(&workspace().join("network.toml"));
    let problems: Vec<String> = outcome.problems.iter().map(|p| p.to_string()).collect();
    assert!(problems.is_empty(), "{}", problems.join("\n"));
    outcome.machine.expect("no problem, so a machine")
}

fn golden() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/six_epos4.rs")
}

/// With UPDATE_GOLDEN set the file is written anew; it is compiled by the next run.
#[test]
fn the_generated_rust_is_the_golden_file() {
    let generated = rust(&sample(), "canmaster");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(golden(), &generated).unwrap();
    }
    let text = std::fs::read_to_string(golden()).unwrap();
    assert_eq!(generated, text.replace("\r\n", "\n"));
}

/// Everything of a network as text, in one order.
fn shown(network: &Network) -> String {
    format!("{network:#?}")
}

#[test]
fn the_generated_network_is_the_one_of_the_library() {
    assert_eq!(shown(&generated::NETWORK), shown(&SIX_EPOS4));
    assert_eq!(generated::AXES, SIX_EPOS4.nodes.len());
    assert_eq!(generated::MOTORS, [Motor::SAMPLE; generated::AXES]);
    assert_eq!(generated::TPDO_DEADLINE_US, 1_130);
    let program = sample().program.unwrap();
    assert_eq!(generated::PROGRAM[..], program.bytes());
    assert_eq!(generated::TPDO_MISSING_LIMIT, GROUP.missing_tpdo_max);
    // What comes after the deadline at worst still fits.
    const { assert!(generated::SHORTEST_CYCLE_US > generated::TPDO_DEADLINE_US as u32) };
    assert_eq!((generated::COMPUTE_US, generated::RPDOS_US), (120, 710));
    // The master's heartbeat each 50 ms and ramps in every 16th cycle share a slot.
    assert_eq!(generated::LONGEST_CYCLE_US, 46_874);
    const { assert!(generated::PDOS_ALIKE) };
}

/// SDO and ramps share a slot directly after SYNC, and no heartbeat is in operational.
#[test]
fn the_generated_cycle_of_the_sample() {
    use generated::*;
    assert_eq!((BUSES, BUS_PERIPHERALS), (1, [1]));
    assert_eq!(BUS_BIT_TIMINGS, [(1, 20, 3)]);
    assert_eq!(AXIS_BUSES, [0; AXES]);
    assert_eq!((RPDOS_AFTER_SYNC, GUARD_US), (false, 20));
    // The shortest SYNC has 47 bits, and the first TPDO comes 50 us later.
    assert_eq!(AFTER_SYNC_US, [97]);
    assert_eq!((ONE_PLANNED, SDO_NEXT_CYCLE), ([true], [false]));
    assert_eq!((SDO_FROM_US, SDO_UNTIL_US, SDO_EVERY), ([0], [97], [0]));
    assert_eq!(RAMPS_ON_CHANGE, [true; AXES]);
    assert_eq!(HEARTBEATS_IN_OPERATIONAL, [false; AXES]);
}

#[test]
fn the_plan_is_that_of_the_library_write_for_write() {
    let machine = sample();
    for (ours, theirs) in machine.nodes.iter().zip(SIX_EPOS4.nodes) {
        let ours: Vec<_> = plan(&machine.master, ours)
            .into_iter()
            .map(|w| (w.at.index, w.at.sub, w.value, usize::from(w.bytes)))
            .collect();
        let theirs: Vec<_> = network::plan(&SIX_EPOS4, theirs)
            .map(|w| (w.at.index.0, w.at.sub.0, w.value(), w.len()))
            .collect();
        assert_eq!(ours, theirs);
    }
}

#[test]
fn the_concise_dcf_holds_the_plan() {
    let machine = sample();
    let node = &machine.nodes[0];
    let bytes = concise_dcf(&machine.master, node);
    let writes = plan(&machine.master, node);
    assert_eq!(bytes[..4], (writes.len() as u32).to_le_bytes());
    // 1400h:01 = 80000201h.
    assert_eq!(
        bytes[4..15],
        [0x00, 0x14, 0x01, 4, 0, 0, 0, 0x01, 0x02, 0x00, 0x80]
    );
    let length: usize = writes
        .iter()
        .map(|write| 7 + usize::from(write.bytes))
        .sum();
    assert_eq!(bytes.len(), 4 + length);
}

#[test]
fn the_dbc_names_every_signal() {
    let text = dbc(&sample(), 0);
    insta::assert_snapshot!(text);
}

#[test]
fn the_cycle_as_a_picture() {
    insta::assert_snapshot!(picture(&sample().buses[0].layout, 72));
}

#[test]
fn an_eds_that_is_written_reads_as_it_was() {
    let path = workspace().join("eds/maxon-epos4.eds");
    let bytes = std::fs::read(path).unwrap();
    let (eds, problems) = Eds::read(&Source::new("maxon-epos4.eds", &bytes));
    assert!(problems.is_empty(), "{problems:?}");
    let (again, problems) = Eds::read(&Source::new("maxon-epos4.eds", eds.write().as_bytes()));
    assert!(problems.is_empty(), "{problems:?}");
    assert_eq!(again.device, eds.device);
    assert_eq!(again.objects.len(), eds.objects.len());
    for ((at, object, entry), (at_2, object_2, entry_2)) in again.entries().zip(eds.entries()) {
        assert_eq!(at, at_2);
        assert_eq!(
            (
                &object.name,
                object.kind,
                &entry.name,
                entry.data_type,
                entry.access,
                entry.mappable
            ),
            (
                &object_2.name,
                object_2.kind,
                &entry_2.name,
                entry_2.data_type,
                entry_2.access,
                entry_2.mappable
            )
        );
        assert_eq!(
            entry.default.map(|n| n.of_type(entry.data_type, 5)),
            entry_2.default.map(|n| n.of_type(entry.data_type, 5)),
            "{at}"
        );
        assert_eq!(entry.low.map(|n| n.value), entry_2.low.map(|n| n.value));
        assert_eq!(entry.high.map(|n| n.value), entry_2.high.map(|n| n.value));
    }
}

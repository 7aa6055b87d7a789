//! Whatever is read, nothing panics.

use std::io;
use std::path::Path;

use canmaster_network::eds::Eds;
use canmaster_network::{Source, derive, read, read_for_firmware};
use proptest::prelude::*;

fn root() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn sample() -> Vec<u8> {
    std::fs::read(root().join("network.toml")).unwrap()
}

fn epos4() -> Vec<u8> {
    std::fs::read(root().join("eds/maxon-epos4.eds")).unwrap()
}

/// The file with some pieces replaced.
fn damaged(mut bytes: Vec<u8>, damage: &[(prop::sample::Index, Vec<u8>)]) -> Vec<u8> {
    for (at, piece) in damage {
        let at = at.index(bytes.len());
        let end = (at + piece.len()).min(bytes.len());
        bytes.splice(at..end, piece.iter().copied());
    }
    bytes
}

/// Pieces that these files are made of, and others.
fn piece() -> impl Strategy<Value = Vec<u8>> {
    prop_oneof![
        prop::collection::vec(any::<u8>(), 0..8),
        prop::sample::select(vec![
            "[",
            "]",
            "=",
            "\n",
            "\"",
            "-",
            "0x",
            "9999999999",
            "$NODEID",
            "sub",
            "[1000sub1]",
            "CompactSubObj=255",
            "-1",
            "0.5",
            "nan",
            "[[node]]",
            "[bus.x]",
            "{",
            "}",
            ",",
            "\u{e9}",
        ])
        .prop_map(|text| text.as_bytes().to_vec()),
    ]
}

fn damage() -> impl Strategy<Value = Vec<(prop::sample::Index, Vec<u8>)>> {
    prop::collection::vec((any::<prop::sample::Index>(), piece()), 1..12)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_as_eds(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let (eds, problems) = Eds::read(&Source::new("x.eds", &bytes));
        prop_assert!(!eds.objects.is_empty() || !problems.is_empty());
    }

    #[test]
    fn random_bytes_as_toml(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let outcome = read(&Source::new("network.toml", &bytes), &mut |_| Err(io::ErrorKind::NotFound.into()));
        prop_assert!(outcome.machine.is_none());
        prop_assert!(!outcome.problems.is_empty());
    }

    #[test]
    fn damaged_eds(damage in damage()) {
        let bytes = damaged(epos4(), &damage);
        let toml = sample();
        let outcome = read(&Source::new("network.toml", &toml), &mut |_| Ok(bytes.clone()));
        prop_assert!(outcome.machine.is_some() || !outcome.problems.is_empty());
        let (eds, _) = Eds::read(&Source::new("x.eds", &bytes));
        let (again, _) = Eds::read(&Source::new("x.eds", eds.write().as_bytes()));
        prop_assert_eq!(again.objects.len(), eds.objects.len());
    }

    #[test]
    fn damaged_toml(damage in damage()) {
        let eds = epos4();
        let toml = damaged(sample(), &damage);
        let source = Source::new("network.toml", &toml);
        let _ = read(&source, &mut |_| Ok(eds.clone()));
        let outcome = read_for_firmware(&source, &mut |_| Ok(eds.clone()));
        match outcome.machine {
            None => prop_assert!(!outcome.problems.is_empty()),
            Some(machine) => {
                let _ = derive::rust(&machine, "canmaster");
                for bus in 0..machine.buses.len() {
                    let _ = derive::dbc(&machine, bus);
                    let _ = derive::picture(&machine.buses[bus].layout, 80);
                    let cycles = machine.buses[bus].cycles();
                    prop_assert!(cycles.contains(&machine.buses[bus].cycle_us));
                }
                for node in &machine.nodes {
                    let _ = derive::concise_dcf(&machine.master, node);
                }
            }
        }
    }
}

//! The mirror of the nodes' PDOs and the process image.

use crate::rig::Bench;
use canmaster::network::sample::SIX_EPOS4_10_MS as SIX_EPOS4;
use canmaster::pdo::MappingEntry;

#[test]
fn the_masters_rpdos_are_the_nodes_tpdos() {
    let mut b = Bench::new();
    for (place, known) in SIX_EPOS4.nodes.iter().enumerate() {
        let id = u64::from(known.id.get());
        for n in 0..2 {
            let offset = (place * 2 + n) as u16;
            let base = [0x180, 0x280][n];
            assert_eq!(b.number(0x1400 + offset, 1), Ok(base + id));
            assert_eq!(b.number(0x1400 + offset, 2), Ok(1));
        }
        for n in 0..4 {
            // Behind the board's own.
            let offset = (4 + place * 4 + n) as u16;
            let base = [0x200, 0x300, 0x400, 0x500][n];
            // Not to be asked for by remote frames.
            assert_eq!(b.number(0x1800 + offset, 1), Ok(0x4000_0000 + base + id));
            assert_eq!(b.number(0x1800 + offset, 2), Ok(1));
        }
    }
}

/// Every mapped object exists, has the mapped length and shows the bytes of the
/// PDO it is mapped into.
#[test]
fn mappings_lead_to_the_process_image() {
    let mut b = Bench::new();
    for (place, known) in SIX_EPOS4.nodes.iter().enumerate() {
        let id = known.id.get();
        let directions = [(0x1600, known.tpdos, 1_u8), (0x1A04, known.rpdos, 2)];
        for (base, pdos, direction) in directions {
            for (n, pdo) in pdos.iter().enumerate() {
                let index = base + (place * pdos.len() + n) as u16;
                let count = b.number(index, 0).unwrap() as u8;
                assert_eq!(usize::from(count), pdo.mapping.len());
                let tail = [1, 2, 3, 4, 5, 6].map(|low| direction << 4 | low);
                let mut rest: &[u8] = &[[id, pdo.number].as_slice(), &tail].concat();
                for (sub, at_node) in (1..=count).zip(pdo.mapping) {
                    let entry = MappingEntry(b.number(index, sub).unwrap() as u32);
                    assert_eq!(entry.bits(), at_node.bits());
                    assert_eq!(entry.at().index.0, 0x3000 + u16::from(id));
                    let value = b.read(entry.at().index.0, entry.at().sub.0).unwrap();
                    let (expected, more) = rest.split_at(usize::from(entry.bits()) / 8);
                    assert_eq!(value, expected);
                    rest = more;
                }
            }
        }
        assert_eq!(b.number(0x3000 + u16::from(id), 0), Ok(12));
    }
}

//! Synthetic records with known figures.

use super::*;
use crate::bus::{PortId, RecordKind};

const CYCLE_US: u64 = 10_000;
/// Any length will do here; the exact ones are the bus's business.
const SYNC_BITS: u32 = 50;
const PDO_BITS: u32 = 100;

fn six() -> Traffic {
    Traffic {
        bit_rate: 1_000_000,
        cycle: Time::from_us(CYCLE_US),
        nodes: (1..=6).map(|id| NodeId::new(id).unwrap()).collect(),
    }
}

fn record(us: u64, bits: u32, id: u16, data: &[u8]) -> WireRecord {
    let mut frame = WireFrame {
        id: WireId::Standard(id),
        rtr: false,
        dlc: data.len() as u8,
        data: [0; 8],
    };
    frame.data[..data.len()].copy_from_slice(data);
    WireRecord {
        sof: Time::from_us(us),
        end: Time::from_us(us + u64::from(bits)),
        bits,
        transmitters: vec![PortId(0)],
        kind: RecordKind::Frame(frame),
    }
}

fn sync(us: u64) -> WireRecord {
    record(us, SYNC_BITS, 0x080, &[])
}

/// SYNC and all PDOs of one whole cycle.
fn whole_cycle(us: u64) -> Vec<WireRecord> {
    let mut records = vec![sync(us)];
    for node in 1..=6 {
        records.push(record(
            us + 200 + u64::from(node) * 110,
            PDO_BITS,
            0x180 + node,
            &[0; 6],
        ));
        records.push(record(
            us + 2000 + u64::from(node) * 110,
            PDO_BITS,
            0x200 + node,
            &[0; 6],
        ));
    }
    records
}

/// The run ends with its last frame.
fn judge(records: &[WireRecord], traffic: &Traffic) -> BusFigures {
    let end = records.last().map_or(Time::ZERO, |record| record.end);
    super::judge(records, traffic, end)
}

/// NMT start, then `cycles` whole cycles and the SYNC that closes the last.
fn running(cycles: u64) -> Vec<WireRecord> {
    let mut records = vec![record(100, 60, 0x000, &[0x01, 0x00])];
    for n in 0..cycles {
        records.extend(whole_cycle(1000 + n * CYCLE_US));
    }
    records.push(sync(1000 + cycles * CYCLE_US));
    records
}

fn without(records: Vec<WireRecord>, nth: usize, wanted: u16) -> Vec<WireRecord> {
    let mut seen = 0;
    records
        .into_iter()
        .filter(|record| match &record.kind {
            RecordKind::Frame(frame) if frame.id == WireId::Standard(wanted) => {
                seen += 1;
                seen != nth
            }
            _ => true,
        })
        .collect()
}

#[test]
fn a_clean_run() {
    let figures = judge(&running(10), &six());
    assert_eq!(figures.sync_count, 11);
    assert_eq!(figures.missed, 0);
    assert_eq!(figures.frames, 1 + 11 + 10 * 12);
    assert_eq!(figures.error_frames, 0);
    assert!((figures.sync_period_us - 10_000.0).abs() < 1e-6);
    assert!(figures.jitter_pp_us < 1e-6);
    // (50 + 12 * 100) bits of 10 000.
    assert!(
        (figures.load_mean - 0.125).abs() < 1e-12,
        "{}",
        figures.load_mean
    );
    assert!((figures.load_max - 0.125).abs() < 1e-12);
}

#[test]
fn a_missing_tpdo1_or_rpdo1_is_one_missed_interval() {
    for id in [0x183, 0x205] {
        assert_eq!(
            judge(&without(running(10), 4, id), &six()).missed,
            1,
            "{id:#x}"
        );
    }
    let both = without(without(running(10), 4, 0x183), 4, 0x184);
    assert_eq!(judge(&both, &six()).missed, 1, "an interval is missed once");
}

#[test]
fn a_missing_sync_is_missed_and_does_not_bend_the_grid() {
    let figures = judge(&without(running(10), 5, 0x080), &six());
    assert_eq!(figures.missed, 1);
    assert!(figures.jitter_pp_us < 1e-6);
    assert!(
        (figures.load_max - 0.12).abs() < 0.01,
        "{}",
        figures.load_max
    );
}

#[test]
fn syncs_that_stop_for_good_are_missed_until_the_end() {
    let last = Time::from_us(1000 + 10 * CYCLE_US);
    for (cycles, missed) in [(1, 0), (2, 1), (7, 6)] {
        let end = last + Time::from_us(cycles * CYCLE_US);
        assert_eq!(super::judge(&running(10), &six(), end).missed, missed);
    }
}

#[test]
fn a_double_sync_is_missed() {
    let mut records = running(10);
    let at = records
        .iter()
        .position(|record| record.sof == Time::from_us(1000 + 3 * CYCLE_US));
    records.insert(at.unwrap() + 1, sync(1000 + 3 * CYCLE_US + 60));
    assert!(judge(&records, &six()).missed >= 1);
}

#[test]
fn nothing_is_expected_of_nodes_that_are_not_operational() {
    let mut records = running(10);
    records.remove(0);
    let silent = without(records, 4, 0x183);
    assert_eq!(judge(&silent, &six()).missed, 0);
}

#[test]
fn a_node_that_says_it_left_operational_is_not_missed() {
    let mut records = running(10);
    let gone = 1000 + 5 * CYCLE_US;
    records.push(record(gone + 5000, PDO_BITS, 0x703, &[0x7F]));
    records.sort_by_key(|record| record.sof);
    let records = records
        .into_iter()
        .filter(|record| match &record.kind {
            RecordKind::Frame(frame) => {
                frame.id != WireId::Standard(0x183) || record.sof < Time::from_us(gone)
            }
            RecordKind::ErrorFrame { .. } => true,
        })
        .collect::<Vec<_>>();
    assert_eq!(judge(&records, &six()).missed, 0);
}

#[test]
fn a_remote_frame_is_no_sync() {
    let mut records = running(10);
    for record in &mut records {
        if let RecordKind::Frame(frame) = &mut record.kind
            && frame.id == WireId::Standard(0x080)
        {
            frame.rtr = true;
        }
    }
    assert_eq!(judge(&records, &six()).sync_count, 0);
}

#[test]
fn jitter_is_peak_to_peak_and_period_is_the_masters() {
    // The master's clock is 50 ppm slow, and every other SYNC is 2 us late.
    let records: Vec<_> = (0..1000)
        .map(|n| sync(1000 + n * 10_000 + n / 2 + (n % 2) * 2))
        .collect();
    let figures = judge(&records, &six());
    assert!(
        (figures.sync_period_us - 10_000.5).abs() < 0.01,
        "{}",
        figures.sync_period_us
    );
    assert!(
        (1.4..2.6).contains(&figures.jitter_pp_us),
        "{}",
        figures.jitter_pp_us
    );
    assert_eq!(figures.sync_residuals_us.len(), 1000);
}

#[test]
fn a_restart_of_the_network_begins_a_new_grid() {
    let mut records: Vec<_> = (0..100).map(|n| sync(1000 + n * CYCLE_US)).collect();
    let again = 1000 + 200 * CYCLE_US + 3333;
    records.push(record(again - 500_000, 60, 0x000, &[0x82, 0x00]));
    records.extend((0..50).map(|n| sync(again + n * CYCLE_US)));
    let figures = judge(&records, &six());
    assert_eq!(figures.missed, 0, "the pause of a reset is no missed cycle");
    assert!(figures.jitter_pp_us < 1e-6);
    assert_eq!(figures.sync_residuals_us.len(), 150);
}

#[test]
fn an_empty_bus_has_no_figures() {
    assert_eq!(judge(&[], &six()), BusFigures::default());
}

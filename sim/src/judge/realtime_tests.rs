//! By traces made by hand.

use super::*;
use crate::frame::WireFrame;

const BOARD: PortId = PortId(0);
const DRIVE: PortId = PortId(1);
const BITS: u32 = 100;

fn record(us: u64, id: u16, from: PortId) -> WireRecord {
    WireRecord {
        sof: Time::from_us(us),
        end: Time::from_us(us + u64::from(BITS)),
        bits: BITS,
        transmitters: vec![from],
        kind: RecordKind::Frame(WireFrame::standard(id, &[])),
    }
}

fn traffic() -> Traffic {
    Traffic {
        bit_rate: 1_000_000,
        cycle: Time::from_us(2000),
        nodes: (1..=2).filter_map(NodeId::new).collect(),
    }
}

/// RPDO1 after the TPDOs, RPDO2 after SYNC.
fn figures_of(records: &[WireRecord]) -> RealTime {
    let bursts = Bursts {
        after_sync: vec![0x301, 0x302],
        after_tpdos: vec![0x201, 0x202],
    };
    judge(records, &traffic(), &bursts, BOARD)
}

fn syncs(count: u64) -> Vec<WireRecord> {
    (0..count)
        .map(|n| record(1000 + 2000 * n, 0x080, BOARD))
        .collect()
}

#[test]
fn sync_on_the_grid_is_on_time() {
    let figures = figures_of(&syncs(100));
    assert!(figures.jitter_pp_us < 1e-6);
    assert_eq!(figures.histogram, [100]);
    assert_eq!(figures.unexplained, 0);
}

#[test]
fn a_late_sync_needs_a_frame_in_its_way() {
    let mut records = syncs(100);
    records[50] = record(1000 + 2000 * 50 + 60, 0x080, BOARD);
    let late = figures_of(&records);
    assert!((late.jitter_pp_us - 60.0).abs() < 0.01, "{late:?}");
    assert_eq!((late.histogram[0], late.histogram.iter().sum()), (99, 100));
    assert_eq!(late.unexplained, 1);
    // A frame that ends where the SYNC begins, and began before it was due.
    records.insert(50, record(1000 + 2000 * 50 - 40, 0x701, DRIVE));
    assert_eq!(figures_of(&records).unexplained, 0);
    // One that began after that is none of its business.
    records[50] = record(1000 + 2000 * 50 + 20, 0x701, DRIVE);
    assert_eq!(figures_of(&records).unexplained, 1);
}

#[test]
fn a_frame_of_the_master_itself_is_no_excuse_unless_it_had_to_wait() {
    let mut records = syncs(100);
    records[50] = record(1000 + 2000 * 50 + 60, 0x080, BOARD);
    records.insert(50, record(1000 + 2000 * 50 - 40, 0x601, BOARD));
    assert_eq!(figures_of(&records).unexplained, 1);
    // Handed over in time, and held up by a drive's.
    records.insert(50, record(1000 + 2000 * 50 - 140, 0x081, DRIVE));
    assert_eq!(figures_of(&records).unexplained, 0);
    records[50] = record(1000 + 2000 * 50 - 150, 0x081, DRIVE);
    assert_eq!(figures_of(&records).unexplained, 1);
}

#[test]
fn what_was_before_the_records_may_have_been_in_the_way() {
    let mut records = syncs(100);
    records[0] = record(1060, 0x080, BOARD);
    assert_eq!(figures_of(&records).unexplained, 0);
    records.insert(0, record(960, 0x601, BOARD));
    assert_eq!(figures_of(&records).unexplained, 0);
    // It is known that nothing was.
    records.insert(0, record(500, 0x081, DRIVE));
    assert_eq!(figures_of(&records).unexplained, 1);
}

/// SYNCs each `us(n)` late, with a frame that ends where the SYNC begins before those
/// that `blocked` names.
fn trace(us: impl Fn(u64) -> u64, blocked: impl Fn(u64) -> bool) -> Vec<WireRecord> {
    let mut records = Vec::new();
    for n in 0..200 {
        let at = 1000 + 2000 * n + us(n);
        if blocked(n) {
            records.push(record(at - u64::from(BITS), 0x701, DRIVE));
        }
        records.push(record(at, 0x080, BOARD));
    }
    records
}

#[test]
fn several_late_ones_in_a_row_need_a_frame_each() {
    let two = |n: u64| match n {
        50 | 51 => 60,
        _ => 0,
    };
    let figures = figures_of(&trace(two, |n| n == 50 || n == 51));
    assert_eq!((figures.unexplained, figures.late_in_a_row), (0, 2));
    assert_eq!(figures_of(&trace(two, |n| n == 50)).unexplained, 1);
    // The second waited for its frame, and was late before that.
    let added = |n: u64| match n {
        50 => 60,
        51 => 120,
        _ => 0,
    };
    let figures = figures_of(&trace(added, |n| n == 50 || n == 51));
    assert_eq!(figures.unexplained, 1, "{figures:?}");
    assert_eq!(figures_of(&trace(|_| 0, |_| false)).late_in_a_row, 0);
}

#[test]
fn who_counts_on_from_a_late_one_is_late_for_ever() {
    for first in [30, 100, 170] {
        let shifted = |n: u64| if n >= first { 60 } else { 0 };
        let figures = figures_of(&trace(shifted, |n| n == first));
        assert!(figures.unexplained >= 10, "{first}: {figures:?}");
    }
    // Each time that a frame is in the way.
    let figures = figures_of(&trace(|n| n / 20 * 60, |n| n > 0 && n % 20 == 0));
    assert!(figures.unexplained >= 10, "{figures:?}");
    assert!(figures.drift_ppm > 1000.0, "{figures:?}");
}

#[test]
fn a_grid_of_another_cycle_drifts() {
    let figures = figures_of(&trace(|n| n, |_| false));
    assert_eq!(figures.unexplained, 0);
    assert!((figures.drift_ppm - 500.0).abs() < 0.1, "{figures:?}");
    assert!(figures_of(&syncs(100)).drift_ppm < 0.001);
}

#[test]
fn a_sync_that_comes_twice_has_no_excuse() {
    for later in [u64::from(BITS), 700] {
        let mut records = syncs(100);
        records.insert(51, record(1000 + 2000 * 50 + later, 0x080, BOARD));
        assert!(figures_of(&records).unexplained > 0, "{later}");
    }
}

#[test]
fn many_late_ones_do_not_bend_the_grid() {
    let mut records = syncs(200);
    for n in (120..200).step_by(2) {
        records[n] = record(1000 + 2000 * n as u64 + 130, 0x080, BOARD);
    }
    let figures = figures_of(&records);
    assert!((figures.jitter_pp_us - 130.0).abs() < 0.01, "{figures:?}");
    assert_eq!(figures.unexplained, 40);
}

#[test]
fn buses_have_one_grid() {
    let shifted = |us: u64| -> Vec<WireRecord> {
        (0..100)
            .map(|n| record(1000 + us + 2000 * n, 0x080, BOARD))
            .collect()
    };
    let cycle = Time::from_us(2000);
    let (one, mut other) = (shifted(0), shifted(1));
    let all = |other: &[WireRecord]| jitter_of_all(&[&one, other], cycle);
    assert!((all(&other) - 1.0).abs() < 1e-6);
    other[50] = record(1000 + 2000 * 50 + 41, 0x080, BOARD);
    assert!((all(&other) - 41.0).abs() < 1e-6);
    assert_eq!(jitter_of_all(&[], cycle), 0.0);
}

#[test]
fn silence_within_a_burst_counts_whoever_ends_it() {
    let burst = |gaps: [u64; 2]| {
        let second = 1400 + 100 + gaps[0];
        let third = second + 100 + gaps[1];
        vec![
            record(1000, 0x080, BOARD),
            record(1400, 0x201, BOARD),
            record(second, 0x701, DRIVE),
            record(third, 0x202, BOARD),
            // Something else, after a silence that is nobody's fault.
            record(third + 500, 0x601, BOARD),
            record(3000, 0x080, BOARD),
            record(3300, 0x201, BOARD),
        ]
    };
    let gap = |records: &[WireRecord]| figures_of(records).burst_gap_bits;
    assert_eq!(gap(&burst([0, 0])), 0.0);
    assert_eq!(gap(&burst([7, 0])), 7.0);
    assert_eq!(gap(&burst([2, 5])), 5.0);
    // What others send is no burst of the master.
    let mut foreign = burst([0, 50]);
    foreign[3].transmitters = vec![DRIVE];
    assert_eq!(gap(&foreign), 0.0);
}

#[test]
fn what_is_ready_before_sync_follows_it_at_once() {
    let gap = |silence: u64| {
        let first = 1000 + 100 + silence;
        figures_of(&[
            record(1000, 0x080, BOARD),
            record(first, 0x302, BOARD),
            record(first + 100, 0x181, DRIVE),
            record(first + 900, 0x201, BOARD),
        ])
        .burst_gap_bits
    };
    assert_eq!([0, 3, 40].map(gap), [0.0, 3.0, 40.0]);
}

#[test]
fn rpdos_that_are_ready_together_are_one_burst() {
    let bursts = Bursts {
        after_sync: vec![0x201, 0x202, 0x301, 0x302],
        after_tpdos: Vec::new(),
    };
    let gap = |silence: u64| {
        let records = [
            record(1000, 0x080, BOARD),
            record(1100, 0x201, BOARD),
            record(1200, 0x202, BOARD),
            record(1300 + silence, 0x301, BOARD),
            record(1400 + silence, 0x302, BOARD),
        ];
        judge(&records, &traffic(), &bursts, BOARD).burst_gap_bits
    };
    assert_eq!([0, 12].map(gap), [0.0, 12.0]);
}

#[test]
fn answers_of_the_buss_nodes_count() {
    let records: Vec<_> = [0x581, 0x601, 0x582, 0x583, 0x581]
        .iter()
        .zip(0..)
        .map(|(id, n)| record(1000 + 200 * n, *id, DRIVE))
        .collect();
    assert_eq!(figures_of(&records).sdo_answers, 3);
}

#[test]
fn nothing_has_no_figures() {
    assert_eq!(figures_of(&[]), RealTime::default());
}

//! Real time on one bus, from what was on its wire: when the SYNCs left, what was
//! in the way of a late one, and whether the master lets the bus lie idle while it
//! has frames to send.

use canmaster::NodeId;
use canmaster::id::{CobId, FunctionCode};

use super::bus::{Traffic, is_sync};
use super::grid::{Grid, peak_to_peak};
use crate::bus::{PortId, RecordKind, WireRecord};
use crate::frame::WireId;
use crate::time::{PS_PER_S, PS_PER_US, Time};

/// A SYNC that is less late than this is on time, microseconds.
const ON_TIME_US: f64 = 2.0;
/// How often the grid is laid again through the SYNCs that are on time.
const PASSES: usize = 3;
/// The part of a COB-ID above the node-ID, of RPDO1 to RPDO4 (CiA 301, 7.3.5).
const RPDOS: [u16; 4] = [0x200, 0x300, 0x400, 0x500];
const FUNCTION_MASK: u16 = 0x780;

/// Figures of one bus.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RealTime {
    /// Peak to peak of the distances of the SYNCs' starts of frame from their grid,
    /// microseconds.
    pub jitter_pp_us: f64,
    /// How much later than the earliest each SYNC left, by whole microseconds: how
    /// many did so.
    pub histogram: Vec<usize>,
    /// SYNCs that were late though no single frame was in their way.
    pub unexplained: usize,
    /// The longest silence of the bus between the first and the last RPDO of a
    /// number in a cycle, beyond the interframe space, in bits.
    pub burst_gap_bits: f64,
    /// Answers of the SDO servers of the bus's nodes.
    pub sdo_answers: usize,
}

/// Judges what was on the wire while the nodes were operational. `board` is the
/// master's port.
pub fn judge(records: &[WireRecord], traffic: &Traffic, board: PortId) -> RealTime {
    let late = lateness(records, traffic.cycle);
    let microseconds: Vec<f64> = late.iter().map(|(_, us)| *us).collect();
    let bit = Time(PS_PER_S / u64::from(traffic.bit_rate.max(1)));
    RealTime {
        jitter_pp_us: peak_to_peak(&microseconds),
        histogram: histogram(&microseconds),
        unexplained: unexplained(records, &late),
        burst_gap_bits: burst_gap(records, board).as_us_f64() / bit.as_us_f64(),
        sdo_answers: sdo_answers(records, &traffic.nodes),
    }
}

/// The place of each SYNC in the records, and how much later it left than the
/// earliest did, against a grid through those that were on time.
fn lateness(records: &[WireRecord], cycle: Time) -> Vec<(usize, f64)> {
    let (places, points) = numbered(records, cycle);
    let late = match grid_of(&points) {
        Some(grid) => lateness_on(&grid, &points),
        None => vec![0.0; points.len()],
    };
    places.into_iter().zip(late).collect()
}

/// The greatest distance between the SYNCs of all buses, each from one grid that they
/// have in common: what the board knows of their starts, counted from its tick.
pub fn jitter_of_all(buses: &[&[WireRecord]], cycle: Time) -> f64 {
    let first = buses.first().copied().unwrap_or_default();
    let Some(grid) = grid_of(&numbered(first, cycle).1) else {
        return 0.0;
    };
    let syncs = buses.iter().flat_map(|records| records.iter());
    let syncs = syncs.filter(|record| is_sync(record));
    let late = syncs.map(|record| {
        let us = record.sof.as_us_f64() - grid.origin;
        us - (us / grid.period).round() * grid.period
    });
    peak_to_peak(&late.collect::<Vec<f64>>())
}

/// The places of the SYNCs in the records, and of each its number and its moment.
fn numbered(records: &[WireRecord], cycle: Time) -> (Vec<usize>, Vec<(u64, f64)>) {
    let cycle_us = cycle.as_us_f64();
    let syncs = records.iter().enumerate();
    let syncs = syncs.filter(|(_, record)| is_sync(record));
    let mut points: Vec<(u64, f64)> = Vec::new();
    let mut places = Vec::new();
    for (place, record) in syncs {
        let us = record.sof.as_us_f64();
        let n = points.last().map_or(0, |&(n, last)| {
            n + ((us - last) / cycle_us).round().max(0.0) as u64
        });
        points.push((n, us));
        places.push(place);
    }
    (places, points)
}

/// How much later than the earliest each point is.
fn lateness_on(grid: &Grid, points: &[(u64, f64)]) -> Vec<f64> {
    let residuals = grid.residuals(points);
    let earliest = residuals.iter().copied().fold(f64::INFINITY, f64::min);
    residuals.iter().map(|us| us - earliest).collect()
}

/// The grid through those that were on time.
fn grid_of(points: &[(u64, f64)]) -> Option<Grid> {
    let mut grid = Grid::fit(points)?;
    for _ in 1..PASSES {
        let late = lateness_on(&grid, points);
        // The half that is least late: whatever disturbs, it is not among them.
        let mut sorted = late.clone();
        sorted.sort_by(f64::total_cmp);
        let limit = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
        let limit = limit.max(ON_TIME_US);
        let on_time: Vec<_> = points
            .iter()
            .zip(&late)
            .filter(|(_, us)| **us <= limit)
            .map(|(point, _)| *point)
            .collect();
        grid = Grid::fit(&on_time)?;
    }
    Some(grid)
}

fn histogram(late: &[f64]) -> Vec<usize> {
    let mut counts = Vec::new();
    for us in late {
        let bin = *us as usize;
        if bin >= counts.len() {
            counts.resize(bin + 1, 0);
        }
        counts[bin] += 1;
    }
    counts
}

/// A late SYNC has an excuse: a frame that was on the wire when it was due (or came
/// before it within what counts as on time), and that it followed at once.
fn unexplained(records: &[WireRecord], late: &[(usize, f64)]) -> usize {
    let ps = |us: f64| Time((us * PS_PER_US as f64) as u64);
    let excused = |place: usize, us: f64| {
        let sync = &records[place];
        let before = place.checked_sub(1).and_then(|place| records.get(place));
        before.is_some_and(|frame| {
            let due = sync.sof - ps(us) + ps(ON_TIME_US);
            frame.sof <= due && sync.sof <= frame.end + ps(ON_TIME_US)
        })
    };
    late.iter()
        .filter(|(place, us)| *us > ON_TIME_US && !excused(*place, *us))
        .count()
}

/// Which RPDO of a node a frame of the board is.
fn rpdo(record: &WireRecord, board: PortId) -> Option<usize> {
    if !record.transmitters.contains(&board) {
        return None;
    }
    match &record.kind {
        RecordKind::Frame(frame) => match frame.id {
            WireId::Standard(id) => RPDOS.iter().position(|code| id & FUNCTION_MASK == *code),
            WireId::Extended(_) => None,
        },
        RecordKind::ErrorFrame { .. } => None,
    }
}

fn burst_gap(records: &[WireRecord], board: PortId) -> Time {
    let mut worst = Time::ZERO;
    // Of each RPDO: the longest silence since the last one in this cycle.
    let mut open: [Option<Time>; RPDOS.len()] = [None; RPDOS.len()];
    let mut end = None;
    for record in records {
        if let Some(end) = end {
            let silence = record.sof.since(end);
            for gap in open.iter_mut().flatten() {
                *gap = silence.max(*gap);
            }
        }
        if is_sync(record) {
            open = [None; RPDOS.len()];
        }
        if let Some(number) = rpdo(record, board) {
            worst = worst.max(open[number].unwrap_or(Time::ZERO));
            open[number] = Some(Time::ZERO);
        }
        end = Some(record.end);
    }
    worst
}

fn sdo_answers(records: &[WireRecord], nodes: &[NodeId]) -> usize {
    let answers =
        |node: &NodeId| WireId::Standard(CobId::of(FunctionCode::SdoResponse, *node).get());
    let answers: Vec<WireId> = nodes.iter().map(answers).collect();
    let frames = records.iter().filter_map(|record| match &record.kind {
        RecordKind::Frame(frame) => Some(frame.id),
        RecordKind::ErrorFrame { .. } => None,
    });
    frames.filter(|id| answers.contains(id)).count()
}

#[cfg(test)]
mod tests {
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

    fn syncs(count: u64) -> Vec<WireRecord> {
        (0..count)
            .map(|n| record(1000 + 2000 * n, 0x080, BOARD))
            .collect()
    }

    #[test]
    fn sync_on_the_grid_is_on_time() {
        let figures = judge(&syncs(100), &traffic(), BOARD);
        assert!(figures.jitter_pp_us < 1e-6);
        assert_eq!(figures.histogram, [100]);
        assert_eq!(figures.unexplained, 0);
    }

    #[test]
    fn a_late_sync_needs_a_frame_in_its_way() {
        let mut records = syncs(100);
        records[50] = record(1000 + 2000 * 50 + 60, 0x080, BOARD);
        let late = judge(&records, &traffic(), BOARD);
        assert!((late.jitter_pp_us - 60.0).abs() < 0.01, "{late:?}");
        assert_eq!((late.histogram[0], late.histogram.iter().sum()), (99, 100));
        assert_eq!(late.unexplained, 1);
        // A frame that ends where the SYNC begins, and began before it was due.
        records.insert(50, record(1000 + 2000 * 50 - 40, 0x701, DRIVE));
        assert_eq!(judge(&records, &traffic(), BOARD).unexplained, 0);
        // One that began after that is none of its business.
        records[50] = record(1000 + 2000 * 50 + 20, 0x701, DRIVE);
        assert_eq!(judge(&records, &traffic(), BOARD).unexplained, 1);
    }

    #[test]
    fn many_late_ones_do_not_bend_the_grid() {
        let mut records = syncs(200);
        for n in (120..200).step_by(2) {
            records[n] = record(1000 + 2000 * n as u64 + 130, 0x080, BOARD);
        }
        let figures = judge(&records, &traffic(), BOARD);
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
                // Another burst, after a silence that is nobody's fault.
                record(third + 500, 0x301, BOARD),
                record(3000, 0x080, BOARD),
                record(3300, 0x201, BOARD),
            ]
        };
        let gap = |records: &[WireRecord]| judge(records, &traffic(), BOARD).burst_gap_bits;
        assert_eq!(gap(&burst([0, 0])), 0.0);
        assert_eq!(gap(&burst([7, 0])), 7.0);
        assert_eq!(gap(&burst([2, 5])), 5.0);
        // What others send is no burst of the master.
        let mut foreign = burst([0, 50]);
        foreign[3].transmitters = vec![DRIVE];
        assert_eq!(gap(&foreign), 0.0);
    }

    #[test]
    fn answers_of_the_buss_nodes_count() {
        let records: Vec<_> = [0x581, 0x601, 0x582, 0x583, 0x581]
            .iter()
            .zip(0..)
            .map(|(id, n)| record(1000 + 200 * n, *id, DRIVE))
            .collect();
        assert_eq!(judge(&records, &traffic(), BOARD).sdo_answers, 3);
    }

    #[test]
    fn nothing_has_no_figures() {
        assert_eq!(judge(&[], &traffic(), BOARD), RealTime::default());
    }
}

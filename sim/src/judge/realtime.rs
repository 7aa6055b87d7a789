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
const PARTS_PER_MILLION: f64 = 1e6;

/// The RPDOs of one bus that the master has ready together, by their COB-IDs: while
/// one of them waits, the wire is not to be idle.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bursts {
    /// Those that are ready before a SYNC and go directly after it.
    pub after_sync: Vec<u16>,
    /// Those that are ready when the TPDOs have been answered to.
    pub after_tpdos: Vec<u16>,
}

/// Figures of one bus.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RealTime {
    /// Peak to peak of the distances of the SYNCs' starts of frame from their grid,
    /// microseconds.
    pub jitter_pp_us: f64,
    /// How much later than the earliest each SYNC left, by whole microseconds: how
    /// many did so.
    pub histogram: Vec<usize>,
    /// SYNCs that were late though no single frame was in their way that may be, and
    /// those that came twice.
    pub unexplained: usize,
    /// How many SYNCs one behind the other were late, at most, each by a frame that was
    /// on the wire when it was due.
    pub late_in_a_row: usize,
    /// How far the SYNCs' grid is from the cycle that was asked for, in parts per
    /// million: the board's crystal, or SYNCs that are counted from late ones.
    pub drift_ppm: f64,
    /// The longest silence of the bus within one of its [`Bursts`], the SYNC before
    /// included, beyond the interframe space, in bits.
    pub burst_gap_bits: f64,
    /// Answers of the SDO servers of the bus's nodes.
    pub sdo_answers: usize,
}

/// A SYNC among the records.
struct Late {
    /// Its place in them.
    place: usize,
    /// Its number on the grid.
    number: u64,
    /// How much later it left than the earliest did.
    us: f64,
}

/// Judges what was on the wire while the nodes were operational. `board` is the
/// master's port.
pub fn judge(
    records: &[WireRecord],
    traffic: &Traffic,
    bursts: &Bursts,
    board: PortId,
) -> RealTime {
    let (late, period_us) = lateness(records, traffic.cycle);
    let microseconds: Vec<f64> = late.iter().map(|sync| sync.us).collect();
    let bit = Time(PS_PER_S / u64::from(traffic.bit_rate.max(1)));
    let cycle_us = traffic.cycle.as_us_f64();
    RealTime {
        jitter_pp_us: peak_to_peak(&microseconds),
        histogram: histogram(&microseconds),
        unexplained: unexplained(records, &late, board),
        late_in_a_row: late_in_a_row(&microseconds),
        drift_ppm: (period_us / cycle_us - 1.0).abs() * PARTS_PER_MILLION,
        burst_gap_bits: burst_gap(records, bursts, board).as_us_f64() / bit.as_us_f64(),
        sdo_answers: sdo_answers(records, &traffic.nodes),
    }
}

/// The SYNCs, and the period of their grid, in microseconds. The grid goes through
/// those that were on time, so that one that was late moves none of the others.
fn lateness(records: &[WireRecord], cycle: Time) -> (Vec<Late>, f64) {
    let (places, points) = numbered(records, cycle);
    let (late, period) = match grid_of(&points) {
        Some(grid) => (lateness_on(&grid, &points), grid.period),
        None => (vec![0.0; points.len()], cycle.as_us_f64()),
    };
    let syncs = places.into_iter().zip(points).zip(late);
    let syncs = syncs.map(|((place, (number, _)), us)| Late { place, number, us });
    (syncs.collect(), period)
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

/// A late SYNC has an excuse: a frame that was on the wire when it was
/// due on the grid (or came before it within what counts as on time), and that it
/// followed at once. That goes for each of several late ones in a row: who counts from
/// a late SYNC instead of the grid has no such frame. A frame of the master itself is one
/// only if it had to wait for a frame of a drive: the master begins nothing that would be
/// in the way. A second SYNC in the same cycle has no excuse. What was on the wire before
/// the first record is not known: whom that could excuse is not counted.
fn unexplained(records: &[WireRecord], late: &[Late], board: PortId) -> usize {
    let ps = |us: f64| Time((us * PS_PER_US as f64) as u64);
    let before = |place: usize| place.checked_sub(1).and_then(|at| records.get(at));
    let at_once = |frame: &WireRecord, next: &WireRecord| next.sof <= frame.end + ps(ON_TIME_US);
    let of_drive = |frame: &WireRecord| !frame.transmitters.contains(&board);
    let excused = |late: &Late| {
        let sync = &records[late.place];
        before(late.place).is_none_or(|frame| {
            let due = sync.sof - ps(late.us) + ps(ON_TIME_US);
            let waited = || {
                let first = late.place.checked_sub(1).and_then(before);
                first.is_none_or(|first| of_drive(first) && at_once(first, frame))
            };
            let allowed = of_drive(frame) || !is_sync(frame) && waited();
            allowed && frame.sof <= due && at_once(frame, sync)
        })
    };
    let without_excuse = |late: &&Late| late.us > ON_TIME_US && !excused(late);
    let twice = |pair: &&[Late]| pair[0].number == pair[1].number;
    late.iter().filter(without_excuse).count() + late.windows(2).filter(twice).count()
}

fn late_in_a_row(late: &[f64]) -> usize {
    let rows = late.chunk_by(|one, next| (*one > ON_TIME_US) == (*next > ON_TIME_US));
    let late_rows = rows.filter(|row| row.iter().all(|us| *us > ON_TIME_US));
    late_rows.map(<[f64]>::len).max().unwrap_or(0)
}

/// The COB-ID of a frame of the board.
fn id_from(record: &WireRecord, board: PortId) -> Option<u16> {
    match &record.kind {
        RecordKind::Frame(frame) if record.transmitters.contains(&board) => match frame.id {
            WireId::Standard(id) => Some(id),
            WireId::Extended(_) => None,
        },
        _ => None,
    }
}

fn burst_gap(records: &[WireRecord], bursts: &Bursts, board: PortId) -> Time {
    let mut worst = Time::ZERO;
    // The longest silence since the SYNC of this cycle, and since the first RPDO after
    // the TPDOs.
    let (mut since_sync, mut since_first) = (None, None);
    let mut end = None;
    for record in records {
        if let Some(end) = end {
            let silence = record.sof.since(end);
            for gap in [&mut since_sync, &mut since_first].into_iter().flatten() {
                *gap = silence.max(*gap);
            }
        }
        if is_sync(record) {
            (since_sync, since_first) = (Some(Time::ZERO), None);
        }
        let id = id_from(record, board);
        if id.is_some_and(|id| bursts.after_sync.contains(&id)) {
            worst = worst.max(since_sync.unwrap_or(Time::ZERO));
        }
        if id.is_some_and(|id| bursts.after_tpdos.contains(&id)) {
            worst = worst.max(since_first.unwrap_or(Time::ZERO));
            since_first = Some(Time::ZERO);
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
#[path = "realtime_tests.rs"]
mod tests;

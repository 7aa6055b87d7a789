//! In which SYNC the axes start and arrive, as the set values on the wire have it:
//! what a drive follows from a SYNC on is the RPDO that came before it (CiA 301,
//! 7.2.2.4).

use canmaster::network::{Network, Node};

use super::axis::{SETTLED, STANDSTILL_RPM};
use crate::bus::{RecordKind, WireRecord};
use crate::frame::{WireFrame, WireId};
use crate::time::Time;

/// The SYNC (CiA 301, 7.3.5).
const SYNC: u16 = 0x080;
/// RPDO 1 of node 0; the others follow in steps of this.
const RPDO1: u16 = 0x200;
const RPDO_STEP: u16 = 0x100;
/// RPDOs of the predefined connection set.
const RPDOS: u16 = 4;
const NODE_MASK: u16 = 0x7F;
/// Set values (CiA 402-2): position, velocity, torque.
const TARGET_POSITION: u16 = 0x607A;
const TARGET_VELOCITY: u16 = 0x60FF;
const TARGET_TORQUE: u16 = 0x6071;
/// A torque that counts as none, per mille: below it friction holds the axis.
const NO_TORQUE: i64 = 5;
/// An axis moves if it is told so many positions, each beyond the one before and so many
/// SYNCs later at most: one that is held may be corrected.
const POSITIONS: usize = 3;
const NEXT_POSITION: usize = 10;

/// A SYNC that was on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// Its number on its bus, from 1.
    pub sync: usize,
    /// Its start of frame.
    pub at: Time,
}

/// One axis was told to move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// Its place in the network.
    pub axis: usize,
    /// The SYNC with which it starts.
    pub start: Edge,
    /// The SYNC with which it is told to move for the last time: with the next it
    /// has arrived.
    pub end: Edge,
}

/// What an RPDO sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Target {
    Position(i64),
    Velocity(i64),
    Torque(i64),
}

#[derive(Clone, Copy, Debug, Default)]
struct Axis {
    /// Came since the last SYNC.
    next: Option<Target>,
    /// Is followed since the last SYNC.
    present: Option<Target>,
    /// Positions in one direction.
    run: Option<Run>,
}

/// Positions of which each is beyond the one before.
#[derive(Clone, Copy, Debug)]
struct Run {
    first: Edge,
    last: Edge,
    up: bool,
    count: usize,
}

/// All spans on all buses, in the order of their starts.
pub fn spans<'w>(buses: impl Iterator<Item = &'w [WireRecord]>, network: &Network) -> Vec<Span> {
    let mut all: Vec<Span> = buses.flat_map(|wire| on_bus(wire, network)).collect();
    all.sort_by_key(|span| (span.start.at, span.axis));
    all
}

fn on_bus(wire: &[WireRecord], network: &Network) -> Vec<Span> {
    let mut axes = vec![Axis::default(); network.nodes.len()];
    let mut open: Vec<Option<Span>> = vec![None; axes.len()];
    let mut done = Vec::new();
    // A shorter rest belongs to one movement.
    let pause = (SETTLED.0 / Time::from(network.cycle).0.max(1)).max(1) as usize;
    let mut sync = 0;
    for record in wire {
        let RecordKind::Frame(frame) = &record.kind else {
            continue;
        };
        let WireId::Standard(id) = frame.id else {
            continue;
        };
        if id != SYNC {
            if let Some((axis, target)) = set_by(frame, id, network) {
                axes[axis].next = Some(target);
            }
            continue;
        }
        sync += 1;
        let edge = Edge {
            sync,
            at: record.sof,
        };
        for (n, (axis, open)) in axes.iter_mut().zip(&mut open).enumerate() {
            let Some(start) = axis.sync(edge) else {
                continue;
            };
            match open {
                Some(span) if start.sync <= span.end.sync + pause => span.end = edge,
                _ => {
                    done.extend(open.take());
                    *open = Some(Span {
                        axis: n,
                        start,
                        end: edge,
                    });
                }
            }
        }
    }
    done.extend(open.into_iter().flatten());
    done
}

impl Axis {
    /// The set value counts; since when the axis is to move, if it is.
    fn sync(&mut self, now: Edge) -> Option<Edge> {
        let before = self.present;
        self.present = self.next.take().or(before);
        let moves = match (self.present, before) {
            (Some(Target::Position(to)), Some(Target::Position(before))) if to != before => {
                let up = to > before;
                let goes_on = |run: &Run| run.up == up && now.sync - run.last.sync <= NEXT_POSITION;
                let run = self.run.filter(goes_on);
                let run = Run {
                    first: run.map_or(now, |run| run.first),
                    last: now,
                    up,
                    count: run.map_or(0, |run| run.count) + 1,
                };
                self.run = Some(run);
                return (run.count >= POSITIONS).then_some(run.first);
            }
            (Some(Target::Velocity(to)), _) => to.abs() as f64 > STANDSTILL_RPM,
            (Some(Target::Torque(to)), _) => to.abs() > NO_TORQUE,
            _ => false,
        };
        moves.then_some(now)
    }
}

/// Whose set value the frame carries, and which.
pub(super) fn set_by(frame: &WireFrame, id: u16, network: &Network) -> Option<(usize, Target)> {
    let above = id.checked_sub(RPDO1)?;
    let number = above / RPDO_STEP;
    // Between them are the TPDOs, and the answers of SDO servers.
    if number >= RPDOS || above % RPDO_STEP > NODE_MASK {
        return None;
    }
    let is_it = |node: &Node| u16::from(node.id.get()) == id & NODE_MASK;
    let axis = network.nodes.iter().position(is_it)?;
    let rpdos = network.nodes[axis].rpdos;
    let pdo = rpdos
        .iter()
        .find(|pdo| u16::from(pdo.number) == number + 1)?;
    let mut from = 0;
    for entry in pdo.mapping {
        let bytes = usize::from(entry.bits() / 8);
        let field = frame.data.get(from..from + bytes)?;
        from += bytes;
        let number = signed(field);
        match entry.at().index.0 {
            TARGET_POSITION => return Some((axis, Target::Position(number))),
            TARGET_VELOCITY => return Some((axis, Target::Velocity(number))),
            TARGET_TORQUE => return Some((axis, Target::Torque(number))),
            _ => {}
        }
    }
    None
}

/// Little-endian, two's complement.
fn signed(field: &[u8]) -> i64 {
    let raw = field
        .iter()
        .rev()
        .fold(0_i64, |n, byte| n << 8 | i64::from(*byte));
    let unused = 64 - 8 * field.len() as u32;
    raw << unused >> unused
}

#[cfg(test)]
mod tests {
    use super::*;
    use canmaster::network::sample::SIX_EPOS4_10_MS as SIX_EPOS4;

    fn record(ms: u64, id: u16, data: &[u8]) -> WireRecord {
        WireRecord {
            sof: Time::from_ms(ms),
            end: Time::from_ms(ms),
            bits: 100,
            transmitters: Vec::new(),
            kind: RecordKind::Frame(WireFrame::standard(id, data)),
        }
    }

    fn rpdo(ms: u64, node: u16, rpm: i32) -> WireRecord {
        let mut data = vec![0x0F, 0x00];
        data.extend_from_slice(&rpm.to_le_bytes());
        record(ms, RPDO1 + node, &data)
    }

    fn spans(wire: &[WireRecord]) -> Vec<Span> {
        super::spans([wire].into_iter(), &SIX_EPOS4)
    }

    /// A SYNC every 10 ms, and these set values of nodes 1 and 2 in between.
    fn wire(targets: &[(i32, i32)]) -> Vec<WireRecord> {
        let cycle = |(n, (one, two)): (usize, &(i32, i32))| {
            let ms = 10 * n as u64;
            [
                record(ms, SYNC, &[]),
                rpdo(ms + 3, 1, *one),
                rpdo(ms + 4, 2, *two),
            ]
        };
        targets.iter().enumerate().flat_map(cycle).collect()
    }

    #[test]
    fn a_set_value_counts_from_the_next_sync() {
        let found = spans(&wire(&[
            (0, 0),
            (100, -50),
            (200, -50),
            (100, 3),
            (4, 0),
            (0, 0),
            (0, 0),
        ]));
        let edge = |sync: usize| Edge {
            sync,
            at: Time::from_ms(10 * (sync as u64 - 1)),
        };
        let span = |axis, start, end| Span {
            axis,
            start: edge(start),
            end: edge(end),
        };
        assert_eq!(found, [span(0, 3, 5), span(1, 3, 4)]);
    }

    #[test]
    fn a_long_rest_ends_a_movement_and_a_short_one_does_not() {
        let targets = |rest: usize| {
            let mut targets = vec![(300, 0); 3];
            targets.extend(vec![(0, 0); rest]);
            targets.extend([(-300, 0), (0, 0)]);
            targets
        };
        assert_eq!(spans(&wire(&targets(9))).len(), 1);
        assert_eq!(spans(&wire(&targets(10))).len(), 2);
    }

    #[test]
    fn other_frames_set_nothing() {
        let mut wire = wire(&[(0, 0), (0, 0)]);
        // RPDO2 carries ramps; an unknown node; a TPDO; too short a frame.
        wire.push(record(14, 0x301, &[1; 8]));
        wire.push(record(15, 0x211, &[1; 6]));
        wire.push(record(16, 0x181, &[1; 6]));
        // TPDO2, and the answer of an SDO server.
        wire.push(record(16, 0x281, &[1; 8]));
        wire.push(record(16, 0x581, &[1; 8]));
        wire.push(record(20, SYNC, &[]));
        assert!(spans(&wire).is_empty());
    }

    #[test]
    fn a_position_that_is_corrected_once_is_no_movement() {
        let frame = |ms: u64, position: i32| {
            let mut data = vec![0x0F, 0x00];
            data.extend_from_slice(&position.to_le_bytes());
            record(ms, RPDO1 + 2 * RPDO_STEP + 1, &data)
        };
        let positions = [7, 7, 8, 8, 8, 9, 12, 16, 16, 16];
        let cycle = |(n, position): (u64, &i32)| {
            let ms = 10 * (n + 20 * u64::from(n > 3));
            [record(ms, SYNC, &[]), frame(ms + 3, *position)]
        };
        let numbered = (0..).zip(&positions);
        let mut wire: Vec<WireRecord> = numbered.flat_map(cycle).collect();
        // Twenty SYNCs more after the first four.
        let more = (4..24).map(|n| record(10 * n, SYNC, &[]));
        wire.splice(8..8, more);
        let network = &canmaster::network::sample::SIX_EPOS4;
        let found = super::spans([wire.as_slice()].into_iter(), network);
        let numbers: Vec<_> = found
            .iter()
            .map(|span| (span.axis, span.start.sync, span.end.sync))
            .collect();
        assert_eq!(numbers, [(0, 27, 29)]);
    }

    #[test]
    fn numbers_have_signs() {
        assert_eq!(signed(&[0xFE, 0xFF]), -2);
        assert_eq!(signed(&[0x00, 0x00, 0x00, 0x80]), i64::from(i32::MIN));
        assert_eq!(signed(&[0x10, 0x27]), 10_000);
    }
}

//! How soon a group reacts to what befalls one of its axes, as the wire shows it: from
//! the SYNC at which a drive took the values of a TPDO to the SYNC at which the others
//! are told to stop.

use canmaster::network::{Network, Node};

use super::bus::is_sync;
use super::contract::STOP_RPM_PER_S;
use super::coordination::{Target, set_by};
use crate::bus::{RecordKind, WireRecord};
use crate::frame::{WireFrame, WireId};
use crate::time::{PS_PER_S, Time};

/// TPDO1 of node 0 (CiA 301, 7.3.5).
const TPDO1: u16 = 0x180;
const STATUSWORD: u16 = 0x6041;
/// Bits of the statusword that tell operation enabled (CiA 402-2, 6041h).
const STATE_MASK: u16 = 0x006F;
const OPERATION_ENABLED: u16 = 0x0027;

/// A stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reaction {
    /// The SYNC at which the drive took the first statusword that shows that it is no
    /// more in operation enabled; `None` if it shows nothing.
    pub sampled: Option<Time>,
    /// The SYNC at which the stop acts in the others.
    pub acts: Time,
}

/// The reaction on something that befalls the axis `struck` at `from`, while the others
/// turn.
pub fn reaction(
    wire: &[WireRecord],
    network: &Network,
    struck: usize,
    from: Time,
) -> Option<Reaction> {
    let cycle = Time::from(network.cycle);
    // Half of what the stop takes from a speed in a cycle: more than noise does.
    let drop = STOP_RPM_PER_S as f64 * cycle.0 as f64 / PS_PER_S as f64 / 2.0;
    let axes = network.nodes.len();
    let mut speeds = vec![Speeds::default(); axes];
    let (mut sampled, mut sync) = (None, None);
    for record in wire {
        if is_sync(record) {
            sync = Some(record.sof);
            let others = speeds.iter_mut().enumerate().filter(|(n, _)| *n != struck);
            let stops = others.filter_map(|(_, axis)| axis.sync(record.sof, drop));
            // The SYNC before that with which they became slower for the second time.
            let mut stops: Vec<Time> = stops.filter(|at| *at > from).collect();
            if stops.len() * 2 > axes - 1 {
                stops.sort();
                return Some(Reaction {
                    sampled,
                    acts: stops[stops.len() / 2],
                });
            }
            continue;
        }
        let RecordKind::Frame(frame) = &record.kind else {
            continue;
        };
        let WireId::Standard(id) = frame.id else {
            continue;
        };
        if let Some((axis, Target::Velocity(rpm))) = set_by(frame, id, network) {
            speeds[axis].next = Some(rpm);
        }
        let shown = network
            .nodes
            .get(struck)
            .and_then(|node| statusword(frame, id, node));
        if record.sof > from
            && sampled.is_none()
            && shown.is_some_and(|word| word & STATE_MASK != OPERATION_ENABLED)
        {
            sampled = sync;
        }
    }
    None
}

/// The set speeds of an axis.
#[derive(Clone, Copy, Debug, Default)]
struct Speeds {
    /// Came since the last SYNC.
    next: Option<i64>,
    /// Is followed.
    present: i64,
    /// The SYNC from which on it is slower.
    slower: Option<Time>,
}

impl Speeds {
    /// The set value counts; since when it has become slower, if it has by `drop` twice
    /// in a row.
    fn sync(&mut self, at: Time, drop: f64) -> Option<Time> {
        let before = self.present;
        self.present = self.next.take().unwrap_or(before);
        let lost = (before.abs() - self.present.abs()) as f64;
        let since = self.slower.take();
        if lost >= drop {
            self.slower = Some(since.unwrap_or(at));
        }
        since.filter(|_| lost >= drop)
    }
}

/// The statusword in a TPDO1 of `node`.
fn statusword(frame: &WireFrame, id: u16, node: &Node) -> Option<u16> {
    if id != TPDO1 + u16::from(node.id.get()) {
        return None;
    }
    let pdo = node.tpdos.iter().find(|pdo| pdo.number == 1)?;
    let mut from = 0;
    for entry in pdo.mapping {
        if entry.at().index.0 == STATUSWORD {
            let bytes = frame.data.get(from..from + 2)?;
            return Some(u16::from_le_bytes([bytes[0], bytes[1]]));
        }
        from += usize::from(entry.bits() / 8);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::PortId;
    use canmaster::network::sample::SIX_EPOS4;

    fn record(us: u64, id: u16, data: &[u8]) -> WireRecord {
        WireRecord {
            sof: Time::from_us(us),
            end: Time::from_us(us + 100),
            bits: 100,
            transmitters: vec![PortId(0)],
            kind: RecordKind::Frame(WireFrame::standard(id, data)),
        }
    }

    /// A cycle of 2 ms: SYNC, statusword of node 2, set speeds of all.
    fn cycle(n: u64, status: u16, rpm: i32) -> Vec<WireRecord> {
        let at = 2000 * n;
        let mut records = vec![record(at, 0x080, &[])];
        let [low, high] = status.to_le_bytes();
        records.push(record(at + 100, 0x182, &[low, high, 0, 0, 0, 0]));
        for node in 1..=6_u16 {
            // Some turn the other way.
            let rpm = if node % 2 == 0 { -rpm } else { rpm };
            let mut data = vec![0x0F, 0];
            data.extend(rpm.to_le_bytes());
            let place = at + 1000 + 100 * u64::from(node);
            records.push(record(place, 0x200 + node, &data));
        }
        records
    }

    fn wire(cycles: &[(u16, i32)]) -> Vec<WireRecord> {
        let numbered = (0..).zip(cycles);
        numbered
            .flat_map(|(n, (status, rpm))| cycle(n, *status, *rpm))
            .collect()
    }

    const FINE: u16 = 0x0637;
    const FAULT: u16 = 0x0218;

    #[test]
    fn from_the_statusword_to_the_stop() {
        let wire = wire(&[
            (FINE, 1000),
            (FINE, 999),
            (FINE, 1001),
            (FAULT, 995),
            (FAULT, 989),
            (FAULT, 983),
        ]);
        let found = reaction(&wire, &SIX_EPOS4, 1, Time::from_us(5000));
        let expected = Reaction {
            sampled: Some(Time::from_us(6000)),
            acts: Time::from_us(8000),
        };
        assert_eq!(found, Some(expected));
    }

    #[test]
    fn what_shows_nothing_is_known_by_the_stop_alone() {
        let mut wire = wire(&[
            (FINE, 1000),
            (FINE, 1000),
            (FINE, 994),
            (FINE, 988),
            (FINE, 982),
        ]);
        wire.retain(|record| !matches!(&record.kind, RecordKind::Frame(frame) if frame.id == WireId::Standard(0x182)));
        let found = reaction(&wire, &SIX_EPOS4, 1, Time::from_us(1));
        let acts = Time::from_us(6000);
        assert_eq!(
            found,
            Some(Reaction {
                sampled: None,
                acts
            })
        );
    }

    #[test]
    fn noise_and_gentle_ramps_are_no_stop() {
        let gentle: Vec<_> = (0..50).map(|n| (FINE, 1000 - 2 * n - n % 2)).collect();
        assert_eq!(reaction(&wire(&gentle), &SIX_EPOS4, 1, Time::ZERO), None);
        assert_eq!(reaction(&[], &SIX_EPOS4, 1, Time::ZERO), None);
    }
}

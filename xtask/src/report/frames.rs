//! One cycle of the bus, sorted into lanes.

use canmaster_sim::bus::RecordKind;
use canmaster_sim::frame::WireId;
use canmaster_sim::time::Time;
use canmaster_sim::world::{BusRecord, Record};

/// One frame in the picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Block {
    pub(super) start_us: f64,
    pub(super) end_us: f64,
    /// Place of the node in the network, for its colour.
    pub(super) axis: Option<usize>,
}

/// Frames of one kind.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Lane {
    pub(super) name: String,
    pub(super) frames: Vec<Block>,
}

/// The names of the lanes, from the top, and the function codes that belong in
/// them (CiA 301, 7.3.5).
const LANES: [(&str, &[u16]); 9] = [
    ("SYNC", &[0x080]),
    ("TPDO1", &[0x180]),
    ("TPDO2", &[0x280]),
    ("RPDO1", &[0x200]),
    ("RPDO2", &[0x300]),
    ("SDO", &[0x580, 0x600]),
    ("heartbeat", &[0x700]),
    ("NMT, EMCY", &[0x000]),
    ("error frames", &[]),
];
const EMCY_LANE: usize = 7;
const ERROR_LANE: usize = 8;
/// Bits of a COB-ID that hold the node-ID.
const NODE_MASK: u16 = 0x7F;
const SYNC: u16 = 0x080;
/// A pause this long ends the burst of a cycle.
const PAUSE_US: f64 = 500.0;

/// The moments between which the picture is drawn: a cycle in the middle of
/// the first motion, or else the fullest one.
pub(super) fn chosen_cycle(record: &Record, bus: &BusRecord) -> Option<(Time, Time)> {
    let released = record
        .releases
        .first()
        .map(|release| release.at + Time::from_ms(500));
    let syncs = || {
        bus.wire.iter().filter_map(|wire| match &wire.kind {
            RecordKind::Frame(frame) if frame.id == WireId::Standard(SYNC) => Some(wire.sof),
            _ => None,
        })
    };
    let in_motion = released.and_then(|from| {
        let mut following = syncs().skip_while(|at| *at < from);
        Some((following.next()?, following.next()?))
    });
    in_motion.or(bus.figures.worst_cycle)
}

/// The frames of that time, in lanes; empty lanes are left out.
pub(super) fn lanes(record: &Record, bus: &BusRecord, from: Time, to: Time) -> Vec<Lane> {
    let mut lanes: Vec<Lane> = LANES
        .iter()
        .map(|(name, _)| Lane {
            name: (*name).into(),
            frames: Vec::new(),
        })
        .collect();
    for wire in &bus.wire {
        if wire.sof < from || wire.sof >= to {
            continue;
        }
        let (lane, node) = match &wire.kind {
            RecordKind::ErrorFrame { .. } => (ERROR_LANE, None),
            RecordKind::Frame(frame) => match frame.id {
                WireId::Standard(id) => lane_of(id),
                WireId::Extended(_) => (EMCY_LANE, None),
            },
        };
        let axis = node.and_then(|node| {
            record
                .axes
                .iter()
                .position(|axis| u16::from(axis.node.get()) == node)
        });
        lanes[lane].frames.push(Block {
            start_us: wire.sof.since(from).as_us_f64(),
            end_us: wire.end.since(from).as_us_f64(),
            axis,
        });
    }
    lanes.retain(|lane| !lane.frames.is_empty());
    lanes
}

/// When the burst of frames that begins with the SYNC is over.
pub(super) fn busy_until(lanes: &[Lane]) -> f64 {
    let mut frames: Vec<&Block> = lanes.iter().flat_map(|lane| &lane.frames).collect();
    frames.sort_by(|a, b| a.start_us.total_cmp(&b.start_us));
    frames
        .iter()
        .map_while({
            let mut end = 0.0;
            move |frame| {
                let joins = frame.start_us <= end + PAUSE_US;
                end = frame.end_us;
                joins.then_some(frame.end_us)
            }
        })
        .last()
        .unwrap_or(0.0)
}

/// The lane of an identifier and the node in it.
fn lane_of(id: u16) -> (usize, Option<u16>) {
    if id == SYNC {
        return (0, None);
    }
    let (function, node) = (id & !NODE_MASK, id & NODE_MASK);
    let lane = LANES
        .iter()
        .skip(1)
        .position(|(_, functions)| functions.contains(&function))
        .map_or(EMCY_LANE, |place| place + 1);
    (lane, (node != 0).then_some(node))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pause_ends_the_burst() {
        let block = |start_us| Block {
            start_us,
            end_us: start_us + 100.0,
            axis: None,
        };
        let lane = |starts: &[f64]| Lane {
            name: String::new(),
            frames: starts.iter().map(|start| block(*start)).collect(),
        };
        let lanes = [lane(&[0.0, 6000.0]), lane(&[150.0, 250.0]), lane(&[800.0])];
        assert_eq!(busy_until(&lanes), 900.0);
        assert_eq!(busy_until(&[]), 0.0);
    }

    #[test]
    fn identifiers_find_their_lane() {
        for (id, name, node) in [
            (0x080, "SYNC", None),
            (0x000, "NMT, EMCY", None),
            (0x083, "NMT, EMCY", Some(3)),
            (0x182, "TPDO1", Some(2)),
            (0x286, "TPDO2", Some(6)),
            (0x201, "RPDO1", Some(1)),
            (0x304, "RPDO2", Some(4)),
            (0x585, "SDO", Some(5)),
            (0x605, "SDO", Some(5)),
            (0x77F, "heartbeat", Some(127)),
        ] {
            let (lane, found) = lane_of(id);
            assert_eq!((LANES[lane].0, found), (name, node), "{id:#05x}");
        }
        assert_eq!(LANES[ERROR_LANE].0, "error frames");
    }
}

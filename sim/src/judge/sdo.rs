//! What SDO clients and servers said to each other, and how long it took: from
//! the frames on the wire alone.

use canmaster::NodeId;
use canmaster::id::{CobId, FunctionCode};

use crate::bus::{RecordKind, WireRecord};
use crate::frame::WireId;
use crate::time::{PS_PER_S, Time};

/// All that a client and the server of one node said to each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Conversation {
    /// Start of the first frame.
    pub first: Time,
    /// End of the last frame, interframe space included.
    pub last: Time,
    /// Bits of all frames, stuff bits and interframe spaces included.
    pub bits: u64,
    /// Frames of the client.
    pub requests: u64,
    /// Frames of the server.
    pub answers: u64,
}

/// The conversation with `node`; `None` if there was none.
pub fn conversation(records: &[WireRecord], node: NodeId) -> Option<Conversation> {
    let request = CobId::of(FunctionCode::SdoRequest, node).get();
    let answer = CobId::of(FunctionCode::SdoResponse, node).get();
    let mut all: Option<Conversation> = None;
    for record in records {
        let RecordKind::Frame(frame) = &record.kind else {
            continue;
        };
        let (requests, answers) = match frame.id {
            WireId::Standard(id) if id == request => (1, 0),
            WireId::Standard(id) if id == answer => (0, 1),
            _ => continue,
        };
        let all = all.get_or_insert(Conversation {
            first: record.sof,
            last: record.end,
            bits: 0,
            requests: 0,
            answers: 0,
        });
        all.last = record.end;
        all.bits += u64::from(record.bits);
        all.requests += requests;
        all.answers += answers;
    }
    all
}

/// How long the configuration of several nodes took, and could have taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Configuration {
    /// First request to last answer of all nodes.
    pub took: Time,
    /// No master can be faster: the larger of the time that the bits of all
    /// nodes take on the wire, and that of the bits of one node and its
    /// latencies.
    pub wire_bound: Time,
    /// The same exchanges one after the other.
    pub sequential: Time,
    /// Requests that were answered.
    pub exchanges: u64,
}

/// Judges the configuration of `nodes`, which answer each request after
/// `latency`. `None` unless all of them were spoken to.
pub fn configuration(
    records: &[WireRecord],
    nodes: &[NodeId],
    latency: Time,
    bit_rate: u32,
) -> Option<Configuration> {
    let all: Vec<Conversation> = nodes
        .iter()
        .map(|node| conversation(records, *node))
        .collect::<Option<_>>()?;
    let wire = |bits: u64| Time(bits * (PS_PER_S / u64::from(bit_rate)));
    let alone = |one: &Conversation| wire(one.bits) + latency * one.answers;
    let first = all.iter().map(|one| one.first).min()?;
    let last = all.iter().map(|one| one.last).max()?;
    let longest = all.iter().map(alone).max()?;
    Some(Configuration {
        took: last - first,
        wire_bound: longest.max(wire(all.iter().map(|one| one.bits).sum())),
        sequential: all.iter().map(alone).fold(Time::ZERO, |a, b| a + b),
        exchanges: all.iter().map(|one| one.answers).sum(),
    })
}

/// Frames, error frames included, that were on the wire during the conversation
/// with `node` and do not belong to it.
pub fn other_frames(records: &[WireRecord], node: NodeId) -> usize {
    let Some(talk) = conversation(records, node) else {
        return 0;
    };
    let own = [FunctionCode::SdoRequest, FunctionCode::SdoResponse]
        .map(|function| WireId::Standard(CobId::of(function, node).get()));
    records
        .iter()
        .filter(|record| (talk.first..talk.last).contains(&record.sof))
        .filter(|record| match &record.kind {
            RecordKind::Frame(frame) => !own.contains(&frame.id),
            RecordKind::ErrorFrame { .. } => true,
        })
        .count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::WireFrame;

    const NODES: [NodeId; 2] = [NodeId::constant::<1>(), NodeId::constant::<2>()];

    fn record(id: u16, start_us: u64, bits: u32) -> WireRecord {
        WireRecord {
            sof: Time::from_us(start_us),
            end: Time::from_us(start_us + u64::from(bits)),
            bits,
            transmitters: Vec::new(),
            kind: RecordKind::Frame(WireFrame::standard(id, &[0; 8])),
        }
    }

    /// Two nodes at 1 Mbit/s, asked at once, 1 ms of latency each.
    fn wire() -> Vec<WireRecord> {
        vec![
            record(0x601, 1000, 120),
            record(0x602, 1120, 110),
            record(0x77F, 1500, 60),
            record(0x581, 2120, 130),
            record(0x582, 2250, 140),
        ]
    }

    #[test]
    fn a_conversation_is_both_directions_of_one_node() {
        let all = conversation(&wire(), NODES[0]).unwrap();
        assert_eq!((all.requests, all.answers, all.bits), (1, 1, 250));
        assert_eq!(all.first, Time::from_us(1000));
        assert_eq!(all.last, Time::from_us(2250));
        assert_eq!(conversation(&wire(), NodeId::constant::<3>()), None);
    }

    #[test]
    fn the_bound_is_the_busier_of_bus_and_node() {
        let judge = |latency| configuration(&wire(), &NODES, latency, 1_000_000).unwrap();
        let slow = judge(Time::from_ms(1));
        assert_eq!(slow.took, Time::from_us(1390));
        assert_eq!(slow.wire_bound, Time::from_us(1250));
        assert_eq!(slow.sequential, Time::from_us(2500));
        assert_eq!(slow.exchanges, 2);
        // Without latency the bus is what counts.
        assert_eq!(judge(Time::ZERO).wire_bound, Time::from_us(500));
    }

    #[test]
    fn a_node_that_nobody_spoke_to_is_no_configuration() {
        let nodes = [NODES[0], NodeId::constant::<3>()];
        assert_eq!(configuration(&wire(), &nodes, Time::ZERO, 1_000_000), None);
    }

    #[test]
    fn what_else_is_on_the_bus_is_counted() {
        assert_eq!(other_frames(&wire(), NODES[0]), 2);
        assert_eq!(
            other_frames(&wire()[..2], NODES[0]),
            0,
            "what follows is not"
        );
    }
}

//! The layer setting services that were on the wire (CiA 305).

use canmaster::CobId;

use crate::bus::{RecordKind, WireRecord};
use crate::frame::{WireFrame, WireId};
use crate::time::Time;

/// Configure node-ID, and the error code for success (CiA 305, 3.9.2).
const NODE_ID: u8 = 0x11;
const DONE: u8 = 0;

/// What LSS took and gave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LssFigures {
    /// Start of the first frame.
    pub from: Time,
    /// End of the last one.
    pub to: Time,
    /// Frames of the master.
    pub requests: usize,
    /// Frames of the nodes; answers sent at the same moment are one.
    pub answers: usize,
    /// Node-IDs that were given and taken.
    pub node_ids: usize,
}

/// Judges what was on the wire; `None` if there was no LSS.
pub fn judge(wire: &[WireRecord]) -> Option<LssFigures> {
    let mut figures: Option<LssFigures> = None;
    for record in wire {
        let RecordKind::Frame(frame) = &record.kind else {
            continue;
        };
        let (request, answer) = (is(frame, CobId::LSS_MASTER), is(frame, CobId::LSS_SLAVE));
        if !request && !answer {
            continue;
        }
        let figures = figures.get_or_insert(LssFigures {
            from: record.sof,
            to: record.end,
            requests: 0,
            answers: 0,
            node_ids: 0,
        });
        figures.to = record.end;
        figures.requests += usize::from(request);
        figures.answers += usize::from(answer);
        let given = answer && frame.data[..2] == [NODE_ID, DONE];
        figures.node_ids += usize::from(given);
    }
    figures
}

fn is(frame: &WireFrame, id: CobId) -> bool {
    frame.id == WireId::Standard(id.get())
}

//! What another tool orders of the group by SDO, seen on the wire: a release that
//! the board has accepted allows motion as the button does, a stop takes it back.

use canmaster::NodeId;

use crate::bus::{RecordKind, WireRecord};
use crate::frame::{WireFrame, WireId};

/// Requests to an SDO server and its answers (CiA 301, 7.3.5).
const REQUEST: u16 = 0x600;
const ANSWER: u16 = 0x580;
/// An expedited download of two bytes (CiA 301, 7.2.4.3.3), of the group command,
/// sub-index 0.
const COMMAND: [u8; 4] = [0x2B, 0x00, 0x20, 0x00];
/// The board has accepted it.
const ACCEPTED: [u8; 4] = [0x60, 0x00, 0x20, 0x00];
/// Values of the group command that let it move: release; start the program and
/// release.
const RELEASES: [u8; 2] = [3, 12];
/// And that do not: disable, stop, halt, quick stop.
const STOPS: [u8; 4] = [2, 4, 5, 6];

/// An order that the board has accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    /// The group may move.
    Release,
    /// It comes to rest.
    Stop,
}

/// Reads the orders to one board off the wire.
#[derive(Clone, Debug)]
pub(super) struct Orders {
    board: u16,
    seen: usize,
    asked: Option<u8>,
}

impl Orders {
    /// To this board.
    pub(super) fn new(board: NodeId) -> Orders {
        Orders {
            board: board.get().into(),
            seen: 0,
            asked: None,
        }
    }

    /// The newest order since the last call. `wire` is everything so far.
    pub(super) fn read(&mut self, wire: &[WireRecord]) -> Option<Order> {
        let new = wire.get(self.seen..).unwrap_or_default();
        self.seen = wire.len();
        let frames = new.iter().filter_map(|record| match &record.kind {
            RecordKind::Frame(frame) => Some(frame),
            RecordKind::ErrorFrame { .. } => None,
        });
        let mut newest = None;
        for frame in frames {
            newest = self.frame(frame).or(newest);
        }
        newest
    }

    fn frame(&mut self, frame: &WireFrame) -> Option<Order> {
        let begins = |with: [u8; 4]| frame.data[..4] == with;
        let WireId::Standard(id) = frame.id else {
            return None;
        };
        if id == REQUEST + self.board {
            self.asked = begins(COMMAND).then_some(frame.data[4]);
            return None;
        }
        if id != ANSWER + self.board {
            return None;
        }
        let asked = self.asked.take().filter(|_| begins(ACCEPTED))?;
        if RELEASES.contains(&asked) {
            Some(Order::Release)
        } else {
            STOPS.contains(&asked).then_some(Order::Stop)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Time;

    const BOARD: NodeId = NodeId::constant::<127>();
    const ABORT: [u8; 4] = [0x80, 0x00, 0x20, 0x00];

    fn record(id: u16, command: [u8; 4], value: u8) -> WireRecord {
        let mut data = command.to_vec();
        data.extend_from_slice(&[value, 0, 0, 0]);
        WireRecord {
            sof: Time::ZERO,
            end: Time::ZERO,
            bits: 100,
            transmitters: Vec::new(),
            kind: RecordKind::Frame(WireFrame::standard(id, &data)),
        }
    }

    #[test]
    fn only_what_the_board_accepts_counts() {
        for (value, answer, order) in [
            (3, ACCEPTED, Some(Order::Release)),
            (12, ACCEPTED, Some(Order::Release)),
            (3, ABORT, None),
            (4, ACCEPTED, Some(Order::Stop)),
            (2, ACCEPTED, Some(Order::Stop)),
            (1, ACCEPTED, None),
            (9, ACCEPTED, None),
        ] {
            let mut orders = Orders::new(BOARD);
            let mut wire = vec![record(0x67F, COMMAND, value)];
            assert_eq!(orders.read(&wire), None);
            wire.push(record(0x5FF, answer, 0));
            assert_eq!(orders.read(&wire), order, "{value}");
            assert_eq!(orders.read(&wire), None, "once");
        }
    }

    #[test]
    fn other_nodes_and_other_objects_mean_nothing() {
        let mut orders = Orders::new(BOARD);
        let mut other = COMMAND;
        other[1] = 0x01;
        let wire = [
            record(0x601, COMMAND, 3),
            record(0x581, ACCEPTED, 0),
            record(0x67F, other, 3),
            record(0x5FF, ACCEPTED, 0),
        ];
        assert_eq!(orders.read(&wire), None);
    }
}

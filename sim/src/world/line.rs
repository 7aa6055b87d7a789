//! A bus of the machine, with the board and the drives that are wired to it.

use super::machine::Segment;
use crate::board::Board;
use crate::bus::{BitTiming, Bus, Event, PortId, WireRecord};
use crate::time::Time;

/// Who is wired to a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Who {
    /// The board.
    Board,
    /// The drive of this axis.
    Axis(usize),
    /// A drive that the network does not name.
    Stranger(usize),
    /// Somebody else's tool.
    Tool,
}

/// See the module.
pub(super) struct Line {
    pub(super) bus: Bus,
    /// Which of the board's controllers is wired to it, from 0.
    controller: usize,
    pub(super) board: PortId,
    board_timing: Option<BitTiming>,
    /// By port.
    who: Vec<Who>,
    pub(super) names: Vec<String>,
    /// What was on the wire so far.
    pub(super) wire: Vec<WireRecord>,
}

/// What the board is called on each bus.
const BOARD: &str = "board";
/// Keeps the noise of the buses apart.
const STREAM: u32 = 40;

impl Line {
    /// The bus of that number, with nothing but the board on it.
    pub(super) fn new(segment: &Segment, number: usize, seed: u64) -> Line {
        let mut bus = Bus::new(seed ^ (number as u64) << STREAM);
        let board = bus.attach(BOARD);
        Line {
            bus,
            controller: segment.controller,
            board,
            board_timing: None,
            who: vec![Who::Board],
            names: vec![BOARD.to_string()],
            wire: Vec::new(),
        }
    }

    /// Wires somebody else to it.
    pub(super) fn attach(&mut self, name: String, who: Who) -> PortId {
        let port = self.bus.attach(&name);
        self.note(name, who);
        port
    }

    /// Somebody has been wired to it.
    pub(super) fn note(&mut self, name: String, who: Who) {
        self.names.push(name);
        self.who.push(who);
    }

    /// Who is at a port.
    pub(super) fn who(&self, port: PortId) -> Who {
        self.who.get(port.0).copied().unwrap_or(Who::Tool)
    }

    /// Tells the bus what the board would send next.
    pub(super) fn offer_board(&mut self, board: &Board, now: Time) {
        let timing = board.can_timing(self.controller);
        if timing != self.board_timing {
            self.board_timing = timing;
            self.bus.set_timing(self.board, timing, now);
        }
        self.bus.offer(self.board, board.can_offer(self.controller));
    }

    /// Hands the board what the bus tells it.
    pub(super) fn tell_board(&self, board: &mut Board, event: &Event) {
        board.can_event(self.controller, event);
    }

    /// Takes over what was on the wire.
    pub(super) fn read(&mut self) {
        self.wire.extend(self.bus.take_records());
    }
}

//! The state machine of the group, as one table; see `docs/motion.md`.

use super::GroupState;

/// What can happen to the group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The network is ready and the axes are wanted; after a fault: again.
    Ready,
    /// The network is not ready.
    NotReady,
    /// A fault of an axis.
    Fault,
    /// An optional axis came or went.
    AxesChanged,
    /// Nobody wants the axes enabled.
    Disable,
    /// The group may move.
    Release,
    /// Ramp down to standby.
    Stop,
    /// Ramp down and wait.
    Halt,
    /// Every drive brakes by itself.
    QuickStop,
    /// Reset the fault.
    Reset,
    /// Search for home.
    Home,
    /// Change modes.
    Mode,
    /// What the state waits for has come.
    Done,
    /// It did not come in time.
    Late,
}

impl Event {
    /// All of them, in the order of the table.
    pub const ALL: [Event; EVENTS] = [
        Event::Ready,
        Event::NotReady,
        Event::Fault,
        Event::AxesChanged,
        Event::Disable,
        Event::Release,
        Event::Stop,
        Event::Halt,
        Event::QuickStop,
        Event::Reset,
        Event::Home,
        Event::Mode,
        Event::Done,
        Event::Late,
    ];
}

/// What an event does in a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cell {
    /// Nothing.
    Stay,
    /// It is refused.
    Refuse,
    /// The group goes to this state.
    Go(GroupState),
}

const EVENTS: usize = 14;
const STATES: usize = 12;

/// A cell of the table: a state, by its place, or one of these.
const O: u8 = 0xFF;
const X: u8 = 0xFE;
const IDLE: u8 = 0;
const ENAB: u8 = 1;
const STBY: u8 = 2;
const MOVE: u8 = 3;
const STOP: u8 = 4;
const HALT: u8 = 5;
const HOME: u8 = 6;
const MODE: u8 = 7;
const QUIK: u8 = 8;
const DISA: u8 = 9;
const FSTP: u8 = 10;
const FAUL: u8 = 11;

#[rustfmt::skip]
const TABLE: [[u8; EVENTS]; STATES] = [
    // Ready NotReady Fault AxesCh Disable Release Stop Halt QuickStop Reset Home Mode  Done  Late
    [ENAB, O,    O,    O,    O,    X,    O,    X,    X,    X,    X,    X,    O,    O   ], // Idle
    [O,    FSTP, FSTP, O,    DISA, X,    O,    X,    DISA, X,    X,    X,    STBY, FSTP], // Enabling
    [O,    FSTP, FSTP, ENAB, DISA, MOVE, O,    X,    QUIK, X,    X,    MODE, O,    O   ], // Standby
    [O,    FSTP, FSTP, O,    STOP, X,    STOP, HALT, QUIK, X,    HOME, X,    STBY, FSTP], // Moving
    [O,    FSTP, FSTP, O,    O,    X,    O,    X,    QUIK, X,    X,    X,    STBY, FSTP], // Stopping
    [O,    FSTP, FSTP, O,    STOP, MOVE, STOP, O,    QUIK, X,    X,    X,    O,    FSTP], // Halt
    [O,    FSTP, FSTP, O,    STOP, X,    STOP, STOP, QUIK, X,    X,    X,    STBY, FSTP], // Homing
    [O,    FSTP, FSTP, O,    O,    X,    O,    X,    QUIK, X,    X,    X,    STBY, FSTP], // ModeChange
    [O,    FSTP, FSTP, O,    O,    X,    O,    X,    O,    X,    X,    X,    DISA, FSTP], // QuickStop
    [O,    FSTP, FSTP, O,    O,    X,    O,    X,    O,    X,    X,    X,    IDLE, FSTP], // Disabling
    [O,    O,    O,    O,    O,    X,    O,    X,    X,    X,    X,    X,    FAUL, FAUL], // FaultStop
    [ENAB, O,    O,    O,    O,    X,    O,    X,    X,    ENAB, X,    X,    O,    O   ], // Faulted
];

/// What `event` does in `state`.
pub fn cell(state: GroupState, event: Event) -> Cell {
    let row = TABLE.get(state as usize);
    let code = row.and_then(|row| row.get(event as usize));
    match code {
        None | Some(&O) => Cell::Stay,
        Some(&X) => Cell::Refuse,
        Some(&state) => Cell::Go(GroupState::of(state)),
    }
}

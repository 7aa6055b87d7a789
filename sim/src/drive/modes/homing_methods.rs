//! The homing methods as sequences of legs (CiA 402-2, 11.3; EPOS4 for -1..-4).

/// What ends a leg.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Until {
    /// The switch is closed.
    Closed(Switch),
    /// The switch, seen closed on this leg, opens.
    Opens(Switch),
    /// The next index pulse.
    Index,
    /// The motor current reaches 30B2h: the axis is at a hard stop.
    Current,
}

/// A switch of the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Switch {
    /// The limit switch at this end.
    Limit(Direction),
    /// The home switch.
    Home,
}

/// Which way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// To smaller positions.
    Negative,
    /// To larger positions.
    Positive,
}

use Direction::{Negative, Positive};
use Until::{Closed, Current, Index, Opens};

impl Direction {
    /// -1 or 1.
    pub const fn sign(self) -> f64 {
        match self {
            Negative => -1.0,
            Positive => 1.0,
        }
    }

    /// The other way.
    pub const fn reversed(self) -> Direction {
        match self {
            Negative => Positive,
            Positive => Negative,
        }
    }
}

/// A part of a homing run: with 6099h:1 or, slow, with 6099h:2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leg {
    /// Which way.
    pub direction: Direction,
    /// At the speed for the zero.
    pub slow: bool,
    /// What ends it.
    pub until: Until,
}

const fn fast(direction: Direction, until: Until) -> Leg {
    Leg {
        direction,
        slow: false,
        until,
    }
}

const fn slow(direction: Direction, until: Until) -> Leg {
    Leg {
        direction,
        slow: true,
        until,
    }
}

/// The legs of a method; none for 37, which takes the place where it is.
/// `None` for a method that the drive does not have.
pub fn legs(method: i8) -> Option<Vec<Leg>> {
    Some(match method {
        37 => Vec::new(),
        34 => vec![slow(Positive, Index)],
        33 => vec![slow(Negative, Index)],
        // The edge at the far side, seen from where the axis comes from, then
        // perhaps the next index outside the switch.
        27 => home(Negative, false),
        23 => home(Positive, false),
        18 => limit(Positive, false),
        17 => limit(Negative, false),
        11 => home(Negative, true),
        7 => home(Positive, true),
        2 => limit(Positive, true),
        1 => limit(Negative, true),
        -1 => vec![fast(Positive, Current), slow(Negative, Index)],
        -2 => vec![fast(Negative, Current), slow(Positive, Index)],
        -3 => vec![fast(Positive, Current)],
        -4 => vec![fast(Negative, Current)],
        _ => return None,
    })
}

/// To the limit switch at the end `to`, and off it again.
fn limit(to: Direction, index: bool) -> Vec<Leg> {
    edge(to, Switch::Limit(to), index)
}

/// To the home switch, and back off it.
fn home(to: Direction, index: bool) -> Vec<Leg> {
    edge(to, Switch::Home, index)
}

fn edge(to: Direction, switch: Switch, index: bool) -> Vec<Leg> {
    let back = to.reversed();
    let mut legs = vec![fast(to, Closed(switch)), slow(back, Opens(switch))];
    if index {
        legs.push(slow(back, Index));
    }
    legs
}

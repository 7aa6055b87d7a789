//! What an axis follows: a position to hold, a move, or a ramp to standstill.

use super::profile::{Profile, Setpoint};

/// A ramp from a velocity to standstill in a whole number of cycles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramp {
    end: i32,
    cycles: u32,
    /// Increments per cycle at the start, signed.
    velocity: f32,
    deceleration: f32,
}

impl Ramp {
    /// From the set-point `from`, at standstill after `cycles`. The end lies on
    /// a whole increment; it is at most one increment off the exact place.
    pub fn new(from: &Setpoint, cycles: u32) -> Ramp {
        let distance = 0.5 * from.velocity * cycles as f32 + from.fraction;
        Ramp {
            end: from.position.wrapping_add(distance as i32),
            cycles,
            velocity: from.velocity,
            deceleration: if cycles == 0 {
                0.0
            } else {
                -from.velocity / cycles as f32
            },
        }
    }

    fn at(&self, t: i32) -> Setpoint {
        let cycles = self.cycles as i32;
        if t >= cycles {
            return Setpoint::at_rest(self.end);
        }
        // Before its start the ramp goes on at its first velocity: the set-point
        // of the SYNC just passed lies there.
        let braking = t.max(0);
        let s = (cycles - braking) as f32;
        let before = (braking - t) as f32;
        let offset = 0.5 * self.deceleration * s * s - self.velocity * before;
        Setpoint {
            velocity: -self.deceleration * s,
            acceleration: if t < 0 { 0.0 } else { self.deceleration },
            ..Setpoint::beside(self.end, offset)
        }
    }
}

/// What an axis follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reference {
    /// Rest at a position.
    Hold(i32),
    /// A move from rest to rest.
    Move(Profile),
    /// To standstill.
    Ramp(Ramp),
}

impl Reference {
    /// The set-point `t` cycles after the start of the reference; `t` may be
    /// negative.
    pub fn at(&self, t: i32) -> Setpoint {
        match self {
            Reference::Hold(position) => Setpoint::at_rest(*position),
            Reference::Move(profile) => profile.at(t),
            Reference::Ramp(ramp) => ramp.at(t),
        }
    }

    /// Where it ends.
    pub const fn end(&self) -> i32 {
        match self {
            Reference::Hold(position) => *position,
            Reference::Move(profile) => profile.target(),
            Reference::Ramp(ramp) => ramp.end,
        }
    }

    /// Cycles until it ends.
    pub const fn duration(&self) -> u32 {
        match self {
            Reference::Hold(_) => 0,
            Reference::Move(profile) => profile.duration(),
            Reference::Ramp(ramp) => ramp.cycles,
        }
    }

    /// Magnitude of the steepest slope, in increments per cycle squared, while
    /// speeding up and while slowing down.
    pub fn accelerations(&self) -> (f32, f32) {
        match self {
            Reference::Hold(_) => (0.0, 0.0),
            Reference::Move(profile) => profile.accelerations(),
            Reference::Ramp(ramp) => (0.0, ramp.deceleration.abs()),
        }
    }
}

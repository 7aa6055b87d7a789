//! What an axis follows: knots, and the cubic between two of them.
//!
//! A knot says how many cycles after the one before the axis shall be where, and
//! how fast. Constant velocity, a ramp, a phase of constant jerk, a piece of a
//! sine or a table and a stop are all such pieces.
//!
//! From SYNC to SYNC a piece costs three additions: the forward differences of a
//! cubic. Their rounding, that of single precision over the way of a ramp (a tenth of
//! an increment in a million), is taken up by the next piece and by the last knot
//! exactly.

use super::fixed::{self, MORE};

/// Knots that wait for their turn: those of a jerk-limited move, and what is left
/// of the one that it replaces.
pub const KNOTS: usize = 12;
/// The most knots of one leg of a plan.
pub const LEG_KNOTS: usize = 8;
/// So many knots of a path may be kept until another replaces it.
const KEPT: u8 = (KNOTS - LEG_KNOTS) as u8;
/// Less than this, in increments, is the rounding of what came before: a ramp
/// stays a ramp.
const BEND_MIN: f32 = 1.0 / 64.0;
const HALF: f32 = 0.5;
const SIXTH: f32 = 1.0 / 6.0;

/// Where an axis shall be and how fast. There are many: without gaps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C, packed(4))]
pub struct Knot {
    /// So many cycles after the knot before; at least 1.
    pub cycles: u32,
    /// In 2^-32 increments; wraps as 6064h does.
    pub position: i64,
    /// In 2^-32 increments per cycle.
    pub velocity: i64,
}

/// Where an axis should be at one SYNC, as exactly as a plan can go on from there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// In 2^-32 increments.
    pub position: i64,
    /// In 2^-32 increments per cycle.
    pub velocity: i64,
    /// In increments per cycle squared, as it is from here on.
    pub acceleration: f32,
}

impl Point {
    /// At rest at a whole increment.
    pub const fn at_rest(position: i32) -> Point {
        Point {
            position: fixed::whole(position),
            velocity: 0,
            acceleration: 0.0,
        }
    }
}

/// The same as the position loop takes it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// In 2^-32 increments.
    pub position: i64,
    /// In increments per cycle.
    pub velocity: f32,
    /// In increments per cycle squared, as it is from here on.
    pub acceleration: f32,
}

impl Sample {
    /// At rest at a whole increment.
    pub const fn at_rest(position: i32) -> Sample {
        Sample {
            position: fixed::whole(position),
            velocity: 0.0,
            acceleration: 0.0,
        }
    }
}

/// The path of one axis, evaluated from SYNC to SYNC. Small fields stand first, where
/// they are reached by short instructions.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Path {
    /// What follows is in `knots` from there on.
    begin: u8,
    len: u8,
    /// So many knots at the back belong to the path that replaces this one.
    next: u8,
    /// What is 0 at constant velocity does not stand together: that would be cleared
    /// by a slow loop.
    position: i64,
    /// Forward differences: of the position in 2^-32, and its second and third
    /// in 2^-44. At rest the first is the velocity at the last knot.
    second: i64,
    first: i64,
    third: i64,
    /// Where the piece ends, and in how many cycles; 0: at rest, or run dry.
    to: Knot,
    acceleration: f32,
    jerk: f32,
    knots: [Knot; KNOTS],
}

impl Path {
    /// At rest at 0.
    pub const ZERO: Path = Path {
        position: 0,
        first: 0,
        second: 0,
        third: 0,
        acceleration: 0.0,
        jerk: 0.0,
        to: Knot {
            cycles: 0,
            position: 0,
            velocity: 0,
        },
        knots: [Knot {
            cycles: 0,
            position: 0,
            velocity: 0,
        }; KNOTS],
        begin: 0,
        len: 0,
        next: 0,
    };

    /// Without knots.
    pub fn new(at: &Point) -> Path {
        let mut path = Path::ZERO;
        path.restart(at);
        path
    }

    /// Forgets everything: goes on from `at`.
    pub fn restart(&mut self, at: &Point) {
        self.len = 0;
        self.next = 0;
        self.stand_at(at.position, at.velocity);
        self.straight_on();
    }

    /// Forgets everything: comes to rest from `velocity`, in increments per cycle, in
    /// so many cycles.
    #[inline(always)]
    pub(super) fn brake(&mut self, position: i64, velocity: f32, cycles: u32) {
        self.len = 0;
        self.next = 0;
        let first = fixed::fixed_here(velocity);
        let way = (first >> 1).wrapping_mul(i64::from(cycles));
        self.position = position;
        self.to = Knot {
            cycles,
            position: position.wrapping_add(way),
            velocity: 0,
        };
        self.acceleration = -velocity / cycles as f32;
        self.jerk = 0.0;
        self.second = fixed::fine_here(self.acceleration);
        self.third = 0;
        self.first = first + (self.second >> (MORE + 1));
    }

    /// One cycle on, which is known to be within a ramp; where that is.
    #[inline(always)]
    pub(super) fn glide(&mut self) -> i64 {
        self.position = self.position.wrapping_add(self.first);
        self.first += self.second >> MORE;
        self.to.cycles -= 1;
        self.position
    }

    /// As at a knot.
    fn stand_at(&mut self, position: i64, velocity: i64) {
        self.position = position;
        self.to = Knot {
            cycles: 0,
            position,
            velocity,
        };
    }

    /// At constant velocity from the last knot on.
    fn straight_on(&mut self) {
        self.first = self.to.velocity;
        (self.second, self.third) = (0, 0);
        (self.acceleration, self.jerk) = (0.0, 0.0);
    }

    /// Whether the last knot is reached.
    #[inline]
    pub fn is_over(&self) -> bool {
        self.to.cycles == 0 && self.len <= self.next
    }

    /// Whether it is over before it came to rest: knots were not pushed in time.
    pub fn is_dry(&self) -> bool {
        self.is_over() && self.to.velocity != 0
    }

    /// Where its last knot is.
    pub fn end(&self) -> i64 {
        let last = self.len.checked_sub(1).and_then(|n| self.knot(n));
        last.unwrap_or(&self.to).position
    }

    /// Room for more knots.
    pub fn room(&self) -> usize {
        KNOTS - usize::from(self.len)
    }

    fn place(&self, n: u8) -> usize {
        let place = usize::from(self.begin + n);
        if place < KNOTS { place } else { place - KNOTS }
    }

    fn knot(&self, n: u8) -> Option<&Knot> {
        self.knots.get(self.place(n))
    }

    /// How many knots the path needs for so many cycles.
    fn needs(&self, cycles: u32) -> u8 {
        let (mut knots, mut reached) = (0, self.to.cycles);
        while reached < cycles && knots + self.next < self.len {
            reached += self.knot(knots).map_or(0, |knot| knot.cycles);
            knots += 1;
        }
        knots
    }

    /// Whether there is room for a path that replaces this one in so many cycles.
    pub(super) fn can_be_replaced(&self, cycles: u32) -> bool {
        self.needs(cycles) <= KEPT
    }

    /// The path that replaces this one in so many cycles is announced: what it needs
    /// until then is kept.
    pub(super) fn announce(&mut self, cycles: u32) {
        self.len = self.needs(cycles);
        self.next = 0;
    }

    /// Adds a knot, `announced` for the path that replaces this one. Without room
    /// it is left, and the path runs dry.
    pub fn push(&mut self, knot: &Knot, announced: bool) {
        if knot.cycles > 0 && self.room() > 0 {
            let place = self.place(self.len);
            if let Some(free) = self.knots.get_mut(place) {
                *free = *knot;
            }
            self.len += 1;
            self.next += u8::from(announced);
        }
    }

    /// Goes over to the path that was announced.
    pub fn cut(&mut self) {
        self.begin = self.place(self.len - self.next) as u8;
        self.len = self.next;
        self.next = 0;
        let Point {
            position, velocity, ..
        } = self.point();
        // The first piece is begun by the next cycle.
        self.stand_at(position, velocity);
    }

    /// Where it stands, in 2^-32 increments.
    pub const fn position(&self) -> i64 {
        self.position
    }

    /// Where it stands and how fast it goes on.
    pub fn point(&self) -> Point {
        let bent = self.bent();
        let mut velocity = self.first;
        if bent != 0.0 {
            velocity -= fixed::fixed(bent);
        }
        Point {
            position: self.position,
            velocity,
            acceleration: self.acceleration,
        }
    }

    /// The same in single precision.
    pub fn sample(&self) -> Sample {
        Sample {
            position: self.position,
            velocity: fixed::float_here(self.first) - self.bent(),
            acceleration: self.acceleration,
        }
    }

    /// What the velocity of a cycle has more than that at its begin.
    fn bent(&self) -> f32 {
        HALF * self.acceleration + SIXTH * self.jerk
    }

    /// One cycle on.
    pub fn advance(&mut self) -> Point {
        self.go_on();
        self.point()
    }

    /// The same, without a look at where that is.
    #[inline(always)]
    pub(super) fn go_on(&mut self) {
        if self.to.cycles == 0 {
            self.begin();
        }
        if self.to.cycles > 0 {
            self.position = self.position.wrapping_add(self.first);
            self.first += self.second >> MORE;
            self.second += self.third;
            self.acceleration += self.jerk;
            self.to.cycles -= 1;
            if self.to.cycles == 0 {
                self.position = self.to.position;
                self.begin();
            }
        }
    }

    /// Begins the piece that leads to the next knot. What is announced waits for
    /// its step.
    fn begin(&mut self) {
        let from = self.to.velocity;
        self.straight_on();
        if self.len <= self.next {
            return;
        }
        let Some(&knot) = self.knot(0) else { return };
        self.begin = self.place(1) as u8;
        self.len -= 1;
        self.to = knot;
        let cycles = knot.cycles as f32;
        let way = knot.position.wrapping_sub(self.position);
        // What constant velocity leaves: small, so that single precision does.
        let left = way.wrapping_sub(from.wrapping_mul(i64::from(knot.cycles)));
        let mut gain = fixed::float(knot.velocity - from);
        let bend = fixed::float(left) - HALF * gain * cycles;
        if bend.abs() >= BEND_MIN {
            const TWO: f32 = 2.0;
            const SIX: f32 = 6.0;
            let bend = SIX * bend / cycles;
            gain += bend;
            self.jerk = -TWO * bend / (cycles * cycles);
            self.third = fixed::fine(self.jerk);
            self.first += fixed::fixed(SIXTH * self.jerk);
        }
        self.acceleration = gain / cycles;
        let steep = fixed::fine(self.acceleration);
        self.second = steep + self.third;
        self.first += steep >> (MORE + 1);
    }

    /// Where it will stand in so many cycles, as far as it is known.
    pub fn ahead(&self, cycles: u32) -> Point {
        let mut path = *self;
        for _ in 0..cycles {
            path.go_on();
        }
        path.point()
    }
}

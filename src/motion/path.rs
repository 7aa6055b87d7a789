//! What an axis follows: knots, and the cubic between two of them.
//!
//! A knot says how many cycles after the one before the axis shall be where, and
//! how fast. Constant velocity, a ramp, a phase of constant jerk, a piece of a
//! sine or a table and a stop are all such pieces.
//!
//! From SYNC to SYNC a piece costs three additions: the forward differences of a
//! cubic. Their rounding, at most a 64th of an increment in pieces of up to
//! 10 000 cycles, is taken up by the next piece and by the last knot exactly.

use super::fixed::{self, BITS, MORE, ONE};
use super::position_control::Setpoint;
use heapless::Deque;

/// Knots that wait for their turn: those of a jerk-limited move, and of one that
/// replaces it.
pub const KNOTS: usize = 16;
/// Less than this, in increments, is the rounding of what came before: a ramp
/// stays a ramp.
const BEND_MIN: f32 = 1.0 / 64.0;

/// Where an axis shall be and how fast.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Knot {
    /// So many cycles after the knot before; at least 1.
    pub cycles: u32,
    /// In 2^-32 increments; wraps as 6064h does.
    pub position: i64,
    /// In 2^-32 increments per cycle.
    pub velocity: i64,
}

/// Where an axis should be at one SYNC.
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

    /// As the position loop takes it.
    pub(super) fn setpoint(&self) -> Setpoint {
        Setpoint {
            position: (self.position >> BITS) as i32,
            fraction: self.position as u32 as f32 / ONE,
            velocity: fixed::float(self.velocity),
            acceleration: self.acceleration,
        }
    }
}

/// Where on its piece a path is.
#[derive(Clone, Copy, Debug)]
struct Cursor {
    position: i64,
    /// Forward differences: of the position in 2^-32, and its second and third
    /// in 2^-44.
    first: i64,
    second: i64,
    third: i64,
    /// A sixth of the third.
    sixth: i64,
    /// Where the piece ends, and in how many cycles; 0: at rest, or run dry.
    to: Knot,
}

impl Cursor {
    const fn at(point: &Point) -> Cursor {
        Cursor {
            position: point.position,
            first: 0,
            second: 0,
            third: 0,
            sixth: 0,
            to: Knot {
                cycles: 0,
                position: point.position,
                velocity: point.velocity,
            },
        }
    }

    fn point(&self) -> Point {
        let Knot {
            cycles, velocity, ..
        } = self.to;
        let (velocity, acceleration) = if cycles == 0 {
            (velocity, 0.0)
        } else {
            (
                self.first - (self.second >> (MORE + 1)) + (self.sixth >> (MORE - 1)),
                fixed::float((self.second - self.third) >> MORE),
            )
        };
        Point {
            position: self.position,
            velocity,
            acceleration,
        }
    }

    /// One cycle on; `next` gives the knots that follow.
    #[inline(never)]
    fn advance(&mut self, next: &mut dyn FnMut() -> Option<Knot>) -> Point {
        if self.to.cycles == 0
            && let Some(knot) = next()
        {
            self.begin(&knot);
        }
        if self.to.cycles > 0 {
            self.position = self.position.wrapping_add(self.first);
            self.first += self.second >> MORE;
            self.second += self.third;
            self.to.cycles -= 1;
            if self.to.cycles == 0 {
                self.position = self.to.position;
                if let Some(knot) = next() {
                    let velocity = self.to.velocity;
                    return Point {
                        position: self.position,
                        velocity,
                        acceleration: self.begin(&knot),
                    };
                }
            }
        }
        self.point()
    }

    /// Begins the piece that leads to `knot`; the acceleration there.
    #[inline(never)]
    fn begin(&mut self, knot: &Knot) -> f32 {
        let from = self.to.velocity;
        let cycles = knot.cycles as f32;
        let way = knot.position.wrapping_sub(self.position);
        // What constant velocity leaves: small, so that single precision does.
        let left = way.wrapping_sub(from.wrapping_mul(i64::from(knot.cycles)));
        let gain = fixed::float(knot.velocity - from);
        let mut bend = fixed::float(left) - 0.5 * gain * cycles;
        if bend.abs() < BEND_MIN {
            bend = 0.0;
        }
        let bend = 6.0 * bend / cycles;
        let acceleration = (gain + bend) / cycles;
        let jerk = -2.0 * bend / (cycles * cycles);
        let steep = fixed::fine(acceleration);
        self.third = fixed::fine(jerk);
        self.sixth = fixed::fine(jerk / 6.0);
        self.second = steep + self.third;
        self.first = from + (((steep >> 1) + self.sixth) >> MORE);
        self.to = *knot;
        acceleration
    }
}

/// The path of one axis, evaluated from SYNC to SYNC.
#[derive(Clone, Debug)]
pub struct Path {
    cursor: Cursor,
    queue: Deque<Knot, KNOTS>,
    /// So many knots at the back belong to the path that replaces this one.
    next: usize,
}

impl Path {
    /// At rest.
    pub const fn new(at: Point) -> Path {
        Path {
            cursor: Cursor::at(&at),
            queue: Deque::new(),
            next: 0,
        }
    }

    /// Forgets everything: goes on from `at`.
    pub fn restart(&mut self, at: &Point) {
        self.queue.clear();
        self.next = 0;
        self.cursor = Cursor::at(at);
    }

    /// To rest in so many cycles, by one ramp from `at` on; `share` is one of them.
    /// The cheapest of pieces: it is made between a SYNC and the next.
    pub(super) fn brake(&mut self, at: &Point, cycles: u32, share: f32) {
        self.restart(at);
        if cycles > 0 {
            let cursor = &mut self.cursor;
            let steep = fixed::fine(-fixed::float(at.velocity) * share);
            cursor.second = steep;
            cursor.first = at.velocity + (steep >> (MORE + 1));
            let way = (at.velocity >> 1).wrapping_mul(i64::from(cycles));
            cursor.to = Knot {
                cycles,
                position: at.position.wrapping_add(way),
                velocity: 0,
            };
        }
    }

    /// Whether the last knot is reached.
    pub fn is_over(&self) -> bool {
        self.cursor.to.cycles == 0 && self.queue.len() <= self.next
    }

    /// Whether it is over before it came to rest: knots were not pushed in time.
    pub fn is_dry(&self) -> bool {
        self.is_over() && self.cursor.to.velocity != 0
    }

    /// Where its last knot is.
    pub fn end(&self) -> i64 {
        let last = self.queue.back().unwrap_or(&self.cursor.to);
        last.position
    }

    /// Room for more knots.
    pub fn room(&self) -> usize {
        KNOTS - self.queue.len()
    }

    /// The path that replaces this one is announced: as little as can be reached
    /// until then is kept.
    pub(super) fn announce(&mut self, cycles: usize) {
        while self.queue.len() > cycles {
            self.queue.pop_back();
        }
        self.next = 0;
    }

    /// Adds a knot, `announced` for the path that replaces this one. Without room
    /// it is left, and the path runs dry.
    pub fn push(&mut self, knot: Knot, announced: bool) {
        if knot.cycles > 0 && self.queue.push_back(knot).is_ok() && announced {
            self.next += 1;
        }
    }

    /// Goes over to the path that was announced.
    pub fn cut(&mut self) {
        while self.queue.len() > self.next {
            self.queue.pop_front();
        }
        self.next = 0;
        self.cursor = Cursor::at(&self.point());
    }

    /// Where it stands.
    pub fn point(&self) -> Point {
        self.cursor.point()
    }

    /// One cycle on.
    pub fn advance(&mut self) -> Point {
        let (queue, next) = (&mut self.queue, self.next);
        // What is announced waits for its step.
        self.cursor.advance(&mut || match queue.len() > next {
            true => queue.pop_front(),
            false => None,
        })
    }

    /// Where it will stand in so many cycles, as far as it is known.
    pub fn ahead(&self, cycles: u32) -> Point {
        let mut cursor = self.cursor;
        let mut knots = self.queue.iter().take(self.queue.len() - self.next);
        let mut point = cursor.point();
        for _ in 0..cycles {
            point = cursor.advance(&mut || knots.next().copied());
        }
        point
    }
}

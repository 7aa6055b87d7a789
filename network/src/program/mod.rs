//! Motion programs: TOML for people, bytes for the firmware. `docs/motion.md`
//! explains both.
//!
//! What can be worked out ahead is worked out here: the pieces of sines, tables and
//! way-points, units, and every limit that does not depend on where the axes are
//! when a step begins.

mod axes;
mod bytes;
mod course;
mod description;
mod pairs;
mod read;
mod shape;
mod slow;
mod timing;
mod units;

pub use axes::{Axis, Group};
pub use course::{Course, Origin, Stop};
pub use pairs::pairs;

use std::path::Path as FilePath;

use crate::model::Machine;
use crate::problem::{Place, Problem, Problems};
use crate::source::Source;

/// How deep loops may be.
pub const LOOPS: usize = 4;
/// The longest program in bytes, its frame included.
pub const LONGEST: usize = 4096;
/// The version of the format.
pub const VERSION: u8 = 2;

/// A program for the axes of a machine.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Program {
    /// For logs and reports.
    pub name: String,
    /// Axes of the machine.
    pub axes: usize,
    /// SYNC period in microseconds.
    pub cycle_us: u32,
    /// What is done, in order.
    pub steps: Vec<Step>,
}

/// A step, and the line that it comes from; 0: from none.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Step {
    /// In the file, from 1.
    pub line: u32,
    /// What is done.
    pub action: Action,
}

/// What a step does.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Action {
    /// Axes start in one SYNC; those of a set arrive in one SYNC.
    Move(Move),
    /// All axes hold their positions.
    Wait {
        /// SYNC cycles.
        cycles: u32,
    },
    /// The steps are repeated.
    Repeat {
        /// 0: for ever.
        times: u16,
        /// Which.
        steps: Vec<Step>,
    },
    /// Axes follow points.
    Path(Path),
    /// The drives search for their homes.
    Home {
        /// Bit n: axis n.
        axes: u32,
        /// SYNC cycles.
        limit: u32,
    },
    /// Another mode of operation.
    Mode {
        /// Bit n: axis n.
        axes: u32,
        /// As 6060h.
        mode: u8,
    },
}

/// See [`Action::Move`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Move {
    /// Targets count from where the axes are, not from home.
    pub relative: bool,
    /// The next step follows as soon as the references have ended.
    pub flying: bool,
    /// rpm/s^2; 0: trapezoid.
    pub jerk: u32,
    /// One for each axis that moves, in their order.
    pub parts: Vec<Part>,
}

/// One axis' part of a move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Part {
    /// Its place among the axes.
    pub axis: usize,
    /// Increments.
    pub target: i32,
    /// rpm
    pub velocity: u32,
    /// rpm/s
    pub acceleration: u32,
    /// rpm/s
    pub deceleration: u32,
    /// Axes with the same number arrive together; with bit 7 the target is a torque, and
    /// the others are per mille a second, and a second squared.
    pub set: u8,
}

/// Points, and the cubic between two of them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Path {
    /// It begins wherever the axes are.
    pub relative: bool,
    /// The next step follows as soon as the references have ended.
    pub flying: bool,
    /// How often it is followed.
    pub periods: u16,
    /// All members have the first shape.
    pub shared: bool,
    /// The axes that follow it, in their order.
    pub members: Vec<Member>,
    /// The points, that where it begins left out.
    pub points: Vec<Point>,
}

/// An axis that follows a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Member {
    /// Its place among the axes.
    pub axis: usize,
    /// What a shape is multiplied by, for positions in 2^-32 increments.
    pub amplitude: i32,
    /// Where it begins, increments from home, unless it is relative.
    pub begin: i32,
}

/// A point of a path.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Point {
    /// SYNC cycles after the point before.
    pub cycles: u16,
    /// Of each shape, position and velocity.
    pub shapes: Vec<(i32, i32)>,
}

impl Path {
    /// Where a member is at a point, from where it begins, and its velocity: in
    /// increments, and increments per cycle.
    pub fn at(&self, member: usize, point: &Point) -> (f64, f64) {
        const ONE: f64 = 4_294_967_296.0;
        let shape = if self.shared { 0 } else { member };
        let amplitude = self.members.get(member).map_or(0, |m| m.amplitude);
        let (position, velocity) = point.shapes.get(shape).copied().unwrap_or_default();
        let times = |x: i32| f64::from(x) * f64::from(amplitude) / ONE;
        (times(position), times(velocity))
    }
}

/// What came of reading a program.
#[derive(Debug)]
#[non_exhaustive]
pub struct Outcome {
    /// The program, if there is no error.
    pub program: Option<Program>,
    /// Everything that is wrong, in the order in which it was found.
    pub problems: Vec<Problem>,
}

/// Reads the program in the file at `path` for a machine.
pub fn load(path: &FilePath, machine: &Machine) -> Outcome {
    let name = path.display().to_string();
    match crate::read_file(path) {
        Ok(bytes) => read(&Source::new(name, &bytes), machine),
        Err(error) => {
            let mut problems = Problems::default();
            problems.error(
                &Place::file(&Source::new(&name, b"")),
                &name,
                format!("the file cannot be read: {error}"),
                "give the path of a motion program; those of the project are in programs/",
            );
            Outcome {
                program: None,
                problems: problems.into_vec(),
            }
        }
    }
}

/// The same from memory.
pub fn read(source: &Source, machine: &Machine) -> Outcome {
    match Group::of(machine) {
        Some(group) => read_for(source, &group),
        None => Outcome {
            program: None,
            problems: Vec::new(),
        },
    }
}

/// The same for axes of which nothing else is known.
pub fn read_for(source: &Source, group: &Group) -> Outcome {
    let mut problems = Problems::default();
    let program = resolve(source, group, &mut problems);
    Outcome {
        program,
        problems: problems.into_vec(),
    }
}

/// The same among other problems.
pub(crate) fn resolve(source: &Source, group: &Group, problems: &mut Problems) -> Option<Program> {
    let program = read::program(source, group, problems);
    program.filter(|_| !problems.has_errors())
}

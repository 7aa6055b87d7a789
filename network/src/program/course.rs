//! What a program does to the axes: where they come to rest, and when it is done.

use super::axes::{CYCLIC_TORQUE, Group, PROFILE_POSITION};
use super::{Action, Path, Program, Step, slow, timing};

/// Between the end of a reference and the next step when nothing disturbs the axes:
/// delay of the loop, last increments, confirmation, planning.
const SETTLING_CYCLES: u64 = 14;
/// A mode is written, confirmed, and the group released again.
const MODE_MS: f64 = 400.0;
/// A rest that everybody sees, ms; a shorter one may be none.
const REST_MS: f64 = 150.0;
/// What is done for ever is done so often here.
const FOR_EVER: u16 = 2;
/// More is not unrolled.
const STEPS_MAX: usize = 100_000;

/// A program from its release to its end, if it begins at home.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Course {
    /// Rests, one after the other: for each axis that a step has moved, where it has to
    /// be.
    pub rests: Vec<Vec<Option<Stop>>>,
    /// How long it takes, in SYNC cycles.
    pub cycles: u64,
    /// It is not over before, in SYNC cycles, however its axes stand meanwhile; 0: it is
    /// as soon as they have been at all of their rests.
    pub least: u64,
    /// It does not end by itself, or is too long to be followed.
    pub endless: bool,
}

/// Where an axis comes to rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Stop {
    /// Increments from home.
    pub target: i32,
    /// Axes with the same number do the same, and stop together to be seen: of two
    /// that arrive together, the one that goes less far is slow before.
    pub set: u8,
    /// It is seen to rest there; else the next step may begin at once.
    pub sure: bool,
    /// So many increments beside it, it may be so slow already that it seems to rest, or
    /// seem to rest while it passes.
    pub within: u32,
}

/// Numbers for what is alike, from 1.
#[derive(Default)]
struct Alike(Vec<(u8, i64)>);

impl Alike {
    fn number(&mut self, what: (u8, i64)) -> u8 {
        let known = self.0.iter().position(|known| *known == what);
        let place = known.unwrap_or_else(|| {
            self.0.push(what);
            self.0.len() - 1
        });
        place as u8 + 1
    }
}

/// While it is followed.
struct Walk<'a> {
    group: &'a Group,
    course: Course,
    at: Vec<i64>,
    modes: Vec<u8>,
    /// In this step.
    moved: Vec<Option<Stop>>,
    /// Its drive has set-points, and goes from one to the next whatever the program does.
    on_its_way: Vec<bool>,
    left: usize,
    /// At least so many cycles, if nothing goes on meanwhile.
    least: u64,
    /// Who only looks at the axes can take a moment on the way for the end.
    held: bool,
}

impl Program {
    /// What it does to the axes of `group`, for which it is made.
    pub fn course(&self, group: &Group) -> Course {
        let mut walk = Walk {
            group,
            course: Course::default(),
            at: vec![0; self.axes],
            modes: group.axes.iter().map(|axis| axis.mode).collect(),
            moved: vec![None; self.axes],
            on_its_way: vec![false; self.axes],
            left: STEPS_MAX,
            least: 0,
            held: false,
        };
        walk.steps(&self.steps);
        walk.end();
        if walk.held || walk.course.rests.is_empty() {
            // The board's clock is not exact, and it may begin nearer.
            walk.course.least = walk.least * 9 / 10;
        }
        walk.course
    }
}

impl Walk<'_> {
    /// A step has ended.
    fn pass(&mut self) {
        if self.moved.iter().any(Option::is_some) {
            let moved = std::mem::replace(&mut self.moved, vec![None; self.at.len()]);
            self.course.rests.push(moved);
        }
    }

    /// All have come to rest.
    fn end(&mut self) {
        self.on_its_way.fill(false);
        self.rest();
    }

    /// Whoever has moved is seen to rest, but for drives that are on their way.
    fn rest(&mut self) {
        for axis in (0..self.at.len()).filter(|axis| !self.on_its_way[*axis]) {
            let mut rests = self.course.rests.iter_mut().rev();
            if let Some(last) = rests.find_map(|rest| rest[axis].as_mut()) {
                last.sure = true;
            }
        }
    }

    fn go(&mut self, axis: usize, to: i64, set: u8) {
        if self.modes[axis] == CYCLIC_TORQUE {
            return;
        }
        if to != self.at[axis] {
            self.moved[axis] = Some(Stop {
                target: to as i32,
                set,
                sure: false,
                within: 0,
            });
        }
        self.at[axis] = to;
    }

    fn steps(&mut self, steps: &[Step]) {
        for step in steps {
            if self.left == 0 {
                self.course.endless = true;
                return;
            }
            self.left -= 1;
            self.action(&step.action);
        }
    }

    fn action(&mut self, action: &Action) {
        match action {
            Action::Move(a_move) => {
                let cycles = timing::cycles(self.group, a_move, &self.at);
                let mut alike = Alike::default();
                for part in &a_move.parts {
                    let at = self.at[part.axis];
                    let alone = self.modes[part.axis] == PROFILE_POSITION;
                    self.on_its_way[part.axis] = alone && a_move.flying;
                    let from = if a_move.relative { at } else { 0 };
                    let to = from + i64::from(part.target);
                    let set = alike.number((part.set, (to - at).abs()));
                    self.go(part.axis, to, set);
                }
                self.pass();
                self.least += cycles;
                self.course.cycles += cycles + SETTLING_CYCLES;
            }
            Action::Wait { cycles } => {
                if *cycles >= self.group.cycles(REST_MS) {
                    self.rest();
                }
                self.least += u64::from(*cycles);
                self.course.cycles += u64::from(*cycles);
            }
            Action::Repeat { times, steps } => {
                self.course.endless |= *times == 0;
                let times = if *times == 0 { FOR_EVER } else { *times };
                for _ in 0..times {
                    self.steps(steps);
                }
            }
            Action::Path(path) => self.path(path),
            Action::Home { axes, limit } => {
                self.end();
                for axis in 0..self.at.len() {
                    if axes >> axis & 1 != 0 {
                        self.at[axis] = 0;
                    }
                }
                self.course.cycles += u64::from(*limit);
            }
            Action::Mode { axes, mode } => {
                self.end();
                for (axis, of) in self.modes.iter_mut().enumerate() {
                    if axes >> axis & 1 != 0 {
                        *of = *mode;
                    }
                }
                self.course.cycles += u64::from(self.group.cycles(MODE_MS));
            }
        }
    }

    fn path(&mut self, path: &Path) {
        let cycles = path.points.iter().map(|point| u64::from(point.cycles));
        let cycles = cycles.sum::<u64>() * u64::from(path.periods);
        self.least += cycles;
        self.course.cycles += cycles + SETTLING_CYCLES;
        let mut alike = Alike::default();
        for (member, of) in path.members.iter().enumerate() {
            let begin = self.at[of.axis];
            let last = path.points.last();
            let end = last.map_or(0.0, |last| path.at(member, last).0);
            let shape = if path.shared { 0 } else { member as u8 };
            let set = alike.number((shape, i64::from(of.amplitude).abs()));
            self.at[of.axis] = begin + end.round() as i64;
            let slow = slow::of(self.group, path, member);
            if !slow.seen {
                self.held = true;
                continue;
            }
            let set = match slow.soft {
                true => alike.number((u8::MAX, member as i64)),
                false => set,
            };
            self.held |= slow.end > 0 || !slow.places.is_empty();
            for (place, within) in slow.places {
                let mut rest = vec![None; self.at.len()];
                rest[of.axis] = Some(Stop {
                    target: (begin + place) as i32,
                    set,
                    sure: false,
                    within,
                });
                self.course.rests.push(rest);
            }
            // It moved, wherever it ends.
            self.moved[of.axis] = Some(Stop {
                target: self.at[of.axis] as i32,
                set,
                sure: false,
                within: slow.end,
            });
        }
        self.pass();
    }
}

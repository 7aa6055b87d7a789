//! What a program does to the axes: where they come to rest, and when it is done.

use super::axes::{CYCLIC_TORQUE, Group, PROFILE_POSITION};
use super::{Action, Part, Path, Program, Step, slow, timing};

/// Between the end of a reference and the next step when nothing disturbs the axes:
/// delay of the loop, last increments, confirmation, planning.
const SETTLING_CYCLES: u64 = 14;
/// A mode is written, confirmed, and the group released again.
const MODE_MS: f64 = 400.0;
/// Until an axis that a torque has driven stands, and is led back from there.
const RUN_OUT_MS: f64 = 5000.0;
/// A rest that everybody sees, ms; a shorter one may be none.
const REST_MS: f64 = 150.0;
/// So many increments apart two places are one to whoever looks.
const NEAR: u32 = 50;
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
    /// Axes are driven by torque: they may turn or not, and as long as they like, so that
    /// nobody who only looks at them can say when it is over.
    pub torque: bool,
}

/// Where an axis comes to rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Stop {
    /// Increments from its origin.
    pub target: i32,
    /// What they count from.
    pub origin: Origin,
    /// Axes with the same number do the same, and stop together to be seen: of two
    /// that arrive together, the one that goes less far is slow before. A drive that makes
    /// its own ramps has a number for itself.
    pub set: u8,
    /// It is seen to rest there; else the next step may begin at once.
    pub sure: bool,
    /// So many increments beside it, it may be so slow already that it seems to rest, or
    /// seem to rest while it passes.
    pub within: u32,
}

/// What the target of an axis counts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// Its home.
    Home,
    /// Its home. It begins anywhere, so that it may stand at its target already.
    HomeFromAnywhere {
        /// As [`Origin::Left`].
        left: usize,
        /// It begins so many increments from there.
        by: i32,
    },
    /// Where it was as it left that mode for the nth time, from 0.
    Left(usize),
}

/// What is alike for no other axis, beside the numbers of sets.
const BY_DRIVE: u8 = u8::MAX - 1;
const FROM_ANYWHERE: u8 = u8::MAX - 2;

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
    /// Increments from the origin; in cyclic synchronous torque mode per mille.
    at: Vec<i64>,
    /// Home, or where a torque has left it.
    origins: Vec<Origin>,
    /// How often each axis has left cyclic synchronous torque mode.
    left_torque: Vec<usize>,
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
            origins: vec![Origin::Home; self.axes],
            left_torque: vec![0; self.axes],
            modes: group.axes.iter().map(|axis| axis.mode).collect(),
            moved: vec![None; self.axes],
            on_its_way: vec![false; self.axes],
            left: STEPS_MAX,
            least: 0,
            held: false,
        };
        walk.steps(&self.steps);
        walk.end();
        if walk.modes.contains(&CYCLIC_TORQUE) {
            walk.course.cycles += u64::from(group.cycles(RUN_OUT_MS));
        }
        walk.held |= (0..self.axes).any(|axis| walk.comes_back(axis));
        if walk.held || walk.course.rests.is_empty() {
            // The board's clock is not exact, and it may begin nearer.
            walk.course.least = walk.least * 9 / 10;
        }
        walk.course
    }
}

impl Walk<'_> {
    /// Whether an axis may rest where it ends before that is its end.
    fn comes_back(&self, axis: usize) -> bool {
        let mut stops = self.course.rests.iter().rev().filter_map(|rest| rest[axis]);
        let last = stops.next();
        let same = |stop: Stop| last.is_some_and(|last| stop.target.abs_diff(last.target) <= NEAR);
        stops.any(|stop| !stop.sure && same(stop))
    }

    /// A step has ended.
    fn pass(&mut self) {
        if self.moved.iter().any(Option::is_some) {
            let moved = std::mem::replace(&mut self.moved, vec![None; self.at.len()]);
            self.course.rests.push(moved);
        }
    }

    /// All have come to rest: so shortly that nobody may see it.
    fn stand(&mut self) {
        self.on_its_way.fill(false);
    }

    /// All have come to rest, and stay.
    fn end(&mut self) {
        self.stand();
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

    /// An axis is led to a position, or by a distance, in a set of its step.
    fn go(&mut self, part: &Part, relative: bool, alike: &mut Alike) {
        let axis = part.axis;
        let (at, known) = (self.at[axis], self.origins[axis]);
        let to = i64::from(part.target) + if relative { at } else { 0 };
        self.at[axis] = to;
        if self.modes[axis] == CYCLIC_TORQUE {
            self.course.torque = true;
            return;
        }
        let origin = match known {
            Origin::Left(left) if !relative => {
                self.origins[axis] = Origin::Home;
                let by = at as i32;
                Origin::HomeFromAnywhere { left, by }
            }
            known => known,
        };
        let from_anywhere = origin != known;
        let set = if self.modes[axis] == PROFILE_POSITION {
            alike.number((BY_DRIVE, axis as i64))
        } else if from_anywhere {
            alike.number((FROM_ANYWHERE, axis as i64))
        } else {
            alike.number((part.set, (to - at).abs()))
        };
        if to != at || from_anywhere {
            self.moved[axis] = Some(Stop {
                target: to as i32,
                origin,
                set,
                sure: false,
                within: 0,
            });
        }
    }

    /// All of them stand, and change their mode.
    fn change(&mut self, axes: u32, mode: u8) {
        let mut run_out = false;
        for axis in (0..self.modes.len()).filter(|axis| axes >> axis & 1 != 0) {
            let before = std::mem::replace(&mut self.modes[axis], mode);
            if before == mode {
                continue;
            }
            if before == CYCLIC_TORQUE {
                run_out = true;
                self.origins[axis] = Origin::Left(self.left_torque[axis]);
                self.left_torque[axis] += 1;
            }
            if [before, mode].contains(&CYCLIC_TORQUE) {
                self.at[axis] = 0;
            }
        }
        let ms = MODE_MS + if run_out { RUN_OUT_MS } else { 0.0 };
        self.course.cycles += u64::from(self.group.cycles(ms));
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
                    let alone = self.modes[part.axis] == PROFILE_POSITION;
                    self.on_its_way[part.axis] = alone && a_move.flying;
                    self.go(part, a_move.relative, &mut alike);
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
                self.stand();
                for axis in 0..self.at.len() {
                    if axes >> axis & 1 != 0 {
                        (self.at[axis], self.origins[axis]) = (0, Origin::Home);
                    }
                }
                self.course.cycles += u64::from(*limit);
            }
            Action::Mode { axes, mode } => {
                self.stand();
                self.change(*axes, *mode);
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
                    origin: self.origins[of.axis],
                    set,
                    sure: false,
                    within,
                });
                self.course.rests.push(rest);
            }
            // It moved, wherever it ends.
            self.moved[of.axis] = Some(Stop {
                target: self.at[of.axis] as i32,
                origin: self.origins[of.axis],
                set,
                sure: false,
                within: slow.end,
            });
        }
        self.pass();
    }
}

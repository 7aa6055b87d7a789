//! Programs as bytes; see `docs/motion.md`. All numbers little-endian.

use crate::motion::fixed;
use crate::motion::mode::Mode;
use crate::motion::path::Knot;
use crate::motion::program::{AxisMove, Judged, Reason, Refusal, Refused, TORQUE};
use crate::motion::{AxisConfig, GroupConfig, next};
use crate::sdo::Crc16;

/// The version of the format.
pub const VERSION: u8 = 2;
/// Bytes before the steps: version, axes, length of the steps, SYNC period.
const HEADER: usize = 8;
/// Bytes behind them.
const CRC: usize = 2;
/// How deep loops may be.
pub const LOOPS: usize = 4;

/// A step begins with its kind, flags or a mode, the set of its axes, and a number.
const STEP: usize = 8;
/// Axes start in one SYNC and arrive in one SYNC; the number is the jerk in
/// rpm/s^2, 0 for a trapezoid.
pub const MOVE: u8 = 1;
/// All axes hold their positions for so many cycles.
pub const WAIT: u8 = 2;
/// What follows up to the end of the loop is done so many times; 0: for ever.
pub const LOOP: u8 = 3;
/// The end of a loop.
pub const END_LOOP: u8 = 4;
/// Axes follow points: the number of them, and in the upper half how often.
pub const PATH: u8 = 5;
/// The drives search for their homes, at most for so many cycles.
pub const HOME: u8 = 6;
/// Change to the mode of operation that stands for the flags.
pub const MODE: u8 = 7;

/// A move counts from where the axes are, a path from where it begins, which is
/// anywhere.
pub const RELATIVE: u8 = 1;
/// The next step follows as soon as the references have ended.
pub const FLYING: u8 = 2;
/// One shape for all axes of a path, each with its amplitude.
pub const SHARED: u8 = 4;

/// The flags that a step of each kind may have.
const FLAGS: [u8; MODE as usize] = [
    RELATIVE | FLYING,
    0,
    0,
    0,
    RELATIVE | FLYING | SHARED,
    0,
    u8::MAX,
];

/// Bytes of one axis' part of a move: target, velocity with the set in its upper
/// eight bits, acceleration, deceleration.
const MOVE_PART: usize = 16;
/// Of a path: amplitude, and where it begins.
const PATH_PART: usize = 8;
/// Cycles of a point, and for each shape its position and velocity.
const POINT: usize = 2;
const SHAPE: usize = 8;
/// Bytes of a number.
const NUMBER: usize = 4;

/// The number at a place; 0 behind the end.
#[inline(never)]
fn number(bytes: &[u8], at: usize) -> u32 {
    let bytes = bytes.get(at..).and_then(|bytes| bytes.first_chunk());
    bytes.map_or(0, |bytes| u32::from_le_bytes(*bytes))
}

/// A step of a program.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Step<'a> {
    pub(super) kind: u8,
    pub(super) flags: u8,
    /// Bit n: axis n.
    pub(super) axes: u32,
    pub(super) value: u32,
    /// What stands behind that, and the steps that follow.
    body: &'a [u8],
}

impl<'a> Step<'a> {
    /// The step at a place; at the end one without a kind.
    #[inline(never)]
    pub(super) fn at(steps: &'a [u8], at: usize) -> Step<'a> {
        let head = number(steps, at);
        Step {
            kind: head as u8,
            flags: (head >> u8::BITS) as u8,
            axes: head >> u16::BITS,
            value: number(steps, at + NUMBER),
            body: steps.get(at + STEP..).unwrap_or_default(),
        }
    }

    pub(super) const fn has(&self, flag: u8) -> bool {
        self.flags & flag != 0
    }

    #[inline(never)]
    fn members(&self) -> usize {
        let (mut left, mut members) = (self.axes, 0);
        while next(&mut left).is_some() {
            members += 1;
        }
        members
    }

    /// Bytes of a point of a path, all its shapes included.
    fn point_len(&self) -> usize {
        let shapes = if self.has(SHARED) { 1 } else { self.members() };
        POINT + shapes * SHAPE
    }

    /// Points of a path.
    pub(super) const fn points(&self) -> usize {
        self.value as u16 as usize
    }

    /// How often a path is followed.
    pub(super) const fn periods(&self) -> u32 {
        self.value >> u16::BITS
    }

    /// All of its bytes.
    pub(super) fn len(&self) -> usize {
        STEP + match self.kind {
            MOVE => self.members() * MOVE_PART,
            PATH => self.members() * PATH_PART + self.points() * self.point_len(),
            _ => 0,
        }
    }

    /// A member's part of a move.
    #[inline(never)]
    pub(super) fn part(&self, member: usize) -> AxisMove {
        const SET: u32 = 24;
        let at = member * MOVE_PART;
        let velocity = number(self.body, at + NUMBER);
        AxisMove {
            target: number(self.body, at) as i32,
            velocity: velocity & ((1 << SET) - 1),
            acceleration: number(self.body, at + 2 * NUMBER),
            deceleration: number(self.body, at + 3 * NUMBER),
            set: (velocity >> SET) as u8,
        }
    }

    /// Where a member's path begins, in increments from home.
    pub(super) fn begin(&self, member: usize) -> i32 {
        number(self.body, member * PATH_PART + NUMBER) as i32
    }

    /// A member's point, as a knot from where the path begins.
    #[inline(never)]
    pub(super) fn point(&self, member: usize, point: usize) -> Knot {
        let amplitude = i64::from(number(self.body, member * PATH_PART) as i32);
        let times = |at| amplitude * i64::from(number(self.body, at) as i32);
        let at = self.members() * PATH_PART + point * self.point_len();
        let shape = if self.has(SHARED) { 0 } else { member };
        let of_shape = at + POINT + shape * SHAPE;
        Knot {
            cycles: u32::from(number(self.body, at) as u16),
            position: times(of_shape),
            velocity: times(of_shape + NUMBER),
        }
    }

    /// Checks a member's path against the limits of its axis: every piece, since it
    /// lies within the hull of its control points. The travel as well, if it is
    /// known where it begins. Its steepest slope in increments per cycle squared.
    #[inline(never)]
    pub(super) fn check_path(
        &self,
        member: usize,
        limits: &AxisConfig,
        begin: Option<i32>,
        why: &mut Refusal,
    ) -> Result<f32, Refused> {
        const THIRD: f32 = 1.0 / 3.0;
        let mut before = Knot::default();
        let (mut fastest, mut steepest) = (0.0, 0.0);
        let greatest = |so_far: &mut f32, x: f32| {
            if x.abs() > *so_far {
                *so_far = x.abs();
            }
        };
        for point in 0..self.points() {
            let knot = self.point(member, point);
            let cycles = knot.cycles as f32;
            let way = fixed::float(knot.position.wrapping_sub(before.position));
            let (from, to) = (fixed::float(before.velocity), fixed::float(knot.velocity));
            let middle = 3.0 * way / cycles - from - to;
            greatest(&mut fastest, to);
            greatest(&mut fastest, middle);
            greatest(&mut steepest, 2.0 * (middle - from) / cycles);
            greatest(&mut steepest, 2.0 * (to - middle) / cycles);
            if let Some(begin) = begin {
                // A knot lies between the control points on both of its sides.
                for (from, ahead) in [(&before, from), (&knot, -to)] {
                    let ahead = fixed::fixed(ahead * cycles * THIRD);
                    let at = fixed::round(from.position.wrapping_add(ahead));
                    limits.reaches(begin.saturating_add(at), why)?;
                }
            }
            before = knot;
            why.within(Reason::Points, knot.cycles, u32::MAX)?;
        }
        let (rpm, slope) = (limits.scale.rpm(fastest), limits.scale.rpm_per_s(steepest));
        let (rpm, slope) = ((rpm as u32).max(1), (slope as u32).max(1));
        why.within(Reason::Velocity, rpm, limits.velocity_max)?;
        why.within(Reason::Acceleration, slope, limits.acceleration_max)?;
        let way = if self.periods() > 1 {
            before.position
        } else {
            0
        };
        if before.velocity | way != 0 {
            why.because(Reason::End, fixed::round(way) as u32, 0)?;
        }
        Ok(steepest)
    }
}

/// The steps of a program that was checked before.
pub(super) fn steps(bytes: &[u8]) -> &[u8] {
    let end = bytes.len().saturating_sub(CRC);
    bytes.get(HEADER..end).unwrap_or_default()
}

/// Reads all of a program against the limits of the axes, as far as they do not
/// depend on where the axes are.
///
/// # Errors
/// The first that is wrong, and in which step.
pub fn check<const N: usize>(bytes: &[u8], config: &GroupConfig<N>) -> Result<(), Refusal> {
    let mut why = Refusal::NONE;
    inspect(bytes, config, &mut why).map_err(|Refused| why)
}

/// The same.
pub(in crate::motion) fn inspect<const N: usize>(
    bytes: &[u8],
    config: &GroupConfig<N>,
    why: &mut Refusal,
) -> Judged {
    let length = bytes.len() as u32;
    let head = number(bytes, 0);
    let summed = bytes.len().saturating_sub(CRC);
    let sum = Crc16::new().update(bytes.get(..summed).unwrap_or_default());
    let crc = number(bytes, bytes.len().saturating_sub(NUMBER)) >> u16::BITS;
    let frame = (HEADER + CRC) as u32 + (head >> u16::BITS);
    let axes = u32::from((head >> u8::BITS) as u8);
    let cycle = number(bytes, NUMBER);
    for (reason, value, allowed) in [
        (Reason::Version, u32::from(head as u8), VERSION.into()),
        (Reason::Axes, axes, N as u32),
        (Reason::Length, length, frame),
        (Reason::Cycle, cycle, config.cycle.as_micros()),
        (Reason::Checksum, crc, sum.get().into()),
    ] {
        if value != allowed {
            return why.because(reason, value, allowed);
        }
    }
    let steps = steps(bytes);
    let (mut at, mut depth) = (0, 0u32);
    while at < steps.len() {
        why.step = why.step.saturating_add(1);
        let step = Step::at(steps, at);
        at += step.len();
        if at > steps.len() {
            return why.because(Reason::Length, at as u32, steps.len() as u32);
        }
        check_step(&step, &mut depth, config, why)?;
    }
    why.step = 0;
    match depth {
        0 => Ok(()),
        depth => why.because(Reason::Loop, depth, 0),
    }
}

#[inline(never)]
fn check_step<const N: usize>(
    step: &Step<'_>,
    depth: &mut u32,
    config: &GroupConfig<N>,
    why: &mut Refusal,
) -> Judged {
    let Some(&flags) = FLAGS.get(usize::from(step.kind).wrapping_sub(1)) else {
        return why.because(Reason::Step, step.kind.into(), MODE.into());
    };
    if step.flags & !flags != 0 {
        return why.because(Reason::Step, step.flags.into(), flags.into());
    }
    let is = |kinds: u32| kinds >> step.kind & 1 != 0;
    if !is(1 << WAIT | 1 << LOOP | 1 << END_LOOP) {
        why.within(Reason::Members, step.axes, (1 << N) - 1)?;
    } else if step.axes != 0 {
        return why.because(Reason::Members, step.axes, 0);
    }
    if is(1 << WAIT | 1 << HOME) {
        why.within(Reason::Time, step.value, i32::MAX as u32)?;
    }
    if is(1 << LOOP | 1 << END_LOOP) {
        if step.kind == LOOP {
            *depth = depth.wrapping_add(1);
            if step.body.first() == Some(&END_LOOP) {
                // One around nothing takes no time.
                *depth = 0;
            }
        }
        why.within(Reason::Loop, *depth, LOOPS as u32)?;
        if step.kind == END_LOOP {
            *depth -= 1;
        }
        return Ok(());
    }
    if step.kind == PATH && (step.points() == 0 || step.periods() == 0) {
        return why.because(Reason::Points, step.value, 0);
    }
    let (mut left, mut member) = (step.axes, 0);
    while let Some(axis) = next(&mut left) {
        let Some(limits) = config.axes.get(axis) else {
            break;
        };
        let absolute = !step.has(RELATIVE);
        why.axis = axis as u8;
        let mode = if step.kind == HOME {
            Mode::Homing.code()
        } else {
            step.flags as i8
        };
        match step.kind {
            MOVE => {
                let part = step.part(member);
                let torque = part.set & TORQUE != 0;
                part.keeps(torque, limits, why)?;
                if absolute {
                    limits.takes(part.target, torque, why)?;
                }
            }
            PATH => {
                let begin = absolute.then(|| step.begin(member));
                step.check_path(member, limits, begin, why)?;
            }
            _ if Mode::of(mode).is_some_and(|mode| mode.is_in(limits.modes)) => {}
            _ => {
                return why.because(Reason::Mode, mode as u32, limits.modes);
            }
        }
        member += 1;
    }
    why.axis = Refusal::NO_AXIS;
    Ok(())
}

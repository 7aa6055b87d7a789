//! Programs as bytes; see `docs/motion.md`. All numbers little-endian.

use crate::motion::mode::Mode;
use crate::motion::program::{AxisMove, Limit, PlanError};
use crate::motion::scale::Scale;
use crate::motion::{AxisConfig, GroupConfig};
use crate::sdo::Crc16;
use crate::words::in_words;

/// The version of the format.
pub const VERSION: u8 = 1;
/// Bytes before the steps.
const HEADER: usize = 4;
/// Bytes behind them.
const CRC: usize = 2;
/// How deep loops may be.
pub const LOOPS: usize = 4;
/// A move counts from where the axes are.
pub const RELATIVE: u8 = 1;
/// The next step follows as soon as the references have ended.
pub const FLYING: u8 = 2;

/// Bytes of one axis' part of a move.
const MOVE_PART: usize = 17;
/// Bytes of a number.
const NUMBER: usize = 4;

/// A step of a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Step<'a> {
    /// Axes start in one SYNC and arrive in one SYNC.
    Move {
        /// [`RELATIVE`], [`FLYING`].
        flags: u8,
        /// Bit n: axis n.
        axes: u32,
        /// rpm/s^2; 0: trapezoid.
        jerk: u32,
        /// The parts of its axes.
        parts: &'a [u8],
    },
    /// All axes hold their positions.
    Wait {
        /// Milliseconds.
        ms: u32,
    },
    /// What follows up to the end of the loop is repeated.
    Loop {
        /// 0: for ever.
        times: u16,
    },
    /// The end of a loop.
    EndLoop,
    /// A set-point generator.
    Generator(Generator<'a>),
    /// The drives search for their homes.
    Home {
        /// Bit n: axis n.
        axes: u32,
        /// Limit in milliseconds.
        ms: u32,
    },
    /// Change the mode of operation.
    Mode {
        /// Bit n: axis n.
        axes: u32,
        /// The new one.
        mode: Mode,
    },
}

/// What a generator makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A sine of the velocity: amplitudes in increments.
    Sine,
    /// Positions at equal distances of time, counted from the start.
    Table,
    /// Way-points, passed with blends: velocity and acceleration of each axis,
    /// then positions from home.
    Points,
}

/// A set-point generator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Generator<'a> {
    /// What it makes.
    pub kind: Kind,
    /// Bit n: axis n.
    pub axes: u32,
    /// Points; of a sine those of a period.
    pub points: u16,
    /// Cycles from one point to the next.
    pub cycles: u16,
    /// Periods of a sine.
    pub periods: u16,
    /// Numbers, those of a point or of an axis beside one another.
    pub numbers: &'a [u8],
}

impl Generator<'_> {
    /// How many axes take part.
    pub const fn members(&self) -> usize {
        self.axes.count_ones() as usize
    }

    /// The number at a place; 0 if there is none.
    pub fn number(&self, place: usize) -> i32 {
        let bytes = self.numbers.get(place * NUMBER..);
        let bytes = bytes.and_then(|bytes| bytes.first_chunk());
        bytes.map_or(0, |bytes| i32::from_le_bytes(*bytes))
    }
}

/// What is wrong with a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ProgramFault {
    /// It ends too early, or goes on after its end.
    Length,
    /// Another version of the format.
    Version(u8),
    /// Made for another number of axes.
    Axes(u8),
    /// The checksum is wrong.
    Checksum,
    /// There is no such step.
    UnknownStep(u8),
    /// The group has no such axis, or the step has none at all; bit n: axis n.
    UnknownAxis(u32),
    /// There is no such mode, or the drive does not have it.
    NoSuchMode(i8),
    /// Loops are too deep, end without beginning, or do not end.
    Loop,
    /// A generator without points, cycles or periods.
    Nothing,
    /// A value breaks a limit.
    Limit(PlanError),
}

in_words!(ProgramFault {
    ProgramFault::Length => ("it ends too early or too late"),
    ProgramFault::Version(version) => ("version {} of the format, not {}", version, VERSION),
    ProgramFault::Axes(axes) => ("it is made for {} axes", axes),
    ProgramFault::Checksum => ("its checksum is wrong"),
    ProgramFault::UnknownStep(code) => ("there is no step of kind {}", code),
    ProgramFault::UnknownAxis(axes) => ("axes {:#b}: there are not so many, or none", axes),
    ProgramFault::NoSuchMode(mode) => ("the drive does not have mode {}", mode),
    ProgramFault::Loop => ("loops are too deep, or do not fit together"),
    ProgramFault::Nothing => ("points, cycles and periods have to be 1 at least"),
    ProgramFault::Limit(error) => ("{}", error),
});

/// What is wrong with a program, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProgramError {
    /// Step, counted from 1; 0: the program as a whole.
    pub step: u16,
    /// What.
    pub fault: ProgramFault,
}

in_words!(ProgramError {
    ProgramError { step: 0, fault } => ("the program: {}", fault),
    ProgramError { step, fault } => ("step {}: {}", step, fault),
});

impl core::error::Error for ProgramError {}

/// Takes little-endian numbers from the front.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, bytes: usize) -> Option<&'a [u8]> {
        let (taken, left) = self.0.split_at_checked(bytes)?;
        self.0 = left;
        Some(taken)
    }

    /// A number of 1, 2 or 4 bytes.
    #[inline(never)]
    fn number(&mut self, bytes: usize) -> Option<u32> {
        let taken = self.take(bytes)?;
        let shifted = taken.iter().rev();
        Some(shifted.fold(0, |number, byte| number << u8::BITS | u32::from(*byte)))
    }
}

/// The steps of a program, its frame and checksum being right.
///
/// # Errors
/// What is wrong with it as a whole.
pub fn steps(bytes: &[u8], axes: usize) -> Result<&[u8], ProgramFault> {
    let mut reader = Reader(bytes);
    let header = (reader.number(1), reader.number(1), reader.number(2));
    let (Some(version), Some(made_for), Some(length)) = header else {
        return Err(ProgramFault::Length);
    };
    if version != u32::from(VERSION) {
        return Err(ProgramFault::Version(version as u8));
    }
    if made_for as usize != axes {
        return Err(ProgramFault::Axes(made_for as u8));
    }
    let length = length as usize;
    let (Some(steps), Some(crc), []) = (reader.take(length), reader.number(CRC), reader.0) else {
        return Err(ProgramFault::Length);
    };
    let summed = bytes.get(..HEADER + length).unwrap_or_default();
    if u32::from(Crc16::new().update(summed).get()) != crc {
        return Err(ProgramFault::Checksum);
    }
    Ok(steps)
}

/// The steps of a program that was checked before.
pub(super) fn body(bytes: &[u8]) -> &[u8] {
    let end = bytes.len().saturating_sub(CRC);
    bytes.get(HEADER..end).unwrap_or_default()
}

/// The first step of `bytes`, and how many bytes it has.
///
/// # Errors
/// What is wrong with it.
pub fn step(bytes: &[u8]) -> Result<(Step<'_>, usize), ProgramFault> {
    let mut reader = Reader(bytes);
    let code = reader.number(1).ok_or(ProgramFault::Length)? as u8;
    let step = decode(code, &mut reader)?.ok_or(ProgramFault::Length)?;
    Ok((step, bytes.len() - reader.0.len()))
}

/// `None`: there are too few bytes.
fn decode<'a>(code: u8, reader: &mut Reader<'a>) -> Result<Option<Step<'a>>, ProgramFault> {
    /// Sizes of the fields that each kind of step begins with.
    const FIELDS: [&[u8]; 9] = [
        &[1, 2, 4],
        &[4],
        &[2],
        &[],
        &[2, 2, 2, 2],
        &[2, 2, 2],
        &[2, 2],
        &[2, 4],
        &[2, 1],
    ];
    let sizes = FIELDS.get(usize::from(code).wrapping_sub(1));
    let sizes = *sizes.ok_or(ProgramFault::UnknownStep(code))?;
    let mut fields = [0; 4];
    for (field, size) in fields.iter_mut().zip(sizes) {
        match reader.number(usize::from(*size)) {
            Some(number) => *field = number,
            None => return Ok(None),
        }
    }
    let [first, second, third, fourth] = fields;
    let members = first.count_ones() as usize;
    let points = second as usize;
    let mut generator = |kind, numbers: usize| {
        Some(Step::Generator(Generator {
            kind,
            axes: first,
            points: second as u16,
            cycles: third as u16,
            periods: fourth as u16,
            numbers: reader.take(numbers * NUMBER)?,
        }))
    };
    Ok(match code {
        1 => {
            let parts = reader.take(second.count_ones() as usize * MOVE_PART);
            parts.map(|parts| Step::Move {
                flags: first as u8,
                axes: second,
                jerk: third,
                parts,
            })
        }
        2 => Some(Step::Wait { ms: first }),
        3 => Some(Step::Loop {
            times: first as u16,
        }),
        4 => Some(Step::EndLoop),
        5 => generator(Kind::Sine, members),
        // Cycles come before points.
        6 => generator(Kind::Table, members * third as usize).map(|step| match step {
            Step::Generator(table) => Step::Generator(Generator {
                points: table.cycles,
                cycles: table.points,
                periods: 1,
                ..table
            }),
            step => step,
        }),
        7 => generator(Kind::Points, members * (2 + points)).map(|step| match step {
            Step::Generator(points) => Step::Generator(Generator {
                cycles: 1,
                periods: 1,
                ..points
            }),
            step => step,
        }),
        8 => Some(Step::Home {
            axes: first,
            ms: second,
        }),
        _ => {
            let code = second as i8;
            let mode = Mode::of(code).ok_or(ProgramFault::NoSuchMode(code))?;
            Some(Step::Mode { axes: first, mode })
        }
    })
}

/// The part of the member number `member` in those of a move.
pub fn part(parts: &[u8], member: usize) -> Option<AxisMove> {
    let mut reader = Reader(parts.get(member * MOVE_PART..)?);
    Some(AxisMove {
        target: reader.number(NUMBER)? as i32,
        velocity: reader.number(NUMBER)?,
        acceleration: reader.number(NUMBER)?,
        deceleration: reader.number(NUMBER)?,
        set: reader.number(1)? as u8,
    })
}

/// The axes of a set with their place among its members.
pub fn members(axes: u32) -> impl Iterator<Item = (usize, usize)> {
    let axes = (0..u32::BITS as usize).filter(move |axis| axes >> axis & 1 != 0);
    axes.enumerate().map(|(member, axis)| (axis, member))
}

/// Reads all of a program against the limits of the axes.
///
/// # Errors
/// The first that is wrong, and in which step.
pub fn check<const N: usize>(bytes: &[u8], config: &GroupConfig<N>) -> Result<(), ProgramError> {
    let at = |step| move |fault| ProgramError { step, fault };
    let mut left = steps(bytes, N).map_err(at(0))?;
    let (mut number, mut depth) = (0, 0);
    while !left.is_empty() {
        number += 1;
        let (one, length) = step(left).map_err(at(number))?;
        left = left.get(length..).unwrap_or_default();
        match one {
            Step::Loop { .. } if depth < LOOPS => depth += 1,
            Step::EndLoop if depth > 0 => depth -= 1,
            Step::Loop { .. } | Step::EndLoop => return Err(at(number)(ProgramFault::Loop)),
            _ => check_step(&one, &config.axes, |axis| config.scale(axis)).map_err(at(number))?,
        }
    }
    if depth > 0 {
        return Err(at(number)(ProgramFault::Loop));
    }
    Ok(())
}

/// A step against the limits, as far as they do not depend on where the axes are.
pub(super) fn check_step(
    step: &Step<'_>,
    limits: &[AxisConfig],
    scale: impl Fn(u8) -> Scale,
) -> Result<(), ProgramFault> {
    let axes = match *step {
        Step::Move { axes, .. } | Step::Home { axes, .. } | Step::Mode { axes, .. } => axes,
        Step::Generator(generator) => generator.axes,
        _ => return Ok(()),
    };
    if axes == 0 || axes >> limits.len() != 0 {
        return Err(ProgramFault::UnknownAxis(axes));
    }
    if let Step::Generator(generator) = step
        && (generator.points == 0 || generator.cycles == 0 || generator.periods == 0)
    {
        return Err(ProgramFault::Nothing);
    }
    for (axis, member) in members(axes) {
        let Some(limit) = limits.get(axis) else {
            continue;
        };
        let axis = axis as u8;
        match step {
            Step::Move { flags, parts, .. } => {
                let part = part(parts, member).ok_or(ProgramFault::Length)?;
                let absolute = flags & RELATIVE == 0;
                part.keeps(axis, limit, absolute)
                    .map_err(ProgramFault::Limit)?;
            }
            Step::Generator(generator) => {
                super::generator::check(generator, member, axis, limit, scale(axis))
                    .map_err(ProgramFault::Limit)?;
            }
            Step::Mode { mode, .. } if !mode.is_in(limit.modes) => {
                return Err(ProgramFault::NoSuchMode(mode.code()));
            }
            Step::Home { .. } if !Mode::Homing.is_in(limit.modes) => {
                return Err(ProgramFault::NoSuchMode(Mode::Homing.code()));
            }
            _ => {}
        }
    }
    Ok(())
}

/// `value` of a quantity against what is allowed.
pub(super) fn within(axis: u8, limit: Limit, value: f32, allowed: u32) -> Result<(), PlanError> {
    if value.abs() > allowed as f32 {
        return Err(PlanError::OutOfLimits {
            axis,
            limit,
            value: value as i32,
            allowed,
        });
    }
    Ok(())
}

//! The group in the hands of any CANopen client: objects 2000h to 2010h of the board
//! (`docs/motion.md`, "Commands"). What cannot be done is refused before anything is
//! sent, with 08000022h where the state forbids it and 06090030h where the value does;
//! the reason stands in 2002h.
//!
//! | bits of 2002h | |
//! |---|---|
//! | 31..24 | axis, counted from 1; FFh: none |
//! | 23..16 | [`Reason`] |
//! | 15..0 | detail |

use super::mode::Mode;
use super::program::{Judged, Refused};
use super::{
    AxisMove, Director, FaultCause, Group, GroupEvent, GroupState, Order, Reason, Refusal, next,
};
use crate::id::Address;
use crate::od::Part;
use crate::sdo::AbortCode;
use crate::time::Duration;

/// Group command.
pub const COMMAND: u16 = 0x2000;
/// Group state.
pub const STATE: u16 = 0x2001;
/// Last refusal.
pub const REFUSAL: u16 = 0x2002;
/// Axes of the command.
pub const AXES: u16 = 0x2003;
/// Target position of each axis.
pub const TARGET: u16 = 0x2004;
/// Profile velocity of each axis.
pub const VELOCITY: u16 = 0x2005;
/// Profile acceleration of each axis.
pub const ACCELERATION: u16 = 0x2006;
/// Profile jerk.
pub const JERK: u16 = 0x2007;
/// Mode of operation of each axis.
pub const MODE: u16 = 0x2008;
/// Actual position of each axis.
pub const POSITION: u16 = 0x2009;
/// Actual velocity of each axis.
pub const ACTUAL_VELOCITY: u16 = 0x200A;
/// Reference position of each axis.
pub const REFERENCE: u16 = 0x200B;
/// Following error of each axis.
pub const FOLLOWING_ERROR: u16 = 0x200C;
/// Statusword of each axis.
pub const STATUSWORD: u16 = 0x200D;
/// Fault of each axis.
pub const FAULT: u16 = 0x200E;
/// Program.
pub const PROGRAM: u16 = 0x200F;
/// Program step.
pub const STEP: u16 = 0x2010;

/// Bytes that a downloaded program may have.
pub const PROGRAM_BYTES: usize = 1024;
/// The longest that a search for home, ordered by 2000h, may take.
const HOMING: Duration = Duration::from_millis(60_000);

/// What clients have set, and what they are told: of refusals (2002h) the
/// [`Reason`] and, as detail, the value, or the step of a program.
///
/// Until something is set all of it is 0, so that it needs no room in an image.
#[derive(Debug)]
#[repr(C)]
pub struct Panel<const N: usize> {
    command: u8,
    /// A program is being written.
    loading: bool,
    refusal: u32,
    /// Axes that the command is not for.
    left_out: u32,
    jerk: u32,
    /// Axes whose mode is to be ordered as soon as the group stands by.
    changing: u32,
    /// Bytes of the program that was taken; 0: none was.
    length: usize,
    /// None: profile velocity.
    modes: [Option<Mode>; N],
    faults: [u32; N],
    moves: [AxisMove; N],
    program: [u8; PROGRAM_BYTES],
}

/// No part in a move.
const AT_REST: AxisMove = AxisMove {
    target: 0,
    velocity: 0,
    acceleration: 0,
    deceleration: 0,
    set: 0,
};

impl<const N: usize> Default for Panel<N> {
    fn default() -> Panel<N> {
        Panel::new()
    }
}

impl<const N: usize> Panel<N> {
    /// All axes, no program.
    pub const fn new() -> Panel<N> {
        Panel {
            command: 0,
            loading: false,
            refusal: 0,
            left_out: 0,
            jerk: 0,
            changing: 0,
            length: 0,
            modes: [None; N],
            faults: [0; N],
            moves: [AT_REST; N],
            program: [0; PROGRAM_BYTES],
        }
    }

    const ALL: u32 = (1 << N) - 1;

    /// The program that was downloaded last.
    pub fn program(&self) -> Option<&[u8]> {
        match self.length {
            0 => None,
            length => self.program.get(..length),
        }
    }

    /// The value of an entry.
    pub fn get(&self, at: Address, group: &Group<N>, director: &Director<N>) -> u32 {
        match at.index.0 {
            COMMAND => self.command.into(),
            STATE => group.state() as u32,
            REFUSAL => self.refusal,
            AXES => Self::ALL & !self.left_out,
            JERK => self.jerk,
            STEP => director.step().into(),
            index => self.of_axis(index, usize::from(at.sub.0).wrapping_sub(1), group),
        }
    }

    fn of_axis(&self, index: u16, axis: usize, group: &Group<N>) -> u32 {
        let (Some(part), Some(of)) = (self.moves.get(axis), group.axis(axis)) else {
            return 0;
        };
        let signed = match index {
            TARGET => part.target,
            VELOCITY => return part.velocity,
            ACCELERATION => return part.acceleration,
            MODE => of.mode() as i32,
            POSITION => of.feedback.position,
            ACTUAL_VELOCITY => of.feedback.velocity,
            REFERENCE => of.head(),
            FOLLOWING_ERROR => of.error(),
            STATUSWORD => of.feedback.statusword.into(),
            _ => return self.faults.get(axis).copied().unwrap_or(0),
        };
        signed as u32
    }

    /// Writes an entry.
    ///
    /// # Errors
    /// 08000022h or 06090030h, and why in 2002h.
    pub fn set(
        &mut self,
        at: Address,
        value: u32,
        group: &mut Group<N>,
        director: &mut Director<N>,
    ) -> Result<(), AbortCode> {
        let mut why = Refusal::NONE;
        let done = self.put(at, value, group, director, &mut why);
        self.note(done, &why)
    }

    fn put(
        &mut self,
        at: Address,
        value: u32,
        group: &mut Group<N>,
        director: &mut Director<N>,
        why: &mut Refusal,
    ) -> Judged {
        let axis = usize::from(at.sub.0).wrapping_sub(1);
        match at.index.0 {
            COMMAND => {
                self.order(value, group, director, why)?;
                self.command = value as u8;
            }
            AXES => {
                if value & !Self::ALL != 0 {
                    return why.because(Reason::Unknown, value, Self::ALL);
                }
                self.left_out = !value;
            }
            JERK => self.jerk = value,
            index => {
                let of = (self.moves.get_mut(axis), director.limits().get(axis));
                let (Some(part), Some(limits)) = of else {
                    return Ok(());
                };
                match index {
                    TARGET => part.target = value as i32,
                    VELOCITY => part.velocity = value,
                    ACCELERATION => (part.acceleration, part.deceleration) = (value, value),
                    _ => {
                        let mode = Mode::of(value as i8).filter(|mode| mode.is_in(limits.modes));
                        let (Some(mode), Some(place)) = (mode, self.modes.get_mut(axis)) else {
                            why.axis = axis as u8;
                            let code = u32::from(value as u8);
                            return why.because(Reason::NoSuchMode, code, limits.modes);
                        };
                        *place = Some(mode);
                    }
                }
            }
        }
        Ok(())
    }

    fn order(
        &mut self,
        command: u32,
        group: &mut Group<N>,
        director: &mut Director<N>,
        why: &mut Refusal,
    ) -> Judged {
        const LAST: u32 = 12;
        let (axes, state) = (Self::ALL & !self.left_out, group.state());
        let order = match command {
            0 => return Ok(()),
            1 => Order::Enable,
            2 => Order::Disable,
            3 => Order::Release,
            4 => Order::Stop,
            5 => Order::Halt,
            6 => Order::QuickStop,
            7 => Order::Reset,
            8 => {
                if state == GroupState::Moving {
                    director.is_free(group, why)?;
                }
                let limit = director.cycles(HOMING);
                Order::Home { axes, limit }
            }
            9 if state == GroupState::Standby => {
                self.changing = axes;
                return self.change_modes(group, why);
            }
            10 => return director.set_moves(group, axes, &self.moves, self.jerk, why),
            // 11 where the group is released already, 12 where it is not.
            11 | LAST if !self.loading && (command == LAST) != (state == GroupState::Moving) => {
                return director.begin(group, why);
            }
            9..=LAST => return why.state(state),
            _ => return why.because(Reason::Unknown, command, LAST),
        };
        group.accept(order, why)
    }

    /// Orders the modes that are still to be changed: those of one kind together, one
    /// kind after the other.
    fn change_modes(&mut self, group: &mut Group<N>, why: &mut Refusal) -> Judged {
        let first = self.changing.trailing_zeros() as usize;
        let Some(&wanted) = self.modes.get(first) else {
            return Ok(());
        };
        let mode = wanted.unwrap_or_default();
        let mut axes = 0;
        for (n, other) in self.modes.iter().enumerate() {
            if *other == wanted {
                axes |= self.changing & 1 << n;
            }
        }
        let done = group.accept(Order::SetMode { axes, mode }, why);
        match done {
            Ok(()) => self.changing &= !axes,
            Err(Refused) if why.reason == Reason::Busy => return Ok(()),
            Err(Refused) => self.changing = 0,
        }
        done
    }

    /// Goes on with what takes several steps of the group.
    pub fn poll(&mut self, group: &mut Group<N>) {
        if self.changing == 0 {
            return;
        }
        match group.state() {
            GroupState::Standby => {
                let mut why = Refusal::NONE;
                let done = self.change_modes(group, &mut why);
                // Nobody waits for the answer.
                let _ = self.note(done, &why);
            }
            GroupState::ModeChange => {}
            _ => self.changing = 0,
        }
    }

    /// The button: not while a program is being written.
    pub fn press(&self, group: &mut Group<N>, director: &mut Director<N>) {
        if self.loading {
            let state = group.state();
            group.report(GroupEvent::ReleaseRefused(Refusal::not_in(state)));
        } else {
            director.press(group);
        }
    }

    /// Takes note of what the group reports: the first fault of each axis, and what
    /// was found impossible when it was planned.
    pub fn on_event(&mut self, event: &GroupEvent) {
        match *event {
            GroupEvent::Fault { axis, cause } => {
                // Without an axis it is one of all.
                let mut axes = axis.map_or(Self::ALL, |axis| 1 << axis);
                while let Some(axis) = next(&mut axes) {
                    if let Some(fault @ 0) = self.faults.get_mut(axis) {
                        *fault = code(cause);
                    }
                }
            }
            GroupEvent::State {
                to: GroupState::Enabling,
                ..
            } => self.faults = [0; N],
            GroupEvent::ReleaseRefused(ref why)
            | GroupEvent::ProgramFailed(ref why)
            | GroupEvent::MoveRefused(ref why) => {
                // Nobody waits for the answer.
                let _ = self.note(Err(Refused), why);
            }
            _ => {}
        }
    }

    /// Takes a part of a program, 200Fh: in the `state` standby, while none runs. What was
    /// downloaded before is gone as soon as the first part comes.
    ///
    /// # Errors
    /// 08000022h in another state, 06070012h if it is too long, 06090030h if it cannot
    /// be run, and why in 2002h.
    pub fn write(
        &mut self,
        part: &Part<'_>,
        state: GroupState,
        director: &Director<N>,
    ) -> Result<(), AbortCode> {
        if state != GroupState::Standby || director.step() != 0 {
            return self.note(Err(Refused), &Refusal::not_in(state));
        }
        self.length = 0;
        self.loading = true;
        let from = part.offset as usize;
        let to = from + part.data.len();
        let size = part.size.map_or(to, |size| size as usize);
        let room = self.program.get_mut(from..to);
        let (Some(room), true) = (room, size <= PROGRAM_BYTES) else {
            self.cancel();
            let mut why = Refusal::NONE;
            let done = why.because(Reason::Length, size as u32, PROGRAM_BYTES as u32);
            // That has a code of its own.
            let _ = self.note(done, &why);
            return Err(AbortCode::TOO_LONG);
        };
        room.copy_from_slice(part.data);
        if part.last {
            self.loading = false;
            let bytes = self.program.get(..to).unwrap_or_default();
            let mut why = Refusal::NONE;
            let checked = director.inspect(bytes, &mut why);
            self.note(checked, &why)?;
            self.length = to;
        }
        Ok(())
    }

    /// The download of a program was ended.
    pub fn cancel(&mut self) {
        self.loading = false;
    }

    /// Keeps the reason of a refusal.
    #[inline(never)]
    fn note(&mut self, done: Judged, why: &Refusal) -> Result<(), AbortCode> {
        if done.is_ok() {
            return Ok(());
        }
        let axis = match why.axis {
            Refusal::NO_AXIS => Refusal::NO_AXIS,
            axis => axis + 1,
        };
        let detail = match why.step {
            0 => why.value as u16,
            step => step,
        };
        self.refusal = u32::from(axis) << 24 | (why.reason as u32) << 16 | u32::from(detail);
        Err(if why.reason.is_of_the_value() {
            AbortCode::VALUE_RANGE
        } else {
            AbortCode::DEVICE_STATE
        })
    }
}

/// What stopped the group: bits 31..16 of 200Eh the [`Cause`](super::Cause), below it
/// the magnitude of its detail, as far as 16 bits hold it.
fn code(cause: FaultCause) -> u32 {
    let detail = cause.detail.unsigned_abs().min(u16::MAX.into());
    (cause.cause as u32) << 16 | detail
}

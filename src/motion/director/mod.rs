//! What is planned in a task of low priority: single moves, and programs.
//!
//! [`Director::look`] and [`Director::act`] touch the group and are short;
//! [`Director::think`] does the planning, without it. The steps of the group go on
//! meanwhile: a plan says in which of them it begins.

pub mod format;
mod legs;

use self::format::{FLYING, Step};
use super::group::{Group, Order};
use super::mode::Mode;
use super::plan::Leg;
use super::program::{Judged, Refusal, Refused};
use super::{AxisConfig, AxisMove, GroupConfig, GroupEvent, GroupState, Reason};
use crate::time::Duration;
use heapless::Vec;

/// Cycles from the look at the group to the first step of the plan; doubled when
/// that was too short, up to the longest.
const LEAD: u32 = 2;
const LATER_MAX: u32 = 62;

/// What is being done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Nothing.
    Idle,
    /// The group is told to move, and the step of the program at `at` follows.
    Released,
    /// The next step of the program is to be read.
    Next,
    /// Legs are to be planned, or a path is to be checked.
    Plan,
    /// The plan is to be handed over.
    Planned,
    /// It could not be made.
    Failed,
    /// The points of a path are handed over.
    Path,
    /// The axes arrive; at rest, or only their references.
    Arriving,
    /// Until the group has made `until` steps.
    Waiting,
    /// The group comes to standby, at the end or for an order.
    Finishing,
    /// The group carries out an order given at step `until`.
    Ordered,
}

/// A loop of a program: where it begins, and how often it is still run; 0: for
/// ever.
#[derive(Clone, Copy, Debug)]
struct Loop {
    begin: usize,
    step: u16,
    left: u32,
}

/// Plans for a [`Group`]. What is long stands last: the rest is reached by short
/// instructions.
#[repr(C)]
pub struct Director<const N: usize> {
    phase: Phase,
    /// A program runs.
    running: bool,
    /// A path is to be checked, not a move to be planned.
    path: bool,
    flying: bool,
    /// The step before did not wait: a drive that moves by itself finishes it first.
    after: bool,
    /// Orders to stop that the group had when it was released.
    stops: u8,
    number: u16,
    config: Option<&'static GroupConfig<N>>,
    /// Where the step that runs begins, and the next one.
    at: usize,
    next: usize,
    until: u32,
    /// The next point of a path, and how often it was followed.
    point: usize,
    period: u32,
    start: u32,
    /// Axes that get a set-point instead of a path.
    set_points: u32,
    /// Cycles more than [`LEAD`].
    later: u32,
    /// Cycles until the next look is needed; 0: something happens before.
    patience: u32,
    /// Why a plan could not be made.
    error: Refusal,
    loops: Vec<Loop, { format::LOOPS }>,
    legs: [Leg; N],
}

impl<const N: usize> Director<N> {
    /// Before it is configured: it does nothing.
    pub const ZERO: Director<N> = Director {
        config: None,
        phase: Phase::Idle,
        running: false,
        path: false,
        flying: false,
        after: false,
        stops: 0,
        number: 0,
        at: 0,
        next: 0,
        until: 0,
        point: 0,
        period: 0,
        start: 0,
        set_points: 0,
        later: 0,
        patience: 0,
        error: Refusal::ZERO,
        loops: Vec::new(),
        legs: [const { Leg::ZERO }; N],
    };

    /// Nothing is planned.
    pub fn new(config: &'static GroupConfig<N>) -> Director<N> {
        let mut director = Director::ZERO;
        director.configure(config);
        director
    }

    /// Makes the same of [`Director::ZERO`], where it is to stay.
    pub const fn configure(&mut self, config: &'static GroupConfig<N>) {
        self.config = Some(config);
    }

    /// The axes' limits and units.
    pub(super) fn limits(&self) -> &'static [AxisConfig] {
        self.config.map_or(&[], |config| &config.axes)
    }

    /// Whole cycles that last at least `time`.
    pub(super) fn cycles(&self, time: Duration) -> u32 {
        self.config.map_or(0, |config| config.cycles(time))
    }

    /// Reads all of a program against the limits of the axes.
    pub(super) fn inspect(&self, program: &[u8], why: &mut Refusal) -> Judged {
        match self.config {
            Some(config) => format::inspect(program, config, why),
            None => why.busy(),
        }
    }

    /// The step of the program that runs, counted from 1; 0: none.
    pub const fn step(&self) -> u16 {
        if self.running { self.number } else { 0 }
    }

    /// Cycles after which the group is to be looked at again, if nothing happens
    /// until then; 0: as many as one likes.
    pub const fn patience(&self) -> u32 {
        self.patience
    }

    /// Runs a program once, and releases the group for it if it is not released; a
    /// halted one goes on with the step that was interrupted, from its beginning.
    ///
    /// # Errors
    /// [`Refusal`] of the group, or because something else is being done.
    pub fn run(&mut self, group: &mut Group<N>) -> Result<(), Refusal> {
        let mut why = Refusal::NONE;
        self.begin(group, &mut why).map_err(|Refused| why)
    }

    /// The same.
    #[inline(never)]
    pub(super) fn begin(&mut self, group: &mut Group<N>, why: &mut Refusal) -> Judged {
        let state = group.state();
        self.heed(group);
        if self.running && state != GroupState::Halt {
            return why.busy();
        }
        if state == GroupState::Moving {
            self.is_free(group, why)?;
        } else {
            group.accept(Order::Release, why)?;
        }
        if !(self.running && state == GroupState::Halt) {
            self.running = true;
            (self.at, self.number) = (0, 0);
            self.loops.clear();
        }
        (self.phase, self.stops) = (Phase::Released, group.stops());
        Ok(())
    }

    /// Whether it can be told to move.
    pub(super) fn is_free(&self, group: &Group<N>, why: &mut Refusal) -> Judged {
        if group.state() != GroupState::Moving {
            return why.state(group.state());
        }
        if self.running || matches!(self.phase, Phase::Plan | Phase::Planned) {
            return why.busy();
        }
        Ok(())
    }

    /// One move of `axes` (bit n for axis n), from the path that they follow now, to
    /// targets from home. What an axis was told before is replaced, without a jump in
    /// velocity.
    ///
    /// # Errors
    /// [`Refusal`] before anything is sent.
    pub fn go(
        &mut self,
        group: &Group<N>,
        axes: u32,
        parts: &[AxisMove; N],
        jerk: u32,
    ) -> Result<(), Refusal> {
        let mut why = Refusal::NONE;
        let done = self.set_moves(group, axes, parts, jerk, &mut why);
        done.map_err(|Refused| why)
    }

    /// The same.
    pub(super) fn set_moves(
        &mut self,
        group: &Group<N>,
        axes: u32,
        parts: &[AxisMove; N],
        jerk: u32,
        why: &mut Refusal,
    ) -> Judged {
        self.is_free(group, why)?;
        self.clear();
        for (axis, part) in parts.iter().enumerate() {
            if axes >> axis & 1 != 0 {
                let set = self.set_leg(group, axis, part, false, jerk);
                *why = self.error;
                set?;
            }
        }
        (self.path, self.flying, self.after) = (false, false, false);
        (self.phase, self.stops) = (Phase::Plan, group.stops());
        Ok(())
    }

    /// The button: stops a program that runs, whatever the group does for it just now,
    /// and else releases the group for one; why not, is reported.
    pub fn press(&mut self, group: &mut Group<N>) {
        if self.running && group.state() != GroupState::Halt {
            // Never refused.
            let _ = group.order(Order::Stop);
        } else if let Err(why) = self.run(group) {
            group.report(GroupEvent::ReleaseRefused(why));
        }
    }

    /// All of it, for whoever has the group for himself.
    pub fn round(&mut self, group: &mut Group<N>, program: &[u8]) {
        if self.look(group, program) {
            self.think(program);
            self.act(group, program);
        }
    }

    /// Looks how far the group is, and goes on with the steps of the program:
    /// `program` are its bytes, as [`format::check`] took them; while it runs it has
    /// to stay the same. Whether there is something to plan.
    pub fn look(&mut self, group: &mut Group<N>, program: &[u8]) -> bool {
        self.patience = 0;
        let steps = format::steps(program);
        self.heed(group);
        match (self.phase, group.state()) {
            (Phase::Idle, _) => return false,
            (_, GroupState::Moving) => self.moving(group, steps),
            (Phase::Ordered, GroupState::Homing | GroupState::ModeChange)
            | (Phase::Released, GroupState::Standby | GroupState::Halt) => {}
            (Phase::Finishing, GroupState::Standby) => self.arrange(group, steps),
            (Phase::Ordered, GroupState::Standby) => {
                // The release of the program counts until its end.
                if group.count() != self.until && group.order(Order::Release).is_ok() {
                    self.at = self.next;
                    self.phase = Phase::Released;
                }
            }
            // The step that is interrupted begins again with the next release.
            (_, GroupState::Halt) if self.running => {
                self.number = self.number.saturating_sub(1);
                self.phase = Phase::Released;
            }
            _ => self.end(),
        }
        if self.phase == Phase::Next {
            self.read(group, steps);
        } else if self.phase == Phase::Path {
            self.feed(group, &Step::at(steps, self.at));
        }
        let mut plan = false;
        match self.phase {
            Phase::Next | Phase::Path | Phase::Finishing => self.patience = 1,
            // Of an arrival there is an event, of an end of the reference none.
            Phase::Arriving if self.flying => self.patience = 1,
            Phase::Waiting => self.patience = self.until.wrapping_sub(group.count()).max(1),
            Phase::Plan => {
                self.patience = 1;
                let ready = self.predict(group, &Step::at(steps, self.at));
                plan = self.judge(ready);
            }
            _ => {}
        }
        if self.phase == Phase::Failed {
            self.give_up(group);
        }
        plan
    }

    /// Nothing is to be done any more.
    fn end(&mut self) {
        self.phase = Phase::Idle;
        self.running = false;
    }

    /// A stop ends everything, also one that the state of the group did not need.
    fn heed(&mut self, group: &Group<N>) {
        if self.stops != group.stops() {
            self.end();
        }
    }

    fn moving(&mut self, group: &mut Group<N>, steps: &[u8]) {
        match self.phase {
            Phase::Released => {
                self.next = self.at;
                self.flying = false;
                self.phase = Phase::Next;
            }
            Phase::Arriving => {
                let there = if self.flying {
                    group.all_over()
                } else {
                    group.all_arrived()
                };
                if there {
                    self.phase = if self.running {
                        Phase::Next
                    } else {
                        Phase::Idle
                    };
                }
            }
            Phase::Waiting if group.count().wrapping_sub(self.until) as i32 >= 0 => {
                self.phase = Phase::Next;
            }
            // Somebody else has released the group again.
            Phase::Ordered if group.count() != self.until => self.phase = Phase::Next,
            Phase::Finishing if group.all_arrived() => self.arrange(group, steps),
            _ => {}
        }
    }

    /// At rest in the middle or at the end of a program: what the step needs of the group,
    /// asked again as long as something else waits there or an axis is not heard.
    fn arrange(&mut self, group: &mut Group<N>, steps: &[u8]) {
        let step = Step::at(steps, self.at);
        let (axes, limit) = (step.axes, step.value);
        let order = match (step.kind, Mode::of(step.flags as i8)) {
            (format::HOME, _) => Order::Home { axes, limit },
            _ if group.state() != GroupState::Standby => Order::Finish,
            (format::MODE, Some(mode)) => Order::SetMode { axes, mode },
            _ => {
                self.end();
                group.report(GroupEvent::ProgramDone);
                return;
            }
        };
        self.error = Refusal::NONE;
        let done = group.accept(order, &mut self.error);
        if done.is_ok() && !matches!(order, Order::Finish) {
            (self.phase, self.until) = (Phase::Ordered, group.count());
        }
        if matches!(self.error.reason, Reason::WrongMode | Reason::NoSuchMode) {
            self.phase = Phase::Failed;
        }
    }

    /// Begins the next step of the program.
    fn read(&mut self, group: &mut Group<N>, steps: &[u8]) {
        self.at = self.next;
        let step = Step::at(steps, self.at);
        self.next = self.at.saturating_add(step.len());
        if self.at < steps.len() {
            self.number = self.number.saturating_add(1);
            let step = self.number.wrapping_sub(1);
            group.report(GroupEvent::StepStarted { step });
        }
        self.path = step.kind == format::PATH;
        // What else there is waits for nobody, or for all.
        if self.path || step.kind == format::MOVE {
            self.after = self.flying;
            self.flying = step.has(FLYING);
        }
        self.phase = match step.kind {
            format::MOVE => {
                self.phase = Phase::Plan;
                let set = self.set_legs(group, &step);
                self.judge(set);
                return;
            }
            format::PATH => Phase::Plan,
            format::WAIT => {
                self.until = group.count().wrapping_add(step.value);
                Phase::Waiting
            }
            format::LOOP => {
                // There is room, as the check has found.
                let _ = self.loops.push(Loop {
                    begin: self.next,
                    step: self.number,
                    left: step.value,
                });
                Phase::Next
            }
            format::END_LOOP => {
                match self.loops.last_mut() {
                    Some(last) if last.left != 1 => {
                        last.left = last.left.saturating_sub(1);
                        (self.next, self.number) = (last.begin, last.step);
                    }
                    _ => drop(self.loops.pop()),
                }
                Phase::Next
            }
            // In standby, as is the end.
            _ => Phase::Finishing,
        };
    }

    /// Takes note of whether something went wrong.
    fn judge(&mut self, result: Result<bool, Refused>) -> bool {
        result.unwrap_or_else(|Refused| {
            self.phase = Phase::Failed;
            false
        })
    }

    /// After that: a program ends; a move that cannot be made leaves everything as
    /// it is.
    fn give_up(&mut self, group: &mut Group<N>) {
        group.forget_speeds();
        self.error.step = self.step();
        let error = self.error;
        let event = if self.running {
            // The group moves: a stop is never refused.
            let _ = group.order(Order::Stop);
            GroupEvent::ProgramFailed(error)
        } else {
            GroupEvent::MoveRefused(error)
        };
        group.report(event);
        self.end();
    }
}

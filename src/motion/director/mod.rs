//! What is planned in a task of low priority: single moves, and programs.
//!
//! [`Director::look`] and [`Director::act`] touch the group and are short;
//! [`Director::think`] does the planning, without it. The steps of the group go on
//! meanwhile: a plan says in which of them it begins.

pub mod format;

use self::format::{FLYING, RELATIVE, Step, members};
use super::group::{Group, Order, SetPoint};
use super::mode::Mode;
use super::plan::{self, Leg};
use super::program::{AxisMove, Fault, PlanError, within};
use super::scale::Scale;
use super::{AxisConfig, GroupConfig, GroupEvent, GroupState, Refusal, fixed};
use heapless::Vec;

/// Cycles from the look at the group to the first step of the plan; doubled when
/// that was too short, up to the longest.
const LEAD: u32 = 2;
const LATER_MAX: u32 = 62;
/// Points of a path that are handed over in one look, since the group waits.
const POINTS: usize = 2;

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
    /// The group carries out an order given in step `until`.
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
    /// Cycles more than [`LEAD`].
    later: u32,
    /// Cycles until the next look is needed; 0: something happens before.
    patience: u32,
    event: Vec<GroupEvent, 1>,
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
        number: 0,
        at: 0,
        next: 0,
        until: 0,
        point: 0,
        period: 0,
        start: 0,
        later: 0,
        patience: 0,
        loops: Vec::new(),
        legs: [const { Leg::ZERO }; N],
        event: Vec::new(),
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

    /// The step of the program that runs, counted from 1; 0: none.
    pub const fn step(&self) -> u16 {
        if self.running { self.number } else { 0 }
    }

    /// Cycles after which the group is to be looked at again, if nothing happens
    /// until then; 0: as many as one likes.
    pub const fn patience(&self) -> u32 {
        self.patience
    }

    /// What it has to report: to be taken after every round.
    pub fn take_event(&mut self) -> Option<GroupEvent> {
        self.event.pop()
    }

    /// Releases the group and runs a program once; a halted one goes on with the
    /// step that was interrupted, from its beginning.
    ///
    /// # Errors
    /// [`Refusal`] of the group.
    pub fn run(&mut self, group: &mut Group<N>) -> Result<(), Refusal> {
        group.order(Order::Release)?;
        if !(self.running && group.state() == GroupState::Halt) {
            self.restart();
        }
        self.phase = Phase::Released;
        Ok(())
    }

    /// Runs a program once, the group being released.
    ///
    /// # Errors
    /// [`Refusal`] if it is not, or does something else.
    pub fn start(&mut self, group: &Group<N>) -> Result<(), Refusal> {
        self.is_free(group)?;
        self.restart();
        self.phase = Phase::Released;
        Ok(())
    }

    fn restart(&mut self) {
        self.running = true;
        (self.at, self.number) = (0, 0);
        self.loops.clear();
    }

    /// Whether it can be told to move.
    fn is_free(&self, group: &Group<N>) -> Result<(), Refusal> {
        if group.state() != GroupState::Moving {
            return Err(Refusal::NotIn(group.state()));
        }
        if self.running || matches!(self.phase, Phase::Plan | Phase::Planned) {
            return Err(Refusal::Busy);
        }
        Ok(())
    }

    /// One move of the axes that have a part, from the path that they follow now:
    /// targets from home or, `relative`, from where their paths end. What an axis
    /// was told before is replaced, without a jump in velocity.
    ///
    /// # Errors
    /// [`Refusal`] before anything is sent.
    pub fn go(
        &mut self,
        group: &Group<N>,
        parts: &[Option<AxisMove>; N],
        relative: bool,
        jerk: u32,
    ) -> Result<(), Refusal> {
        self.is_free(group)?;
        self.clear();
        for (axis, part) in parts.iter().enumerate() {
            if let Some(part) = part {
                let set = self.set_leg(group, axis, part, relative, jerk);
                set.map_err(Refusal::Program)?;
            }
        }
        (self.path, self.flying) = (false, false);
        self.phase = Phase::Plan;
        Ok(())
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
        let steps = format::steps(program);
        self.patience = 0;
        match (self.phase, group.state()) {
            (Phase::Idle, _) => return false,
            (Phase::Ordered, GroupState::Homing | GroupState::ModeChange)
            | (Phase::Released, GroupState::Standby) => {}
            (Phase::Finishing | Phase::Ordered, GroupState::Standby) => self.standby(group, steps),
            (_, GroupState::Moving) => self.moving(group),
            (Phase::Released, GroupState::Halt) => {}
            // The step that is interrupted begins again with the next release.
            (_, GroupState::Halt) if self.running => {
                self.number = self.number.saturating_sub(1);
                self.phase = Phase::Released;
            }
            _ => self.end(),
        }
        match self.phase {
            Phase::Next => self.read(group, steps),
            Phase::Path => self.feed(group, &Step::at(steps, self.at)),
            _ => {}
        }
        let mut plan = false;
        if self.phase == Phase::Plan {
            self.patience = 1;
            match self.predict(group, &Step::at(steps, self.at)) {
                Ok(ready) => plan = ready,
                error => self.judge(error.map(drop)),
            }
        }
        match self.phase {
            Phase::Next | Phase::Path => self.patience = 1,
            Phase::Waiting => self.patience = self.until.wrapping_sub(group.count()).max(1),
            Phase::Failed => self.give_up(group),
            _ => {}
        }
        plan
    }

    /// Nothing is to be done any more.
    fn end(&mut self) {
        self.phase = Phase::Idle;
        self.running = false;
    }

    fn moving(&mut self, group: &mut Group<N>) {
        match self.phase {
            Phase::Released => {
                self.next = self.at;
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
            Phase::Finishing if group.all_arrived() => {
                // Refused only while another order waits.
                let _ = group.order(Order::Finish);
            }
            _ => {}
        }
    }

    /// In standby in the middle or at the end of a program.
    fn standby(&mut self, group: &mut Group<N>, steps: &[u8]) {
        let count = group.count();
        if self.phase == Phase::Ordered {
            // The release of the program counts until its end.
            if count != self.until && group.order(Order::Release).is_ok() {
                self.at = self.next;
                self.phase = Phase::Released;
            }
            return;
        }
        let step = Step::at(steps, self.at);
        let axes = step.axes;
        let order = match (step.kind, Mode::of(step.flags as i8)) {
            (format::HOME, _) => Order::Home {
                axes,
                limit: step.value,
            },
            (format::MODE, Some(mode)) => Order::SetMode { axes, mode },
            _ => {
                self.end();
                self.report(GroupEvent::ProgramDone);
                return;
            }
        };
        (self.phase, self.until) = (Phase::Ordered, count);
        if let Err(why) = group.order(order) {
            self.end();
            self.report(GroupEvent::ReleaseRefused(why));
        }
    }

    /// Begins the next step of the program.
    fn read(&mut self, group: &Group<N>, steps: &[u8]) {
        self.at = self.next;
        let step = Step::at(steps, self.at);
        self.next = self.at.saturating_add(step.len());
        if self.at < steps.len() {
            self.number = self.number.saturating_add(1);
            self.report(GroupEvent::StepStarted {
                step: self.number.wrapping_sub(1) as u8,
            });
        }
        self.flying = step.has(FLYING);
        self.path = step.kind == format::PATH;
        self.phase = match step.kind {
            format::MOVE => {
                let set = self.set_legs(group, &step);
                self.phase = Phase::Plan;
                return self.judge(set);
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

    fn set_legs(&mut self, group: &Group<N>, step: &Step<'_>) -> Result<(), PlanError> {
        self.clear();
        let relative = step.has(RELATIVE);
        for (axis, member) in members(step.axes) {
            self.set_leg(group, axis, &step.part(member), relative, step.value)?;
        }
        Ok(())
    }

    /// The last counts.
    #[inline(never)]
    fn report(&mut self, event: GroupEvent) {
        self.event.clear();
        // There is room.
        let _ = self.event.push(event);
    }

    /// What went wrong is reported.
    #[inline(never)]
    fn judge(&mut self, result: Result<(), PlanError>) {
        if let Err(error) = result {
            self.phase = Phase::Failed;
            self.report(if self.running {
                GroupEvent::ProgramFailed(PlanError {
                    step: self.number,
                    ..error
                })
            } else {
                GroupEvent::MoveRefused(error)
            });
        }
    }

    /// After that: a program ends; a move that cannot be made leaves everything as
    /// it is.
    fn give_up(&mut self, group: &mut Group<N>) {
        if self.running {
            // The group moves: a stop is never refused.
            let _ = group.order(Order::Stop);
        }
        self.end();
    }

    fn clear(&mut self) {
        for leg in &mut self.legs {
            leg.set = None;
        }
    }

    /// The leg of an axis, checked against its limits.
    #[inline(never)]
    fn set_leg(
        &mut self,
        group: &Group<N>,
        axis: usize,
        part: &AxisMove,
        relative: bool,
        jerk: u32,
    ) -> Result<(), PlanError> {
        let number = axis as u8;
        let (Some(config), Some(view), Some(leg)) =
            (self.config, group.view(axis), self.legs.get_mut(axis))
        else {
            return Ok(());
        };
        let Some(limits) = config.axes.get(axis) else {
            return Ok(());
        };
        let torque = view.mode == Mode::CyclicTorque;
        let (home, scale) = if torque {
            (0, Scale::per_second(config.cycle))
        } else {
            (view.home, limits.scale)
        };
        let mut target = part.target;
        if relative {
            target = target.saturating_add(view.end.wrapping_sub(home));
        }
        part.keeps(number, limits)?;
        if torque {
            let value = target.unsigned_abs().max(1);
            within(number, Fault::Torque, value, limits.torque_max.into())?;
        } else {
            limits.reaches(number, target)?;
        }
        leg.set = Some(part.set);
        leg.target = target.wrapping_add(home);
        [leg.velocity, leg.acceleration, leg.deceleration] = part.limits(scale);
        leg.jerk = scale.per_cycle(scale.acceleration(jerk as f32));
        Ok(())
    }

    /// Where the paths will stand when the plan begins, and what is left to the
    /// drives; `false` if one has not taken its last set-point yet.
    #[inline(never)]
    fn predict(&mut self, group: &mut Group<N>, step: &Step<'_>) -> Result<bool, PlanError> {
        let lead = LEAD + self.later;
        self.start = group.count().wrapping_add(lead);
        let all = self.legs.iter_mut().zip(limits(self.config));
        for (axis, (leg, limits)) in all.enumerate() {
            let Some(view) = group.view(axis) else {
                continue;
            };
            leg.home = view.home;
            let is_in = step.axes >> axis & 1 != 0;
            if self.path && is_in && !view.mode.has_position() {
                // Its drive moves it by itself, or it is no motion.
                let mode = u32::from(view.mode as u8);
                return Err(PlanError {
                    axis: axis as u8,
                    ..PlanError::whole(Fault::Mode, mode, Mode::WITH_POSITION)
                });
            }
            if !self.path && leg.set.is_some() && view.mode == Mode::ProfilePosition {
                let up = limits.scale.rpm_per_s(leg.acceleration);
                let down = limits.scale.rpm_per_s(leg.deceleration);
                group.set_ramps(axis, up, down);
                let set_point = SetPoint {
                    target: leg.target,
                    immediately: true,
                    relative: false,
                };
                if !group.ask(axis, &set_point) {
                    return Ok(false);
                }
                leg.set = None;
            }
            leg.from = group.predict(axis, lead - 1).unwrap_or_default();
        }
        Ok(true)
    }

    /// Plans what there is to plan, and checks it against the travel from where the
    /// axes are.
    pub fn think(&mut self, program: &[u8]) {
        let step = Step::at(format::steps(program), self.at);
        self.phase = Phase::Planned;
        let result = self.plan(&step);
        self.judge(result);
    }

    fn plan(&mut self, step: &Step<'_>) -> Result<(), PlanError> {
        if !self.path {
            plan::plan(&mut self.legs).map_err(|axis| PlanError {
                axis,
                ..PlanError::whole(Fault::Time, u32::MAX, plan::CYCLES_MAX)
            })?;
        }
        let mut member = 0;
        let all = self.legs.iter_mut().zip(limits(self.config));
        for (axis, (leg, limits)) in (0..).zip(all) {
            let from = fixed::round(leg.from.position).wrapping_sub(leg.home);
            if !self.path {
                if leg.set.is_some() && leg.turn != 0.0 {
                    limits.reaches(axis, from.saturating_add(leg.turn as i32))?;
                }
            } else if step.axes >> axis & 1 != 0 {
                let told = step.begin(member);
                if !step.has(RELATIVE) && from != told {
                    return Err(PlanError {
                        axis,
                        ..PlanError::whole(Fault::Begin, from as u32, told as u32)
                    });
                }
                let slope = step.check_path(axis, member, limits, Some(from))?;
                (leg.up, leg.down) = (slope, slope);
                member += 1;
            }
        }
        Ok(())
    }

    /// Hands the plan over. Too late for its first step, it is made anew.
    pub fn act(&mut self, group: &mut Group<N>, program: &[u8]) {
        match self.phase {
            Phase::Failed => return self.give_up(group),
            Phase::Planned => {}
            _ => return,
        }
        let step = Step::at(format::steps(program), self.at);
        let mut axes = step.axes;
        if !self.path {
            axes = 0;
            for (axis, leg) in self.legs.iter().enumerate() {
                axes |= u32::from(leg.set.is_some()) << axis;
            }
        }
        // A path begins at rest: the sooner, the better.
        let start = if self.path {
            group.count().wrapping_add(1)
        } else {
            self.start
        };
        if group.announce(start, axes).is_err() {
            self.later = LATER_MAX.min(self.later * 2 + LEAD);
            self.phase = Phase::Plan;
            return;
        }
        let all = self.legs.iter().zip(limits(self.config));
        for (axis, (leg, limits)) in all.enumerate() {
            if axes >> axis & 1 == 0 {
                continue;
            }
            let up = limits.scale.rpm_per_s(leg.up);
            group.set_ramps(axis, up, limits.scale.rpm_per_s(leg.down));
            if !self.path {
                for knot in &leg.knots {
                    group.push(axis, knot);
                }
            }
        }
        self.phase = Phase::Arriving;
        if self.path {
            (self.point, self.period) = (0, 0);
            self.phase = Phase::Path;
            self.feed(group, &step);
        }
    }

    /// Hands over the next points of a path, if there is room.
    fn feed(&mut self, group: &mut Group<N>, step: &Step<'_>) {
        for _ in 0..POINTS {
            if self.period == step.periods() {
                self.phase = Phase::Arriving;
                return;
            }
            for (axis, member) in members(step.axes) {
                if group.room(axis) == 0 {
                    return;
                }
                let mut knot = step.point(member, self.point);
                let begin = self.legs.get(axis).map_or(0, |leg| leg.from.position);
                knot.position = knot.position.wrapping_add(begin);
                group.push(axis, &knot);
            }
            self.point += 1;
            if self.point == step.points() {
                self.point = 0;
                self.period += 1;
            }
        }
    }
}

/// The axes' limits and units.
fn limits<const N: usize>(config: Option<&'static GroupConfig<N>>) -> &'static [AxisConfig] {
    config.map_or(&[], |config| &config.axes)
}

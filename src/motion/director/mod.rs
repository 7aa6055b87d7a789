//! What is planned in a task of low priority: single moves, and programs.
//!
//! [`Director::look`] and [`Director::act`] touch the group and are short;
//! [`Director::think`] does the planning, without it. The steps of the group go on
//! meanwhile: a plan says in which of them it begins.

pub mod format;
mod generator;

use self::format::{FLYING, Generator, ProgramError, ProgramFault, RELATIVE, Step};
use self::generator::{Begin, Run};
use super::group::{Group, Order, SetPoint};
use super::mode::Mode;
use super::plan::{self, Knots, Leg};
use super::program::{AxisMove, Limit, PlanError};
use super::{GroupConfig, GroupEvent, GroupState, Refusal, fixed};
use crate::time::Duration;
use heapless::Vec;

/// Cycles from the look at the group to the first step of the plan; doubled when
/// that was too short, up to the longest.
const LEAD: u32 = 2;
const LEAD_MAX: u32 = 64;
const US_PER_MS: u32 = 1000;
/// No axis.
const NO_LEG: Option<Leg> = None;

/// What is being done.
#[derive(Clone, Copy, Debug)]
enum Phase {
    /// Nothing.
    Idle,
    /// The group is told to move, and the step of the program at `at` follows.
    Released,
    /// The next step of the program is to be read.
    Next,
    /// Legs are to be planned; the program goes on after that, if one runs.
    Plan,
    /// The plan is to be handed over.
    Planned,
    /// A generator makes knots.
    Generating,
    /// The axes arrive; at rest, or only their references.
    Arriving { flying: bool },
    /// Until the group has made so many steps.
    Waiting(u32),
    /// The group comes to standby for an order.
    Finishing(Option<Order>),
    /// The group carries out an order given in that step.
    Ordered(u32),
}

/// A loop of a program: where it begins, and how often it is still run; 0: for
/// ever.
#[derive(Clone, Copy, Debug)]
struct Loop {
    begin: usize,
    step: u16,
    left: u16,
}

/// Plans for a [`Group`].
pub struct Director<const N: usize> {
    config: &'static GroupConfig<N>,
    phase: Phase,
    /// A program runs.
    running: bool,
    /// Where the step that runs begins, and the next one.
    at: usize,
    next: usize,
    number: u16,
    loops: Vec<Loop, { format::LOOPS }>,
    flying: bool,
    legs: [Option<Leg>; N],
    knots: [Knots; N],
    begin: [Begin; N],
    run: Run,
    start: u32,
    lead: u32,
    event: Option<GroupEvent>,
}

impl<const N: usize> Director<N> {
    /// Nothing is planned.
    pub fn new(config: &'static GroupConfig<N>) -> Director<N> {
        Director {
            config,
            phase: Phase::Idle,
            running: false,
            at: 0,
            next: 0,
            number: 0,
            loops: Vec::new(),
            flying: false,
            legs: [NO_LEG; N],
            knots: [const { Vec::new() }; N],
            begin: [Begin::default(); N],
            run: Run::default(),
            start: 0,
            lead: LEAD,
            event: None,
        }
    }

    /// The step of the program that runs, counted from 1; 0: none.
    pub const fn step(&self) -> u16 {
        if self.running { self.number } else { 0 }
    }

    /// What it has to report: to be taken after every round.
    pub fn take_event(&mut self) -> Option<GroupEvent> {
        self.event.take()
    }

    /// Releases the group and runs a program once; a halted one goes on with the
    /// step that was interrupted, from its beginning.
    ///
    /// # Errors
    /// [`Refusal`] of the group.
    pub fn run(&mut self, group: &mut Group<N>) -> Result<(), Refusal> {
        group.order(Order::Release)?;
        if !(self.running && group.state() == GroupState::Halt) {
            self.running = true;
            (self.at, self.number) = (0, 0);
            self.loops.clear();
        }
        self.phase = Phase::Released;
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
        if group.state() != GroupState::Moving {
            return Err(Refusal::NotIn(group.state()));
        }
        if self.running || matches!(self.phase, Phase::Plan | Phase::Planned) {
            return Err(Refusal::Busy);
        }
        for (axis, part) in parts.iter().enumerate() {
            let leg = part
                .as_ref()
                .map(|part| self.leg(group, axis, part, relative, jerk));
            if let Some(place) = self.legs.get_mut(axis) {
                *place = leg.transpose().map_err(Refusal::Program)?;
            }
        }
        self.flying = false;
        self.phase = Phase::Plan;
        Ok(())
    }

    /// All of it, for whoever has the group for himself.
    pub fn round(&mut self, group: &mut Group<N>, program: &[u8]) {
        if self.look(group, program) {
            self.think();
            self.act(group);
        }
    }

    /// Looks how far the group is, and goes on with the steps of the program:
    /// `program` are its bytes, as [`format::check`] took them; while it runs it has
    /// to stay the same. Whether there is something to plan.
    pub fn look(&mut self, group: &mut Group<N>, program: &[u8]) -> bool {
        let steps = format::body(program);
        match (self.phase, group.state()) {
            (Phase::Idle, _) => {}
            (Phase::Released, GroupState::Moving) => {
                self.next = self.at;
                self.phase = Phase::Next;
            }
            (Phase::Released, GroupState::Standby | GroupState::Halt) => {}
            (Phase::Finishing(_) | Phase::Ordered(_), GroupState::Standby) => self.standby(group),
            (Phase::Ordered(_), GroupState::Homing | GroupState::ModeChange) => {}
            (_, GroupState::Moving) => self.moving(group),
            // The step that is interrupted begins again with the next release.
            (_, GroupState::Halt) if self.running => self.number = self.number.saturating_sub(1),
            _ => {
                self.phase = Phase::Idle;
                self.running = false;
            }
        }
        if group.state() == GroupState::Halt && self.running {
            self.phase = Phase::Released;
        }
        if matches!(self.phase, Phase::Next) {
            self.read(group, steps);
        }
        if matches!(self.phase, Phase::Generating) {
            self.generate(group, steps);
        }
        matches!(self.phase, Phase::Plan) && self.predict(group)
    }

    fn moving(&mut self, group: &mut Group<N>) {
        match self.phase {
            Phase::Arriving { flying } => {
                let there = if flying {
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
            Phase::Waiting(until) if group.count().wrapping_sub(until) as i32 >= 0 => {
                self.phase = Phase::Next;
            }
            Phase::Finishing(_) if group.all_arrived() => {
                // Refused only while another order waits.
                let _ = group.order(Order::Finish);
            }
            _ => {}
        }
    }

    /// In standby in the middle or at the end of a program.
    fn standby(&mut self, group: &mut Group<N>) {
        match self.phase {
            Phase::Finishing(None) => {
                self.phase = Phase::Idle;
                self.running = false;
                self.event = Some(GroupEvent::ProgramDone);
            }
            Phase::Finishing(Some(order)) => match group.order(order) {
                Ok(()) => self.phase = Phase::Ordered(group.count()),
                Err(_) => self.phase = Phase::Idle,
            },
            // The release of the program counts until its end.
            Phase::Ordered(count)
                if count != group.count() && group.order(Order::Release).is_ok() =>
            {
                self.at = self.next;
                self.phase = Phase::Released;
            }
            _ => {}
        }
    }

    /// Begins the next step of the program.
    fn read(&mut self, group: &mut Group<N>, steps: &[u8]) {
        let left = steps.get(self.next..).unwrap_or_default();
        if left.is_empty() {
            self.phase = Phase::Finishing(None);
            return;
        }
        self.number = self.number.saturating_add(1);
        self.at = self.next;
        match self.begin(group, left) {
            Ok(phase) => {
                self.event = Some(GroupEvent::StepStarted {
                    step: self.number.wrapping_sub(1) as u8,
                });
                self.phase = phase;
            }
            Err(fault) => self.fail(group, fault),
        }
    }

    fn fail(&mut self, group: &mut Group<N>, fault: ProgramFault) {
        self.event = Some(GroupEvent::ProgramFailed(ProgramError {
            step: self.number,
            fault,
        }));
        self.phase = Phase::Idle;
        self.running = false;
        // The group moves: a stop is never refused.
        let _ = group.order(Order::Stop);
    }

    #[inline(never)]
    fn begin(&mut self, group: &mut Group<N>, left: &[u8]) -> Result<Phase, ProgramFault> {
        let (step, length) = format::step(left)?;
        self.next += length;
        let config = self.config;
        format::check_step(&step, &config.axes, |axis| config.scale(axis))?;
        Ok(match step {
            Step::Move {
                flags,
                axes,
                jerk,
                parts,
            } => {
                self.legs = [NO_LEG; N];
                for (axis, member) in format::members(axes) {
                    let part = format::part(parts, member).ok_or(ProgramFault::Length)?;
                    let leg = self.leg(group, axis, &part, flags & RELATIVE != 0, jerk);
                    if let Some(place) = self.legs.get_mut(axis) {
                        *place = Some(leg.map_err(ProgramFault::Limit)?);
                    }
                }
                self.flying = flags & FLYING != 0;
                Phase::Plan
            }
            Step::Wait { ms } => {
                let time = Duration::from_micros(ms.saturating_mul(US_PER_MS));
                Phase::Waiting(group.count().wrapping_add(config.cycles(time)))
            }
            Step::Loop { times } => {
                let begun = self.loops.push(Loop {
                    begin: self.next,
                    step: self.number,
                    left: times,
                });
                begun.map_err(|_| ProgramFault::Loop)?;
                Phase::Next
            }
            Step::EndLoop => {
                let last = self.loops.last_mut().ok_or(ProgramFault::Loop)?;
                if last.left == 1 {
                    self.loops.pop();
                } else {
                    last.left = last.left.saturating_sub(1);
                    (self.next, self.number) = (last.begin, last.step);
                }
                Phase::Next
            }
            Step::Generator(generator) => {
                self.begin_generator(group, &generator)?;
                Phase::Generating
            }
            Step::Home { axes, ms } => {
                let time = Duration::from_micros(ms.saturating_mul(US_PER_MS));
                let limit = config.cycles(time);
                Phase::Finishing(Some(Order::Home { axes, limit }))
            }
            Step::Mode { axes, mode } => Phase::Finishing(Some(Order::SetMode { axes, mode })),
        })
    }

    /// The leg of an axis, checked against its limits.
    fn leg(
        &self,
        group: &Group<N>,
        axis: usize,
        part: &AxisMove,
        relative: bool,
        jerk: u32,
    ) -> Result<Leg, PlanError> {
        let (Some(limits), Some(view)) = (self.config.axes.get(axis), group.view(axis)) else {
            return Err(PlanError::TooLong { axis: axis as u8 });
        };
        let number = axis as u8;
        let mut part = *part;
        let torque = view.mode == Mode::CyclicTorque;
        let home = if torque { 0 } else { view.home };
        if relative {
            let from = view.end.wrapping_sub(home);
            part.target = part.target.saturating_add(from);
        }
        part.keeps(number, limits, true)?;
        let scale = self.config.scale(number);
        let mut leg = part.leg(scale);
        leg.target = leg.target.wrapping_add(home);
        leg.jerk = scale.per_cycle(scale.acceleration(jerk as f32));
        if torque {
            format::within(
                number,
                Limit::Torque,
                part.target as f32,
                limits.torque_max.into(),
            )?;
            leg.velocity = scale.per_cycle(part.velocity as f32);
            leg.acceleration = scale.per_cycle(scale.per_cycle(part.acceleration as f32));
            leg.deceleration = scale.per_cycle(scale.per_cycle(part.deceleration as f32));
        }
        Ok(leg)
    }

    /// Where the paths will stand when the plan begins; `false` if nothing has to
    /// be planned.
    fn predict(&mut self, group: &mut Group<N>) -> bool {
        self.start = group.count().wrapping_add(self.lead);
        for (axis, leg) in self.legs.iter_mut().enumerate() {
            let Some(some) = leg else { continue };
            let Some(view) = group.view(axis) else {
                continue;
            };
            if let Some(begin) = self.begin.get_mut(axis) {
                begin.home = view.home;
            }
            if view.mode == Mode::ProfilePosition {
                let set_point = SetPoint {
                    target: some.target,
                    immediately: true,
                    relative: false,
                };
                let scale = self.config.scale(axis as u8);
                let up = scale.rpm_per_s(some.acceleration);
                group.set_ramps(axis, up, scale.rpm_per_s(some.deceleration));
                if !group.ask(axis, &set_point) {
                    return false;
                }
                *leg = None;
                continue;
            }
            some.from = group.predict(axis, self.lead - 1).unwrap_or_default();
        }
        true
    }

    /// Plans what there is to plan.
    pub fn think(&mut self) {
        let planned = plan::plan(&self.legs, &mut self.knots);
        let error = match planned {
            Ok(_) => self.beyond(),
            Err(plan::TooLong { leg }) => Some(PlanError::TooLong { axis: leg }),
        };
        self.phase = Phase::Planned;
        if let Some(error) = error {
            self.phase = Phase::Idle;
            self.event = Some(if self.running {
                GroupEvent::ProgramFailed(ProgramError {
                    step: self.number,
                    fault: ProgramFault::Limit(error),
                })
            } else {
                GroupEvent::MoveRefused(error)
            });
        }
    }

    /// An axis that would turn around outside of its travel.
    fn beyond(&self) -> Option<PlanError> {
        let legs = self.legs.iter().zip(&self.knots).zip(&self.config.axes);
        for (axis, ((leg, knots), limits)) in legs.enumerate() {
            let Some(leg) = leg else { continue };
            let Some(turn) = plan::turning_point(&leg.from, knots) else {
                continue;
            };
            let begin = self.begin.get(axis).copied().unwrap_or_default();
            let value = fixed::round(turn).wrapping_sub(begin.home);
            if let Err(error) = limits.reaches(axis as u8, value) {
                return Some(error);
            }
        }
        None
    }

    /// Hands the plan over. Too late for its first step, it is made anew.
    pub fn act(&mut self, group: &mut Group<N>) {
        if !matches!(self.phase, Phase::Planned) {
            if self.running && matches!(self.phase, Phase::Idle) {
                self.running = false;
                let _ = group.order(Order::Stop);
            }
            return;
        }
        let axes = mask(self.legs.iter().map(Option::is_some));
        if group.announce(self.start, axes).is_err() {
            self.lead = LEAD_MAX.min(self.lead * 2);
            self.phase = Phase::Plan;
            return;
        }
        let plans = self.legs.iter().zip(&self.knots);
        for (axis, (leg, knots)) in plans.enumerate() {
            let Some(leg) = leg else { continue };
            let scale = self.config.scale(axis as u8);
            let (mut up, mut down) = (0.0f32, 0.0f32);
            let mut speed = fixed::float(leg.from.velocity);
            for knot in knots {
                group.push(axis, knot);
                let next = fixed::float(knot.velocity);
                let slope = (next - speed).abs() / knot.cycles.max(1) as f32;
                if next.abs() > speed.abs() {
                    up = up.max(slope);
                } else {
                    down = down.max(slope);
                }
                speed = next;
            }
            if leg.jerk > 0.0 {
                // In between it is steeper.
                (up, down) = (leg.acceleration, leg.deceleration);
            }
            group.set_ramps(axis, scale.rpm_per_s(up), scale.rpm_per_s(down));
        }
        self.phase = Phase::Arriving {
            flying: self.flying,
        };
    }

    /// A generator begins where the axes are.
    fn begin_generator(
        &mut self,
        group: &mut Group<N>,
        generator: &Generator<'_>,
    ) -> Result<(), ProgramFault> {
        for (axis, begin) in self.begin.iter_mut().enumerate() {
            if let Some(view) = group.view(axis) {
                begin.from = view.reference;
                begin.home = view.home;
            }
        }
        let config = self.config;
        let scale = |axis| config.scale(axis as u8);
        self.run = Run::new(generator, &self.begin, &scale);
        self.reach(generator)?;
        for (axis, member) in format::members(generator.axes) {
            // As steep as the limits let it be, where nothing else is told.
            let slope = generator::slope(generator, member, scale(axis)).unwrap_or(
                config
                    .axes
                    .get(axis)
                    .map_or(0.0, |a| a.acceleration_max as f32),
            );
            group.set_ramps(axis, slope, slope);
        }
        let start = group.count().wrapping_add(1);
        // The next step cannot have passed.
        let _ = group.announce(start, generator.axes);
        Ok(())
    }

    /// Whether the travel allows what begins where the axes are.
    fn reach(&self, generator: &Generator<'_>) -> Result<(), ProgramFault> {
        for (axis, member) in format::members(generator.axes) {
            let begin = self.begin.get(axis).copied().unwrap_or_default();
            let from = begin.from.wrapping_sub(begin.home);
            let Some(limits) = self.config.axes.get(axis) else {
                continue;
            };
            for way in generator::reach(generator, member) {
                let farthest = from.saturating_add(way);
                let reached = limits.reaches(axis as u8, farthest);
                reached.map_err(ProgramFault::Limit)?;
            }
        }
        Ok(())
    }

    /// Makes as many knots as there is room for.
    fn generate(&mut self, group: &mut Group<N>, steps: &[u8]) {
        let Ok((Step::Generator(generator), _)) =
            format::step(steps.get(self.at..).unwrap_or_default())
        else {
            return;
        };
        let config = self.config;
        let scale = |axis| config.scale(axis as u8);
        let room = |group: &Group<N>| {
            let mut axes = format::members(generator.axes);
            axes.all(|(axis, _)| group.room(axis) > 0)
        };
        while room(group) {
            for (axis, member) in format::members(generator.axes) {
                match self.run.next(&generator, &self.begin, &scale, axis, member) {
                    Some(knot) => group.push(axis, &knot),
                    None => {
                        self.phase = Phase::Arriving { flying: false };
                        return;
                    }
                }
            }
            self.run.knot += 1;
        }
    }
}

/// A set: bit n for the n-th that is in it.
fn mask(members: impl Iterator<Item = bool>) -> u32 {
    members
        .enumerate()
        .fold(0, |set, (n, is)| set | u32::from(is) << n)
}

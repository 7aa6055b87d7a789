//! Several axes as one group with one contract for faults.
//!
//! [`Group::step`] is called once per SYNC cycle, when the TPDOs of this SYNC are
//! in or late; the commands it gives are taken over by the drives at the next
//! SYNC.
//!
//! The contract:
//! 1. The group moves only after a release, given in standby, when every axis is
//!    enabled, fresh and at rest; the program starts from actual positions.
//! 2. A fault of one axis stops all: the commands of the very step that detects
//!    it carry the stop, which acts at the following SYNC. The axes that still
//!    obey ramp down so that they come to rest together; an axis disabled by
//!    its own drive is left out.
//! 3. Recovery leads to standby, never to motion: a faulted group waits until
//!    the network has gone down and come up again, or until the axis at fault is
//!    left out.
//! 4. What cannot be carried out is refused with a reason, and nothing is sent.

mod axis;
mod config;
mod event;
mod watch;

pub use config::{AxisConfig, GroupConfig};
pub use event::{FaultCause, GroupEvent, GroupState, Refusal};

use core::mem::MaybeUninit;
use heapless::{Deque, Vec};

use self::axis::Axis;
use super::profile::whole_cycles;
use super::program::{self, PlanError, Step};
use super::{Profile, Ramp, Reference};
use crate::cia402::Goal;
use crate::time::{Duration, Instant};

/// Events kept until they are taken: enough for the busiest step, in which every
/// one of six axes fails.
const EVENTS: usize = 24;

/// Where the count of cycles stands still: far behind the end of any reference,
/// and far before the end of its type.
const LONGEST_T: i32 = i32::MAX / 2;

/// What a drive reported in this cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AxisFeedback {
    /// 6041h.
    pub statusword: u16,
    /// 6064h, increments, sampled at this SYNC.
    pub position: i32,
    /// 606Ch, rpm.
    pub velocity: i32,
    /// 6077h, per mille of the rated torque.
    pub torque: i16,
    /// The TPDO with statusword and position of this SYNC has arrived. Without
    /// it, the other values are not looked at.
    pub fresh: bool,
}

/// What a drive is told for the next cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AxisCommand {
    /// 6040h.
    pub controlword: u16,
    /// 60FFh, rpm.
    pub velocity: i32,
    /// 6083h, rpm/s.
    pub acceleration: u32,
    /// 6084h, rpm/s.
    pub deceleration: u32,
}

/// What is asked of the group in one step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Request {
    /// Level: all mandatory nodes are checked, configured and operational.
    pub network_ready: bool,
    /// Edge: run the program once.
    pub release: bool,
    /// Edge: ramp down to standby.
    pub stop: bool,
    /// Edge: a fault seen elsewhere, with the axis counted from 0; a number that no
    /// axis has: of all.
    pub fault: Option<(usize, FaultCause)>,
    /// Cycles since the last step: more than one if some were missed, for the axes went
    /// on meanwhile. 0 counts as 1.
    pub passed: u32,
    /// Level: bit n leaves out axis n, whose optional node is not there. One that
    /// goes in motion is a fault; one that comes waits for standby.
    pub absent: u32,
}

/// `N` axes moved in step; see the module.
pub struct Group<const N: usize> {
    config: &'static GroupConfig<N>,
    /// All `N`: a vector, so that they can be made one by one where they stay.
    axes: Vec<Axis, N>,
    state: GroupState,
    now: Instant,
    /// Cycles since the references were set. They start at the SYNC after that,
    /// so that at this step's SYNC they stand at `t - 1`.
    t: i32,
    /// Where all axes go together while enabling.
    stage: Goal,
    step: usize,
    /// Cycles of the ramp after a fault.
    fault_ramp: u32,
    /// Since the fault, the network has gone down, or an axis at fault is left
    /// out.
    network_was_down: bool,
    /// The axes left out since the group began to enable.
    absent: u32,
    program: Result<(), PlanError>,
    events: Events,
}

/// Events that were not taken yet, and how many found no room.
struct Events {
    queue: Deque<GroupEvent, EVENTS>,
    lost: u16,
}

impl Events {
    #[inline(never)]
    fn report(&mut self, event: GroupEvent) {
        if self.queue.push_back(event).is_err() {
            self.lost = self.lost.saturating_add(1);
        }
    }
}

impl<const N: usize> Group<N> {
    /// A group in [`GroupState::Idle`]. A program that breaks the limits is
    /// reported when it is released.
    pub fn new(config: &'static GroupConfig<N>) -> Group<N> {
        let mut group = Group::without_axes(config);
        group.add_axes();
        group
    }

    /// The same, made where it is to stay, without a copy on the stack.
    pub fn new_in<'a>(
        place: &'a mut MaybeUninit<Group<N>>,
        config: &'static GroupConfig<N>,
    ) -> &'a mut Group<N> {
        let group = place.write(Group::without_axes(config));
        group.add_axes();
        group
    }

    fn add_axes(&mut self) {
        for (n, axis) in (0..).zip(&self.config.axes) {
            // There is room: both are `N`.
            let _ = self.axes.push(Axis::new(n, axis, self.config));
        }
    }

    fn without_axes(config: &'static GroupConfig<N>) -> Group<N> {
        Group {
            config,
            axes: Vec::new(),
            state: GroupState::Idle,
            now: Instant::ZERO,
            t: 0,
            stage: Goal::Disabled,
            step: 0,
            fault_ramp: 0,
            network_was_down: false,
            absent: 0,
            program: config.program.duration(config).map(|_| ()),
            events: Events {
                queue: Deque::new(),
                lost: 0,
            },
        }
    }

    /// The state after the last step.
    pub const fn state(&self) -> GroupState {
        self.state
    }

    /// The oldest event that was not taken yet. Take all after every step.
    pub fn take_event(&mut self) -> Option<GroupEvent> {
        self.events.queue.pop_front().or_else(|| {
            let count = core::mem::take(&mut self.events.lost);
            (count > 0).then_some(GroupEvent::Lost { count })
        })
    }

    /// One cycle: takes in what the drives reported for this SYNC and fills in
    /// what to command for the next.
    pub fn step(
        &mut self,
        request: Request,
        feedback: &[AxisFeedback; N],
        out: &mut [AxisCommand; N],
    ) {
        let passed = request.passed.max(1);
        let cycles = i32::try_from(passed).unwrap_or(LONGEST_T).min(LONGEST_T);
        let us = self.config.cycle.as_micros().saturating_mul(passed);
        self.now += Duration::from_micros(us);
        self.t = (self.t + cycles).min(LONGEST_T);
        let follows = !matches!(self.state, GroupState::Idle | GroupState::Faulted);
        for (axis, feedback) in self.axes.iter_mut().zip(feedback) {
            if follows {
                axis.look(self.t);
            }
            if let Some(state) = axis.hear(feedback) {
                let axis = axis.n;
                self.events.report(GroupEvent::AxisState { axis, state });
            }
        }
        self.watch(&request);
        self.obey(&request);
        self.advance();
        for (axis, out) in self.axes.iter_mut().zip(out) {
            *out = match self.state {
                _ if axis.absent => axis.command_off(),
                GroupState::Idle | GroupState::Faulted => axis.command_off(),
                GroupState::Enabling | GroupState::Standby => axis.command_rest(self.now),
                GroupState::Moving | GroupState::Stopping => axis.command_follow(self.now, self.t),
                GroupState::FaultStop => {
                    let sent = u32::try_from(self.t).unwrap_or(0).saturating_add(1);
                    let left = self.fault_ramp.saturating_sub(sent);
                    axis.command_fault_stop(left, self.fault_ramp, self.config)
                }
            };
        }
    }

    fn enter(&mut self, to: GroupState) {
        let from = core::mem::replace(&mut self.state, to);
        self.events.report(GroupEvent::State { from, to });
    }

    /// Requests: network up, release, stop.
    fn obey(&mut self, request: &Request) {
        let ready = request.network_ready;
        let left_out = |axis: &Axis| axis.faulted && axis.is_in(request.absent);
        self.network_was_down |= !ready || self.axes.iter().any(left_out);
        let enable = match self.state {
            GroupState::Idle => ready,
            GroupState::Faulted => ready && self.network_was_down,
            GroupState::Standby => request.absent != self.absent,
            GroupState::Moving if request.stop => {
                self.begin_stopping();
                false
            }
            _ => false,
        };
        if enable {
            self.begin_enabling(request.absent);
        }
        if request.release
            && let Err(refusal) = self.release(request.stop)
        {
            self.events.report(GroupEvent::ReleaseRefused(refusal));
        }
    }

    fn begin_enabling(&mut self, absent: u32) {
        self.enter(GroupState::Enabling);
        self.absent = absent;
        for axis in &mut self.axes {
            axis.restart(absent);
        }
        self.set_stage(Goal::Disabled);
    }

    fn set_stage(&mut self, stage: Goal) {
        self.stage = stage;
        for axis in &mut self.axes {
            axis.machine.set_goal(stage, self.now);
        }
    }

    fn release(&mut self, stop: bool) -> Result<(), Refusal> {
        if self.state != GroupState::Standby {
            return Err(Refusal::NotInStandby(self.state));
        }
        if stop {
            return Err(Refusal::StopRequested);
        }
        for axis in &self.axes {
            let AxisFeedback {
                velocity, fresh, ..
            } = axis.feedback;
            let axis = match axis.absent {
                true => continue,
                false => axis.n,
            };
            if !fresh {
                return Err(Refusal::NotFresh { axis });
            }
            if velocity.unsigned_abs() > self.config.standstill_rpm {
                return Err(Refusal::NotAtRest { axis, velocity });
            }
        }
        self.program.map_err(Refusal::Program)?;
        self.hold_actual();
        self.begin_step(0).map_err(Refusal::Program)?;
        self.enter(GroupState::Moving);
        self.events.report(GroupEvent::StepStarted { step: 0 });
        Ok(())
    }

    /// References at rest where the axes are.
    fn hold_actual(&mut self) {
        self.t = 0;
        for axis in &mut self.axes {
            let position = if axis.feedback.fresh {
                axis.feedback.position
            } else {
                axis.reference.end()
            };
            axis.follow(Reference::Hold(position), self.config);
        }
    }

    /// Sets the references for a step of the program, from where they end now.
    /// Past the last step nothing changes.
    fn begin_step(&mut self, step: usize) -> Result<(), PlanError> {
        self.step = step;
        match self.config.program.steps.get(step) {
            None => {}
            Some(Step::Dwell(_)) => {
                for axis in &mut self.axes {
                    axis.follow(Reference::Hold(axis.reference.end()), self.config);
                }
            }
            Some(Step::Move(moves)) => {
                let mut from = [0; N];
                for (from, axis) in from.iter_mut().zip(&self.axes) {
                    *from = axis.reference.end().wrapping_sub(axis.home);
                }
                let timings = program::plan(moves, &from, self.config)?;
                for ((axis, part), timing) in self.axes.iter_mut().zip(moves).zip(timings) {
                    let start = axis.reference.end();
                    let reference = match part {
                        None => Reference::Hold(start),
                        Some(part) => {
                            let target = axis.home.wrapping_add(part.target);
                            Reference::Move(Profile::new(start, target, timing))
                        }
                    };
                    axis.follow(reference, self.config);
                }
            }
        }
        self.t = 0;
        Ok(())
    }

    /// Ramps from the set-points of the next SYNC, equally long for all axes.
    fn begin_stopping(&mut self) {
        let mut cycles = 0;
        for axis in &self.axes {
            let speed = axis.scale.rpm(axis.next(self.t).velocity);
            cycles = self.stop_cycles(speed.abs() as u32).max(cycles);
        }
        for axis in &mut self.axes {
            let ramp = Ramp::new(&axis.next(self.t), cycles);
            axis.follow(Reference::Ramp(ramp), self.config);
        }
        self.t = 0;
        self.enter(GroupState::Stopping);
    }

    /// Whole cycles to stop from a speed in rpm.
    fn stop_cycles(&self, rpm: u32) -> u32 {
        const SECOND_US: f32 = 1e6;
        let per_cycle = self.config.stop_deceleration as f32
            * (self.config.cycle.as_micros() as f32 / SECOND_US);
        whole_cycles(rpm as f32 / per_cycle).unwrap_or(u32::MAX)
    }

    /// What goes on by itself in each state.
    fn advance(&mut self) {
        match self.state {
            GroupState::Idle | GroupState::Standby | GroupState::Faulted => {}
            GroupState::Enabling => self.advance_enabling(),
            GroupState::Moving => self.advance_program(),
            GroupState::Stopping => self.advance_stopping(),
            GroupState::FaultStop => self.advance_fault_stop(),
        }
    }

    /// All axes reach a state before the next transition is commanded.
    fn advance_enabling(&mut self) {
        if !self.axes.iter().all(|a| a.absent || a.machine.reached()) {
            return;
        }
        match self.stage {
            Goal::Disabled => self.set_stage(Goal::Ready),
            Goal::Ready => self.set_stage(Goal::SwitchedOn),
            Goal::SwitchedOn => self.set_stage(Goal::Enabled),
            Goal::Enabled | Goal::QuickStop => {
                // A drive that was switched off in motion may have been enabled
                // before its axis stood: it brakes first.
                let limit = self.config.standstill_rpm;
                let rests =
                    |a: &Axis| a.feedback.fresh && a.feedback.velocity.unsigned_abs() <= limit;
                if self.axes.iter().all(|a| a.absent || rests(a)) {
                    self.hold_actual();
                    for axis in &mut self.axes {
                        axis.home = axis.feedback.position;
                    }
                    self.enter(GroupState::Standby);
                }
            }
        }
    }

    fn advance_program(&mut self) {
        let finished = match self.config.program.steps.get(self.step) {
            None => true,
            Some(Step::Dwell(time)) => {
                u32::try_from(self.t).is_ok_and(|t| t >= self.config.cycles(*time))
            }
            Some(Step::Move(_)) => self.all_arrived(),
        };
        // An arrival that failed has already begun the stop.
        if !finished || self.state != GroupState::Moving {
            return;
        }
        let next = self.step.saturating_add(1);
        if next >= self.config.program.steps.len() {
            self.enter(GroupState::Standby);
            self.events.report(GroupEvent::ProgramDone);
        } else if let Err(error) = self.begin_step(next) {
            self.fault(None, FaultCause::Program(error));
        } else {
            self.events
                .report(GroupEvent::StepStarted { step: next as u8 });
        }
    }

    /// Whether every axis has come to rest on its target.
    fn all_arrived(&mut self) -> bool {
        let mut all = true;
        for axis in &mut self.axes {
            if axis.arrived || axis.absent {
                continue;
            }
            all = false;
            match axis.comes_to_rest(self.t, true, self.config) {
                Ok(None) => {}
                Ok(Some(error)) => {
                    axis.arrived = true;
                    self.events.report(GroupEvent::Arrived {
                        axis: axis.n,
                        target: axis.reference.end(),
                        error,
                    });
                }
                Err(cause) => {
                    let axis = axis.n;
                    self.fault(Some(axis), cause);
                    return false;
                }
            }
        }
        all
    }

    fn advance_stopping(&mut self) {
        let mut all = true;
        for axis in &mut self.axes {
            if axis.absent {
                continue;
            }
            match axis.comes_to_rest(self.t, false, self.config) {
                Ok(rests) => all &= rests.is_some(),
                Err(cause) => {
                    let axis = axis.n;
                    self.fault(Some(axis), cause);
                    return;
                }
            }
        }
        if all {
            self.hold_actual();
            self.enter(GroupState::Standby);
        }
    }
}

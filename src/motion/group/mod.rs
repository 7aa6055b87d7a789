//! The group as it is stepped from SYNC to SYNC: it evaluates paths, supervises,
//! and knows the contract. What paths there are is planned elsewhere.
//!
//! [`Group::step`] is called once per cycle, when the TPDOs of this SYNC are in or
//! late; what it commands is taken over by the drives at the next SYNC. Between
//! two steps the group takes orders ([`Group::order`]) and paths
//! ([`Group::announce`], [`Group::push`]).

mod axis;
mod drive_led;
mod order;
mod watch;

pub use drive_led::SetPoint;
pub use order::Order;

use self::axis::{Axis, stop_cycles};
use super::contract::{Cell, Event, cell};
use super::mode::Mode;
use super::path::{Knot, Point};
use super::{FaultCause, GroupConfig, GroupEvent, GroupState};
use crate::cia402::{Command, Goal, State};
use crate::time::Instant;
use core::mem::MaybeUninit;
use heapless::{Deque, Vec};

/// Events kept until they are taken: enough for the busiest step, in which every
/// one of six axes fails.
const EVENTS: usize = 24;
/// Cycles in which every drive has the target of a new mode before the mode is
/// written.
const TARGET_SETTLED: u32 = 3;

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
    /// Which of the RPDOs is sent, and what the target is.
    pub mode: Mode,
    /// 6040h.
    pub controlword: u16,
    /// 60FFh in the unit of 60A9h, 607Ah in increments, or 6071h in per mille.
    pub target: i32,
    /// 6083h, rpm/s.
    pub acceleration: u32,
    /// 6084h, rpm/s.
    pub deceleration: u32,
}

/// What the group is told in every step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inputs {
    /// Level: all mandatory nodes are checked, configured and operational.
    pub network_ready: bool,
    /// Level: bit n leaves out axis n, whose optional node is not there. One that
    /// goes in motion is a fault; one that comes waits for standby.
    pub absent: u32,
    /// Edge: a fault seen elsewhere, with the axis counted from 0.
    pub fault: Option<(usize, FaultCause)>,
}

/// One axis, for whoever looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisView {
    /// As confirmed in 6061h.
    pub mode: Mode,
    /// As last heard since the group began to enable.
    pub state: Option<State>,
    /// What its drive reported in the last cycle.
    pub feedback: AxisFeedback,
    /// Where it should be, increments; in torque mode per mille.
    pub reference: i32,
    /// Where its path ends, as far as it is known.
    pub end: i32,
    /// Position from which targets count.
    pub home: i32,
    /// It is left out.
    pub absent: bool,
    /// A fault of it stopped the group.
    pub faulted: bool,
}

/// An axis whose mode is to be written to 6060h and confirmed in 6061h.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModeWanted {
    /// Counted from 0.
    pub axis: usize,
    /// What to write.
    pub mode: Mode,
}

/// The cycle at which a path was to begin has passed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLate;

/// `N` axes moved in step; see the module.
pub struct Group<const N: usize> {
    config: &'static GroupConfig<N>,
    /// All `N`: a vector, so that they can be made one by one where they stay.
    axes: Vec<Axis, N>,
    state: GroupState,
    now: Instant,
    /// Steps so far, and since the state was entered.
    count: u32,
    since: u32,
    /// Somebody wants the axes enabled.
    wanted: bool,
    /// What was ordered since the last step.
    ordered: Option<Order>,
    /// A path that replaces what its axes follow: from which step on, and whose.
    announced: Option<(u32, u32)>,
    /// Where all axes go together while enabling.
    stage: Goal,
    /// Since the fault, the network has gone down, or an axis at fault is left
    /// out.
    network_was_down: bool,
    network_ready: bool,
    /// The axes left out since the group began to enable.
    absent: u32,
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
    /// A group in [`GroupState::Idle`] whose axes are enabled as soon as the
    /// network is ready.
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

    const fn without_axes(config: &'static GroupConfig<N>) -> Group<N> {
        Group {
            config,
            axes: Vec::new(),
            state: GroupState::Idle,
            now: Instant::ZERO,
            count: 0,
            since: 0,
            wanted: true,
            ordered: None,
            announced: None,
            stage: Goal::Disabled,
            network_was_down: false,
            network_ready: false,
            absent: 0,
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

    /// Steps so far; wraps.
    pub const fn count(&self) -> u32 {
        self.count
    }

    /// One axis, counted from 0.
    pub fn view(&self, axis: usize) -> Option<AxisView> {
        let axis = self.axes.get(axis)?;
        Some(AxisView {
            mode: axis.mode,
            state: axis.state(),
            feedback: axis.feedback,
            reference: super::fixed::round(axis.head().position),
            end: super::fixed::round(axis.path.end()),
            home: axis.home,
            absent: axis.absent,
            faulted: axis.faulted,
        })
    }

    /// The oldest event that was not taken yet. Take all after every step.
    pub fn take_event(&mut self) -> Option<GroupEvent> {
        self.events.queue.pop_front().or_else(|| {
            let count = core::mem::take(&mut self.events.lost);
            (count > 0).then_some(GroupEvent::Lost { count })
        })
    }

    /// Where the path of an axis will stand `cycles` steps from now: from there a
    /// plan can go on.
    pub fn predict(&self, axis: usize, cycles: u32) -> Option<Point> {
        Some(self.axes.get(axis)?.path.ahead(cycles))
    }

    /// In the step number `start` the axes of `axes` go over to a path of which
    /// the knots are pushed from now on. They count as moving from now on.
    ///
    /// # Errors
    /// [`TooLate`] if that step was, or the group is not released.
    pub fn announce(&mut self, start: u32, axes: u32) -> Result<(), TooLate> {
        const FAR: u32 = 1 << 8;
        let left = start.wrapping_sub(self.count);
        if left == 0 || left > FAR || self.state != GroupState::Moving {
            return Err(TooLate);
        }
        for axis in self.axes.iter_mut().filter(|axis| axis.is_in(axes)) {
            axis.path.announce(left as usize);
            axis.arrived = axis.absent;
        }
        self.announced = Some((start, axes));
        Ok(())
    }

    /// Adds a knot to the path of an axis: to that announced, if one is.
    pub fn push(&mut self, axis: usize, knot: Knot) {
        let announced = self.announced.map_or(0, |(_, axes)| axes);
        if let Some(axis) = self.axes.get_mut(axis) {
            axis.path.push(knot, axis.is_in(announced));
        }
    }

    /// Knots for which the path of an axis has room.
    pub fn room(&self, axis: usize) -> usize {
        self.axes.get(axis).map_or(0, |axis| axis.path.room())
    }

    /// The steepest slopes of what follows, rpm/s, for the ramps of the drive.
    pub fn set_ramps(&mut self, axis: usize, up: f32, down: f32) {
        let config = self.config;
        if let Some(axis) = self.axes.get_mut(axis) {
            axis.set_ramps(up, down, config);
        }
    }

    /// A set-point of profile position mode, to be handed to the drive. `false`:
    /// the drive has not taken the last one yet, or the group is not released, or
    /// the axis is in another mode.
    pub fn ask(&mut self, axis: usize, set_point: &SetPoint) -> bool {
        let released = self.state == GroupState::Moving;
        let Some(axis) = self.axes.get_mut(axis) else {
            return false;
        };
        let can = released && axis.mode == Mode::ProfilePosition && axis.led.is_taken();
        if can {
            axis.led.ask(set_point);
            axis.arrived = axis.absent;
        }
        can
    }

    /// Whether every axis has come to rest at the end of its path, and no other is
    /// announced.
    pub fn all_arrived(&self) -> bool {
        self.announced.is_none() && self.axes.iter().all(|axis| axis.arrived)
    }

    /// Whether every path has reached its last knot, and no other is announced.
    pub fn all_over(&self) -> bool {
        self.announced.is_none() && self.axes.iter().all(|axis| axis.path.is_over())
    }

    /// The next axis whose mode has to be written and confirmed.
    pub fn mode_wanted(&self) -> Option<ModeWanted> {
        if self.state != GroupState::ModeChange || self.since < TARGET_SETTLED {
            return None;
        }
        let wanted = |(axis, a): (usize, &Axis)| a.wanted.map(|mode| ModeWanted { axis, mode });
        self.axes.iter().enumerate().find_map(wanted)
    }

    /// 6061h of an axis shows `mode`.
    pub fn confirm_mode(&mut self, confirmed: ModeWanted) {
        if let Some(axis) = self.axes.get_mut(confirmed.axis)
            && axis.wanted == Some(confirmed.mode)
        {
            axis.mode = confirmed.mode;
            axis.wanted = None;
            axis.hold_actual();
        }
    }

    /// One cycle: takes in what the drives reported for this SYNC and fills in
    /// what to command for the next.
    pub fn step(
        &mut self,
        inputs: &Inputs,
        feedback: &[AxisFeedback; N],
        out: &mut [AxisCommand; N],
    ) {
        self.now += self.config.cycle;
        self.count = self.count.wrapping_add(1);
        self.since = self.since.saturating_add(1);
        let mut cut = 0;
        if let Some((start, axes)) = self.announced
            && start == self.count
        {
            cut = axes;
            self.announced = None;
        }
        for (axis, feedback) in self.axes.iter_mut().zip(feedback) {
            if let Some(state) = axis.hear(feedback, axis.is_in(cut)) {
                let axis = axis.n;
                self.events.report(GroupEvent::AxisState { axis, state });
            }
        }
        self.watch(inputs);
        self.obey(inputs);
        self.advance();
        let (now, state) = (self.now, self.state);
        let halt = matches!(state, GroupState::Stopping | GroupState::Halt);
        for (axis, out) in self.axes.iter_mut().zip(out) {
            *out = match state {
                _ if axis.absent => axis.command(Command::DisableVoltage),
                GroupState::Idle | GroupState::Faulted => axis.command(Command::DisableVoltage),
                GroupState::Enabling
                | GroupState::Standby
                | GroupState::ModeChange
                | GroupState::Disabling => axis.rest(now),
                GroupState::Moving
                | GroupState::Stopping
                | GroupState::Halt
                | GroupState::Homing => axis.follow(now, false, halt),
                // Quick stop leaves a drive that is braking by itself on its ramp
                // and cannot enable anything.
                GroupState::FaultStop if !axis.excluded && !axis.mode.is_led_by_drive() => {
                    axis.follow(now, true, true)
                }
                GroupState::QuickStop | GroupState::FaultStop => axis.command(Command::QuickStop),
            };
        }
    }

    /// What an event does, as the table has it. `false`: it is refused.
    fn happen(&mut self, event: Event) -> bool {
        match cell(self.state, event) {
            Cell::Stay => {}
            Cell::Refuse => return false,
            Cell::Go(to) => self.enter(to),
        }
        true
    }

    #[inline(never)]
    fn enter(&mut self, to: GroupState) {
        let from = core::mem::replace(&mut self.state, to);
        self.since = 0;
        self.events.report(GroupEvent::State { from, to });
        self.announced = None;
        match to {
            GroupState::Enabling => {
                for axis in &mut self.axes {
                    axis.restart(self.absent);
                }
                self.set_stage(Goal::Disabled);
            }
            GroupState::Disabling => self.set_stage(Goal::Disabled),
            GroupState::Stopping | GroupState::Halt => self.stop(false),
            GroupState::FaultStop => {
                self.network_was_down = false;
                for axis in &mut self.axes {
                    axis.begin_fault_stop(from != GroupState::Enabling);
                }
                self.stop(true);
            }
            // At the end of a motion the axes are where they should be.
            GroupState::Standby if from != GroupState::Moving => self.hold_actual(),
            _ => {}
        }
    }

    /// Ramps from the next SYNC on, equally long for all axes.
    fn stop(&mut self, fault: bool) {
        let mut speeds = [0.0; N];
        let mut fastest = 0.0f32;
        for (speed, axis) in speeds.iter_mut().zip(&self.axes) {
            *speed = axis.speed(fault);
            fastest = fastest.max(speed.abs());
        }
        let cycles = stop_cycles(fastest, self.config);
        let share = 1.0 / cycles.max(1) as f32;
        for (speed, axis) in speeds.into_iter().zip(&mut self.axes) {
            axis.stop(cycles, share, speed, fault, self.config);
        }
    }

    fn set_stage(&mut self, stage: Goal) {
        self.stage = stage;
        for axis in &mut self.axes {
            axis.machine.set_goal(stage, self.now);
        }
    }

    fn hold_actual(&mut self) {
        for axis in &mut self.axes {
            axis.hold_actual();
        }
    }

    /// What goes on by itself in each state.
    fn advance(&mut self) {
        let done = match self.state {
            GroupState::Idle | GroupState::Standby | GroupState::Faulted | GroupState::Halt => {
                false
            }
            GroupState::Enabling | GroupState::Disabling => self.next_stage(),
            GroupState::Moving | GroupState::Homing => {
                let arrived = self.arrive(true);
                arrived && self.state == GroupState::Homing
            }
            GroupState::Stopping => self.arrive(false),
            GroupState::ModeChange => {
                let change = self.axes.iter().find(|axis| axis.wanted.is_some());
                match change.map(|axis| (axis.n, axis.wanted.unwrap_or_default())) {
                    None => true,
                    Some((axis, mode)) => {
                        if self.since > self.config.cycles(self.config.enable_timeout) {
                            let cause = FaultCause::ModeNotConfirmed { mode };
                            self.fault(Some(axis), cause, Event::Late);
                        }
                        false
                    }
                }
            }
            GroupState::QuickStop | GroupState::FaultStop => self.comes_to_rest(),
        };
        if done {
            self.happen(Event::Done);
        }
    }

    /// All axes reach a state before the next transition is commanded.
    fn next_stage(&mut self) -> bool {
        for axis in &mut self.axes {
            // The target is the actual position until the drive follows it.
            axis.hold_actual();
        }
        if !self.axes.iter().all(|a| a.absent || a.machine.reached()) {
            return false;
        }
        let next = match self.stage {
            _ if self.state == GroupState::Disabling => return true,
            Goal::Disabled => Goal::Ready,
            Goal::Ready => Goal::SwitchedOn,
            Goal::SwitchedOn => Goal::Enabled,
            Goal::Enabled | Goal::QuickStop => {
                // A drive that was switched off in motion may have been enabled
                // before its axis stood: it brakes first.
                let limit = self.config.standstill_rpm;
                let rests = |axis: &Axis| {
                    let AxisFeedback {
                        fresh, velocity, ..
                    } = axis.feedback;
                    axis.absent || (fresh && velocity.unsigned_abs() <= limit)
                };
                let rest = self.axes.iter().all(rests);
                for axis in self.axes.iter_mut().filter(|_| rest) {
                    axis.home = axis.feedback.position;
                }
                return rest;
            }
        };
        self.set_stage(next);
        false
    }

    /// Whether every axis has come to rest, `on_target` or wherever it is.
    fn arrive(&mut self, on_target: bool) -> bool {
        let config = self.config;
        let announced = self.announced.map_or(0, |(_, axes)| axes);
        let mut all = announced == 0;
        for axis in &mut self.axes {
            if (axis.arrived && on_target) || axis.absent || axis.is_in(announced) {
                continue;
            }
            match axis.comes_to_rest(on_target, config) {
                Ok(None) => all = false,
                Ok(Some(error)) => {
                    axis.arrived = true;
                    if axis.mode == Mode::Homing && on_target {
                        axis.home = 0;
                    }
                    if on_target {
                        let (axis, target) = (axis.n, super::fixed::round(axis.head().position));
                        self.events.report(GroupEvent::Arrived {
                            axis,
                            target,
                            error,
                        });
                    }
                }
                Err(cause) => {
                    let axis = axis.n;
                    self.fault(Some(axis), cause, Event::Late);
                    return false;
                }
            }
        }
        all
    }

    /// After a quick stop or a fault: waits for standstill, for as long as an axis
    /// may take. Axes that report nothing are not waited for.
    fn comes_to_rest(&mut self) -> bool {
        let config = self.config;
        let patience = config.cycles(config.settle_timeout);
        let (mut all, mut fastest) = (true, 0);
        for axis in &mut self.axes {
            let silent = axis.missing >= config.missing_tpdo_max;
            let rests = axis.absent || (axis.path.is_over() && axis.settle(None, config));
            all &= rests || silent;
            fastest = fastest.max(axis.config.velocity_max);
        }
        if !all && self.since > patience.saturating_add(stop_cycles(fastest as f32, config)) {
            for axis in &mut self.axes {
                if !axis.absent && !axis.settle(None, config) {
                    self.events.report(GroupEvent::NotAtRest {
                        axis: axis.n,
                        velocity: axis.feedback.velocity,
                    });
                }
            }
            self.happen(Event::Late);
        }
        all
    }
}

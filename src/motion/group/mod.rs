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

use self::axis::{Axis, Lead};
use super::contract::{Cell, Event, cell};
use super::mode::Mode;
use super::path::{Knot, Point};
use super::{AxisConfig, FaultCause, GroupConfig, GroupEvent, GroupState, fixed};
use crate::cia402::{Command, ControlWord, Goal, State};
use crate::time::Instant;
use heapless::Deque;

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
    /// Reference minus actual position at the SYNC of that, increments.
    pub following_error: i32,
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

/// A set of axes: bit n for axis n.
type Axes = u32;

const fn bit(n: usize) -> Axes {
    1 << (n % Axes::BITS as usize)
}

/// `N` axes moved in step; see the module.
///
/// Until it is configured all of it is 0, so that it needs no room in an image.
pub struct Group<const N: usize> {
    config: Option<&'static GroupConfig<N>>,
    axes: [Axis; N],
    state: GroupState,
    now: Instant,
    /// Steps so far, and since the state was entered.
    count: u32,
    since: u32,
    /// Nobody wants the axes enabled.
    unwanted: bool,
    /// What was ordered since the last step; to enable: nothing.
    ordered: Order,
    /// Whose path is replaced by one that is announced, and from which step on.
    announced: Axes,
    start: u32,
    /// Where all axes go together while enabling.
    stage: Goal,
    /// Since the fault, the network has gone down, or an axis at fault is left
    /// out.
    network_was_down: bool,
    network_ready: bool,
    /// Left out since the group began to enable: nothing is asked of them.
    absent: Axes,
    /// A fault of them has been reported.
    faulted: Axes,
    /// Their own drives have taken them out of the master's hands.
    excluded: Axes,
    /// That has been reported, or there was nothing to report.
    coasting: Axes,
    /// Their part of the last path is not done yet.
    busy: Axes,
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

/// What is sent in a state: the controlword, and how the axes are led. Without a
/// lead each goes by its own state machine.
const fn sent(state: GroupState) -> (Command, Option<Lead>) {
    const REST: Option<Lead> = Some(Lead::Rest);
    match state {
        GroupState::Idle | GroupState::Faulted => (Command::DisableVoltage, REST),
        GroupState::Enabling | GroupState::Disabling => (Command::DisableVoltage, None),
        GroupState::Standby | GroupState::ModeChange => (Command::EnableOperation, REST),
        GroupState::Moving | GroupState::Homing => (Command::EnableOperation, Some(Lead::Follow)),
        GroupState::Stopping | GroupState::Halt => (Command::EnableOperation, Some(Lead::Halt)),
        GroupState::FaultStop => (Command::EnableOperation, Some(Lead::Fault)),
        GroupState::QuickStop => (Command::QuickStop, REST),
    }
}

impl<const N: usize> Group<N> {
    /// Before it is configured: it does nothing.
    pub const ZERO: Group<N> = Group {
        config: None,
        axes: [Axis::ZERO; N],
        state: GroupState::Idle,
        now: Instant::ZERO,
        count: 0,
        since: 0,
        unwanted: false,
        ordered: Order::Enable,
        announced: 0,
        start: 0,
        stage: Goal::Disabled,
        network_was_down: false,
        network_ready: false,
        absent: 0,
        faulted: 0,
        excluded: 0,
        coasting: 0,
        busy: 0,
        events: Events {
            queue: Deque::new(),
            lost: 0,
        },
    };

    /// A group in [`GroupState::Idle`] whose axes are enabled as soon as the
    /// network is ready.
    pub fn new(config: &'static GroupConfig<N>) -> Group<N> {
        let mut group = Group::ZERO;
        group.configure(config);
        group
    }

    /// Makes the same of [`Group::ZERO`], where it is to stay.
    pub fn configure(&mut self, config: &'static GroupConfig<N>) {
        self.config = Some(config);
        let ramp = config.ramp_min as f32;
        for axis in &mut self.axes {
            axis.set_ramps(ramp, ramp);
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
        let config = self.config?.axes.get(axis)?;
        let bit = bit(axis);
        let axis = self.axes.get(axis)?;
        Some(AxisView {
            mode: axis.mode(config),
            state: axis.state(),
            feedback: axis.feedback,
            reference: axis.head(),
            following_error: axis.error(),
            end: fixed::round(axis.path.end()),
            home: axis.home,
            absent: self.absent & bit != 0,
            faulted: self.faulted & bit != 0,
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
    /// [`TooLate`] if that step was, or the group is not released, or so much of
    /// the old path is still to come that there is no room.
    pub fn announce(&mut self, start: u32, axes: u32) -> Result<(), TooLate> {
        const FAR: u32 = 1 << 8;
        let left = start.wrapping_sub(self.count);
        let fits =
            |(n, axis): (usize, &Axis)| axes & bit(n) == 0 || axis.path.can_be_replaced(left);
        let fit = self.axes.iter().enumerate().all(fits);
        if left == 0 || left > FAR || self.state != GroupState::Moving || !fit {
            return Err(TooLate);
        }
        for (n, axis) in self.axes.iter_mut().enumerate() {
            if axes & bit(n) != 0 {
                axis.path.announce(left);
            }
        }
        self.busy |= axes;
        self.announced = axes;
        self.start = start;
        Ok(())
    }

    /// Adds a knot to the path of an axis: to that announced, if one is.
    pub fn push(&mut self, axis: usize, knot: &Knot) {
        let announced = self.announced & bit(axis) != 0;
        if let Some(axis) = self.axes.get_mut(axis) {
            axis.path.push(knot, announced);
        }
    }

    /// Knots for which the path of an axis has room.
    pub fn room(&self, axis: usize) -> usize {
        self.axes.get(axis).map_or(0, |axis| axis.path.room())
    }

    /// The steepest slopes of what follows, rpm/s, for the ramps of the drive, which
    /// get room for the position loop.
    #[inline(never)]
    pub fn set_ramps(&mut self, axis: usize, up: f32, down: f32) {
        const PERCENT: f32 = 0.01;
        let (Some(config), Some(axis)) = (self.config, self.axes.get_mut(axis)) else {
            return;
        };
        let more = config.ramp_percent as f32 * PERCENT;
        let least = config.ramp_min as f32;
        axis.set_ramps(least.max(up * more), least.max(down * more));
    }

    /// A set-point of profile position mode, to be handed to the drive. `false`:
    /// the drive has not taken the last one yet, or the group is not released, or
    /// the axis is in another mode.
    pub fn ask(&mut self, axis: usize, set_point: &SetPoint) -> bool {
        let bit = bit(axis);
        let config = self.config.and_then(|config| config.axes.get(axis));
        let (Some(config), Some(axis)) = (config, self.axes.get_mut(axis)) else {
            return false;
        };
        let can = self.state == GroupState::Moving
            && axis.mode(config) == Mode::ProfilePosition
            && axis.led.is_taken();
        if can {
            axis.led.ask(set_point);
            self.busy |= bit;
        }
        can
    }

    /// Whether every axis has come to rest at the end of its path, and no other is
    /// announced.
    pub const fn all_arrived(&self) -> bool {
        self.announced == 0 && self.busy & !self.absent == 0
    }

    /// Whether every path has reached its last knot, and no other is announced.
    pub fn all_over(&self) -> bool {
        self.announced == 0 && self.axes.iter().all(|axis| axis.path.is_over())
    }

    /// The next axis whose mode has to be written and confirmed.
    pub fn mode_wanted(&self) -> Option<ModeWanted> {
        if self.state != GroupState::ModeChange || self.since < TARGET_SETTLED {
            return None;
        }
        self.next_wanted()
    }

    fn next_wanted(&self) -> Option<ModeWanted> {
        let wanted = |(axis, a): (usize, &Axis)| a.wanted.map(|mode| ModeWanted { axis, mode });
        self.axes.iter().enumerate().find_map(wanted)
    }

    /// 6061h of an axis shows `mode`.
    pub fn confirm_mode(&mut self, confirmed: ModeWanted) {
        let config = self
            .config
            .and_then(|config| config.axes.get(confirmed.axis));
        if let (Some(config), Some(axis)) = (config, self.axes.get_mut(confirmed.axis))
            && axis.wanted == Some(confirmed.mode)
        {
            axis.changed = axis.wanted.take();
            axis.hold_actual(config);
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
        let Some(config) = self.config else { return };
        self.now += config.cycle;
        self.count = self.count.wrapping_add(1);
        self.since = self.since.saturating_add(1);
        let mut cut = 0;
        if self.start == self.count {
            cut = core::mem::take(&mut self.announced);
        }
        for (n, (axis, feedback)) in self.axes.iter_mut().zip(feedback).enumerate() {
            if let Some(state) = axis.hear(feedback, self.count, cut & bit(n) != 0) {
                let axis = n as u8;
                self.events.report(GroupEvent::AxisState { axis, state });
            }
        }
        self.watch(inputs, config);
        self.obey(inputs, config);
        self.advance(config);
        let (command, lead) = sent(self.state);
        let axes = self.axes.iter_mut().zip(&config.axes).zip(out);
        for (n, ((axis, config_of), out)) in axes.enumerate() {
            let (mut command, mut led) = (command, lead.unwrap_or(Lead::Rest));
            if self.absent & bit(n) != 0 {
                (command, led) = (Command::DisableVoltage, Lead::Rest);
            } else if led == Lead::Fault
                && (self.excluded & bit(n) != 0 || axis.mode(config_of).is_led_by_drive())
            {
                // It leaves a drive that is braking by itself on its ramp and cannot
                // enable anything.
                (command, led) = (Command::QuickStop, Lead::Rest);
            }
            let word = if lead.is_none() && self.absent & bit(n) == 0 {
                axis.machine.step(self.now, axis.fresh_status())
            } else {
                ControlWord::new(command)
            };
            axis.command(word.0, led, config_of, &config.tuning, out);
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
        self.announced = 0;
        match to {
            GroupState::Enabling => {
                self.faulted = 0;
                self.excluded = 0;
                self.coasting = 0;
                self.busy = 0;
                self.axes.iter_mut().for_each(Axis::restart);
                self.set_stage(Goal::Disabled);
            }
            GroupState::Disabling => self.set_stage(Goal::Disabled),
            GroupState::Stopping | GroupState::Halt => self.stop(false),
            GroupState::FaultStop => {
                self.network_was_down = false;
                // Axes that their drives do not hold enabled are excluded; that is
                // news only if they were.
                self.excluded = self.absent;
                for (n, axis) in self.axes.iter().enumerate() {
                    if !axis.is_enabled() {
                        self.excluded |= bit(n);
                    }
                }
                self.coasting = self.absent;
                if from == GroupState::Enabling {
                    self.coasting = self.excluded;
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
        let Some(config) = self.config else { return };
        let mut speeds = [0.0; N];
        let mut fastest = 0.0f32;
        let axes = self.axes.iter().zip(&config.axes).zip(&mut speeds);
        for (n, ((axis, config), speed)) in axes.enumerate() {
            if (self.excluded | self.absent) & bit(n) == 0 {
                *speed = axis.speed(fault, config);
                fastest = fastest.max(speed.abs());
            }
        }
        let cycles = stop_cycles(fastest, config).max(1);
        for (n, speed) in speeds.into_iter().enumerate() {
            let (Some(axis), Some(config)) = (self.axes.get_mut(n), config.axes.get(n)) else {
                continue;
            };
            let slope = axis.stop(cycles, speed, config);
            if axis.mode(config).has_position() {
                self.set_ramps(n, slope, slope);
            }
        }
    }

    fn set_stage(&mut self, stage: Goal) {
        self.stage = stage;
        for axis in &mut self.axes {
            axis.machine.set_goal(stage, self.now);
        }
    }

    #[inline(never)]
    fn hold_actual(&mut self) {
        let Some(config) = self.config else { return };
        for (axis, config) in self.axes.iter_mut().zip(&config.axes) {
            axis.hold_actual(config);
        }
    }

    /// What goes on by itself in each state.
    fn advance(&mut self, config: &GroupConfig<N>) {
        let done = match self.state {
            GroupState::Idle | GroupState::Standby | GroupState::Faulted | GroupState::Halt => {
                false
            }
            GroupState::Enabling | GroupState::Disabling => self.next_stage(config),
            GroupState::Moving | GroupState::Homing => {
                self.arrive(true, config) && self.state == GroupState::Homing
            }
            GroupState::Stopping => self.arrive(false, config),
            GroupState::ModeChange => match self.next_wanted() {
                None => true,
                Some(ModeWanted { axis, mode }) => {
                    if self.since > config.cycles(config.enable_timeout) {
                        let cause = FaultCause::ModeNotConfirmed { mode };
                        self.fault(Some(axis as u8), cause, Event::Late);
                    }
                    false
                }
            },
            GroupState::QuickStop | GroupState::FaultStop => self.comes_to_rest(config),
        };
        if done {
            self.happen(Event::Done);
        }
    }

    /// All axes reach a state before the next transition is commanded.
    fn next_stage(&mut self, config: &GroupConfig<N>) -> bool {
        // The target is the actual position until the drive follows it.
        self.hold_actual();
        let (mut reached, mut rest) = (true, true);
        for (n, axis) in self.axes.iter().enumerate() {
            if self.absent & bit(n) == 0 {
                let AxisFeedback {
                    fresh, velocity, ..
                } = axis.feedback;
                reached &= axis.machine.reached();
                rest &= fresh && velocity.unsigned_abs() <= config.standstill_rpm;
            }
        }
        if !reached {
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
    fn arrive(&mut self, on_target: bool, config: &GroupConfig<N>) -> bool {
        let mut all = self.announced == 0;
        let mut waiting = !(self.absent | self.announced);
        if on_target {
            waiting &= self.busy;
        }
        let (enable, settle) = (config.enable_timeout, config.settle_timeout);
        for (n, (axis, limits)) in self.axes.iter_mut().zip(&config.axes).enumerate() {
            if waiting & bit(n) == 0 {
                continue;
            }
            let mode = axis.mode(limits);
            let near = on_target && mode.has_position();
            let failed = if on_target && mode.is_led_by_drive() {
                match axis.led.outcome(mode, config.cycles(enable)) {
                    Ok(None) => {
                        all = false;
                        continue;
                    }
                    outcome => outcome.err(),
                }
            } else if !axis.ended() {
                all = false;
                continue;
            } else {
                let most = if near { limits.in_position } else { u32::MAX };
                let rests = axis.settle(most, config.standstill_rpm, config.settle_cycles);
                if !rests && axis.waited() <= config.cycles(settle) {
                    all = false;
                    continue;
                }
                let error = axis.error();
                (!rests).then_some(FaultCause::NotArrived { error })
            };
            if let Some(cause) = failed {
                self.fault(Some(n as u8), cause, Event::Late);
                return false;
            }
            self.busy &= !bit(n);
            if on_target {
                if mode == Mode::Homing {
                    axis.home = 0;
                }
                self.events.report(GroupEvent::Arrived {
                    axis: n as u8,
                    target: axis.head(),
                    error: if near { axis.error() } else { 0 },
                });
            }
        }
        all
    }

    /// After a quick stop or a fault: waits for standstill, for as long as an axis
    /// may take. Axes that report nothing are not waited for.
    fn comes_to_rest(&mut self, config: &GroupConfig<N>) -> bool {
        let mut moving = 0;
        for (n, axis) in self.axes.iter_mut().enumerate() {
            let rests = axis.path.is_over()
                && axis.settle(u32::MAX, config.standstill_rpm, config.settle_cycles);
            if !rests && self.absent & bit(n) == 0 && axis.missing < config.missing_tpdo_max {
                moving |= bit(n);
            }
        }
        let fastest = |most: u32, axis: &AxisConfig| most.max(axis.velocity_max);
        let fastest = config.axes.iter().fold(0, fastest);
        let patience = config.cycles(config.settle_timeout) + stop_cycles(fastest as f32, config);
        if moving != 0 && self.since > patience {
            for (n, axis) in self.axes.iter().enumerate() {
                if moving & bit(n) != 0 {
                    self.events.report(GroupEvent::NotAtRest {
                        axis: n as u8,
                        velocity: axis.feedback.velocity,
                    });
                }
            }
            self.happen(Event::Late);
        }
        moving == 0
    }
}

/// Whole cycles to come from `rpm` to rest.
fn stop_cycles<const N: usize>(rpm: f32, group: &GroupConfig<N>) -> u32 {
    const SECOND_US: f32 = 1e6;
    let per_cycle = group.stop_deceleration as f32 * (group.cycle.as_micros() as f32 / SECOND_US);
    fixed::ceil(rpm.abs() / per_cycle)
}

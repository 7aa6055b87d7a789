//! The group as it is stepped from SYNC to SYNC: it evaluates paths, supervises,
//! and knows the contract. What paths there are is planned elsewhere.
//!
//! [`Group::step`] is called once per cycle, when the TPDOs of this SYNC are in or
//! late; what it commands is taken over by the drives at the next SYNC. Between
//! two steps the group takes orders ([`Group::order`]) and paths
//! ([`Group::announce`], [`Group::push`]).

mod advance;
mod axis;
mod drive_led;
mod exchange;
mod order;
mod watch;

pub use drive_led::SetPoint;
pub use exchange::{AxisCommand, AxisFeedback, AxisView, DriveSetting, Inputs, Wanted};
pub use order::Order;

use self::axis::{Axes, Axis, BY_DRIVE, HEARD, Lead, REACHED, Seen};
use super::mode::Mode;
use super::path::{Knot, Point};
use super::{GroupConfig, GroupEvent, GroupState, fixed, greater, next};
use crate::cia402::{Command, ControlWord, Goal};
use crate::time::{Duration, Instant};
use heapless::Deque;

/// Events kept until they are taken: enough for the busiest step, in which every
/// one of six axes fails.
const EVENTS: usize = 24;
/// Cycles before a mode is written: in every other of them the target of the new mode
/// is sent.
const TARGET_SETTLED: u32 = 4;
/// So many missed cycles the references are followed up in one step. After more the
/// group is stopped anyway.
const CAUGHT_UP_MAX: u32 = 8;

/// The cycle at which a path was to begin has passed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLate;

const fn bit(n: usize) -> Axes {
    1 << (n % Axes::BITS as usize)
}

/// `N` axes moved in step; see the module.
///
/// Until it is configured all of it is 0, so that it needs no room in an image. Small
/// fields stand first, where they are reached by short instructions.
#[repr(C)]
pub struct Group<const N: usize> {
    state: GroupState,
    /// Where all axes go together while enabling.
    stage: Goal,
    /// Nobody wants the axes enabled.
    unwanted: bool,
    /// Since the fault, the network has gone down, or an axis at fault is left
    /// out.
    network_was_down: bool,
    network_ready: bool,
    config: Option<&'static GroupConfig<N>>,
    /// Steps so far, and since the state was entered or the stage was set.
    count: u32,
    since: u32,
    /// Whose path is replaced by one that is announced, and from which step on.
    announced: Axes,
    start: u32,
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
    /// What was ordered since the last step; to enable: nothing.
    ordered: Order,
    /// Orders to stop so far.
    stops: u8,
    now: Instant,
    axes: [Axis; N],
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
        stops: 0,
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
        for (axis, limits) in self.axes.iter_mut().zip(&config.axes) {
            axis.set_ramps(ramp, ramp);
            axis.take_mode(limits.mode);
        }
    }

    /// Those of which all of `what` is seen.
    fn which(&self, what: Seen) -> Axes {
        self.matching(what, what)
    }

    /// Those of which, of `mask`, exactly `what` is seen.
    #[inline(never)]
    fn matching(&self, mask: Seen, what: Seen) -> Axes {
        let mut axes = 0;
        for axis in self.axes.iter().rev() {
            axes = axes << 1 | Axes::from(axis.seen & mask == what);
        }
        axes
    }

    /// All axes that are there.
    pub(super) const fn here(&self) -> Axes {
        (bit(N) - 1) & !self.absent
    }

    /// The state after the last step.
    pub const fn state(&self) -> GroupState {
        self.state
    }

    /// Steps so far; wraps.
    pub const fn count(&self) -> u32 {
        self.count
    }

    /// How often the release was taken back so far, by a stop, a quick stop or a
    /// disable, whatever the state was; wraps. What was released before is over.
    pub const fn stops(&self) -> u8 {
        self.stops
    }

    /// One axis, counted from 0.
    pub fn view(&self, axis: usize) -> Option<AxisView> {
        let bit = bit(axis);
        let axis = self.axes.get(axis)?;
        Some(AxisView {
            mode: axis.mode(),
            state: (axis.seen & HEARD != 0).then_some(axis.state),
            feedback: axis.feedback,
            reference: axis.head(),
            following_error: axis.error(),
            end: fixed::round(axis.path.end()),
            home: axis.home,
            absent: self.absent & bit != 0,
            faulted: self.faulted & bit != 0,
        })
    }

    pub(super) fn axis(&self, axis: usize) -> Option<&Axis> {
        self.axes.get(axis)
    }

    pub(super) fn axis_mut(&mut self, axis: usize) -> Option<&mut Axis> {
        self.axes.get_mut(axis)
    }

    /// Whether there are events to take.
    pub fn has_events(&self) -> bool {
        !self.events.queue.is_empty()
    }

    /// Puts an event to those of the group.
    pub fn report(&mut self, event: GroupEvent) {
        self.events.report(event);
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

    /// Whether it is released, and no order waits that may end that.
    const fn takes(&self) -> bool {
        matches!(
            (self.state, self.ordered),
            (GroupState::Moving, Order::Enable)
        )
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
        if left == 0 || left > FAR || !self.takes() || !fit {
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

    /// The steepest slopes of what follows, increments per cycle squared, for the
    /// ramps of the drive, which get room for the position loop.
    #[inline(never)]
    pub fn set_ramps(&mut self, axis: usize, up: f32, down: f32) {
        const PERCENT: f32 = 0.01;
        let (Some(config), Some(of)) = (self.config, self.axes.get_mut(axis)) else {
            return;
        };
        let Some(limits) = config.axes.get(axis) else {
            return;
        };
        let more = config.ramp_percent as f32 * PERCENT;
        let ramp = |slope: f32| {
            let slope = limits.scale.rpm_per_s(slope) * more;
            greater(slope, config.ramp_min as f32)
        };
        of.set_ramps(ramp(up), ramp(down));
    }

    /// A set-point of profile position mode, to be handed to the drive. `false`:
    /// the drive has not taken the last one yet, or the group is not released, or
    /// the axis is in another mode.
    pub fn ask(&mut self, axis: usize, set_point: &SetPoint) -> bool {
        let (bit, takes) = (bit(axis), self.takes());
        let Some(axis) = self.axes.get_mut(axis) else {
            return false;
        };
        let can = takes && axis.mode() == Mode::ProfilePosition && axis.led.is_taken();
        if can {
            axis.led.ask(set_point);
            if set_point.relative {
                axis.led.target = axis.led.target.wrapping_sub(axis.head());
            }
            // What comes next counts from there.
            axis.end_at(set_point.target);
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

    /// The next axis whose drive is to be written to, and what it has to show then.
    pub fn wanted(&self) -> Option<Wanted> {
        match self.state {
            GroupState::Moving => {}
            GroupState::ModeChange | GroupState::Enabling if self.since >= TARGET_SETTLED => {}
            _ => return None,
        }
        self.next_wanted()
    }

    fn next_wanted(&self) -> Option<Wanted> {
        let mut look = self.here();
        while let Some(axis) = next(&mut look) {
            if let Some((setting, value)) = self.axes.get(axis)?.setting_wanted() {
                return Some(Wanted {
                    axis,
                    setting,
                    value,
                });
            }
        }
        None
    }

    /// No drive is asked for a velocity any more.
    pub(super) fn forget_speeds(&mut self) {
        self.axes.iter_mut().for_each(Axis::forget_speed);
    }

    /// The drive of an axis shows what was wanted.
    pub fn confirm(&mut self, shown: &Wanted) {
        let Some(axis) = self.axes.get_mut(shown.axis) else {
            return;
        };
        match (shown.setting, axis.wanted) {
            (DriveSetting::Mode, Some(mode)) if shown.value == mode as u32 => {
                axis.wanted = None;
                axis.take_mode(mode);
                axis.hold_actual();
                self.set_ramps(shown.axis, 0.0, 0.0);
            }
            (DriveSetting::ProfileVelocity, _) => axis.show_speed(shown.value),
            _ => {}
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
        let passed = inputs.cycles();
        let us = config.cycle.as_micros().saturating_mul(passed);
        self.now += Duration::from_micros(us);
        self.since = self.since.saturating_add(passed);
        let mut cut = self.count_on();
        for _ in 1..passed.min(CAUGHT_UP_MAX) {
            for (n, axis) in self.axes.iter_mut().enumerate() {
                axis.go_on(self.count, cut & bit(n) != 0);
            }
            cut = self.count_on();
        }
        let axes = self.axes.iter_mut().zip(&config.axes).zip(feedback);
        for (n, ((axis, limits), feedback)) in axes.enumerate() {
            let cut = cut & bit(n) != 0;
            if let Some(state) = axis.hear(feedback, self.count, cut, limits, config) {
                let axis = n as u8;
                self.events.report(GroupEvent::AxisState { axis, state });
            }
        }
        self.watch(inputs, config);
        self.obey(inputs);
        self.advance(config);
        let (command, lead) = sent(self.state);
        // Quick stop leaves a drive that is braking by itself on its ramp and cannot
        // enable anything.
        let fault = lead == Some(Lead::Fault);
        let axes = self.axes.iter_mut().zip(&config.axes).zip(out);
        for (n, ((axis, limits), out)) in axes.enumerate() {
            let (mut led, mut word) = (Lead::Rest, ControlWord::new(command));
            if self.absent & bit(n) != 0 {
                word = ControlWord::new(Command::DisableVoltage);
            } else if fault && (self.excluded & bit(n) != 0 || axis.seen & BY_DRIVE != 0) {
                word = ControlWord::new(Command::QuickStop);
            } else if let Some(lead) = lead {
                led = lead;
            } else {
                led = Lead::Actual;
                word = if axis.feedback.fresh {
                    axis.machine.follow(self.now, axis.state)
                } else {
                    axis.machine.word()
                };
                axis.seen &= !REACHED;
                if axis.machine.reached() {
                    axis.seen |= REACHED;
                }
            }
            axis.command(self.count, word.0, led, limits, &config.tuning, out);
        }
    }

    /// Another cycle: those whose announced path begins in it.
    fn count_on(&mut self) -> Axes {
        self.count = self.count.wrapping_add(1);
        match self.start == self.count {
            true => core::mem::take(&mut self.announced),
            false => 0,
        }
    }
}

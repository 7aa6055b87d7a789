//! One axis inside a group: its bookkeeping from cycle to cycle.

use super::config::{AxisConfig, GroupConfig};
use super::{AxisCommand, AxisFeedback, FaultCause};
use crate::cia402::{self, Command, ControlWord, State, StatusWord};
use crate::motion::position_control::{PositionControl, Window};
use crate::motion::profile::Setpoint;
use crate::motion::reference::Reference;
use crate::motion::scale::Scale;
use crate::time::Instant;

/// Percent of the whole.
const HUNDRED: f32 = 100.0;

/// From the SYNC just passed to what the next command leads to.
const POINTS: usize = 4;

pub(super) struct Axis {
    /// Its place in the group.
    pub(super) n: u8,
    /// What its drive reported in this cycle.
    pub(super) feedback: AxisFeedback,
    pub(super) config: &'static AxisConfig,
    pub(super) scale: Scale,
    pub(super) machine: cia402::Axis,
    pub(super) reference: Reference,
    /// What it is at four moments, that of `t` at place `t` modulo 4.
    points: [Setpoint; POINTS],
    /// The last of these moments; far in the past: none is known.
    known: i32,
    /// Position that the program's targets count from.
    pub(super) home: i32,
    /// Last fresh statusword since the group began to enable.
    status: Option<StatusWord>,
    reported: Option<State>,
    /// Consecutive cycles without TPDO.
    pub(super) missing: u8,
    /// Left out: nothing is asked of it.
    pub(super) absent: bool,
    /// A fault of this axis has been reported.
    pub(super) faulted: bool,
    /// The drive itself has taken the axis out of the master's hands.
    pub(super) excluded: bool,
    /// That has been reported, or there was nothing to report.
    pub(super) coasting: bool,
    pub(super) arrived: bool,
    /// Consecutive cycles in position, or at standstill.
    settled: u8,
    control: PositionControl,
    velocity: i32,
    /// Target velocity when the stop after a fault began.
    ramp_from: i32,
    acceleration: u32,
    deceleration: u32,
}

impl Axis {
    pub(super) fn new<const N: usize>(
        n: u8,
        config: &'static AxisConfig,
        group: &'static GroupConfig<N>,
    ) -> Axis {
        let scale = Scale::new(config.increments_per_turn, group.cycle);
        Axis {
            n,
            feedback: AxisFeedback::default(),
            config,
            scale,
            machine: cia402::Axis::new(group.enable_timeout),
            reference: Reference::Hold(0),
            points: [Setpoint::at_rest(0); POINTS],
            known: i32::MIN,
            home: 0,
            status: None,
            reported: None,
            missing: 0,
            absent: false,
            faulted: false,
            excluded: false,
            coasting: false,
            arrived: false,
            settled: 0,
            control: PositionControl::new(scale, config.tuning),
            velocity: 0,
            ramp_from: 0,
            acceleration: group.ramp_min,
            deceleration: group.ramp_min,
        }
    }

    /// Forgets what was heard and what went wrong, before enabling.
    pub(super) fn restart(&mut self, absent: u32) {
        self.absent = self.is_in(absent);
        self.status = None;
        self.missing = 0;
        self.faulted = false;
        self.excluded = false;
        self.coasting = false;
        self.arrived = false;
        self.velocity = 0;
    }

    /// Whether a set of axes, bit n for axis n, holds it.
    pub(super) fn is_in(&self, axes: u32) -> bool {
        let bits = axes.checked_shr(self.n.into()).unwrap_or(0);
        bits & 1 != 0
    }

    /// Takes in this cycle's feedback; returns the state if it is another one
    /// than last reported.
    pub(super) fn hear(&mut self, feedback: &AxisFeedback) -> Option<State> {
        self.feedback = *feedback;
        if !feedback.fresh {
            self.missing = self.missing.saturating_add(1);
            return None;
        }
        self.missing = 0;
        let status = StatusWord(feedback.statusword);
        let last = self.status.replace(status);
        if last.is_some_and(|last| last.is_alike(status)) {
            return None;
        }
        let state = status.state();
        let changed = self.reported != Some(state);
        self.reported = Some(state);
        changed.then_some(state)
    }

    /// The state last heard since enabling began.
    pub(super) fn state(&self) -> Option<State> {
        self.status.map(StatusWord::state)
    }

    /// Works out the reference around `t`: all that follows looks there. One moment
    /// is new in each cycle.
    pub(super) fn look(&mut self, t: i32) {
        let last = t + 2;
        let first = match last.wrapping_sub(self.known) {
            0 => return,
            1 => last,
            _ => t - 1,
        };
        for t in first..=last {
            if let Some(point) = self.points.get_mut(t as usize % POINTS) {
                *point = self.reference.at(t);
            }
        }
        self.known = last;
    }

    /// The reference at a moment that was looked at.
    fn at(&self, t: i32) -> &Setpoint {
        let [first, ..] = &self.points;
        self.points.get(t as usize % POINTS).unwrap_or(first)
    }

    /// Reference minus actual position at the SYNC just passed.
    pub(super) fn error(&self, t: i32) -> i32 {
        self.at(t - 1).minus(self.feedback.position) as i32
    }

    /// Sets what to follow from the next SYNC on, and the drive's ramps for it.
    pub(super) fn follow<const N: usize>(&mut self, reference: Reference, group: &GroupConfig<N>) {
        let (up, down) = reference.accelerations();
        self.acceleration = self.ramp(self.scale.rpm_per_s(up), group);
        self.deceleration = self.ramp(self.scale.rpm_per_s(down), group);
        self.reference = reference;
        self.known = i32::MIN;
        self.settled = 0;
        self.arrived = false;
    }

    /// 6083h or 6084h for a reference with a slope of `rpm_per_s`.
    fn ramp<const N: usize>(&self, rpm_per_s: f32, group: &GroupConfig<N>) -> u32 {
        let with_headroom = rpm_per_s * (group.ramp_percent as f32 / HUNDRED);
        (with_headroom as u32).max(group.ramp_min)
    }

    /// The set-point at the next SYNC, from which another reference can go on.
    pub(super) fn next(&self, t: i32) -> Setpoint {
        self.reference.at(t)
    }

    /// Whether the reference had ended `cycles` before the SYNC just passed.
    pub(super) fn ended(&self, t: i32, cycles: u32) -> bool {
        u32::try_from(t - 1).is_ok_and(|t| t >= self.reference.duration().saturating_add(cycles))
    }

    /// Whether it has come to rest since its reference ended, `on_target` or
    /// wherever it is; then with its error. An error if that takes too long.
    pub(super) fn comes_to_rest<const N: usize>(
        &mut self,
        t: i32,
        on_target: bool,
        group: &GroupConfig<N>,
    ) -> Result<Option<i32>, FaultCause> {
        if !self.ended(t, 0) {
            return Ok(None);
        }
        let error = self.error(t);
        if self.settle(on_target.then_some(error), group) {
            return Ok(Some(error));
        }
        if self.ended(t, group.cycles(group.settle_timeout)) {
            return Err(FaultCause::NotArrived { error });
        }
        Ok(None)
    }

    /// Counts cycles at rest, within `error` if one is given, and says whether
    /// they are enough.
    pub(super) fn settle<const N: usize>(
        &mut self,
        error: Option<i32>,
        group: &GroupConfig<N>,
    ) -> bool {
        if self.feedback.fresh {
            let near = error.is_none_or(|e| e.unsigned_abs() <= self.config.in_position);
            let at_rest = self.feedback.velocity.unsigned_abs() <= group.standstill_rpm;
            self.settled = if near && at_rest {
                self.settled.saturating_add(1)
            } else {
                0
            };
        }
        self.settled >= group.settle_cycles
    }

    /// Begins the stop after a fault. Axes that their drives do not hold enabled
    /// are excluded; that is news only if they `were_enabled`.
    pub(super) fn begin_fault_stop(&mut self, were_enabled: bool) {
        self.ramp_from = self.velocity;
        self.settled = 0;
        if self.absent || !self.state().is_some_and(State::is_enabled) {
            self.excluded = true;
            self.coasting = self.absent || !were_enabled;
        }
    }

    /// Target velocity when the stop after a fault began.
    pub(super) fn speed_before_fault(&self) -> u32 {
        if self.excluded {
            0
        } else {
            self.ramp_from.unsigned_abs()
        }
    }

    /// Off: disable voltage, target 0.
    pub(super) fn command_off(&mut self) -> AxisCommand {
        self.velocity = 0;
        self.command(ControlWord::new(Command::DisableVoltage))
    }

    /// As the state machine says, target 0.
    pub(super) fn command_rest(&mut self, now: Instant) -> AxisCommand {
        self.velocity = 0;
        let word = self.machine.step(now, self.fresh_status());
        self.command(word)
    }

    /// Along the reference.
    pub(super) fn command_follow(&mut self, now: Instant, t: i32) -> AxisCommand {
        self.look(t);
        let window = Window {
            now: *self.at(t - 1),
            ahead: *self.at(t + 1),
            beyond: self.at(t + 2).velocity,
        };
        let position = self.feedback.fresh.then_some(self.feedback.position);
        self.velocity = self
            .control
            .step(&window, position, self.config.velocity_max);
        let word = self.machine.step(now, self.fresh_status());
        self.command(word)
    }

    /// On the ramp after a fault: `left` of `total` cycles remain at the end of
    /// the cycle commanded now.
    pub(super) fn command_fault_stop<const N: usize>(
        &mut self,
        left: u32,
        total: u32,
        group: &GroupConfig<N>,
    ) -> AxisCommand {
        if self.excluded {
            // Quick stop leaves a drive that is braking by itself on its ramp
            // and cannot enable anything.
            self.velocity = 0;
            return self.command(ControlWord::new(Command::QuickStop));
        }
        self.velocity = if total == 0 {
            0
        } else {
            (self.ramp_from as f32 * (left as f32 / total as f32)) as i32
        };
        if total > 0 {
            let slope = self.ramp_from.unsigned_abs() as f32 / total as f32;
            self.deceleration = self.ramp(self.scale.cycles(slope), group);
        }
        self.command(ControlWord::new(Command::EnableOperation))
    }

    fn fresh_status(&self) -> Option<StatusWord> {
        let AxisFeedback {
            fresh, statusword, ..
        } = self.feedback;
        fresh.then_some(StatusWord(statusword))
    }

    fn command(&self, word: ControlWord) -> AxisCommand {
        AxisCommand {
            controlword: word.0,
            velocity: self.velocity,
            acceleration: self.acceleration,
            deceleration: self.deceleration,
        }
    }
}

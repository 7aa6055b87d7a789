//! One axis of the group: what is commanded to its drive, cycle by cycle.

use super::AxisCommand;
use super::drive_led::DriveLed;
use crate::cia402::{self, Command, ControlWord, State, StatusWord};
use crate::motion::fixed;
use crate::motion::mode::Mode;
use crate::motion::path::{Knot, Path, Point};
use crate::motion::position_control::{PositionControl, Window};
use crate::motion::scale::Scale;
use crate::motion::{AxisConfig, AxisFeedback, FaultCause, GroupConfig};
use crate::time::Instant;

/// SYNCs that the path is ahead of the last sampled position: the next command
/// acts at the next SYNC and lasts to the one after it; the position loop looks
/// one further.
const AHEAD: usize = 3;

pub(super) struct Axis {
    /// Its place in the group.
    pub(super) n: u8,
    pub(super) config: &'static AxisConfig,
    pub(super) scale: Scale,
    /// What its drive reported in this cycle.
    pub(super) feedback: AxisFeedback,
    pub(super) machine: cia402::Axis,
    /// As confirmed in 6061h.
    pub(super) mode: Mode,
    /// The mode to change to.
    pub(super) wanted: Option<Mode>,
    pub(super) path: Path,
    /// The reference at the SYNC just passed, and at the next ones.
    points: [Point; AHEAD + 1],
    /// Position that targets count from.
    pub(super) home: i32,
    pub(super) led: DriveLed,
    control: PositionControl,
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
    /// Its part of the last path is done, and that was reported.
    pub(super) arrived: bool,
    /// Consecutive cycles in position, or at standstill.
    settled: u8,
    /// Cycles since the path was over.
    over: u32,
    output: AxisCommand,
}

impl Axis {
    pub(super) fn new<const N: usize>(
        n: u8,
        config: &'static AxisConfig,
        group: &'static GroupConfig<N>,
    ) -> Axis {
        let scale = Scale::new(config.increments_per_turn, group.cycle);
        let rest = Point::at_rest(0);
        Axis {
            n,
            config,
            scale,
            feedback: AxisFeedback::default(),
            machine: cia402::Axis::new(group.enable_timeout),
            mode: config.mode,
            wanted: None,
            path: Path::new(rest),
            points: [rest; AHEAD + 1],
            home: 0,
            led: DriveLed::new(),
            control: PositionControl::new(scale, config.tuning),
            status: None,
            reported: None,
            missing: 0,
            absent: false,
            faulted: false,
            excluded: false,
            coasting: false,
            arrived: true,
            settled: 0,
            over: 0,
            output: AxisCommand {
                acceleration: group.ramp_min,
                deceleration: group.ramp_min,
                ..AxisCommand::default()
            },
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
        self.arrived = true;
        self.led = DriveLed::new();
    }

    /// Whether a set of axes, bit n for axis n, holds it.
    pub(super) fn is_in(&self, axes: u32) -> bool {
        axes >> (self.n % u32::BITS as u8) & 1 != 0
    }

    /// Takes in this cycle's feedback and goes one cycle on; returns the state of
    /// the drive if it is another one than last reported.
    pub(super) fn hear(&mut self, feedback: &AxisFeedback, cut: bool) -> Option<State> {
        if cut {
            self.path.cut();
            self.settled = 0;
            self.over = 0;
        }
        let over = self.path.is_over();
        // At rest all points are the same.
        if !(over && self.ended()) {
            let head = self.path.advance();
            let [now, next, ahead, beyond] = &mut self.points;
            (*now, *next, *ahead, *beyond) = (*next, *ahead, *beyond, head);
        }
        self.over = if over && self.path.is_over() {
            self.over.saturating_add(1)
        } else {
            0
        };
        self.feedback = *feedback;
        if !feedback.fresh {
            self.missing = self.missing.saturating_add(1);
            return None;
        }
        self.missing = 0;
        let status = StatusWord(feedback.statusword);
        self.status = Some(status);
        let state = status.state();
        let changed = self.reported != Some(state);
        self.reported = Some(state);
        changed.then_some(state)
    }

    /// The state last heard since enabling began.
    pub(super) fn state(&self) -> Option<State> {
        self.status.map(StatusWord::state)
    }

    pub(super) fn fresh_status(&self) -> Option<StatusWord> {
        let AxisFeedback {
            fresh, statusword, ..
        } = self.feedback;
        fresh.then_some(StatusWord(statusword))
    }

    /// Reference minus actual position at the SYNC just passed.
    pub(super) fn error(&self) -> i32 {
        let [now, ..] = &self.points;
        let at = fixed::whole(self.feedback.position);
        (now.position.wrapping_sub(at) / fixed::whole(1)) as i32
    }

    /// The reference one cycle behind the command that goes out now: where it
    /// ends.
    pub(super) const fn ahead(&self) -> &Point {
        let [.., ahead, _] = &self.points;
        ahead
    }

    /// Where the path stands.
    pub(super) const fn head(&self) -> &Point {
        let [.., head] = &self.points;
        head
    }

    /// At rest where it is: the next release starts there. A torque rests at 0.
    pub(super) fn hold_actual(&mut self) {
        let position = match self.sent_mode() {
            Mode::CyclicTorque => 0,
            _ if self.feedback.fresh => self.feedback.position,
            _ => fixed::round(self.ahead().position),
        };
        let rest = Point::at_rest(position);
        self.points = [rest; AHEAD + 1];
        self.path.restart(&rest);
        self.settled = 0;
    }

    /// The drive's ramps for what follows, rpm/s, each with room for the position
    /// loop.
    pub(super) fn set_ramps<const N: usize>(&mut self, up: f32, down: f32, group: &GroupConfig<N>) {
        let ramp = |slope: f32| {
            const HUNDRED: f32 = 100.0;
            let wanted = slope * (group.ramp_percent as f32 / HUNDRED);
            (wanted as u32).max(group.ramp_min)
        };
        self.output.acceleration = ramp(up);
        self.output.deceleration = ramp(down);
    }

    /// Speed from which a stop begins, rpm: of the reference, after a fault of
    /// what was last commanded; of a torque, of the motor.
    pub(super) fn speed(&self, fault: bool) -> f32 {
        match self.mode {
            _ if self.excluded || self.absent || self.mode.is_led_by_drive() => 0.0,
            Mode::CyclicTorque => self.feedback.velocity as f32,
            mode if fault && mode.is_velocity() => self.output.target as f32,
            _ => self.scale.rpm(fixed::float(self.points[1].velocity)),
        }
    }

    /// Replaces the path by a ramp of so many cycles from the next SYNC on; `share`
    /// is one of them.
    pub(super) fn stop<const N: usize>(
        &mut self,
        cycles: u32,
        share: f32,
        speed: f32,
        fault: bool,
        group: &GroupConfig<N>,
    ) {
        self.settled = 0;
        self.over = 0;
        let [_, mut from, ..] = self.points;
        if cycles == 0 {
            from.velocity = 0;
        }
        if self.mode.has_position() {
            if fault {
                from.velocity = fixed::fixed(self.scale.velocity(speed));
            }
            let slope = self.scale.cycles(speed.abs() * share);
            self.set_ramps(slope, slope, group);
            self.path.brake(&from, cycles, share);
        } else {
            self.path.restart(&from);
            let end = Knot {
                cycles,
                ..Knot::default()
            };
            self.path.push(end, false);
        }
        let [.., ahead, beyond] = &mut self.points;
        *ahead = self.path.advance();
        *beyond = self.path.advance();
    }

    /// Begins the stop after a fault. Axes that their drives do not hold enabled
    /// are excluded; that is news only if they `were_enabled`.
    pub(super) fn begin_fault_stop(&mut self, were_enabled: bool) {
        self.settled = 0;
        if self.absent || !self.state().is_some_and(State::is_enabled) {
            self.excluded = true;
            self.coasting = self.absent || !were_enabled;
        }
    }

    /// Whether the path is over and the SYNC just passed lies behind its end.
    pub(super) fn ended(&self) -> bool {
        self.over >= AHEAD as u32
    }

    /// Whether it has come to rest since its path ended, `on_target` or wherever
    /// it is; then with its error. An error if that takes too long.
    pub(super) fn comes_to_rest<const N: usize>(
        &mut self,
        on_target: bool,
        group: &GroupConfig<N>,
    ) -> Result<Option<i32>, FaultCause> {
        if self.mode.is_led_by_drive() && on_target {
            let limit = group.cycles(group.enable_timeout);
            return self.led.outcome(self.mode, limit);
        }
        if !self.ended() {
            return Ok(None);
        }
        let error = self.error();
        let near = on_target && self.mode.has_position();
        if self.settle(near.then_some(error), group) {
            return Ok(Some(if near { error } else { 0 }));
        }
        if self.over
            > group
                .cycles(group.settle_timeout)
                .saturating_add(AHEAD as u32)
        {
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

    /// The mode whose RPDO is sent: the new one while the mode is being changed.
    fn sent_mode(&self) -> Mode {
        self.wanted.unwrap_or(self.mode)
    }

    /// A command, and target 0, or the reference where that is a position.
    pub(super) fn command(&mut self, command: Command) -> AxisCommand {
        self.rest_with(ControlWord::new(command))
    }

    /// As the state machine says, at rest.
    pub(super) fn rest(&mut self, now: Instant) -> AxisCommand {
        let word = self.machine.step(now, self.fresh_status());
        self.rest_with(word)
    }

    fn rest_with(&mut self, word: ControlWord) -> AxisCommand {
        let mode = self.sent_mode();
        self.output.mode = mode;
        self.output.controlword = word.0;
        self.output.target = if mode.rpdo() == Mode::CyclicPosition.rpdo() {
            fixed::round(self.ahead().position)
        } else {
            0
        };
        self.output
    }

    /// Along the reference; after a fault without the position loop. `halt`: the
    /// drive leads the motion and shall end it.
    pub(super) fn follow(&mut self, now: Instant, fault: bool, halt: bool) -> AxisCommand {
        let word = if fault {
            ControlWord::new(Command::EnableOperation)
        } else {
            self.machine.step(now, self.fresh_status())
        };
        let mode = self.mode;
        self.output.mode = mode;
        self.output.controlword = word.0;
        self.output.target = match mode {
            Mode::ProfileVelocity | Mode::CyclicVelocity => self.velocity(fault),
            Mode::CyclicPosition => fixed::round(self.ahead().position),
            Mode::CyclicTorque => {
                let most = i32::from(self.config.torque_max);
                fixed::round(self.ahead().position).min(most).max(-most)
            }
            Mode::ProfilePosition | Mode::Homing => {
                self.output.controlword = word.0 | self.led.bits(halt);
                self.led.target
            }
        };
        self.output
    }

    /// The velocity that leads to where the reference is ahead.
    fn velocity(&mut self, fault: bool) -> i32 {
        let [now, _, ahead, beyond] = &self.points;
        if fault {
            return self.scale.rpm(fixed::float(ahead.velocity)) as i32;
        }
        let window = Window {
            now: now.setpoint(),
            ahead: ahead.setpoint(),
            beyond: fixed::float(beyond.velocity),
        };
        let position = self.feedback.fresh.then_some(self.feedback.position);
        self.control
            .step(&window, position, self.config.velocity_max)
    }
}

/// Whole cycles to come from `rpm` to rest.
pub(super) fn stop_cycles<const N: usize>(rpm: f32, group: &GroupConfig<N>) -> u32 {
    const SECOND_US: f32 = 1e6;
    let per_cycle = group.stop_deceleration as f32 * (group.cycle.as_micros() as f32 / SECOND_US);
    fixed::ceil(rpm.abs() / per_cycle)
}

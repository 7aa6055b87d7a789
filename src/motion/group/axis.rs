//! One axis of the group: what is commanded to its drive, cycle by cycle.

use super::drive_led::DriveLed;
use super::{AxisCommand, DriveSetting};
use crate::cia402::{self, Command, ControlWord, State, StatusWord};
use crate::motion::fixed;
use crate::motion::mode::Mode;
use crate::motion::path::{Path, Point, Sample};
use crate::motion::position_control::{PositionControl, Tuning, Window};
use crate::motion::{AxisConfig, AxisFeedback, GroupConfig};

/// SYNCs that the path is ahead of the last sampled position: the next command
/// acts at the next SYNC and lasts to the one after it; the position loop looks
/// one further.
const AHEAD: u32 = 3;
/// Where in the ring of samples those of the next SYNCs are, from now on.
const NEXT: u32 = 1;
const END: u32 = 2;
const RING: usize = 4;
/// Cycles of the shortest stop: it ends behind what it is looked ahead.
pub(super) const STOP_MIN: u32 = AHEAD;

/// A set of axes: bit n for axis n.
pub(super) type Axes = u32;

/// What a step sees of an axis, as bits.
pub(super) type Seen = u16;

/// Its TPDOs have come.
pub(super) const FRESH: Seen = 1 << 0;
/// And show no more speed than at rest.
pub(super) const SLOW: Seen = 1 << 1;
/// And that drive, reference and position are as they should be in a motion that
/// the drive does not lead.
pub(super) const SOUND: Seen = 1 << 2;
/// And that its drive reports a fault.
pub(super) const FAILED: Seen = 1 << 3;
/// Its TPDOs have been missing for too long.
pub(super) const SILENT: Seen = 1 << 4;
/// Its path is over, and the SYNC just passed lies behind the end.
pub(super) const ENDED: Seen = 1 << 5;
/// And it has come to rest.
pub(super) const AT_REST: Seen = 1 << 6;
/// And that on its target.
pub(super) const PLACED: Seen = 1 << 7;
/// A statusword has come since the group began to enable ...
pub(super) const HEARD: Seen = 1 << 8;
/// ... and the last showed operation enabled.
pub(super) const ENABLED: Seen = 1 << 9;
/// Its drive leads the motion, by the mode that it is in.
pub(super) const BY_DRIVE: Seen = 1 << 10;
/// Its reference is a position.
pub(super) const BY_POSITION: Seen = 1 << 11;
/// It has reached the stage of enabling.
pub(super) const REACHED: Seen = 1 << 12;
/// What lasts longer than a step.
const LASTING: Seen = HEARD | ENABLED | BY_DRIVE | BY_POSITION | REACHED;
/// What is over when the group enters a state.
pub(super) const PASSING: Seen = ENDED | AT_REST | PLACED;

/// How a state of the group leads an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lead {
    /// It stays where it is.
    Rest,
    /// It is not held there yet.
    Actual,
    /// It follows its reference.
    Follow,
    /// It is to end the motion that its drive leads, or follows its reference.
    Halt,
    /// It follows its reference without the position loop.
    Fault,
}

/// All of it is 0 before the group is configured. Small fields stand first, where
/// they are reached by short instructions.
#[repr(C)]
pub(in crate::motion) struct Axis {
    pub(super) seen: Seen,
    /// Consecutive cycles at standstill since the path was over, and of those in
    /// position.
    rested: u8,
    placed: u8,
    /// Consecutive cycles without TPDO.
    pub(super) missing: u8,
    /// As confirmed in 6061h; none before the group is configured.
    mode: Option<Mode>,
    /// The mode to change to.
    pub(super) wanted: Option<Mode>,
    /// Last fresh statusword, and its state.
    pub(super) state: State,
    status: Option<StatusWord>,
    /// The step that it counts from.
    count: u32,
    /// Cycles since the path was over.
    over: u32,
    /// Reference minus position at the SYNC just passed, increments.
    error: f32,
    /// Position that targets count from.
    pub(in crate::motion) home: i32,
    /// What was commanded last.
    target: i32,
    /// 6083h and 6084h, rpm/s, and since which step they are these for a set-point.
    up: u32,
    down: u32,
    ramped: u32,
    /// 6081h, rpm: as its drive has shown it, and as it is to be; 0: unknown.
    speed: u32,
    speed_wanted: u32,
    control: PositionControl,
    /// What its drive reported in this cycle.
    pub(in crate::motion) feedback: AxisFeedback,
    pub(super) led: DriveLed,
    /// The reference at the SYNC just passed, and at the next ones: a ring, in
    /// which that of the step `n` is at `n` modulo its length.
    samples: [Sample; RING],
    pub(in crate::motion) path: Path,
    pub(super) machine: cia402::Axis,
}

impl Axis {
    pub(super) const ZERO: Axis = Axis {
        feedback: AxisFeedback::NONE,
        machine: cia402::Axis::new(),
        seen: 0,
        mode: None,
        wanted: None,
        path: Path::ZERO,
        samples: [Sample::at_rest(0); RING],
        count: 0,
        error: 0.0,
        home: 0,
        led: DriveLed::new(),
        control: PositionControl::new(),
        status: None,
        state: State::NotReadyToSwitchOn,
        missing: 0,
        rested: 0,
        placed: 0,
        over: 0,
        target: 0,
        up: 0,
        down: 0,
        ramped: 0,
        speed: 0,
        speed_wanted: 0,
    };

    /// Forgets what was asked of the drive, before enabling. A change of its mode that
    /// something came in between of is finished then; and in which mode it is can be taken
    /// for granted only of that which its configuration gives it: it may have booted.
    pub(super) fn restart(&mut self, configured: Mode) {
        if self.mode != Some(configured) {
            self.wanted = self.wanted.or(self.mode);
        }
        self.missing = 0;
        self.seen &= !(HEARD | ENABLED);
        self.led = DriveLed::new();
        (self.speed, self.speed_wanted) = (0, 0);
    }

    pub(in crate::motion) fn mode(&self) -> Mode {
        self.mode.unwrap_or_default()
    }

    /// Takes over a mode.
    pub(super) fn take_mode(&mut self, mode: Mode) {
        self.mode = Some(mode);
        self.seen &= !(BY_DRIVE | BY_POSITION);
        if mode.is_led_by_drive() {
            self.seen |= BY_DRIVE;
        } else if mode.has_position() {
            self.seen |= BY_POSITION;
        }
    }

    /// Goes one cycle on: to that of the number `count`, in which an announced path
    /// begins if it is `cut`.
    #[inline]
    pub(super) fn go_on(&mut self, count: u32, cut: bool) {
        self.count = count;
        if cut {
            self.path.cut();
            self.over = 0;
        }
        // At rest all samples are the same.
        let over = self.path.is_over();
        if !over || self.over < AHEAD {
            self.look(AHEAD);
        }
        self.over = if over { self.over.saturating_add(1) } else { 0 };
    }

    /// Takes in this cycle's feedback and goes one cycle on; returns the state of
    /// the drive if it is another one than last reported.
    #[inline(never)]
    pub(super) fn hear<const N: usize>(
        &mut self,
        feedback: &AxisFeedback,
        count: u32,
        cut: bool,
        limits: &AxisConfig,
        config: &GroupConfig<N>,
    ) -> Option<State> {
        self.go_on(count, cut);
        let mut seen = self.seen & LASTING;
        if self.over >= AHEAD {
            seen |= ENDED;
        } else {
            (self.rested, self.placed) = (0, 0);
        }
        self.feedback = *feedback;
        let mut news = None;
        if feedback.fresh {
            seen = seen & !ENABLED | FRESH | HEARD;
            self.missing = 0;
            let status = StatusWord(feedback.statusword);
            let at = fixed::whole(feedback.position);
            self.error = fixed::float(self.sample(0).position.wrapping_sub(at));
            let error = self.error().unsigned_abs();
            if status.is_fault() {
                seen |= FAILED;
            }
            if status.is_enabled() {
                seen |= ENABLED;
                let near = error <= limits.following_error_max && seen & BY_DRIVE == 0;
                if near && !status.mode_bit_13() && !self.path.is_dry() {
                    seen |= SOUND;
                }
            }
            let slow = feedback.velocity.unsigned_abs() <= config.standstill_rpm;
            if slow {
                seen |= SLOW;
            }
            if seen & ENDED != 0 {
                count_if(&mut self.rested, slow);
                count_if(&mut self.placed, slow && error <= limits.in_position);
            }
            let before = self.status.replace(status);
            if !before.is_some_and(|last| last.shows_as(status)) {
                let last = core::mem::replace(&mut self.state, status.state());
                news = (before.is_none() || last != self.state).then_some(self.state);
            }
        } else {
            self.missing = self.missing.saturating_add(1);
            if self.missing >= config.missing_tpdo_max {
                seen |= SILENT;
            }
        }
        if self.rested >= config.settle_cycles {
            seen |= AT_REST;
        }
        if self.placed >= config.settle_cycles {
            seen |= PLACED;
        }
        self.seen = seen;
        news
    }

    /// The next point of the path, as that of so many cycles ahead.
    fn look(&mut self, ahead: u32) {
        self.path.go_on();
        let sample = self.path.sample();
        if let Some(place) = self.samples.get_mut(place(self.count, ahead)) {
            *place = sample;
        }
    }

    fn sample(&self, ahead: u32) -> &Sample {
        const REST: &Sample = &Sample::at_rest(0);
        self.samples.get(place(self.count, ahead)).unwrap_or(REST)
    }

    pub(super) fn fresh_status(&self) -> Option<StatusWord> {
        let AxisFeedback {
            fresh, statusword, ..
        } = self.feedback;
        fresh.then_some(StatusWord(statusword))
    }

    /// Reference minus actual position when it was last heard, increments.
    pub(in crate::motion) fn error(&self) -> i32 {
        self.error as i32
    }

    /// Where the path stands.
    pub(in crate::motion) fn head(&self) -> i32 {
        fixed::round(self.path.position())
    }

    /// At rest where it is: the next release starts there. A torque rests at 0; while
    /// the mode is being changed the path is one of positions, which no path of a
    /// torque leads to.
    #[inline(never)]
    pub(super) fn hold_actual(&mut self) {
        let changes = self.wanted.is_some();
        let position = match self.mode() {
            Mode::CyclicTorque if !changes => 0,
            _ if self.feedback.fresh || changes => self.feedback.position,
            _ => fixed::round(self.sample(END).position),
        };
        let holds = self.mode() == Mode::ProfilePosition;
        // From what it holds already the next one may count.
        let position = self.led.held().filter(|_| holds).unwrap_or(position);
        self.end_at(position);
        self.led.rest(holds.then_some(position));
    }

    /// Whether its drive can be given another set-point.
    pub(in crate::motion) fn takes_set_points(&self) -> bool {
        self.led.is_taken()
    }

    /// Its drive leads it to `position` by itself.
    pub(super) fn end_at(&mut self, position: i32) {
        self.path.restart(&Point::at_rest(position));
        self.samples = [Sample::at_rest(position); RING];
        self.over = 0;
    }

    /// The drive's ramps for what follows, rpm/s.
    pub(super) fn set_ramps(&mut self, up: f32, down: f32) {
        self.up = up as u32;
        self.down = down as u32;
    }

    /// What its next set-point needs: velocity and ramps, rpm and rpm/s. Whether its drive
    /// has it: RPDO2 takes so many `cycles`, 6081h is asked for.
    pub(in crate::motion) fn prepare(&mut self, [speed, up, down]: [u32; 3], cycles: u32) -> bool {
        if (self.up, self.down) != (up, down) {
            (self.up, self.down, self.ramped) = (up, down, self.count);
        }
        self.speed_wanted = speed;
        if self.speed != speed {
            // It may be written from now on.
            self.speed = 0;
            return false;
        }
        self.count.wrapping_sub(self.ramped) > cycles
    }

    /// Its drive shows this in 6081h.
    pub(super) fn show_speed(&mut self, rpm: u32) {
        if self.speed_wanted == rpm {
            self.speed = rpm;
        }
    }

    /// Nothing is asked for any more.
    pub(super) fn forget_speed(&mut self) {
        self.speed_wanted = self.speed;
    }

    /// What its drive is to show, and does not yet.
    pub(super) fn setting_wanted(&self) -> Option<(DriveSetting, u32)> {
        let rpm = self.speed_wanted;
        match self.wanted {
            Some(mode) => Some((DriveSetting::Mode, mode as u32)),
            None if rpm != self.speed => Some((DriveSetting::ProfileVelocity, rpm)),
            None => None,
        }
    }

    /// Speed from which a stop begins, rpm: of the reference, after a fault of
    /// what was last commanded; of a torque, of the motor.
    #[inline(never)]
    pub(super) fn speed(&self, fault: bool, config: &AxisConfig) -> f32 {
        match self.mode() {
            mode if mode.is_led_by_drive() => 0.0,
            Mode::CyclicTorque => self.feedback.velocity as f32,
            mode if fault && mode.is_velocity() => self.target as f32,
            _ => config.scale.rpm(self.sample(NEXT).velocity),
        }
    }

    /// Replaces the path by a ramp from `speed` in so many cycles from the next SYNC
    /// on, at least [`STOP_MIN`]. The slope of it in increments per cycle squared.
    #[inline(never)]
    pub(super) fn stop(&mut self, cycles: u32, speed: f32, config: &AxisConfig) -> f32 {
        self.over = 0;
        if self.seen & BY_DRIVE != 0 || self.wanted.is_some() {
            // Its path stands where it is.
            self.led.stop();
            return 0.0;
        }
        let position = self.sample(NEXT).position;
        let mut velocity = config.scale.velocity(speed);
        if self.mode() == Mode::CyclicTorque {
            // So that it ends at 0.
            const TWICE: f32 = -2.0;
            velocity = TWICE * fixed::float(position) / cycles as f32;
        }
        self.path.brake(position, velocity, cycles);
        let slope = velocity / cycles as f32;
        // All axes stop in one step: this is shorter than to look.
        velocity -= slope;
        let position = self.path.glide();
        self.put(END, position, velocity, -slope);
        let position = self.path.glide();
        self.put(AHEAD, position, velocity - slope, -slope);
        slope.abs()
    }

    #[inline(always)]
    fn put(&mut self, ahead: u32, position: i64, velocity: f32, acceleration: f32) {
        if let Some(place) = self.samples.get_mut(place(self.count, ahead)) {
            *place = Sample {
                position,
                velocity,
                acceleration,
            };
        }
    }

    /// How long it has waited to come to rest since its path ended, in cycles.
    pub(super) fn waited(&self) -> u32 {
        self.over.saturating_sub(AHEAD)
    }

    /// The mode whose RPDO is sent. While the mode is being changed nobody knows in
    /// which the drive is, and in both it may want a target every other cycle at least
    /// (60C2h): then the RPDOs of both go by turns.
    fn sent_mode(&self, count: u32) -> Mode {
        let turn = count & 1 == 0;
        self.wanted.filter(|_| turn).unwrap_or(self.mode())
    }

    /// Fills in what is sent in cycle `count` with the controlword `word`.
    #[inline(never)]
    pub(super) fn command(
        &mut self,
        count: u32,
        word: u16,
        lead: Lead,
        config: &AxisConfig,
        tuning: &Tuning,
        out: &mut AxisCommand,
    ) {
        let mode = self.sent_mode(count);
        let end = match lead {
            Lead::Actual if self.feedback.fresh => self.feedback.position,
            Lead::Actual => self.target,
            _ => fixed::round(self.sample(END).position),
        };
        let rests = matches!(lead, Lead::Rest | Lead::Actual) || self.wanted.is_some();
        out.mode = mode;
        out.controlword = word;
        // While the mode changes, bit 4 may begin something in the other one.
        let led = lead != Lead::Actual
            && self.wanted.is_none()
            && ControlWord(word).gives(Command::EnableOperation);
        self.target = match mode {
            Mode::ProfilePosition | Mode::Homing if led => {
                let halt = lead == Lead::Halt;
                let (begun, target) = match self.led.begun() {
                    Some(begun) => begun,
                    None if mode == Mode::Homing => (0, 0),
                    None => (0, end),
                };
                out.controlword = ControlWord(word | begun).with_halt(halt).0;
                target
            }
            Mode::CyclicPosition | Mode::ProfilePosition => end,
            _ if rests => 0,
            Mode::CyclicTorque => {
                let most = i32::from(config.torque_max);
                end.min(most).max(-most)
            }
            _ if lead == Lead::Fault => config.scale.rpm(self.sample(END).velocity) as i32,
            _ => {
                // Not by `sample`: the loop is another part of the axis.
                let at = |ahead: u32| self.samples.get(place(self.count, ahead));
                let (Some(now), Some(ahead), Some(beyond)) = (at(0), at(END), at(AHEAD)) else {
                    return;
                };
                let window = Window {
                    now,
                    ahead,
                    beyond: beyond.velocity,
                    error: self.feedback.fresh.then_some(self.error),
                };
                self.control
                    .step(&window, tuning, config.scale, config.velocity_max)
            }
        };
        out.target = self.target;
        out.acceleration = self.up;
        out.deceleration = self.down;
    }
}

/// Counts consecutive cycles in which something holds.
fn count_if(cycles: &mut u8, holds: bool) {
    *cycles = if holds { cycles.saturating_add(1) } else { 0 };
}

/// Where in the ring the sample of so many steps after `count` is.
const fn place(count: u32, ahead: u32) -> usize {
    count.wrapping_add(ahead) as usize % RING
}

//! One axis of the group: what is commanded to its drive, cycle by cycle.

use super::AxisCommand;
use super::drive_led::DriveLed;
use crate::cia402::{self, State, StatusWord};
use crate::motion::fixed;
use crate::motion::mode::Mode;
use crate::motion::path::{Knot, Path, Point, Sample};
use crate::motion::position_control::{PositionControl, Tuning, Window};
use crate::motion::{AxisConfig, AxisFeedback};

/// SYNCs that the path is ahead of the last sampled position: the next command
/// acts at the next SYNC and lasts to the one after it; the position loop looks
/// one further.
const AHEAD: u32 = 3;
/// Where in the ring of samples those of the next SYNCs are, from now on.
const NEXT: u32 = 1;
const END: u32 = 2;
const RING: usize = 4;

/// How a state of the group leads an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lead {
    /// It stays where it is.
    Rest,
    /// It follows its reference.
    Follow,
    /// It is to end the motion that its drive leads, or follows its reference.
    Halt,
    /// It follows its reference without the position loop.
    Fault,
}

/// All of it is 0 before the group is configured.
pub(super) struct Axis {
    /// What its drive reported in this cycle.
    pub(super) feedback: AxisFeedback,
    pub(super) machine: cia402::Axis,
    /// As confirmed in 6061h, if it is another one than configured.
    pub(super) changed: Option<Mode>,
    /// The mode to change to.
    pub(super) wanted: Option<Mode>,
    pub(super) path: Path,
    /// The reference at the SYNC just passed, and at the next ones: a ring, in
    /// which that of the step `n` is at `n` modulo its length.
    samples: [Sample; RING],
    /// The step that it counts from.
    count: u32,
    /// Reference minus position at the SYNC just passed, increments.
    error: f32,
    /// Position that targets count from.
    pub(super) home: i32,
    pub(super) led: DriveLed,
    control: PositionControl,
    /// Last fresh statusword since the group began to enable.
    pub(super) status: Option<StatusWord>,
    reported: Option<StatusWord>,
    /// Consecutive cycles without TPDO.
    pub(super) missing: u8,
    /// Consecutive cycles in position, or at standstill.
    pub(super) settled: u8,
    /// Cycles since the path was over.
    pub(super) over: u32,
    /// What was commanded last.
    target: i32,
    /// 6083h and 6084h, rpm/s.
    up: u32,
    down: u32,
}

impl Axis {
    pub(super) const ZERO: Axis = Axis {
        feedback: AxisFeedback {
            statusword: 0,
            position: 0,
            velocity: 0,
            torque: 0,
            fresh: false,
        },
        machine: cia402::Axis::new(),
        changed: None,
        wanted: None,
        path: Path::ZERO,
        samples: [Sample::at_rest(0); RING],
        count: 0,
        error: 0.0,
        home: 0,
        led: DriveLed::new(),
        control: PositionControl::new(),
        status: None,
        reported: None,
        missing: 0,
        settled: 0,
        over: 0,
        target: 0,
        up: 0,
        down: 0,
    };

    /// Forgets what was heard, before enabling.
    pub(super) fn restart(&mut self) {
        self.status = None;
        self.missing = 0;
        self.led = DriveLed::new();
    }

    pub(super) fn mode(&self, config: &AxisConfig) -> Mode {
        self.changed.unwrap_or(config.mode)
    }

    /// Takes in this cycle's feedback and goes one cycle on; returns the state of
    /// the drive if it is another one than last reported.
    #[inline(never)]
    pub(super) fn hear(&mut self, feedback: &AxisFeedback, count: u32, cut: bool) -> Option<State> {
        self.count = count;
        if cut {
            self.path.cut();
            self.settled = 0;
            self.over = 0;
        }
        // At rest all samples are the same.
        let over = self.path.is_over();
        if !(over && self.ended()) {
            self.go_on(AHEAD);
        }
        self.over = if over { self.over.saturating_add(1) } else { 0 };
        self.feedback = *feedback;
        if !feedback.fresh {
            self.missing = self.missing.saturating_add(1);
            return None;
        }
        self.missing = 0;
        let at = fixed::whole(feedback.position);
        self.error = fixed::float(self.sample(0).position.wrapping_sub(at));
        let status = StatusWord(feedback.statusword);
        self.status = Some(status);
        if self.reported.is_some_and(|last| last.shows_as(status)) {
            return None;
        }
        let before = self.reported.replace(status).map(StatusWord::state);
        let state = status.state();
        (before != Some(state)).then_some(state)
    }

    /// The next point of the path, as that of so many cycles ahead.
    fn go_on(&mut self, ahead: u32) {
        self.path.go_on();
        let sample = self.path.sample();
        let place = self.count.wrapping_add(ahead) as usize % RING;
        if let Some(place) = self.samples.get_mut(place) {
            *place = sample;
        }
    }

    fn sample(&self, ahead: u32) -> &Sample {
        let place = self.count.wrapping_add(ahead) as usize % RING;
        const REST: &Sample = &Sample::at_rest(0);
        self.samples.get(place).unwrap_or(REST)
    }

    /// The state last heard since enabling began.
    pub(super) fn state(&self) -> Option<State> {
        self.status.map(StatusWord::state)
    }

    /// Whether that was operation enabled.
    pub(super) fn is_enabled(&self) -> bool {
        self.status.is_some_and(StatusWord::is_enabled)
    }

    pub(super) fn fresh_status(&self) -> Option<StatusWord> {
        let AxisFeedback {
            fresh, statusword, ..
        } = self.feedback;
        fresh.then_some(StatusWord(statusword))
    }

    /// Reference minus actual position when it was last heard, increments.
    pub(super) fn error(&self) -> i32 {
        self.error as i32
    }

    /// Where the path stands.
    pub(super) fn head(&self) -> i32 {
        fixed::round(self.path.position())
    }

    /// At rest where it is: the next release starts there. A torque rests at 0.
    #[inline(never)]
    pub(super) fn hold_actual(&mut self, config: &AxisConfig) {
        let position = match self.sent_mode(config) {
            Mode::CyclicTorque => 0,
            _ if self.feedback.fresh => self.feedback.position,
            _ => fixed::round(self.sample(END).position),
        };
        self.samples = [Sample::at_rest(position); RING];
        self.path.restart(&Point::at_rest(position));
        self.settled = 0;
    }

    /// The drive's ramps for what follows, rpm/s.
    pub(super) fn set_ramps(&mut self, up: f32, down: f32) {
        self.up = up as u32;
        self.down = down as u32;
    }

    /// Speed from which a stop begins, rpm: of the reference, after a fault of
    /// what was last commanded; of a torque, of the motor.
    pub(super) fn speed(&self, fault: bool, config: &AxisConfig) -> f32 {
        match self.mode(config) {
            mode if mode.is_led_by_drive() => 0.0,
            Mode::CyclicTorque => self.feedback.velocity as f32,
            mode if fault && mode.is_velocity() => self.target as f32,
            _ => config.scale.rpm(self.sample(NEXT).velocity),
        }
    }

    /// Replaces the path by a ramp from `speed` in so many cycles from the next SYNC
    /// on. The slope of it in rpm/s.
    #[inline(never)]
    pub(super) fn stop(&mut self, cycles: u32, speed: f32, config: &AxisConfig) -> f32 {
        self.settled = 0;
        self.over = 0;
        let from = *self.sample(NEXT);
        let mut at = Point {
            position: from.position,
            ..Point::default()
        };
        let mut end = Knot {
            cycles,
            ..Knot::default()
        };
        let mut slope = 0.0;
        if self.mode(config) == Mode::CyclicTorque {
            at.velocity = fixed::fixed(from.velocity);
        } else {
            at.velocity = fixed::fixed(config.scale.velocity(speed));
            let way = (at.velocity >> 1).wrapping_mul(i64::from(cycles));
            end.position = at.position.wrapping_add(way);
            slope = config.scale.cycles(speed.abs() / cycles as f32);
        }
        self.path.restart(&at);
        self.path.push(&end, false);
        self.go_on(END);
        self.go_on(AHEAD);
        slope
    }

    /// Whether the path is over and the SYNC just passed lies behind its end.
    pub(super) fn ended(&self) -> bool {
        self.over >= AHEAD
    }

    /// How long it has waited to come to rest since its path ended, in cycles.
    pub(super) fn waited(&self) -> u32 {
        self.over.saturating_sub(AHEAD)
    }

    /// Counts cycles at rest, not farther than `near` from the reference, and says
    /// whether they are `enough`.
    #[inline(never)]
    pub(super) fn settle(&mut self, near: u32, slow: u32, enough: u8) -> bool {
        if self.feedback.fresh {
            let still = self.error().unsigned_abs() <= near
                && self.feedback.velocity.unsigned_abs() <= slow;
            self.settled = if still {
                self.settled.saturating_add(1)
            } else {
                0
            };
        }
        self.settled >= enough
    }

    /// The mode whose RPDO is sent: the new one while the mode is being changed.
    fn sent_mode(&self, config: &AxisConfig) -> Mode {
        self.wanted.unwrap_or(self.mode(config))
    }

    /// Fills in what is sent with the controlword `word`.
    #[inline(never)]
    pub(super) fn command(
        &mut self,
        word: u16,
        lead: Lead,
        config: &AxisConfig,
        tuning: &Tuning,
        out: &mut AxisCommand,
    ) {
        let mode = self.sent_mode(config);
        let end = fixed::round(self.sample(END).position);
        out.mode = mode;
        out.controlword = word;
        self.target = match mode {
            Mode::ProfilePosition | Mode::Homing if lead != Lead::Rest => {
                out.controlword |= self.led.bits(lead == Lead::Halt);
                self.led.target
            }
            Mode::CyclicPosition | Mode::ProfilePosition => end,
            _ if lead == Lead::Rest => 0,
            Mode::CyclicTorque => {
                let most = i32::from(config.torque_max);
                end.min(most).max(-most)
            }
            _ if lead == Lead::Fault => config.scale.rpm(self.sample(END).velocity) as i32,
            _ => {
                // Not by `sample`: the loop is another part of the axis.
                let at = |ahead: u32| self.count.wrapping_add(ahead) as usize % RING;
                let [now, ahead, beyond] = [0, END, AHEAD].map(|ahead| self.samples.get(at(ahead)));
                let (Some(now), Some(ahead), Some(beyond)) = (now, ahead, beyond) else {
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

//! One axis: state machine, mode of operation, velocity loop and motor.

use super::cia402::{Machine, Options, Power, Ramp, State};
use super::dictionary::Dictionary;
use super::errors::Reaction;
use super::modes::{Cycle, Demand, FOLLOWING_ERROR, INTERNAL_LIMIT, Limits, Mode, Modes};
use super::plant::PlantState;
use super::ramp::{self, Slopes};
use super::servo::{Follow, Servo, Standstill};
use super::{errors, position, supervision};

/// Bit 7 of the statusword.
const WARNING: u16 = 1 << 7;
/// Bit 4 of the statusword.
const VOLTAGE_ENABLED: u16 = 1 << 4;
/// Bit 9 of the statusword.
const REMOTE: u16 = 1 << 9;
/// Bit 15 of the statusword: referenced to home.
const REFERENCED: u16 = 1 << 15;

/// The axis.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    machine: Machine,
    servo: Servo,
    modes: Modes,
    mode: Mode,
    mode_sticks: bool,
    /// The last one that acted.
    controlword: u16,
    mode_bits: u16,
    /// rpm; meaningless while the power stage is off.
    demand: f64,
    /// Position demand, increments, of a mode that controls the position.
    target: Option<f64>,
    /// Position minus count of the encoder: homing changes it.
    shift: i64,
    /// Bit 15 of the statusword.
    referenced: bool,
    /// How long a ramp has been at zero, seconds.
    waited_s: f64,
}

impl Axis {
    /// Before power-on.
    pub(super) fn new(servo: Servo) -> Axis {
        Axis {
            machine: Machine::new(),
            servo,
            modes: Modes::default(),
            mode: Mode::ProfilePosition,
            mode_sticks: false,
            controlword: 0,
            mode_bits: 0,
            demand: 0.0,
            target: None,
            shift: 0,
            referenced: false,
            waited_s: 0.0,
        }
    }

    /// The supply failed, or the drive starts anew: only the motor remembers.
    pub(super) fn power_on_reset(&mut self) {
        self.machine = Machine::new();
        self.modes = Modes::default();
        self.controlword = 0;
        self.mode_bits = 0;
        self.target = None;
        self.shift = 0;
        self.referenced = false;
    }

    /// What is true.
    pub(super) fn truth(&self) -> PlantState {
        self.servo.truth()
    }

    /// State of CiA 402.
    pub(super) fn state(&self) -> State {
        self.machine.state()
    }

    /// 6061h.
    pub(super) fn mode(&self) -> Mode {
        self.mode
    }

    /// Speed demand in rpm, 0 while the power stage is off.
    pub(super) fn demand(&self) -> f64 {
        self.demand
    }

    /// Whether the motor has torque.
    pub(super) fn powered(&self) -> bool {
        self.machine.powered()
    }

    /// A controlword was written. True if a fault was reset.
    pub(super) fn control(&mut self, controlword: u16, od: &Dictionary) -> bool {
        self.controlword = controlword;
        self.modes.control(controlword, od, self.servo.per_rpm());
        self.command(od)
    }

    fn command(&mut self, od: &Dictionary) -> bool {
        let may_reset = od.errors.may_reset();
        self.machine
            .control(self.controlword, options(od), may_reset)
    }

    /// An error occurred.
    pub(super) fn fault(&mut self, reaction: Reaction, od: &Dictionary) {
        self.machine.fault(reaction, options(od));
    }

    /// A set value was written.
    pub(super) fn set(&mut self, index: u16, od: &Dictionary, now_s: f64) {
        self.modes.set(index, od, now_s);
    }

    /// From now on 6061h stays as it is.
    pub(super) fn stick_mode(&mut self) {
        self.mode_sticks = true;
    }

    /// Another load on the shaft, per mille of rated torque.
    pub(super) fn set_load(&mut self, permille: f64) {
        self.servo.set_load(permille);
    }

    /// Something blocks the shaft, or lets it go.
    pub(super) fn block(&mut self, blocked: bool) {
        self.servo.block(blocked);
    }

    /// The power stage goes off by itself.
    pub(super) fn drop_out(&mut self) {
        self.machine.drop_out();
    }

    /// Whether a control cycle can end in an error by itself.
    pub(super) fn may_fail(&self, od: &Dictionary) -> bool {
        let has_switches = self.servo.travel().has_limit_switch();
        self.machine.power() == Power::Run && supervision::is_needed(self.mode, od, has_switches)
    }

    /// NMT takes the drive out of operational.
    pub(super) fn connection_ends(&mut self, od: &Dictionary) {
        self.machine.connection_ends(options(od));
    }

    /// One control cycle while the drive has no supply, or before it runs.
    pub(super) fn coast(&mut self, own_s: f64, true_s: f64) {
        self.demand = 0.0;
        let still = Standstill::DEFAULT;
        self.servo.step(Follow::Nothing, still, own_s, true_s);
    }

    /// One control cycle; the measured values go into the dictionary. Answers
    /// the error in which it ends.
    pub(super) fn cycle(
        &mut self,
        od: &mut Dictionary,
        own_s: f64,
        true_s: f64,
        now_s: f64,
    ) -> Option<u16> {
        let standstill = Standstill {
            speed_rpm: od.number(0x30E0, 1) as f64,
            window_s: od.number(0x30E0, 2) as f64 / 1000.0,
        };
        if let Some(mode) = Mode::from_code(od.number(0x6060, 0) as i8)
            && !self.mode_sticks
        {
            self.mode = mode;
        }
        let (follow, error) = self.follow(od, own_s, now_s);
        self.servo.step(follow, standstill, own_s, true_s);

        let timeout_s = od.number(0x30E0, 3) as f64 / 1000.0;
        let at_rest = self.at_rest(own_s, timeout_s);
        if self.machine.cycle(at_rest) {
            // What was asked for during the ramp counts now.
            self.command(od);
        }
        self.publish(od);
        error
    }

    /// What the servo follows, and the error that was noticed.
    fn follow(&mut self, od: &Dictionary, own_s: f64, now_s: f64) -> (Follow, Option<u16>) {
        let limits = Limits::read(od);
        let measured = self.servo.measured();
        // A ramp starts from the speed that the axis has.
        let before = match (self.servo.powered(), measured.standstill) {
            (true, _) => self.demand,
            (false, true) => 0.0,
            (false, false) => measured.velocity,
        };
        let power = self.machine.power();
        if power != Power::Run {
            self.target = None;
            self.mode_bits = self.modes.idle(self.mode, measured);
            let positioning = matches!(self.mode, Mode::ProfilePosition | Mode::CyclicPosition);
            if positioning && od.errors.is_active(errors::FOLLOWING) {
                self.mode_bits |= FOLLOWING_ERROR;
            }
        }
        match power {
            Power::Off => {
                self.demand = 0.0;
                (Follow::Nothing, None)
            }
            Power::Run => self.run(&Cycle {
                od,
                controlword: self.controlword,
                limits,
                measured,
                position: measured.count + self.shift,
                index: measured.index.map(|at| at + self.shift),
                inputs: self.servo.inputs(),
                current_ma: self.current_ma(measured.torque),
                demand: before,
                per_rpm: self.servo.per_rpm(),
                seconds: own_s,
                now_s,
            }),
            Power::Stop(kind) => {
                let slopes = match kind {
                    Ramp::SlowDown => limits.profile,
                    Ramp::QuickStop => Slopes {
                        deceleration: limits.quick_stop,
                        ..limits.profile
                    },
                };
                self.demand = ramp::step(before, 0.0, slopes, own_s);
                (Follow::Speed(self.demand), None)
            }
        }
    }

    /// The mode moves the axis.
    fn run(&mut self, cycle: &Cycle<'_>) -> (Follow, Option<u16>) {
        let outcome = self.modes.step(self.mode, cycle);
        self.mode_bits = outcome.bits;
        let (mut error, mut position) = (None, cycle.position);
        if let Some(shift) = outcome.shift {
            self.shift += shift;
            position += shift;
            self.referenced = true;
            self.target = None;
        }
        let follow = match outcome.demand {
            Demand::Position(motion) => {
                // Both as they were when the last cycle ended.
                let following = self.target.unwrap_or(position as f64) - position as f64;
                self.target = Some(motion.position);
                self.demand = motion.rate / cycle.per_rpm;
                error = supervision::check(self.mode, cycle, &outcome, Some(following));
                let time_constant_s = self.servo.config().time_constant_s;
                let wanted = position::speed(motion, following, time_constant_s, cycle.per_rpm);
                let speed = wanted.clamp(-cycle.limits.motor, cycle.limits.motor);
                if speed != wanted {
                    self.mode_bits |= INTERNAL_LIMIT;
                }
                Follow::Speed(speed)
            }
            Demand::Speed(speed) => {
                self.target = None;
                self.demand = speed;
                Follow::Speed(speed)
            }
            Demand::Torque(permille) => {
                self.target = None;
                self.demand = cycle.measured.velocity;
                Follow::Torque(permille)
            }
        };
        if self.target.is_none() {
            error = supervision::check(self.mode, cycle, &outcome, None);
        }
        (follow, error)
    }

    fn current_ma(&self, torque_permille: f64) -> f64 {
        torque_permille / 1000.0 * self.servo.config().rated_current_ma
    }

    /// A ramp has come to zero and the axis stands, or does not within
    /// 30E0h:3.
    fn at_rest(&mut self, own_s: f64, timeout_s: f64) -> bool {
        let stopping = matches!(self.machine.power(), Power::Stop(_));
        if !stopping || self.demand != 0.0 {
            self.waited_s = 0.0;
            return false;
        }
        self.waited_s += own_s;
        self.servo.measured().standstill || self.waited_s >= timeout_s
    }

    /// Statusword; `remote` in NMT operational.
    pub(super) fn statusword(&self, remote: bool, warning: bool) -> u16 {
        let state = self.machine.state();
        let mut word = state.statusword() | self.mode_bits;
        if state.voltage_enabled() {
            word |= VOLTAGE_ENABLED;
        }
        if warning {
            word |= WARNING;
        }
        if remote {
            word |= REMOTE;
        }
        if self.referenced {
            word |= REFERENCED;
        }
        word
    }

    fn publish(&self, od: &mut Dictionary) {
        let measured = self.servo.measured();
        let unit = od.velocity_unit();
        let speed = |rpm: f64| (rpm / unit).round() as i64;
        let statusword = self.statusword(od.operational, od.errors.warning());
        od.put(0x6041, 0, statusword.into());
        od.put(0x6061, 0, self.mode.code().into());
        let position = measured.count + self.shift;
        let target = self.target.map_or(position, |target| target.round() as i64);
        let following = (target - position).clamp(i32::MIN.into(), i32::MAX.into());
        od.put(0x6062, 0, target);
        od.put(0x6064, 0, position);
        od.put(0x60F4, 0, following);
        od.put(0x60FD, 0, self.servo.inputs().bits().into());
        let current = |torque| self.current_ma(torque).round() as i64;
        od.put(0x30D1, 1, current(measured.torque_averaged));
        od.put(0x30D1, 2, current(measured.torque));
        od.put(0x606B, 0, speed(self.demand));
        od.put(0x606C, 0, speed(measured.velocity));
        od.put(0x30D3, 1, speed(measured.velocity_averaged));
        od.put(0x6077, 0, measured.torque.round() as i64);
        od.put(0x30D2, 1, measured.torque_averaged.round() as i64);
    }
}

fn options(od: &Dictionary) -> Options {
    let code = |index| od.number(index, 0) as i16;
    Options {
        shutdown: code(0x605B),
        disable_operation: code(0x605C),
        fault_reaction: code(0x605E),
        abort_connection: code(0x6007),
    }
}

//! One axis: state machine, mode of operation, velocity loop and motor.

use super::cia402::{Machine, Options, Power, Ramp, State};
use super::dictionary::Dictionary;
use super::errors::Reaction;
use super::modes::{Cycle, Limits, Mode, Modes};
use super::plant::PlantState;
use super::ramp::{self, Slopes};
use super::servo::{Servo, Standstill};

/// Bit 7 of the statusword.
const WARNING: u16 = 1 << 7;
/// Bit 4 of the statusword.
const VOLTAGE_ENABLED: u16 = 1 << 4;
/// Bit 9 of the statusword.
const REMOTE: u16 = 1 << 9;

/// The axis.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    machine: Machine,
    servo: Servo,
    modes: Modes,
    mode: Mode,
    mode_bits: u16,
    /// rpm; meaningless while the power stage is off.
    demand: f64,
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
            mode_bits: 0,
            demand: 0.0,
            waited_s: 0.0,
        }
    }

    /// The supply failed, or the drive starts anew: only the motor remembers.
    pub(super) fn power_on_reset(&mut self) {
        self.machine = Machine::new();
        self.modes = Modes::default();
        self.mode_bits = 0;
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
    pub(super) fn control(&mut self, od: &Dictionary) -> bool {
        let controlword = od.number(0x6040, 0) as u16;
        let may_reset = od.errors.may_reset();
        self.machine.control(controlword, options(od), may_reset)
    }

    /// An error occurred.
    pub(super) fn fault(&mut self, reaction: Reaction, od: &Dictionary) {
        self.machine.fault(reaction, options(od));
    }

    /// NMT takes the drive out of operational.
    pub(super) fn connection_ends(&mut self, od: &Dictionary) {
        self.machine.connection_ends(options(od));
    }

    /// One control cycle while the drive has no supply, or before it runs.
    pub(super) fn coast(&mut self, own_s: f64, true_s: f64) {
        self.demand = 0.0;
        self.servo.step(None, Standstill::DEFAULT, own_s, true_s);
    }

    /// One control cycle; the measured values go into the dictionary.
    pub(super) fn cycle(&mut self, od: &mut Dictionary, own_s: f64, true_s: f64) {
        let standstill = Standstill {
            speed_rpm: od.number(0x30E0, 1) as f64,
            window_s: od.number(0x30E0, 2) as f64 / 1000.0,
        };
        if let Some(mode) = Mode::from_code(od.number(0x6060, 0) as i8) {
            self.mode = mode;
        }
        let demand = self.follow(od, own_s);
        self.servo.step(demand, standstill, own_s, true_s);
        self.demand = demand.unwrap_or(0.0);

        let timeout_s = od.number(0x30E0, 3) as f64 / 1000.0;
        let at_rest = self.at_rest(own_s, timeout_s);
        if self.machine.cycle(at_rest) {
            // What was asked for during the ramp counts now.
            self.control(od);
        }
        self.publish(od);
    }

    /// The speed to follow; `None` without torque.
    fn follow(&mut self, od: &Dictionary, own_s: f64) -> Option<f64> {
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
            self.mode_bits = self.modes.idle_bits(self.mode, measured);
        }
        match power {
            Power::Off => None,
            Power::Run => {
                let outcome = self.modes.step(
                    self.mode,
                    Cycle {
                        od,
                        limits,
                        measured,
                        demand: before,
                        seconds: own_s,
                    },
                );
                self.mode_bits = outcome.bits;
                Some(outcome.demand)
            }
            Power::Stop(kind) => {
                let slopes = match kind {
                    Ramp::SlowDown => limits.profile,
                    Ramp::QuickStop => Slopes {
                        deceleration: limits.quick_stop,
                        ..limits.profile
                    },
                };
                Some(ramp::step(before, 0.0, slopes, own_s))
            }
        }
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
        word
    }

    fn publish(&self, od: &mut Dictionary) {
        let measured = self.servo.measured();
        let unit = od.velocity_unit();
        let speed = |rpm: f64| (rpm / unit).round() as i64;
        let statusword = self.statusword(od.operational, od.errors.warning());
        od.put(0x6041, 0, statusword.into());
        od.put(0x6061, 0, self.mode.code().into());
        od.put(0x6062, 0, measured.position.into());
        od.put(0x6064, 0, measured.position.into());
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

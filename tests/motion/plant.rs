//! A drive in profile velocity mode with motor and load, no more than these
//! tests need. Written from the drive's data sheet and CiA 402-2.

use canmaster::cia402::{Command, ControlWord, State};
use canmaster::motion::{AxisCommand, AxisFeedback};

/// Steps of the drive's control loop per cycle of 10 ms.
pub(crate) const STEPS: u32 = 25;
/// Length of a step in seconds.
const STEP_S: f64 = 0.01 / STEPS as f64;
/// Acceleration that rated torque gives the nominal inertia, rpm/s.
const RATED: f64 = 25_000.0;
/// Increments per second that are 1 rpm.
const PER_RPM: f64 = 2000.0 / 60.0;

/// Splitmix64: enough for noise, and the same everywhere.
#[derive(Clone)]
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Random {
        Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(1))
    }

    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }
}

/// One drive with its motor.
pub(crate) struct Drive {
    random: Random,
    /// Time constant of the velocity loop, seconds.
    tau: f64,
    /// Inertia over the nominal one.
    inertia: f64,
    /// Coulomb friction in rated torques.
    friction: f64,
    disturbance: f64,
    pub(crate) state: State,
    word: ControlWord,
    target: AxisCommand,
    pending: AxisCommand,
    demand: f64,
    model: f64,
    integral: f64,
    pub(crate) position: f64,
    pub(crate) velocity: f64,
    /// The shaft does not turn, whatever the torque.
    pub(crate) blocked: bool,
    /// The state machine never leaves this state.
    pub(crate) stuck: Option<State>,
}

impl Drive {
    pub(crate) fn new(seed: u64) -> Drive {
        let mut random = Random::new(seed);
        Drive {
            tau: random.between(0.003, 0.010),
            inertia: random.between(0.7, 1.3),
            friction: random.between(0.02, 0.05),
            position: random.between(-50_000.0, 50_000.0).round(),
            random,
            disturbance: 0.0,
            state: State::NotReadyToSwitchOn,
            word: ControlWord(0),
            target: AxisCommand::default(),
            pending: AxisCommand::default(),
            demand: 0.0,
            model: 0.0,
            integral: 0.0,
            velocity: 0.0,
            blocked: false,
            stuck: None,
        }
    }

    /// The RPDOs: taken over at the next SYNC.
    pub(crate) fn receive(&mut self, command: AxisCommand) {
        self.pending = command;
    }

    /// SYNC: takes over the RPDOs and samples the TPDOs.
    pub(crate) fn sync(&mut self) -> AxisFeedback {
        // What the statusword says was true before the new controlword.
        let feedback = AxisFeedback {
            statusword: 0x0210 | self.state.bits(),
            position: self.position.round() as i64 as i32,
            velocity: (self.velocity + self.random.between(-1.0, 1.0)).round() as i32,
            torque: 0,
            fresh: true,
        };
        self.target = self.pending;
        self.obey(ControlWord(self.target.controlword));
        feedback
    }

    /// The drive's own error: the power stage goes off.
    pub(crate) fn fail(&mut self) {
        self.state = State::Fault;
    }

    /// The transitions of CiA 402-2, figure of the state machine.
    fn obey(&mut self, word: ControlWord) {
        use Command::*;
        use State::*;
        let edge = word.gives(FaultReset) && !self.word.gives(FaultReset);
        self.word = word;
        if self.stuck == Some(self.state) {
            return;
        }
        self.state = match self.state {
            NotReadyToSwitchOn => SwitchOnDisabled,
            Fault if edge => SwitchOnDisabled,
            SwitchOnDisabled if word.gives(Shutdown) => ReadyToSwitchOn,
            ReadyToSwitchOn | SwitchedOn | OperationEnabled if word.gives(DisableVoltage) => {
                SwitchOnDisabled
            }
            ReadyToSwitchOn if word.gives(SwitchOn) => SwitchedOn,
            SwitchedOn if word.gives(EnableOperation) => OperationEnabled,
            SwitchedOn | OperationEnabled if word.gives(Shutdown) => ReadyToSwitchOn,
            OperationEnabled if word.gives(DisableOperation) => SwitchedOn,
            other => other,
        };
    }

    /// One control step.
    pub(crate) fn step(&mut self) {
        let torque = if self.state == State::OperationEnabled {
            self.ramp();
            self.control()
        } else {
            self.demand = self.velocity;
            self.model = self.velocity;
            self.integral = 0.0;
            0.0
        };
        self.disturbance =
            (self.disturbance * 0.95 + self.random.between(-0.004, 0.004)).clamp(-0.01, 0.01);
        self.turn(torque + self.disturbance);
    }

    /// 6083h while the speed grows, 6084h while it shrinks.
    fn ramp(&mut self) {
        let wanted = f64::from(self.target.velocity);
        let slowing = self.demand * wanted < 0.0 || wanted.abs() < self.demand.abs();
        let slope = if slowing {
            self.target.deceleration
        } else {
            self.target.acceleration
        };
        let most = f64::from(slope) * STEP_S;
        self.demand += (wanted - self.demand).clamp(-most, most);
    }

    /// A first-order model with the loop's time constant, followed by a
    /// proportional-integral controller with both poles at it.
    fn control(&mut self) -> f64 {
        let before = self.model;
        self.model += (self.demand - before) * (1.0 - (-STEP_S / self.tau).exp());
        let error = before - self.velocity;
        let torque = ((self.model - before) / STEP_S + 2.0 / self.tau * error) / RATED;
        self.integral += error * STEP_S / (self.tau * self.tau) / RATED;
        torque + self.integral
    }

    fn turn(&mut self, torque: f64) {
        const PARTS: u32 = 4;
        let dt = STEP_S / f64::from(PARTS);
        if self.blocked {
            self.velocity = 0.0;
        }
        for _ in 0..PARTS {
            if self.blocked || (self.velocity == 0.0 && torque.abs() <= self.friction) {
                continue;
            }
            let against = if self.velocity == 0.0 {
                torque
            } else {
                self.velocity
            };
            let net = torque - self.friction.copysign(against);
            let next = self.velocity + net * RATED / self.inertia * dt;
            let next = if next * self.velocity < 0.0 {
                0.0
            } else {
                next
            };
            self.position += (self.velocity + next) / 2.0 * PER_RPM * dt;
            self.velocity = next;
        }
    }
}

//! A drive with motor and load in every mode, no more than these tests need.
//! Written from the drive's data sheet and CiA 402-2.

use canmaster::cia402::{Command, ControlWord, State};
use canmaster::motion::AxisCommand;
use canmaster::motion::AxisFeedback;
use canmaster::motion::mode::Mode;

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
    /// As 6061h.
    pub(crate) mode: Mode,
    target: AxisCommand,
    pending: AxisCommand,
    /// What each RPDO has brought: the drive obeys the object of its mode.
    objects: [i32; 4],
    demand: f64,
    model: f64,
    integral: f64,
    /// Where a cyclic position comes from, and how much of its cycle is over.
    last: f64,
    over: f64,
    /// Where a move of the drive itself goes; `None`: there is none.
    going: Option<f64>,
    /// The last set-point, and how fast and with which ramps it goes there.
    aimed: i64,
    profile: (f64, u32, u32),
    /// 6081h, rpm.
    pub(crate) profile_velocity: f64,
    /// Bit 12 in modes that the drive leads.
    answered: bool,
    /// It never answers set-points, and does not find its home.
    pub(crate) deaf: bool,
    /// Homing ends with an error.
    pub(crate) homeless: bool,
    pub(crate) position: f64,
    pub(crate) velocity: f64,
    /// The shaft does not turn, whatever the torque.
    pub(crate) blocked: bool,
    /// Something turns the shaft at this speed, rpm, whatever the torque.
    pub(crate) pushed: Option<f64>,
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
            objects: [0; 4],
            demand: 0.0,
            model: 0.0,
            integral: 0.0,
            mode: Mode::ProfileVelocity,
            last: 0.0,
            over: 0.0,
            going: None,
            aimed: 0,
            profile: (0.0, 1, 1),
            profile_velocity: 1000.0,
            answered: false,
            deaf: false,
            homeless: false,
            velocity: 0.0,
            blocked: false,
            pushed: None,
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
        let leads = matches!(self.mode, Mode::ProfilePosition | Mode::Homing);
        let there = self.velocity.abs() < 5.0 && (self.going.is_none() || self.word.halt());
        let failed = self.mode == Mode::Homing && self.homeless && self.word.0 & 1 << 4 != 0;
        let bits = u16::from(there) << 10
            | u16::from(leads && self.answered) << 12
            | u16::from(failed) << 13;
        let feedback = AxisFeedback {
            statusword: 0x0210 | bits | self.state.bits(),
            position: self.position.round() as i64 as i32,
            velocity: (self.velocity + self.random.between(-1.0, 1.0)).round() as i32,
            torque: 0,
            fresh: true,
        };
        self.last = self.aim();
        self.over = 0.0;
        self.objects[usize::from(self.pending.mode.rpdo())] = self.pending.target;
        self.target = AxisCommand {
            target: self.objects[usize::from(self.mode.rpdo())],
            ..self.pending
        };
        let before = self.word;
        self.obey(ControlWord(self.target.controlword));
        if leads {
            self.lead(before);
        }
        feedback
    }

    /// 6060h is written while the axis stands.
    pub(crate) fn set_mode(&mut self, mode: Mode) {
        self.mode = mode;
        self.answered = false;
        self.going = None;
        self.target.target = self.objects[usize::from(mode.rpdo())];
        self.last = f64::from(self.target.target);
        self.over = 1.0;
    }

    /// Set-point handshake, and homing on the actual position (method 37).
    fn lead(&mut self, before: ControlWord) {
        const BEGIN: u16 = 1 << 4;
        const RELATIVE: u16 = 1 << 6;
        let begin = self.word.0 & BEGIN != 0;
        if self.deaf || self.state != State::OperationEnabled {
            return;
        }
        if self.mode == Mode::Homing {
            if begin && before.0 & BEGIN == 0 && !self.homeless {
                self.position = 0.0;
            }
            self.answered = begin && !self.homeless;
        } else {
            if begin && before.0 & BEGIN == 0 {
                // From the target before, or to a position.
                if self.word.0 & RELATIVE == 0 {
                    self.aimed = 0;
                }
                self.aimed += i64::from(self.target.target);
                self.going = Some(self.aimed as f64);
                let AxisCommand {
                    acceleration,
                    deceleration,
                    ..
                } = self.target;
                self.profile = (self.profile_velocity, acceleration, deceleration);
            }
            self.answered = begin;
        }
    }

    /// Where a cyclic target is between two SYNCs.
    fn aim(&self) -> f64 {
        let to = f64::from(self.target.target);
        self.last + (to - self.last) * self.over.min(1.0)
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
            OperationEnabled if word.gives(QuickStop) => QuickStopActive,
            QuickStopActive if word.gives(DisableVoltage) => SwitchOnDisabled,
            OperationEnabled if word.gives(DisableOperation) => SwitchedOn,
            other => other,
        };
    }

    /// One control step.
    pub(crate) fn step(&mut self) {
        let before = self.aim();
        self.over += 1.0 / f64::from(STEPS);
        let torque = if self.state == State::OperationEnabled {
            self.demand(before)
        } else if self.state == State::QuickStopActive {
            self.ramp(0.0);
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

    /// The torque that the mode asks for.
    fn demand(&mut self, before: f64) -> f64 {
        let target = f64::from(self.target.target);
        match self.mode {
            Mode::ProfileVelocity => self.ramp(target),
            Mode::CyclicVelocity => self.demand = self.aim(),
            Mode::CyclicTorque => return target / 1000.0,
            Mode::CyclicPosition => {
                let aim = self.aim();
                let feed = (aim - before) / STEP_S / PER_RPM;
                self.demand = feed + 40.0 * (aim - self.position) / PER_RPM;
            }
            Mode::ProfilePosition | Mode::Homing => {
                // With halt it brakes, and goes on afterwards.
                let going = self.going.filter(|_| !self.word.halt());
                let left = going.map_or(0.0, |to| to - self.position);
                let (fastest, up, down) = match going {
                    Some(_) => self.profile,
                    None => (0.0, self.target.acceleration, self.target.deceleration),
                };
                let speed = (2.0 * left.abs() / PER_RPM * f64::from(down) * 0.5)
                    .sqrt()
                    .min(fastest);
                self.ramp_by(speed.copysign(left), up, down);
                if going.is_some() && left.abs() < 2.0 && self.velocity.abs() < 5.0 {
                    self.going = None;
                }
            }
        }
        self.control()
    }

    /// 6083h while the speed grows, 6084h while it shrinks.
    fn ramp(&mut self, wanted: f64) {
        self.ramp_by(wanted, self.target.acceleration, self.target.deceleration);
    }

    fn ramp_by(&mut self, wanted: f64, up: u32, down: u32) {
        let slowing = self.demand * wanted < 0.0 || wanted.abs() < self.demand.abs();
        let slope = if slowing { down } else { up };
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
        if let Some(speed) = self.pushed {
            self.velocity = speed;
            self.position += speed * PER_RPM * STEP_S;
            return;
        }
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

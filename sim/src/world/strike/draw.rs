//! What a seed draws: by whom the group is led, in which modes, what goes wrong and
//! when.

use std::fmt;

use canmaster::motion::mode::Mode;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::{Cause, Strike, programs};
use crate::time::Time;

/// Keeps the choices apart from everybody else's random numbers, and that of who leads
/// from that of the fault.
const STREAM: u64 = 0x57E1_4B00;
const LEADERS: u64 = 0x1EAD_E400;
/// The start goes wrong at some moment until then.
const START_US: u64 = 3_000_000;
/// A client's move is over by then.
const MOVE_US: u64 = 1_400_000;
/// With torque an axis becomes faster all the time: until then.
const TORQUE_US: u64 = 450_000;
/// The way to the home switch at search speed.
const SEARCH_US: u64 = 2_000_000;
/// A program runs for so long before the fault.
const PROGRAM_US: u64 = 5_000_000;

/// Who leads the group to the moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leader {
    /// The button, and the program that the image has.
    Button,
    /// An SDO client, in these modes.
    Client(Modes),
    /// An SDO client that downloads a program, by its place in the list.
    Program(usize),
}

/// The modes of all axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Modes {
    /// One for all.
    All(Mode),
    /// Neighbours have different ones.
    Mixed,
}

impl Modes {
    /// That of an axis.
    pub fn of(self, axis: usize) -> Mode {
        const MIXED: [Mode; 4] = [
            Mode::ProfileVelocity,
            Mode::CyclicPosition,
            Mode::ProfilePosition,
            Mode::CyclicVelocity,
        ];
        match self {
            Modes::All(mode) => mode,
            Modes::Mixed => MIXED[axis % MIXED.len()],
        }
    }
}

impl fmt::Display for Leader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Leader::Button => f.write_str("button"),
            Leader::Client(Modes::All(mode)) => write!(f, "client, {mode}"),
            Leader::Client(Modes::Mixed) => f.write_str("client, mixed modes"),
            Leader::Program(program) => write!(f, "program, {}", programs::PROGRAMS[program].0),
        }
    }
}

/// When the fault comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// While the network starts.
    Start,
    /// In standby.
    Standby,
    /// At the release.
    Release,
    /// While the program or the move runs.
    Motion,
    /// After a stop.
    Stop,
    /// While the axes search for home.
    Homing,
    /// After a change of modes was ordered.
    ModeChange,
    /// After a halt.
    Halt,
    /// After a quick stop.
    QuickStop,
    /// After the axes were disabled in standby.
    Disable,
    /// After they were enabled again.
    Enable,
}

impl Phase {
    /// Nobody wants the axes enabled any more.
    pub(super) fn is_unwanted(self) -> bool {
        matches!(self, Phase::QuickStop | Phase::Disable)
    }
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Phase::Start => "start",
            Phase::Standby => "standby",
            Phase::Release => "release",
            Phase::Motion => "motion",
            Phase::Stop => "stop",
            Phase::Homing => "homing",
            Phase::ModeChange => "mode change",
            Phase::Halt => "halt",
            Phase::QuickStop => "quick stop",
            Phase::Disable => "disable",
            Phase::Enable => "enable",
        })
    }
}

impl Strike {
    /// What `seed` draws for a machine of `axes`.
    pub fn random(seed: u64, axes: usize) -> Strike {
        let mut random = Pcg64Mcg::seed_from_u64(seed ^ LEADERS);
        let strike = Strike::by_button(seed, axes);
        match random.random_range(0..20) {
            0..=4 => strike,
            5..=8 => strike.in_a_program(&mut random),
            _ => strike.by_a_client(&mut random),
        }
    }

    /// The same where nobody but the button leads the group.
    pub fn by_button(seed: u64, axes: usize) -> Strike {
        let mut random = Pcg64Mcg::seed_from_u64(seed ^ STREAM);
        let cause = Cause::ALL[random.random_range(0..Cause::ALL.len())];
        let phase = match random.random_range(0..20) {
            0 | 1 => Phase::Start,
            2 => Phase::Standby,
            3 | 4 => Phase::Release,
            5 | 6 => Phase::Stop,
            _ => Phase::Motion,
        };
        let (least, most) = match cause {
            // Shorter ones, of which nobody takes notice, are no fault.
            Cause::DriveCutOff | Cause::MasterCutOff => (400_000, 1_500_000),
            Cause::ShortCircuit => (20_000, 600_000),
            Cause::SupplyLost => (50_000, 1_000_000),
            _ => (1_000, 1_200_000),
        };
        Strike {
            leader: Leader::Button,
            cause,
            axis: random.random_range(0..axes),
            phase,
            before: Time::ZERO,
            after: Time::from_us(match phase {
                Phase::Start => random.random_range(0..START_US),
                Phase::Standby => random.random_range(0..300_000),
                Phase::Release => random.random_range(0..60_000),
                // A part of the round trip: see `lead`.
                Phase::Motion => random.random_range(0..1_000_000),
                _ => random.random_range(0..700_000),
            }),
            lasts: Time::from_us(random.random_range(least..most)),
            kind: random.random_range(0..15),
        }
    }

    fn by_a_client(self, random: &mut Pcg64Mcg) -> Strike {
        const MODES: usize = Mode::ALL.len();
        let modes = match random.random_range(0..=MODES) {
            MODES => Modes::Mixed,
            n => Modes::All(Mode::ALL[n]),
        };
        let homing = modes == Modes::All(Mode::Homing);
        let phase = match (homing, random.random_range(0..20)) {
            (_, 0) => Phase::Standby,
            (_, 1..=3) => Phase::ModeChange,
            (_, 4..=6) => Phase::QuickStop,
            (_, 7..=8) => Phase::Disable,
            (_, 9) => Phase::Enable,
            (_, 10..=11) => Phase::Stop,
            (true, _) => Phase::Homing,
            (false, 12..=13) => Phase::Halt,
            (false, 14) => Phase::Release,
            (false, _) => Phase::Motion,
        };
        let moving = match modes {
            Modes::All(Mode::CyclicTorque) => TORQUE_US,
            Modes::All(Mode::Homing) => SEARCH_US,
            _ => MOVE_US,
        };
        let most = match phase {
            Phase::Motion | Phase::Homing => moving,
            // Of 2 ms each: see `lead`.
            Phase::ModeChange => 30_000,
            Phase::Enable => 12_000,
            Phase::Disable => 6_000,
            Phase::Release => 60_000,
            Phase::QuickStop => 120_000,
            Phase::Stop if homing => 120_000,
            _ => 700_000,
        };
        Strike {
            leader: Leader::Client(modes),
            phase,
            before: Time::from_us(random.random_range(200_000..moving)),
            after: Time::from_us(random.random_range(0..most)),
            ..self
        }
        .possible()
    }

    fn in_a_program(self, random: &mut Pcg64Mcg) -> Strike {
        let (phase, most) = match random.random_range(0..8) {
            0 => (Phase::Stop, 100_000),
            1 => (Phase::QuickStop, 100_000),
            2 => (Phase::Halt, 300_000),
            _ => (Phase::Motion, PROGRAM_US),
        };
        Strike {
            leader: Leader::Program(random.random_range(0..programs::PROGRAMS.len())),
            phase,
            before: Time::from_us(random.random_range(0..PROGRAM_US / 2)),
            after: Time::from_us(random.random_range(0..most)),
            ..self
        }
        .possible()
    }

    /// A blocked axis is noticed where it does not follow a position, and here only where
    /// another makes the same move: else something else goes wrong.
    fn possible(mut self) -> Strike {
        let follows = |modes| match modes {
            Modes::All(mode) => !matches!(mode, Mode::Homing | Mode::CyclicTorque),
            Modes::Mixed => false,
        };
        let visible = match self.leader {
            Leader::Button => true,
            Leader::Client(modes) => {
                follows(modes) && matches!(self.phase, Phase::Motion | Phase::Release)
            }
            Leader::Program(_) => false,
        };
        if self.cause == Cause::Blocked && !visible {
            self.cause = Cause::TpdosMissing;
        }
        self
    }
}

//! A random fault at a random moment, and whether the machine keeps the contract:
//! never motion without release, everything at rest in time, what the master stops
//! comes to rest together, and the way back leads to standby.

use std::fmt;

use canmaster::NodeId;
use canmaster::emcy::{Emcy, EmcyCode, ErrorRegister};
use canmaster::id::Address;
use canmaster::motion::panel;
use canmaster::nmt::{Command, NodeControl};
use canmaster::sdo::SdoError;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::trials::{TrialError, must};
use super::{Image, Scenario, Stimulus, World};
use crate::board::irqs;
use crate::bus::BusFault;
use crate::drive::cia402::State;
use crate::drive::{DriveFault, Trouble};
use crate::judge::verdict::stop_tolerance;
use crate::judge::{Cause, Limits, Reaction, STANDSTILL_RPM};
use crate::time::Time;

/// Keeps the choice apart from everybody else's random numbers.
const STREAM: u64 = 0x57E1_4B00;
/// All drives are enabled by then, counted from power-on or from the end of a
/// fault that the machine overcomes.
const READY_BY: Time = Time::from_ms(8000);
/// All axes turn this soon after the button was pressed.
const MOVING_BY: Time = Time::from_ms(1000);
/// The start goes wrong at some moment until then.
const START_US: u64 = 3_000_000;
/// How long the machine is watched when it stands.
const WATCHED: Time = Time::from_ms(400);
/// How often the axes are looked at.
const LOOK: Time = Time::from_ms(1);
/// What a drive was told before a stop is still seen in the shaft: three times the
/// 10 ms of its velocity loop. An axis told to start in the last cycle before the
/// stop may first exceed the speed that counts as standing then.
const LOOP_TAIL: Time = Time::from_ms(30);
/// An axis that shall stop does not become faster than it was by more: noise and
/// the tail of its loop, rpm.
const FASTER_RPM: f64 = 40.0;
/// Axes slower than that when the stop begins are not compared, rpm: their ramps
/// are so flat that noise of 1 rpm is several milliseconds.
const COMPARED_RPM: f64 = 200.0;
/// Axes come to rest together if they reach this part of their speeds together.
const TOGETHER_PART: f64 = 0.15;
/// The firmware's limit of the following error: a part of a turn.
const FOLLOWING_PART: f64 = 0.25;
/// How late a velocity loop and the firmware's position loop may be, as a part of
/// that limit.
const FOLLOWING_MARGIN: f64 = 1.4;
/// After the end of a move that a blocked axis has not followed, the firmware waits
/// so long for its arrival.
const ARRIVAL: Time = Time::from_ms(2100);
/// TPDOs that may be missing in a row: `[liveness]` of network.toml.
const MISSING: u64 = 3;
/// Errors that switch a drive off: overcurrent, undervoltage, sensor.
const DISABLING: [u16; 3] = [0x2310, 0x3220, 0x7320];
/// Errors that stop it on a ramp: following error, limit switch, short PDO.
const STOPPING: [u16; 3] = [0x8611, 0x8A81, 0x8210];
/// Of no range that a standard or the drive's manual names.
const UNKNOWN: EmcyCode = EmcyCode(0x1234);
/// Interrupts whose tasks can hang.
const TASKS: [u8; 5] = [
    irqs::FDCAN1_IT0,
    irqs::TIM2,
    irqs::TIM3,
    irqs::TIM7,
    irqs::UART4,
];

/// When the fault comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// While the network starts.
    Start,
    /// In standby.
    Standby,
    /// While the button is pressed.
    Release,
    /// While the program runs.
    Motion,
    /// After the button was pressed to stop.
    Stop,
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Phase::Start => "start",
            Phase::Standby => "standby",
            Phase::Release => "release",
            Phase::Motion => "motion",
            Phase::Stop => "stop",
        })
    }
}

/// What happens, and when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Strike {
    /// What.
    pub cause: Cause,
    /// To which drive, if to one.
    pub axis: usize,
    /// In which phase.
    pub phase: Phase,
    /// So long after the phase has begun.
    pub after: Time,
    /// For so long, where it ends by itself.
    pub lasts: Time,
    /// Which of several of its kind.
    kind: usize,
}

/// What came of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Struck {
    /// The moment of the fault, from power-on.
    pub at: Time,
    /// From there until every axis stood that still had torque; `None` if nothing
    /// turned.
    pub stood_after: Option<Time>,
    /// The contract's limit for that.
    pub allowed: Time,
    /// The same for the axis at fault, if it was left to friction.
    pub coasted: Option<Time>,
    /// How far apart the axes that the master stopped reached the same part of their
    /// speeds.
    pub apart: Option<Time>,
    /// The machine was in standby again, and moved when it was released.
    pub recovered: bool,
}

impl Strike {
    /// What `seed` draws for a machine of `axes`.
    pub fn random(seed: u64, axes: usize) -> Strike {
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
            cause,
            axis: random.random_range(0..axes),
            phase,
            after: Time::from_us(match phase {
                Phase::Start => random.random_range(0..START_US),
                Phase::Standby => random.random_range(0..300_000),
                Phase::Release => random.random_range(0..60_000),
                // A part of the round trip: see `World::strike`.
                Phase::Motion => random.random_range(0..1_000_000),
                Phase::Stop => random.random_range(0..700_000),
            }),
            lasts: Time::from_us(random.random_range(least..most)),
            kind: random.random_range(0..15),
        }
    }

    /// Whether only a machine knows of it whose drives send heartbeats in operational.
    pub fn wants_heartbeats(&self) -> bool {
        self.cause == Cause::HeartbeatLost
    }

    /// Does it to a machine of its own, and watches what comes of it.
    ///
    /// # Errors
    /// What the contract does not allow, with its moment.
    pub fn run(&self, image: &Image, seed: u64) -> Result<Struck, TrialError> {
        let scenario = Scenario::new(seed, Time::MAX).unattended();
        let mut world = World::new(image, scenario)?.with_guest();
        self.lead_to(&mut world)?;
        let at = world.now();
        self.harm(&mut world);
        let mut watched = self.stops(&mut world, at)?;
        self.comes_back(&mut world, &mut watched)?;
        nothing_moved_unasked(&world)?;
        Ok(watched)
    }

    /// Brings the machine to the moment.
    fn lead_to(&self, world: &mut World<'_>) -> Result<(), TrialError> {
        if self.phase == Phase::Start {
            world.run_until(self.after);
            return Ok(());
        }
        let ready = world.run_to(READY_BY, World::ready);
        must(world, ready, "the drives are not all enabled")?;
        if self.phase == Phase::Standby {
            world.run_until(world.now() + self.after);
            return Ok(());
        }
        world.press();
        let pressed = world.now();
        match self.phase {
            Phase::Motion => {
                let whole = world.machine().round_trip().unwrap_or(Time::ZERO);
                let share = self.after.as_secs_f64();
                let after = Time::from_secs_f64(whole.as_secs_f64() * share);
                world.run_until(pressed + after);
            }
            Phase::Stop => {
                let turning = world.run_to(pressed + MOVING_BY, World::in_full_motion);
                must(world, turning, "the axes do not turn after the release")?;
                world.press();
                world.run_until(world.now() + self.after);
            }
            _ => world.run_until(pressed + self.after),
        }
        Ok(())
    }

    fn node(&self, world: &World<'_>) -> NodeId {
        world.machine().network().nodes[self.axis].id
    }

    fn harm(&self, world: &mut World<'_>) {
        let (at, node) = (world.now(), self.node(world));
        let until = at + self.lasts;
        let drive = |fault| Stimulus::Drive { node, fault };
        let error = |code| {
            drive(DriveFault::Error {
                at,
                code,
                until: None,
            })
        };
        let cut = |isolated| {
            Stimulus::Bus(BusFault::Cut {
                isolated,
                from: at,
                until,
            })
        };
        let stimulus = match self.cause {
            Cause::DriveDisabled => error(DISABLING[self.kind % DISABLING.len()]),
            Cause::DriveStops => error(STOPPING[self.kind % STOPPING.len()]),
            Cause::Emergency => {
                let emcy = Emcy::new(UNKNOWN, ErrorRegister::GENERIC);
                world.say(emcy.frame(node).into());
                return;
            }
            Cause::LeftOperational => {
                let stop = NodeControl::node(Command::Stop, node);
                world.say(stop.frame().into());
                return;
            }
            Cause::DropOut => drive(DriveFault::InState {
                state: State::OperationEnabled,
                what: Trouble::DropsOut { after_us: 0 },
            }),
            Cause::Sto => drive(DriveFault::Sto {
                at,
                until: Some(until),
            }),
            Cause::HeartbeatLost => drive(DriveFault::HeartbeatLost { at }),
            Cause::TpdosMissing => drive(DriveFault::TpdosLost { at }),
            Cause::SupplyLost => drive(DriveFault::PowerCycle { off: at, on: until }),
            Cause::Blocked => drive(DriveFault::Blocked { at, until: None }),
            Cause::DriveCutOff => cut(world.drive_port(node)),
            Cause::MasterCutOff => cut(Some(world.board_port())),
            Cause::ShortCircuit => Stimulus::Bus(BusFault::StuckDominant { from: at, until }),
            Cause::MasterReset => {
                world.schedule(until, Stimulus::Reset(false));
                Stimulus::Reset(true)
            }
            Cause::MasterHangs => {
                let irq = TASKS[self.kind % TASKS.len()];
                match self.kind / TASKS.len() {
                    0 => Stimulus::Hang { irq },
                    1 => Stimulus::Spin { irq },
                    _ => Stimulus::Crash { irq },
                }
            }
        };
        world.apply(stimulus);
    }

    /// Nothing starts or becomes faster once the stop must have begun, and all stand
    /// in time.
    fn stops(&self, world: &mut World<'_>, at: Time) -> Result<Struck, TrialError> {
        let limits = self.cause.limits(world.machine().network(), MISSING);
        let known = match self.cause {
            Cause::Blocked => self.wait_for_following_error(world, at),
            _ => at,
        };
        let latest = limits.struck.stops_by.max(limits.others.stops_by);
        world.watch.revoke(known + latest + LOOP_TAIL);
        let mut axes: Vec<Stopping> = world.truths().map(|_| Stopping::default()).collect();
        let end = known + limits.struck.stands_by.max(limits.others.stands_by);
        while world.now() < end && !(world.now() > known + latest && world.at_rest()) {
            world.run_until(world.now() + LOOK);
            self.look(world, known, limits, &mut axes)?;
        }
        must(world, world.at_rest(), "an axis still turns")?;
        let others = || axes.iter().enumerate().filter(|(n, _)| !self.hits(*n));
        let coasted = (limits.struck.reaction == Reaction::Coasts).then(|| axes[self.axis].turned);
        let stood = match coasted {
            Some(_) => others().filter_map(|(_, axis)| axis.turned).max(),
            None => axes.iter().filter_map(|axis| axis.turned).max(),
        };
        let ramped = limits.others.reaction == Reaction::Ramp;
        let reached: Vec<Time> = match ramped {
            true => others().filter_map(|(_, axis)| axis.slow_at).collect(),
            false => Vec::new(),
        };
        let apart = reached.iter().max().zip(reached.iter().min());
        let apart = apart.map(|(last, first)| last.since(*first));
        let together = stop_tolerance(Time::from(world.machine().network().cycle));
        must(
            world,
            apart.is_none_or(|apart| apart <= together),
            &format!(
                "the axes come to rest {} ms apart",
                apart.unwrap_or(Time::ZERO).as_ms()
            ),
        )?;
        Ok(Struck {
            at,
            stood_after: stood.map(|stood| stood.since(at)),
            allowed: known.since(at) + limits.others.stands_by,
            coasted: coasted.flatten().map(|stood| stood.since(at)),
            apart,
            recovered: false,
        })
    }

    /// Whether the axis is the one at fault.
    fn hits(&self, axis: usize) -> bool {
        axis == self.axis
    }

    fn look(
        &self,
        world: &World<'_>,
        known: Time,
        limits: Limits,
        axes: &mut [Stopping],
    ) -> Result<(), TrialError> {
        let now = world.now();
        for (n, (truth, axis)) in world.truths().zip(axes).enumerate() {
            let limit = match self.hits(n) {
                true => limits.struck,
                false => limits.others,
            };
            let speed = truth.map_or(0.0, |truth| truth.velocity_rpm.abs());
            let node = world.machine().network().nodes[n].id.get();
            if now >= known + limit.stops_by {
                let from = *axis.from.get_or_insert(speed);
                let faster = speed > from + FASTER_RPM;
                must(
                    world,
                    !faster,
                    &format!("node {node} becomes faster: {speed:.0} rpm"),
                )?;
                if from > COMPARED_RPM && speed <= from * TOGETHER_PART {
                    axis.slow_at.get_or_insert(now);
                }
            }
            if speed > STANDSTILL_RPM {
                axis.turned = Some(now);
                let late = now > known + limit.stands_by;
                must(
                    world,
                    !late,
                    &format!("node {node} still turns: {speed:.0} rpm"),
                )?;
            }
        }
        Ok(())
    }

    /// Runs until the blocked axis is as far behind as the master allows, or the
    /// master has noticed that it does not arrive: an axis that makes the same moves
    /// shows where it should be.
    fn wait_for_following_error(&self, world: &mut World<'_>, at: Time) -> Time {
        let position = |world: &World<'_>, axis: usize| {
            let truth = world.truths().nth(axis).flatten();
            truth.map_or(0.0, |truth| truth.position_inc)
        };
        let assignment = world.machine().assignment();
        let set = |axis| assignment.of_axis(axis).next().map(|(_, part)| part.set);
        let others = 0..world.machine().network().nodes.len();
        let twin = others
            .into_iter()
            .find(|&n| !self.hits(n) && set(n) == set(self.axis));
        let twin = twin.unwrap_or(self.axis);
        let turn = f64::from(world.machine().motors()[self.axis].increments_per_turn);
        let from = position(world, twin);
        let whole = world.machine().round_trip().unwrap_or(Time::ZERO);
        while world.now() < at + whole {
            let behind = (position(world, twin) - from).abs();
            let gone = !world.round_trips().1;
            if gone || behind > turn * FOLLOWING_PART * FOLLOWING_MARGIN {
                return world.now();
            }
            if behind > 0.0 && world.at_rest() {
                return world.now() + ARRIVAL;
            }
            world.run_until(world.now() + LOOK);
        }
        world.now()
    }

    /// The machine is ready again where it overcomes the fault, and does not move
    /// before it is released.
    fn comes_back(&self, world: &mut World<'_>, struck: &mut Struck) -> Result<(), TrialError> {
        let limit = struck.at.max(world.now()) + self.lasts + READY_BY;
        if self.stays() {
            world.run_until(world.now() + WATCHED);
        } else {
            let ready = world.run_to(limit, World::ready);
            must(world, ready, "the drives are not all enabled again")?;
            world.run_until(world.now() + WATCHED);
        }
        must(world, world.at_rest(), "an axis turns again")?;
        nothing_moved_unasked(world)?;
        let ready = world.ready();
        refuses(world, ready)?;
        world.press();
        if !ready {
            world.run_until(world.now() + WATCHED);
            return must(
                world,
                world.at_rest(),
                "an axis turns although it was not ready",
            );
        }
        if self.cause == Cause::Blocked {
            return Ok(());
        }
        let turning = world.run_to(world.now() + MOVING_BY, World::in_full_motion);
        must(world, turning, "the axes do not turn after the release")?;
        struck.recovered = true;
        Ok(())
    }

    /// Whether somebody has to remove its cause.
    fn stays(&self) -> bool {
        match self.cause {
            Cause::DriveDisabled
            | Cause::DriveStops
            | Cause::Emergency
            | Cause::DropOut
            | Cause::Sto
            | Cause::HeartbeatLost
            | Cause::TpdosMissing
            | Cause::Blocked => true,
            Cause::SupplyLost
            | Cause::LeftOperational
            | Cause::DriveCutOff
            | Cause::MasterCutOff
            | Cause::ShortCircuit
            | Cause::MasterReset
            | Cause::MasterHangs => false,
        }
    }
}

/// One axis on its way to rest.
#[derive(Clone, Copy, Debug, Default)]
struct Stopping {
    /// Its speed when the stop must have begun.
    from: Option<f64>,
    /// When it had reached [`TOGETHER_PART`] of that.
    slow_at: Option<Time>,
    /// When it was last seen to turn.
    turned: Option<Time>,
}

/// A command that cannot be carried out is refused, with a reason: a move without a
/// release, or a release of a machine that is not ready.
fn refuses(world: &mut World<'_>, ready: bool) -> Result<(), TrialError> {
    const RELEASE: u16 = 3;
    const START: u16 = 10;
    let command = if ready { START } else { RELEASE };
    let board = world.machine().network().master.node;
    let at = Address::new(panel::COMMAND, 0);
    let done = world.sdo_write(board, at, &command.to_le_bytes());
    let refused = matches!(done, Err(SdoError::Aborted { .. }));
    must(world, refused, &format!("command {command}: {done:?}"))?;
    let why = world.sdo_read(board, Address::new(panel::REFUSAL, 0));
    let told = why.is_ok_and(|why| why.data().iter().any(|byte| *byte != 0));
    must(world, told, "the board does not say why it refuses")
}

fn nothing_moved_unasked(world: &World<'_>) -> Result<(), TrialError> {
    let mut axes = world.watch.axes.iter();
    let unasked = axes.any(|axis| axis.unreleased().is_some());
    must(world, !unasked, "an axis moved without a release")
}

//! A random fault at a random moment, and whether the machine keeps the contract:
//! never motion without release, everything at rest in time, what the master stops
//! comes to rest together, and the way back leads to standby.

mod draw;
mod judge;
mod lead;
mod programs;

use canmaster::NodeId;
use canmaster::emcy::{Emcy, EmcyCode, ErrorRegister};
use canmaster::motion::GroupState;
use canmaster::motion::mode::Mode;
use canmaster::nmt::{Command, NodeControl};

use super::trials::TrialError;
use super::{Client, Image, Scenario, Stimulus, World};
use crate::board::irqs;
use crate::bus::BusFault;
use crate::drive::cia402::State;
use crate::drive::{DriveFault, Trouble};
use crate::judge::Cause;
use crate::time::Time;

pub use draw::{Leader, Modes, Phase};

/// All drives are enabled by then, counted from power-on or from the end of a
/// fault that the machine overcomes.
const READY_BY: Time = Time::from_ms(8000);
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

/// What happens, and when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Strike {
    /// Who leads the group to the moment.
    pub leader: Leader,
    /// What.
    pub cause: Cause,
    /// To which drive, if to one.
    pub axis: usize,
    /// In which phase.
    pub phase: Phase,
    /// So long it moves before a client stops it.
    pub before: Time,
    /// So long after the phase has begun.
    pub after: Time,
    /// For so long, where it ends by itself.
    pub lasts: Time,
    /// Which of several of its kind.
    kind: usize,
}

/// The moment of the fault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Moment {
    /// From power-on.
    pub at: Time,
    /// What the group was in, as the firmware had logged it.
    pub state: GroupState,
    /// What the drives were in, as 6061h of each says.
    pub mode: &'static str,
}

/// What came of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Struck {
    /// From the fault until every axis stood that still had torque; `None` if nothing
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
    /// Whether only a machine knows of it whose drives send heartbeats in operational.
    pub fn wants_heartbeats(&self) -> bool {
        self.cause == Cause::HeartbeatLost
    }

    /// Does it to a machine of its own, and watches what comes of it: when it was, if it
    /// came to that, and what the contract does not allow, with its moment.
    pub fn run(&self, image: &Image, seed: u64) -> (Option<Moment>, Result<Struck, TrialError>) {
        let scenario = Scenario::new(seed, Time::MAX).unattended();
        let board = image.machine().network().master.node;
        let world = match World::new(image, scenario) {
            Ok(world) => world,
            Err(error) => return (None, Err(error.into())),
        };
        let mut client = Client::new(world, board);
        if let Err(error) = self.lead_to(&mut client) {
            return (None, Err(error));
        }
        let world = &client.world;
        let modes = modes(world);
        let moment = Moment {
            at: world.now(),
            state: group_state(world),
            mode: match self.phase {
                Phase::Start => "not set up",
                _ => common(&modes),
            },
        };
        let result = self.strike(&mut client, &modes);
        (Some(moment), result)
    }

    fn strike(&self, client: &mut Client<'_>, modes: &[Mode]) -> Result<Struck, TrialError> {
        let at = client.world.now();
        self.harm(&mut client.world);
        let mut struck = self.stops(&mut client.world, modes, at)?;
        self.comes_back(client, &mut struck)?;
        judge::nothing_moved_unasked(&client.world)?;
        Ok(struck)
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
}

/// The modes of all axes, as their drives have them; those that are not there and those
/// that are not set up are none of the group's.
fn modes(world: &World<'_>) -> Vec<Mode> {
    let mode = |status: crate::drive::DriveStatus| Mode::of(status.mode);
    let statuses = world.statuses();
    let modes = statuses.map(|status| status.and_then(mode).unwrap_or_default());
    modes.collect()
}

/// The modes as a table counts them.
pub const MODES: [&str; 8] = [
    "profile position",
    "profile velocity",
    "homing",
    "cyclic position",
    "cyclic velocity",
    "cyclic torque",
    "mixed",
    "not set up",
];

/// The name of the mode that all are in.
fn common(modes: &[Mode]) -> &'static str {
    const MIXED: usize = Mode::ALL.len();
    let all = |mode: &Mode| modes.iter().all(|of| of == mode);
    MODES[Mode::ALL.iter().position(all).unwrap_or(MIXED)]
}

/// What the group is in, as far as the firmware has said so since it started.
fn group_state(world: &World<'_>) -> GroupState {
    let mut lines = world.log().iter().rev();
    lines
        .find_map(|(_, line)| state_in(&line.message))
        .unwrap_or(GroupState::Idle)
}

fn state_in(message: &str) -> Option<GroupState> {
    let (_, to) = message.strip_prefix("group: ")?.split_once(" -> ")?;
    let named = |state: &GroupState| to.starts_with(&state.to_string());
    let states = GroupState::ALL.into_iter().filter(named);
    // One name is the beginning of another.
    states.max_by_key(|state| state.to_string().len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_state_is_read_from_the_log() {
        for state in GroupState::ALL {
            let line = format!("group: moving -> {state}: and more");
            assert_eq!(state_in(&line), Some(state));
        }
        assert_eq!(state_in("axis 1: arrived at 5 -> idle"), None);
    }
}

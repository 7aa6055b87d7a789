//! How many cycles of the core the steps of the axes take in each mode: while they move,
//! when a move replaces another, when they are stopped, and when a fault stops them.

use std::thread;
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};
use canmaster::NodeId;
use canmaster::id::Address;
use canmaster::motion::{GroupState, panel};
use canmaster_sim::board::irqs;
use canmaster_sim::drive::DriveFault;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Image, Scenario, Stimulus, World};
use serde::Serialize;

use super::{Outcome, Report};
use crate::table;

/// The most that a step of all axes may take, cycles.
const WORST: u64 = 10_000;
/// All drives are enabled by then.
const READY_BY: Time = Time::from_ms(8000);
/// A mode, and what is moved in it.
#[derive(Clone, Copy)]
struct Case {
    mode: &'static str,
    /// 6060h.
    code: i8,
    task: Task,
}

/// What the axes do while their steps are measured.
#[derive(Clone, Copy)]
enum Task {
    /// A move that is ordered over CAN, and replaced on the way.
    Move([i32; 2]),
    /// A search for home where they are, and one that is stopped.
    Home,
}

const fn case(mode: &'static str, code: i8, task: Task) -> Case {
    Case { mode, code, task }
}

/// Increments from home.
const FAR: Task = Task::Move([20_000, -5_000]);
/// Homing methods (CiA 402-2, 11.3): home is where the drive is; home switch and index.
const HERE: u8 = 37;
const SWITCH: u8 = 7;
/// An error of a drive that switches it off (EMCY).
const OVERCURRENT: u16 = 0x2310;

/// Every mode.
const CASES: [Case; 6] = [
    case("profile velocity", 3, FAR),
    case("cyclic synchronous position", 8, FAR),
    case("cyclic synchronous velocity", 9, FAR),
    // Per mille of the rated torque.
    case("cyclic synchronous torque", 10, Task::Move([30, -30])),
    case("profile position", 1, FAR),
    case("homing", 6, Task::Home),
];

/// Profile velocity and acceleration of a move, rpm and rpm/s; of a torque per mille
/// in a second.
const VELOCITY: u32 = 1000;
const ACCELERATION: u32 = 2000;
/// Values of the group command and of the group state (`docs/motion.md`).
const RELEASE: u16 = 3;
const STOP: u16 = 4;
const HOME: u16 = 8;
const SET_MODES: u16 = 9;
const START: u16 = 10;
/// How long a command may take to have its effect.
const PATIENCE: Time = Time::from_ms(3000);
/// How long the first move is followed, and the one that replaces it.
const FIRST: Time = Time::from_ms(400);
const SECOND: Time = Time::from_ms(1200);

/// What was measured in one mode.
#[derive(Serialize)]
struct Mode {
    mode: &'static str,
    mean: f64,
    worst: u64,
}

#[derive(Serialize)]
struct Figures {
    axes: usize,
    worst_allowed: u64,
    modes: Vec<Mode>,
}

pub(super) fn run(image: &Image, seed: u64) -> Result<Outcome> {
    let started = Instant::now();
    let modes: Result<Vec<Mode>> = thread::scope(|scope| {
        let start = |case| scope.spawn(move || Case::measure(&case, image, seed));
        let all = CASES.map(start).into_iter();
        all.map(|one| {
            one.join()
                .unwrap_or_else(|_| bail!("the emulation broke off"))
        })
        .collect()
    });
    let modes = modes?;
    let figures = Figures {
        axes: image.machine().network().nodes.len(),
        worst_allowed: WORST,
        modes,
    };
    let missed = figures.missed();
    let table = figures.as_table();
    let report = Report::new(figures, seed, started.elapsed().as_secs_f64(), &missed);
    Ok(Outcome {
        json: report.json()?,
        table,
        missed,
    })
}

impl Case {
    fn measure(&self, image: &Image, seed: u64) -> Result<Mode> {
        let scenario = Scenario::new(seed, Time::MAX).unattended();
        let world =
            World::new(image, scenario).context("the emulated board cannot boot this image")?;
        let mut tool = Tool::new(world.with_guest());
        ensure!(
            tool.world.run_to(READY_BY, World::ready),
            "not all drives were enabled after {READY_BY} s; see `cargo xtask run`"
        );
        if self.code != PROFILE_VELOCITY {
            tool.change_modes(self.code)?;
        }
        tool.until(GroupState::Standby)?;
        tool.world.clear_stats();
        match self.task {
            Task::Move(targets) => tool.moves(targets)?,
            Task::Home => tool.home()?,
        }
        tool.fault()?;
        let stats = tool.world.board().stats();
        let steps = stats.irq(irqs::TIM3).context("the axes were not stepped")?;
        Ok(Mode {
            mode: self.mode,
            mean: steps.total_cycles as f64 / steps.count.max(1) as f64,
            worst: steps.worst_cycles,
        })
    }
}

/// The mode that the drives start in.
const PROFILE_VELOCITY: i8 = 3;

/// A tool on the bus that orders by SDO what the group does.
struct Tool<'i> {
    world: World<'i>,
    board: NodeId,
    nodes: Vec<NodeId>,
}

impl<'i> Tool<'i> {
    fn new(world: World<'i>) -> Tool<'i> {
        let network = world.machine().network();
        Tool {
            board: network.master.node,
            nodes: network.nodes.iter().map(|node| node.id).collect(),
            world,
        }
    }

    fn write(&mut self, index: u16, sub: usize, data: &[u8]) -> Result<()> {
        let at = Address::new(index, sub as u8);
        let done = self.world.sdo_write(self.board, at, data);
        done.with_context(|| format!("the board refuses {index:04X}h:{sub:02X}"))
    }

    fn command(&mut self, command: u16) -> Result<()> {
        let Err(refused) = self.write(panel::COMMAND, 0, &command.to_le_bytes()) else {
            return Ok(());
        };
        let why = self.number(panel::REFUSAL)?;
        let why = why.iter().rev().map(|byte| format!("{byte:02X}"));
        let why: String = why.collect();
        let state = self.number(panel::STATE)?;
        Err(refused).context(format!(
            "command {command}: {why}h in 2002h, the group is in state {state:?}; see docs/motion.md"
        ))
    }

    fn number(&mut self, index: u16) -> Result<Vec<u8>> {
        let answer = self.world.sdo_read(self.board, Address::new(index, 0));
        let answer = answer.with_context(|| format!("the board does not tell {index:04X}h"))?;
        Ok(answer.data().to_vec())
    }

    /// Until the group is in a state.
    fn until(&mut self, state: GroupState) -> Result<()> {
        let limit = self.world.now() + PATIENCE;
        while self.world.now() < limit {
            if self.number(panel::STATE)? == [state as u8] {
                return Ok(());
            }
        }
        let found = self.number(panel::STATE)?;
        let mut faults = Vec::new();
        for axis in 1..=self.nodes.len() {
            let at = Address::new(panel::FAULT, axis as u8);
            let answer = self.world.sdo_read(self.board, at);
            faults.push(answer.map(|answer| answer.data().to_vec()));
        }
        bail!(
            "the group is not {state} after {PATIENCE} s but in state {found:?}; 200Eh: {faults:X?}"
        )
    }

    fn change_modes(&mut self, code: i8) -> Result<()> {
        self.until(GroupState::Standby)?;
        for axis in 1..=self.nodes.len() {
            self.write(panel::MODE, axis, &code.to_le_bytes())?;
        }
        self.command(SET_MODES)?;
        let limit = self.world.now() + PATIENCE;
        let done = self.world.run_to(limit, |world| {
            world.statuses().flatten().all(|status| status.mode == code)
        });
        ensure!(done, "not all drives are in mode {code} after {PATIENCE} s");
        self.until(GroupState::Standby)
    }

    fn moves(&mut self, targets: [i32; 2]) -> Result<()> {
        for axis in 1..=self.nodes.len() {
            self.write(panel::VELOCITY, axis, &VELOCITY.to_le_bytes())?;
            self.write(panel::ACCELERATION, axis, &ACCELERATION.to_le_bytes())?;
        }
        let [first, second] = targets;
        self.command(RELEASE)?;
        self.until(GroupState::Moving)?;
        self.start(first, FIRST)?;
        self.start(second, SECOND)?;
        self.start(first, FIRST)?;
        self.command(STOP)?;
        self.until(GroupState::Standby)?;
        self.command(RELEASE)?;
        self.until(GroupState::Moving)?;
        self.start(second, FIRST)
    }

    /// A move of all axes, and so much of it.
    fn start(&mut self, target: i32, time: Time) -> Result<()> {
        for axis in 1..=self.nodes.len() {
            self.write(panel::TARGET, axis, &target.to_le_bytes())?;
        }
        self.command(START)?;
        self.world.run_until(self.world.now() + time);
        self.until(GroupState::Moving)
    }

    fn home(&mut self) -> Result<()> {
        self.search(HERE)?;
        self.until(GroupState::Standby)?;
        self.search(SWITCH)?;
        self.command(STOP)?;
        self.until(GroupState::Standby)?;
        self.search(SWITCH)
    }

    /// All axes search for home by this method, for a while.
    fn search(&mut self, method: u8) -> Result<()> {
        let at = Address::new(HOMING_METHOD, 0);
        for node in self.nodes.clone() {
            let done = self.world.sdo_write(node, at, &[method]);
            done.with_context(|| format!("node {} refuses the method", node.get()))?;
        }
        self.command(RELEASE)?;
        self.until(GroupState::Moving)?;
        self.command(HOME)?;
        self.world.run_until(self.world.now() + FIRST);
        Ok(())
    }

    /// The first drive fails, and the others are stopped.
    fn fault(&mut self) -> Result<()> {
        let node = *self.nodes.first().context("there is no axis")?;
        let fault = DriveFault::Error {
            at: self.world.now(),
            code: OVERCURRENT,
            until: None,
        };
        self.world.apply(Stimulus::Drive { node, fault });
        self.until(GroupState::Faulted)
    }
}

/// Homing method (CiA 402-2, 11.5).
const HOMING_METHOD: u16 = 0x6098;

impl Figures {
    fn missed(&self) -> Vec<String> {
        let slow = self.modes.iter().filter(|mode| mode.worst > WORST);
        slow.map(|mode| {
            format!(
                "{}: {} cycles at worst, at most {WORST} are allowed",
                mode.mode, mode.worst
            )
        })
        .collect()
    }

    fn as_table(&self) -> comfy_table::Table {
        let mut table = table::new(&["mode", "mean [cycles]", "worst [cycles]", "allowed"]);
        table::align_right(&mut table, &[1, 2, 3]);
        for mode in &self.modes {
            table.add_row([
                mode.mode.to_string(),
                format!("{:.0}", mode.mean),
                mode.worst.to_string(),
                WORST.to_string(),
            ]);
        }
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_mode_is_told() {
        let figures = |worst| Figures {
            axes: 6,
            worst_allowed: WORST,
            modes: vec![Mode {
                mode: "profile velocity",
                mean: 5000.5,
                worst,
            }],
        };
        assert!(figures(WORST).missed().is_empty());
        let missed = figures(WORST + 1).missed();
        assert!(missed[0].contains("profile velocity: 10001 cycles"));
        let report = Report::new(figures(WORST + 1), 1, 0.5, &missed);
        let object: serde_json::Value = serde_json::from_str(&report.json().unwrap()).unwrap();
        assert_eq!(object["result"], "failed");
        assert_eq!(object["axes"], 6);
        assert_eq!(object["modes"][0]["mode"], "profile velocity");
        assert_eq!(object["modes"][0]["worst"], 10_001);
        assert_eq!(object["modes"][0]["mean"], 5000.5);
    }
}

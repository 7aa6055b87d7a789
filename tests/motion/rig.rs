//! Six drives, a group and the SYNC between them.

use canmaster::cia402::State;
use canmaster::motion::experiment::GROUP;
use canmaster::motion::mode::Mode;
use canmaster::motion::{AxisCommand, DriveSetting, Group, Inputs, Order};
use canmaster::motion::{AxisFeedback, AxisMove, Director, GroupEvent, GroupState};

use crate::plant::{Drive, STEPS};

pub(crate) const AXES: usize = 6;
/// Cycle in milliseconds.
pub(crate) const CYCLE_MS: f64 = 10.0;
/// Speed above which an axis is not stopped, rpm.
const STOPPED_RPM: f64 = 5.0;

/// What the plant did since it was last asked.
#[derive(Clone, Copy, Default)]
pub(crate) struct Observed {
    /// Last moment above 5 rpm, milliseconds.
    pub(crate) stopped_ms: f64,
    /// Extremes of the true position 100 ms after that and later.
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Extremes of the true position at any time.
    pub(crate) lowest: f64,
    pub(crate) highest: f64,
}

pub(crate) struct Rig {
    pub(crate) group: Group<AXES>,
    pub(crate) director: Director<AXES>,
    pub(crate) program: Vec<u8>,
    pub(crate) notices: Vec<GroupEvent>,
    /// 6061h follows 6060h.
    pub(crate) confirms: bool,
    pub(crate) drives: [Drive; AXES],
    pub(crate) feedback: [AxisFeedback; AXES],
    pub(crate) commands: [AxisCommand; AXES],
    pub(crate) observed: [Observed; AXES],
    pub(crate) events: Vec<GroupEvent>,
    /// TPDOs of these axes are missing.
    pub(crate) silent: [bool; AXES],
    pub(crate) cycle: u32,
}

impl Rig {
    pub(crate) fn new(seed: u64) -> Rig {
        let drives = core::array::from_fn(|n| Drive::new(seed * 100 + n as u64));
        Rig {
            group: Group::new(&GROUP),
            director: Director::new(&GROUP),
            program: Vec::new(),
            notices: Vec::new(),
            confirms: true,
            drives,
            feedback: Default::default(),
            commands: Default::default(),
            observed: Default::default(),
            events: Vec::new(),
            silent: [false; AXES],
            cycle: 0,
        }
    }

    /// Enabled and in standby.
    pub(crate) fn standby(seed: u64) -> Rig {
        let mut rig = Rig::new(seed);
        rig.until(GroupState::Standby, 100);
        rig
    }

    /// In standby in another mode.
    pub(crate) fn in_mode(seed: u64, mode: Mode) -> Rig {
        let mut rig = Rig::standby(seed);
        rig.order(Order::SetMode { axes: ALL, mode });
        rig.step(READY);
        rig.until(GroupState::Standby, 50);
        assert!(rig.drives.iter().all(|drive| drive.mode == mode));
        rig
    }

    /// Released, without anything to do.
    pub(crate) fn released(&mut self) {
        self.order(Order::Release);
        self.step(READY);
        assert_eq!(self.group.state(), GroupState::Moving);
    }

    /// Released and on a long move, fast after 100 cycles.
    pub(crate) fn moving(seed: u64, cycles: u32) -> Rig {
        let mut rig = Rig::standby(seed);
        rig.released();
        rig.go(far);
        for _ in 0..cycles {
            rig.step(READY);
        }
        assert_eq!(rig.group.state(), GroupState::Moving);
        rig
    }

    pub(crate) fn order(&mut self, order: Order) {
        assert_eq!(self.group.order(order), Ok(()), "{}", self.last());
    }

    /// A move of all axes.
    pub(crate) fn go(&mut self, part: impl Fn(usize) -> AxisMove) {
        let parts = core::array::from_fn(part);
        assert_eq!(self.director.go(&self.group, ALL, &parts, 0), Ok(()));
    }

    /// Releases the program.
    pub(crate) fn run(&mut self) {
        assert_eq!(self.director.run(&mut self.group), Ok(()));
    }

    /// Steps until `state`, at most `cycles`.
    pub(crate) fn until(&mut self, state: GroupState, cycles: u32) {
        let came = (0..cycles).any(|_| {
            self.step(READY);
            self.group.state() == state
        });
        assert!(came, "{state} is not reached: {}", self.last());
    }

    /// Steps until all have arrived, and nothing is planned any more.
    pub(crate) fn arrive(&mut self, cycles: u32) {
        self.step(READY);
        let came = (0..cycles).any(|_| {
            self.step(READY);
            self.director.patience() == 0 && self.group.all_arrived()
        });
        assert!(came, "{}", self.last());
    }

    /// One cycle: SYNC, TPDOs, group, RPDOs, planning, and 10 ms of plant.
    pub(crate) fn step(&mut self, inputs: Inputs) {
        for (n, drive) in self.drives.iter_mut().enumerate() {
            self.feedback[n] = drive.sync();
            self.feedback[n].fresh = !self.silent[n];
        }
        self.group.step(&inputs, &self.feedback, &mut self.commands);
        while let Some(event) = self.group.take_event() {
            self.events.push(event);
        }
        self.director.round(&mut self.group, &self.program);
        while let Some(event) = self.group.take_event() {
            self.notices.push(event);
        }
        if self.confirms
            && let Some(wanted) = self.group.wanted()
        {
            let drive = &mut self.drives[wanted.axis];
            match wanted.setting {
                DriveSetting::Mode => drive.set_mode(Mode::of(wanted.value as i8).unwrap()),
                DriveSetting::ProfileVelocity => drive.profile_velocity = wanted.value.into(),
            }
            self.group.confirm(&wanted);
        }
        for (drive, command) in self.drives.iter_mut().zip(&self.commands) {
            drive.receive(*command);
        }
        for step in 0..STEPS {
            let now = CYCLE_MS * (f64::from(self.cycle) + f64::from(step) / f64::from(STEPS));
            for (drive, seen) in self.drives.iter_mut().zip(&mut self.observed) {
                drive.step();
                seen.lowest = seen.lowest.min(drive.position);
                seen.highest = seen.highest.max(drive.position);
                if drive.velocity.abs() > STOPPED_RPM {
                    seen.stopped_ms = now;
                }
                if now < seen.stopped_ms + 100.0 {
                    (seen.low, seen.high) = (drive.position, drive.position);
                }
                seen.low = seen.low.min(drive.position);
                seen.high = seen.high.max(drive.position);
            }
        }
        self.cycle += 1;
    }

    /// Forgets what the plant did.
    pub(crate) fn observe_anew(&mut self) {
        for (drive, seen) in self.drives.iter().zip(&mut self.observed) {
            (seen.low, seen.high) = (drive.position, drive.position);
            (seen.lowest, seen.highest) = (drive.position, drive.position);
        }
    }

    pub(crate) fn all(&self, state: State) -> bool {
        self.drives.iter().all(|d| d.state == state)
    }

    pub(crate) fn standing(&self) -> bool {
        self.drives.iter().all(|d| d.velocity.abs() < STOPPED_RPM)
    }

    /// The end of what was told, for messages.
    pub(crate) fn last(&self) -> String {
        let from = self.events.len().saturating_sub(9);
        let notices = self.notices.len().saturating_sub(4);
        format!("{:?} {:?}", &self.events[from..], &self.notices[notices..])
    }

    /// The states that the group went through.
    pub(crate) fn states(&self) -> Vec<GroupState> {
        let entered = self.events.iter().filter_map(|event| match event {
            GroupEvent::State { to, .. } => Some(*to),
            _ => None,
        });
        entered.collect()
    }
}

/// Every axis.
pub(crate) const ALL: u32 = (1 << AXES) - 1;

/// A long move, another for each pair.
pub(crate) fn far(n: usize) -> AxisMove {
    AxisMove {
        target: [80_000, -60_000, 80_000, -60_000, 120_000, 120_000][n],
        velocity: [1200, 900, 1200, 900, 1500, 1500][n],
        acceleration: [1500, 1000, 1500, 1000, 2000, 2000][n],
        deceleration: [800, 600, 800, 600, 1000, 1000][n],
        set: [1, 2, 1, 2, 3, 3][n],
    }
}

/// The network is up, and nothing else.
pub(crate) const READY: Inputs = Inputs {
    network_ready: true,
    absent: 0,
    fault: None,
    passed: 1,
};

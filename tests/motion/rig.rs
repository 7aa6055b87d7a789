//! Six drives, a group and the SYNC between them.

use canmaster::cia402::State;
use canmaster::motion::experiment::GROUP;
use canmaster::motion::{AxisCommand, AxisFeedback, Group, GroupEvent, GroupState, Request};

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
        let left = rig.until(GroupState::Standby, 100);
        assert!(left > 0, "{:?}", rig.events);
        rig
    }

    /// Released; returns once the group moves.
    pub(crate) fn moving(seed: u64, cycles: u32) -> Rig {
        let mut rig = Rig::standby(seed);
        rig.release();
        for _ in 0..cycles {
            rig.step(READY);
        }
        assert_eq!(rig.group.state(), GroupState::Moving);
        rig
    }

    pub(crate) fn release(&mut self) {
        self.step(Request {
            release: true,
            ..READY
        });
    }

    /// Steps until `state`, at most `cycles`; returns how many were left.
    pub(crate) fn until(&mut self, state: GroupState, cycles: u32) -> u32 {
        (0..cycles)
            .rev()
            .find(|_| {
                self.step(READY);
                self.group.state() == state
            })
            .unwrap_or(0)
    }

    /// One cycle: SYNC, TPDOs, group, RPDOs, and 10 ms of plant.
    pub(crate) fn step(&mut self, request: Request) {
        for (n, drive) in self.drives.iter_mut().enumerate() {
            self.feedback[n] = drive.sync();
            self.feedback[n].fresh = !self.silent[n];
        }
        self.group.step(request, &self.feedback, &mut self.commands);
        while let Some(event) = self.group.take_event() {
            self.events.push(event);
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
}

/// Nothing is asked and the network is up.
pub(crate) const READY: Request = Request {
    network_ready: true,
    release: false,
    stop: false,
    fault: None,
    passed: 1,
    absent: 0,
};

//! A step of the group, in each of its states. What six ideal drives say is
//! recorded first, so that the drives' own work is not counted.

use std::hint::black_box;

use canmaster::motion::experiment::GROUP;
use canmaster::motion::{
    AxisCommand, AxisFeedback, AxisMove, Cause, Director, Group, GroupState, Inputs, Order,
};

const AXES: usize = 6;
/// A bit for each of them.
const ALL: u32 = (1 << AXES) - 1;
/// Increments that an axis goes in a cycle of 10 ms at 3 rpm: 2000 a turn.
const STEP_INC: i32 = 1;
const STEP_RPM: i32 = 3;
/// When the drives begin to obey: the group waits for them while enabling.
const ASLEEP: usize = 30;
/// When things are asked for.
const NETWORK_UP: usize = 15;
const RELEASED: usize = 100;
const STOPPED: usize = 150;
const RELEASED_AGAIN: usize = 300;
const FAULT: usize = 350;
const END: usize = 500;

/// One step and what the group was told in it.
struct Step {
    inputs: Inputs,
    order: Option<Order>,
    feedback: [AxisFeedback; AXES],
    /// The state before it.
    state: GroupState,
}

/// A move that lasts.
const FAR: AxisMove = AxisMove {
    target: 1_000_000,
    velocity: 1500,
    acceleration: 2000,
    deceleration: 2000,
    set: 0,
};

/// Statuswords of CiA 402 with remote.
const DISABLED: u16 = 0x0250;
const READY: u16 = 0x0231;
const SWITCHED_ON: u16 = 0x0233;
const ENABLED: u16 = 0x0237;

fn obey(drive: &mut AxisFeedback, command: &AxisCommand, awake: bool) {
    drive.fresh = true;
    if !awake {
        drive.statusword = DISABLED;
        return;
    }
    drive.statusword = match (command.controlword & 0x0F, drive.statusword) {
        (0x06, _) => READY,
        (0x07, READY | SWITCHED_ON | ENABLED) => SWITCHED_ON,
        (0x0F, SWITCHED_ON | ENABLED) => ENABLED,
        (0x0F, other) => other,
        _ => DISABLED,
    };
    let moves = drive.statusword == ENABLED;
    drive.velocity = if moves { command.target } else { 0 };
    drive.position += drive.velocity * STEP_INC / STEP_RPM;
}

/// From the start through all states to the fault.
fn recorded() -> Vec<Step> {
    let mut run = Run::new();
    let mut feedback = [AxisFeedback::default(); AXES];
    let mut steps = Vec::new();
    for at in 0..END {
        for (drive, command) in feedback.iter_mut().zip(&run.commands) {
            obey(drive, command, at >= ASLEEP);
        }
        steps.push(Step {
            inputs: Inputs {
                network_ready: at >= NETWORK_UP,
                fault: (at == FAULT).then_some((0, Cause::HeartbeatLost.alone())),
                absent: 0,
                passed: 1,
            },
            order: match at {
                RELEASED | RELEASED_AGAIN => Some(Order::Release),
                STOPPED => Some(Order::Stop),
                _ => None,
            },
            feedback,
            state: run.group.state(),
        });
        run.step(steps.last());
    }
    steps
}

/// The group, and who plans for it.
struct Run {
    group: Group<AXES>,
    director: Director<AXES>,
    commands: [AxisCommand; AXES],
}

impl Run {
    fn new() -> Run {
        Run {
            group: Group::new(&GROUP),
            director: Director::new(&GROUP),
            commands: [AxisCommand::default(); AXES],
        }
    }

    /// A released group gets something to do at once.
    fn step(&mut self, step: Option<&Step>) {
        let Some(step) = step else { return };
        if let Some(order) = step.order {
            // What is refused shows in the state.
            let _ = self.group.order(order);
        }
        self.group
            .step(&step.inputs, &step.feedback, &mut self.commands);
        while self.group.take_event().is_some() {}
        let released = step.order == Some(Order::Release);
        if released && self.group.state() == GroupState::Moving {
            let _ = self.director.go(&self.group, ALL, &[FAR; AXES], 0);
            self.director.round(&mut self.group, &[]);
        }
    }
}

/// Leads a group to step `from` and then `times` farther.
fn from(steps: &[Step], from: usize, times: u32) {
    let mut run = Run::new();
    for n in 0..from {
        run.step(steps.get(n));
    }
    for n in from..from + times as usize {
        run.step(steps.get(n));
        black_box(&run.commands);
    }
}

/// The steps of the last time that the group was in `state`.
fn within(state: GroupState, times: u32) {
    let steps = recorded();
    let is = |step: &Step| step.state == state;
    let last = steps.iter().rposition(is).unwrap_or(0);
    let before = steps.iter().take(last).rposition(|step| !is(step));
    let first = before.map_or(0, |before| before + 1);
    assert!(
        is(&steps[last]) && first + times as usize <= last,
        "{state:?} is reached for {} steps",
        last - first
    );
    from(&steps, first, times);
}

pub(crate) fn idle(times: u32) {
    from(&recorded(), 0, times);
}

pub(crate) fn enabling(times: u32) {
    within(GroupState::Enabling, times);
}

pub(crate) fn standby(times: u32) {
    within(GroupState::Standby, times);
}

pub(crate) fn moving(times: u32) {
    within(GroupState::Moving, times);
}

/// The step in which a motion is released.
pub(crate) fn release(times: u32) {
    from(&recorded(), RELEASED, times);
}

pub(crate) fn stopping(times: u32) {
    within(GroupState::Stopping, times);
}

pub(crate) fn fault_stop(times: u32) {
    within(GroupState::FaultStop, times);
}

pub(crate) fn faulted(times: u32) {
    within(GroupState::Faulted, times);
}

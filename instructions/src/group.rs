//! A step of the group, in each of its states. What six ideal drives say is
//! recorded first, so that the drives' own work is not counted.

use std::hint::black_box;

use canmaster::motion::experiment::GROUP;
use canmaster::motion::{AxisCommand, AxisFeedback, FaultCause, Group, GroupState, Request};

const AXES: usize = 6;
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
    request: Request,
    feedback: [AxisFeedback; AXES],
    /// The state before it.
    state: GroupState,
}

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
    drive.velocity = if moves { command.velocity } else { 0 };
    drive.position += drive.velocity * STEP_INC / STEP_RPM;
}

/// From the start through all states to the fault.
fn recorded() -> Vec<Step> {
    let mut group = Group::new(&GROUP);
    let mut feedback = [AxisFeedback::default(); AXES];
    let mut commands = [AxisCommand::default(); AXES];
    let mut steps = Vec::new();
    for at in 0..END {
        for (drive, command) in feedback.iter_mut().zip(&commands) {
            obey(drive, command, at >= ASLEEP);
        }
        let request = Request {
            network_ready: at >= NETWORK_UP,
            release: at == RELEASED || at == RELEASED_AGAIN,
            stop: at == STOPPED,
            fault: (at == FAULT).then_some((0, FaultCause::HeartbeatLost)),
            passed: 1,
            absent: 0,
        };
        steps.push(Step {
            request,
            feedback,
            state: group.state(),
        });
        step(&mut group, steps.last(), &mut commands);
    }
    steps
}

fn step(group: &mut Group<AXES>, step: Option<&Step>, commands: &mut [AxisCommand; AXES]) {
    if let Some(step) = step {
        group.step(step.request, &step.feedback, commands);
    }
    while group.take_event().is_some() {}
}

/// Leads a group to step `from` and then `times` farther.
fn from(steps: &[Step], from: usize, times: u32) {
    let mut group = Group::new(&GROUP);
    let mut commands = [AxisCommand::default(); AXES];
    for n in 0..from {
        step(&mut group, steps.get(n), &mut commands);
    }
    for n in from..from + times as usize {
        step(&mut group, steps.get(n), &mut commands);
        black_box(&commands);
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

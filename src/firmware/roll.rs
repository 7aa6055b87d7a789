//! The roll call of the tasks.

use canmaster::master::RollCall;

/// The tasks that have to show up before the watchdog is fed.
#[derive(Clone, Copy)]
#[repr(u32)]
pub(crate) enum Task {
    SyncTick,
    CanIrq,
    PdoProducer,
    Network,
    SdoConfigurator,
}

const TASKS: u32 = Task::SdoConfigurator as u32 + 1;

static ROLL: RollCall = RollCall::new(TASKS);

/// `task` is alive.
#[inline(always)]
pub(crate) fn check_in(task: Task) {
    ROLL.check_in(task as u32);
}

/// Whether every task has shown up since the last `true`.
pub(crate) fn complete() -> bool {
    ROLL.complete()
}

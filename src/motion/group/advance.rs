//! What goes on by itself in each state, and how a state is entered.

use super::axis::{
    AT_REST, Axis, BY_DRIVE, BY_POSITION, ENABLED, ENDED, PASSING, PLACED, REACHED, SILENT, SLOW,
    STOP_MIN,
};
use super::{Group, Wanted, bit};
use crate::cia402::Goal;
use crate::motion::contract::{Cell, Event, cell};
use crate::motion::mode::Mode;
use crate::motion::{AxisConfig, Cause, GroupConfig, GroupEvent, GroupState, fixed, greater, next};

impl<const N: usize> Group<N> {
    /// What an event does, as the table has it. `false`: it is refused.
    pub(super) fn happen(&mut self, event: Event) -> bool {
        match cell(self.state, event) {
            Cell::Stay => {}
            Cell::Refuse => return false,
            Cell::Go(to) => self.enter(to),
        }
        true
    }

    #[inline(never)]
    fn enter(&mut self, to: GroupState) {
        let Some(config) = self.config else { return };
        let from = core::mem::replace(&mut self.state, to);
        self.since = 0;
        self.events.report(GroupEvent::State { from, to });
        self.announced = 0;
        // What came to rest before does not count.
        for axis in &mut self.axes {
            axis.seen &= !PASSING;
            axis.forget_speed();
        }
        match to {
            GroupState::Enabling => {
                self.faulted = 0;
                self.excluded = 0;
                self.coasting = 0;
                self.busy = 0;
                for (axis, limits) in self.axes.iter_mut().zip(&config.axes) {
                    axis.restart(limits.mode);
                }
                self.set_stage(Goal::Disabled);
            }
            GroupState::Disabling => self.set_stage(Goal::Disabled),
            GroupState::Stopping | GroupState::Halt => self.stop(false, config),
            GroupState::FaultStop => {
                self.network_was_down = false;
                // Axes that their drives do not hold enabled are excluded; that is
                // news only if they were.
                self.excluded = !(self.which(ENABLED) & self.here());
                self.coasting = self.absent;
                if from == GroupState::Enabling {
                    self.coasting = self.excluded;
                }
                self.stop(true, config);
            }
            // Where the drives come to rest is theirs to say.
            GroupState::QuickStop => self.hold_actual(),
            // At the end of a motion the axes are where they should be.
            GroupState::Standby if from != GroupState::Moving => self.hold_actual(),
            _ => {}
        }
    }

    /// Ramps from the next SYNC on, equally long for all axes.
    fn stop(&mut self, fault: bool, config: &GroupConfig<N>) {
        let led = self.here() & !self.excluded;
        let mut speeds = [0.0; N];
        let mut fastest = 0.0;
        let axes = self.axes.iter().zip(&config.axes).zip(&mut speeds);
        for (n, ((axis, config), speed)) in axes.enumerate() {
            if led & bit(n) != 0 {
                *speed = axis.speed(fault, config);
                fastest = greater(fastest, speed.abs());
            }
        }
        let cycles = stop_cycles(fastest, config).max(STOP_MIN);
        const PERCENT: f32 = 0.01;
        let more = config.ramp_percent as f32 * PERCENT;
        let least = config.ramp_min as f32;
        // Of a drive that halts by itself.
        let own = config.stop_deceleration as f32;
        let axes = self.axes.iter_mut().zip(&config.axes).zip(speeds);
        for ((axis, config), speed) in axes {
            let slope = axis.stop(cycles, speed, config);
            let ramp = if axis.seen & BY_POSITION != 0 {
                greater(config.scale.rpm_per_s(slope) * more, least)
            } else if axis.seen & BY_DRIVE != 0 {
                own
            } else {
                continue;
            };
            axis.set_ramps(ramp, ramp);
        }
    }

    fn set_stage(&mut self, stage: Goal) {
        self.stage = stage;
        self.since = 0;
        for axis in &mut self.axes {
            axis.seen &= !REACHED;
            axis.machine.set_goal(stage, self.now);
        }
    }

    #[inline(never)]
    pub(super) fn hold_actual(&mut self) {
        self.axes.iter_mut().for_each(Axis::hold_actual);
    }

    /// What goes on by itself in each state.
    pub(super) fn advance(&mut self, config: &GroupConfig<N>) {
        let done = match self.state {
            GroupState::Idle | GroupState::Standby | GroupState::Faulted | GroupState::Halt => {
                false
            }
            GroupState::Enabling | GroupState::Disabling => self.next_stage(config),
            GroupState::Moving | GroupState::Homing => {
                self.arrive(true, config) && self.state == GroupState::Homing
            }
            GroupState::Stopping => self.arrive(false, config),
            GroupState::ModeChange => self.knows_modes(config),
            // The step that begins it has enough to do.
            GroupState::QuickStop | GroupState::FaultStop => {
                self.since > 0 && self.comes_to_rest(config)
            }
        };
        if done {
            self.happen(Event::Done);
        }
    }

    /// Whether 6061h of every axis has shown its mode.
    #[inline(never)]
    fn knows_modes(&mut self, config: &GroupConfig<N>) -> bool {
        // No velocity is asked for in this state.
        let Some(Wanted { axis, value, .. }) = self.next_wanted() else {
            return true;
        };
        if self.since > config.cycles(config.enable_timeout) {
            let cause = Cause::ModeNotConfirmed.with(value as i32);
            self.fault(Some(axis as u8), cause, Event::Late);
        }
        false
    }

    /// All axes reach a state before the next transition is commanded.
    fn next_stage(&mut self, config: &GroupConfig<N>) -> bool {
        let here = self.here();
        if here & !self.which(REACHED) != 0 {
            return false;
        }
        let next = match self.stage {
            _ if self.state == GroupState::Disabling => return true,
            Goal::Disabled => {
                if !self.knows_modes(config) {
                    return false;
                }
                Goal::Ready
            }
            Goal::Ready => Goal::SwitchedOn,
            Goal::SwitchedOn => Goal::Enabled,
            Goal::Enabled | Goal::QuickStop => {
                // A drive that was switched off in motion may have been enabled
                // before its axis stood: it brakes first.
                let rest = here & !self.which(SLOW) == 0;
                for axis in self.axes.iter_mut().filter(|_| rest) {
                    axis.home = axis.feedback.position;
                }
                return rest;
            }
        };
        self.set_stage(next);
        false
    }

    /// Whether every axis has come to rest, `on_target` or wherever it is.
    fn arrive(&mut self, on_target: bool, config: &GroupConfig<N>) -> bool {
        let mut waiting = self.here() & !self.announced;
        if on_target {
            waiting &= self.busy;
        }
        // The path of an axis that its drive leads is over all the time.
        let mut ready = waiting & self.which(ENDED);
        while let Some(n) = next(&mut ready) {
            let Some(axis) = self.axes.get_mut(n) else {
                break;
            };
            let near = on_target && axis.seen & BY_POSITION != 0;
            let rest = if near { PLACED } else { AT_REST };
            let (done, late, cause);
            if on_target && axis.seen & BY_DRIVE != 0 {
                let limit = config.cycles(config.enable_timeout);
                done = axis.led.is_done();
                late = axis.led.is_late(axis.mode(), limit);
                cause = Cause::NotDone.with(axis.mode() as i32);
            } else {
                // A torque is not expected to lead anywhere.
                let torque = on_target && axis.mode() == Mode::CyclicTorque;
                done = torque || axis.seen & rest != 0;
                late = axis.waited() > config.cycles(config.settle_timeout);
                cause = Cause::NotArrived.with(axis.error());
            }
            if !done {
                if late {
                    self.fault(Some(n as u8), cause, Event::Late);
                    return false;
                }
                continue;
            }
            waiting &= !bit(n);
            self.busy &= !bit(n);
            if on_target {
                let mut error = 0;
                if near {
                    error = axis.error();
                } else if self.state == GroupState::Homing {
                    axis.home = 0;
                }
                self.events.report(GroupEvent::Arrived {
                    axis: n as u8,
                    target: axis.head(),
                    error,
                });
            }
        }
        self.announced == 0 && waiting == 0
    }

    /// After a quick stop or a fault: waits for standstill, for as long as an axis
    /// may take. Axes that report nothing are not waited for.
    fn comes_to_rest(&mut self, config: &GroupConfig<N>) -> bool {
        let mut moving = self.here() & self.matching(AT_REST | SILENT, 0);
        if moving == 0 {
            return true;
        }
        let fastest = |most: u32, axis: &AxisConfig| most.max(axis.velocity_max);
        let fastest = config.axes.iter().fold(0, fastest);
        let patience = config.cycles(config.settle_timeout) + stop_cycles(fastest as f32, config);
        if self.since > patience {
            while let Some(n) = next(&mut moving) {
                let velocity = self.axes.get(n).map_or(0, |axis| axis.feedback.velocity);
                let axis = n as u8;
                self.events.report(GroupEvent::NotAtRest { axis, velocity });
            }
            self.happen(Event::Late);
        }
        false
    }
}

/// Whole cycles to come from `rpm` to rest.
fn stop_cycles<const N: usize>(rpm: f32, group: &GroupConfig<N>) -> u32 {
    const SECOND_US: f32 = 1e6;
    let per_cycle = group.stop_deceleration as f32 * (group.cycle.as_micros() as f32 / SECOND_US);
    fixed::ceil(rpm.abs() / per_cycle)
}

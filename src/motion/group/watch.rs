//! Supervision: what stops the group, and the stop after a fault.

use super::axis::Axis;
use super::{FaultCause, Group, GroupEvent, GroupState, Request};
use crate::cia402::{Goal, StatusWord};

impl<const N: usize> Group<N> {
    /// Looks for faults in what was asked and reported in this step.
    pub(super) fn watch(&mut self, request: &Request) {
        if let Some((axis, cause)) = request.fault {
            self.fault(u8::try_from(axis).ok(), cause);
        }
        let state = self.state;
        match state {
            GroupState::Idle | GroupState::Faulted => return,
            GroupState::FaultStop => {}
            _ if !request.network_ready => self.fault(None, FaultCause::NetworkLost),
            _ => {}
        }
        for n in 0..self.axes.len() {
            if let Some(axis) = self.axes.get(n)
                && let Some(cause) = self.find_fault(axis, state, request)
            {
                let axis = axis.n;
                self.fault(Some(axis), cause);
            }
        }
        if self.state == GroupState::FaultStop {
            self.exclude_lost_axes();
        }
    }

    /// A fault of an axis that was not reported yet, in the state that the
    /// group had at the beginning of the step.
    fn find_fault(&self, axis: &Axis, state: GroupState, request: &Request) -> Option<FaultCause> {
        let feedback = &axis.feedback;
        if axis.absent {
            return None;
        }
        if request.network_ready && axis.is_in(request.absent) && !axis.faulted {
            return Some(FaultCause::LeftOperational);
        }
        if axis.missing >= self.config.missing_tpdo_max && !axis.faulted {
            return Some(FaultCause::TpdoMissing {
                cycles: axis.missing,
            });
        }
        if state == GroupState::Enabling
            && let Err(timeout) = axis.machine.check(self.now)
        {
            return Some(FaultCause::NotEnabled(timeout));
        }
        if !feedback.fresh || (state == GroupState::FaultStop && axis.excluded) {
            return None;
        }
        let status = StatusWord(feedback.statusword);
        if !status.is_enabled() {
            let fault = status.state().is_fault();
            if state == GroupState::Enabling {
                // The first stage of enabling resets the faults of the past.
                let reset = self.stage == Goal::Disabled;
                return (fault && !reset).then_some(FaultCause::DriveFault { status });
            }
            return Some(match fault {
                true => FaultCause::DriveFault { status },
                false => FaultCause::LeftEnabled { status },
            });
        }
        if state == GroupState::Enabling {
            return None;
        }
        let allowed = axis.config.following_error_max;
        let error = axis.error(self.t);
        (self.state != GroupState::FaultStop && error.unsigned_abs() > allowed)
            .then_some(FaultCause::FollowingError { error, allowed })
    }

    /// Reports a fault and, if the group is not stopped for one yet, stops it.
    /// Before the axes are to be enabled a fault is only reported.
    #[inline(never)]
    pub(super) fn fault(&mut self, axis: Option<u8>, cause: FaultCause) {
        self.events.report(GroupEvent::Fault { axis, cause });
        if let Some(axis) = axis.and_then(|n| self.axes.get_mut(usize::from(n))) {
            axis.faulted = true;
        }
        match self.state {
            GroupState::Idle | GroupState::Faulted | GroupState::FaultStop => {}
            _ => self.begin_fault_stop(),
        }
    }

    fn begin_fault_stop(&mut self) {
        self.network_was_down = false;
        self.t = 0;
        let enabled = self.state != GroupState::Enabling;
        self.enter(GroupState::FaultStop);
        self.fault_ramp = 0;
        for axis in &mut self.axes {
            axis.begin_fault_stop(enabled);
        }
        for axis in &self.axes {
            let cycles = self.stop_cycles(axis.speed_before_fault());
            self.fault_ramp = self.fault_ramp.max(cycles);
        }
    }

    /// Axes whose drives have left operation enabled, each reported once.
    fn exclude_lost_axes(&mut self) {
        for axis in &mut self.axes {
            let Some(state) = axis.state() else { continue };
            if !state.is_enabled() && !axis.coasting {
                axis.coasting = true;
                axis.excluded = true;
                let axis = axis.n;
                self.events.report(GroupEvent::Coasting { axis, state });
            }
        }
    }

    /// Waits for standstill, then disables. Axes that report nothing are not
    /// waited for.
    pub(super) fn advance_fault_stop(&mut self) {
        let group = self.config;
        let t = u32::try_from(self.t).unwrap_or(0);
        if t < self.fault_ramp {
            return;
        }
        let patience = group.cycles(group.settle_timeout);
        let late = t >= self.fault_ramp.saturating_add(patience);
        let mut all = true;
        for axis in &mut self.axes {
            let silent = axis.missing >= group.missing_tpdo_max;
            let rests = axis.absent || axis.settle(None, group);
            all &= rests || silent;
            if late && !rests {
                self.events.report(GroupEvent::NotAtRest {
                    axis: axis.n,
                    velocity: axis.feedback.velocity,
                });
            }
        }
        if all || late {
            self.enter(GroupState::Faulted);
        }
    }
}

//! Supervision: what stops the group, and the stop after a fault.

use super::{AxisFeedback, FaultCause, Group, GroupEvent, GroupState, Request, is_in};
use crate::cia402::{Goal, StatusWord};

impl<const N: usize> Group<N> {
    /// Looks for faults in what was asked and reported in this step.
    pub(super) fn watch(&mut self, request: &Request, feedback: &[AxisFeedback; N]) {
        if let Some((axis, cause)) = request.fault {
            self.fault(Some(axis), cause);
        }
        let state = self.state;
        match state {
            GroupState::Idle | GroupState::Faulted => return,
            GroupState::FaultStop => {}
            _ if !request.network_ready => self.fault(None, FaultCause::NetworkLost),
            _ => {}
        }
        for n in 0..N {
            if let Some(cause) = self.find_fault(n, state, request, feedback) {
                self.fault(Some(n), cause);
            }
        }
        if self.state == GroupState::FaultStop {
            self.exclude_lost_axes();
        }
    }

    /// A fault of axis `n` that was not reported yet, in the state that the
    /// group had at the beginning of the step.
    fn find_fault(
        &self,
        n: usize,
        state: GroupState,
        request: &Request,
        feedback: &[AxisFeedback; N],
    ) -> Option<FaultCause> {
        let (axis, feedback) = (self.axes.get(n)?, feedback.get(n)?);
        if axis.absent {
            return None;
        }
        if request.network_ready && is_in(request.absent, n) && !axis.faulted {
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
        if state == GroupState::Enabling {
            // The first stage of enabling resets the faults of the past.
            let reset = self.stage == Goal::Disabled;
            return (status.state().is_fault() && !reset)
                .then_some(FaultCause::DriveFault { status });
        }
        if status.state().is_fault() {
            return Some(FaultCause::DriveFault { status });
        }
        if !status.state().is_enabled() {
            return Some(FaultCause::LeftEnabled { status });
        }
        let allowed = axis.config.following_error_max;
        let error = axis.error(self.t, feedback.position);
        (self.state != GroupState::FaultStop && error.unsigned_abs() > allowed)
            .then_some(FaultCause::FollowingError { error, allowed })
    }

    /// Reports a fault and, if the group is not stopped for one yet, stops it.
    /// Before the axes are to be enabled a fault is only reported.
    pub(super) fn fault(&mut self, axis: Option<usize>, cause: FaultCause) {
        self.report(GroupEvent::Fault {
            axis: axis.and_then(|n| u8::try_from(n).ok()),
            cause,
        });
        if let Some(axis) = axis.and_then(|n| self.axes.get_mut(n)) {
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
        for n in 0..N {
            let Some(axis) = self.axes.get_mut(n) else {
                continue;
            };
            let Some(state) = axis.state() else { continue };
            if !state.is_enabled() && !axis.coasting {
                axis.coasting = true;
                axis.excluded = true;
                self.report(GroupEvent::Coasting {
                    axis: n as u8,
                    state,
                });
            }
        }
    }

    /// Waits for standstill, then disables. Axes that report nothing are not
    /// waited for.
    pub(super) fn advance_fault_stop(&mut self, feedback: &[AxisFeedback; N]) {
        let group = self.config;
        let t = u32::try_from(self.t).unwrap_or(0);
        if t < self.fault_ramp {
            return;
        }
        let patience = group.cycles(group.settle_timeout);
        let late = t >= self.fault_ramp.saturating_add(patience);
        let mut all = true;
        for n in 0..N {
            let (Some(axis), Some(feedback)) = (self.axes.get_mut(n), feedback.get(n)) else {
                continue;
            };
            let silent = axis.missing >= group.missing_tpdo_max;
            let rests = axis.settle(feedback, None, group);
            all &= rests || silent || axis.absent;
            if late && !rests && !axis.absent {
                let velocity = feedback.velocity;
                self.report(GroupEvent::NotAtRest {
                    axis: n as u8,
                    velocity,
                });
            }
        }
        if all || late {
            self.enter(GroupState::Faulted);
        }
    }
}

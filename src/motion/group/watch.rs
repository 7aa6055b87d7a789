//! Supervision: what stops the group.

use super::axis::Axis;
use super::{Event, Group, Inputs};
use crate::cia402::{Goal, StatusWord};
use crate::motion::mode::Mode;
use crate::motion::{FaultCause, GroupEvent, GroupState};

impl<const N: usize> Group<N> {
    /// Looks for faults in what was told and reported in this step.
    pub(super) fn watch(&mut self, inputs: &Inputs) {
        if let Some((axis, cause)) = inputs.fault {
            self.fault(u8::try_from(axis).ok(), cause, Event::Fault);
        }
        let state = self.state;
        match state {
            GroupState::Idle | GroupState::Faulted => return,
            GroupState::FaultStop => {}
            _ if !inputs.network_ready => {
                self.fault(None, FaultCause::NetworkLost, Event::NotReady);
            }
            _ => {}
        }
        for n in 0..self.axes.len() {
            if let Some(axis) = self.axes.get_mut(n)
                && !axis.absent
            {
                let led = match state {
                    GroupState::Moving | GroupState::Homing if axis.mode.is_led_by_drive() => {
                        axis.led.hear(axis.mode, axis.fresh_status()).err()
                    }
                    _ => None,
                };
                let n = axis.n;
                if let Some(cause) = led.or_else(|| self.find_fault(usize::from(n), state, inputs))
                {
                    self.fault(Some(n), cause, Event::Fault);
                }
            }
        }
        if self.state == GroupState::FaultStop {
            self.exclude_lost_axes();
        }
    }

    /// A fault of an axis that was not reported yet, in the state that the
    /// group had at the beginning of the step.
    fn find_fault(&self, n: usize, state: GroupState, inputs: &Inputs) -> Option<FaultCause> {
        let axis: &Axis = self.axes.get(n)?;
        let feedback = &axis.feedback;
        if inputs.network_ready && axis.is_in(inputs.absent) && !axis.faulted {
            return Some(FaultCause::LeftOperational);
        }
        if axis.missing >= self.config.missing_tpdo_max && !axis.faulted {
            return Some(FaultCause::TpdoMissing {
                cycles: axis.missing,
            });
        }
        let leads = matches!(state, GroupState::Enabling | GroupState::Disabling);
        if leads && let Err(timeout) = axis.machine.check(self.now) {
            return Some(FaultCause::NotEnabled(timeout));
        }
        if !feedback.fresh || (state == GroupState::FaultStop && axis.excluded) {
            return None;
        }
        let status = StatusWord(feedback.statusword);
        if status.state().is_fault() {
            // The first stage of enabling resets the faults of the past.
            let reset = leads && self.stage == Goal::Disabled;
            return (!reset).then_some(FaultCause::DriveFault { status });
        }
        if leads || state == GroupState::QuickStop {
            return None;
        }
        let braking = state == GroupState::FaultStop && axis.mode.is_led_by_drive();
        if !status.state().is_enabled() && !braking {
            return Some(FaultCause::LeftEnabled { status });
        }
        if self.state == GroupState::FaultStop {
            return None;
        }
        if axis.wanted.is_some() {
            return None;
        }
        let reports = matches!(axis.mode, Mode::CyclicPosition | Mode::ProfilePosition);
        if reports && status.mode_bit_13() {
            return Some(FaultCause::DriveError { status });
        }
        if axis.mode.has_position() {
            let (allowed, error) = (axis.config.following_error_max, axis.error());
            if error.unsigned_abs() > allowed {
                return Some(FaultCause::FollowingError { error, allowed });
            }
        }
        axis.path.is_dry().then_some(FaultCause::PathDry)
    }

    /// Reports a fault and, if the group is not stopped for one yet, stops it.
    /// Before the axes are to be enabled a fault is only reported.
    #[inline(never)]
    pub(super) fn fault(&mut self, axis: Option<u8>, cause: FaultCause, event: Event) {
        self.events.report(GroupEvent::Fault { axis, cause });
        if let Some(axis) = axis.and_then(|n| self.axes.get_mut(usize::from(n))) {
            axis.faulted = true;
        }
        if self.state != GroupState::FaultStop {
            self.happen(event);
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
}

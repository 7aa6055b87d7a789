//! Supervision: what stops the group.

use super::axis::{BY_DRIVE, BY_POSITION, ENABLED, FAILED, FRESH, HEARD, REACHED, SILENT, SOUND};
use super::{Group, Inputs, bit};
use crate::cia402::{Goal, StatusWord};
use crate::motion::contract::Event;
use crate::motion::mode::Mode;
use crate::motion::{Cause, FaultCause, GroupConfig, GroupEvent, GroupState, next};

impl<const N: usize> Group<N> {
    /// Looks for faults in what was told and reported in this step.
    pub(super) fn watch(&mut self, inputs: &Inputs, config: &GroupConfig<N>) {
        if let Some((axis, cause)) = inputs.fault {
            self.fault(u8::try_from(axis).ok(), cause, Event::Fault);
        }
        let state = self.state;
        match state {
            GroupState::Idle | GroupState::Faulted => return,
            GroupState::FaultStop => {}
            _ if !inputs.network_ready => {
                self.fault(None, Cause::NetworkLost.alone(), Event::NotReady);
            }
            _ => {}
        }
        let leads = matches!(state, GroupState::Enabling | GroupState::Disabling);
        let late = leads && self.since > config.cycles(config.enable_timeout);
        let mut look = self.here();
        if leads {
            let late = if late { !self.which(REACHED) } else { 0 };
            look &= self.which(FAILED) | self.which(SILENT) | inputs.absent | late;
        } else {
            look &= !self.which(SOUND) | inputs.absent;
        }
        while let Some(n) = next(&mut look) {
            if let Some(cause) = self.find_fault(n, state, late, inputs, config) {
                self.fault(Some(n as u8), cause, Event::Fault);
            }
        }
        // Who is left to himself is told from the next step on.
        if state == GroupState::FaultStop {
            self.exclude_lost_axes();
        }
    }

    /// A fault of an axis that was not reported yet, in the state that the
    /// group had at the beginning of the step.
    fn find_fault(
        &mut self,
        n: usize,
        state: GroupState,
        late: bool,
        inputs: &Inputs,
        config: &GroupConfig<N>,
    ) -> Option<FaultCause> {
        let (axis, limits) = (self.axes.get_mut(n)?, config.axes.get(n)?);
        let status = StatusWord(axis.feedback.statusword);
        let shown = i32::from(status.0);
        let faulted = self.faulted & bit(n) != 0;
        let mode = axis.mode();
        let (seen, by_drive) = (axis.seen, axis.seen & BY_DRIVE != 0);
        if by_drive
            && matches!(state, GroupState::Moving | GroupState::Homing)
            && !axis.led.hear(mode, axis.fresh_status(), inputs.cycles())
        {
            return Some(Cause::DriveError.with(shown));
        }
        if !faulted && inputs.network_ready && inputs.absent & bit(n) != 0 {
            return Some(Cause::LeftOperational.alone());
        }
        if !faulted && seen & SILENT != 0 {
            return Some(Cause::TpdoMissing.with(axis.missing.into()));
        }
        let leads = matches!(state, GroupState::Enabling | GroupState::Disabling);
        if late && seen & REACHED == 0 {
            return Some(Cause::NotEnabled.with(shown));
        }
        let stops = state == GroupState::FaultStop;
        if seen & FRESH == 0 || (stops && self.excluded & bit(n) != 0) {
            return None;
        }
        if seen & FAILED != 0 {
            // The first stage of enabling resets the faults of the past.
            let reset = leads && self.stage == Goal::Disabled;
            return (!reset).then_some(Cause::DriveFault.with(shown));
        }
        if leads || state == GroupState::QuickStop {
            return None;
        }
        if !(seen & ENABLED != 0 || (stops && by_drive)) {
            return Some(Cause::LeftEnabled.with(shown));
        }
        if self.state == GroupState::FaultStop || axis.wanted.is_some() {
            return None;
        }
        let reports = matches!(mode, Mode::CyclicPosition | Mode::ProfilePosition);
        if reports && status.mode_bit_13() {
            return Some(Cause::DriveError.with(shown));
        }
        let (allowed, error) = (limits.following_error_max, axis.error());
        if seen & BY_POSITION != 0 && error.unsigned_abs() > allowed {
            return Some(Cause::FollowingError.with(error));
        }
        axis.path.is_dry().then_some(Cause::PathDry.alone())
    }

    /// Reports a fault and, if the group is not stopped for one yet, stops it.
    /// Before the axes are to be enabled a fault is only reported.
    #[inline(never)]
    pub(super) fn fault(&mut self, axis: Option<u8>, cause: FaultCause, event: Event) {
        self.events.report(GroupEvent::Fault { axis, cause });
        if let Some(n) = axis {
            self.faulted |= bit(n.into());
        }
        if self.state != GroupState::FaultStop {
            self.happen(event);
        }
    }

    /// Axes whose drives have left operation enabled, each reported once.
    fn exclude_lost_axes(&mut self) {
        let mut lost = self.matching(HEARD | ENABLED, HEARD) & !self.coasting;
        self.coasting |= lost;
        self.excluded |= lost;
        while let Some(n) = next(&mut lost) {
            if let Some(state) = self.axes.get(n).map(|axis| axis.state) {
                let axis = n as u8;
                self.events.report(GroupEvent::Coasting { axis, state });
            }
        }
    }
}

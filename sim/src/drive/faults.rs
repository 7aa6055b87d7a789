//! Faults of the configuration, turned into what the drive does.

use super::cia402::State;
use super::config::{DriveFault, Trouble};
use super::warnings::Warnings;
use super::{Drive, Job, Planned, errors};
use crate::time::Time;
use canmaster::id::Address;
use canmaster::sdo::AbortCode;

impl Drive {
    /// Power-on, and the faults of the configuration.
    pub(super) fn plan_life(&mut self) {
        self.plan_always(self.config.power_on, Job::PowerOn);
        for fault in self.config.faults.clone() {
            self.apply(fault);
        }
    }

    /// One more fault, from now on. Moments that have passed mean now.
    pub fn inject(&mut self, fault: DriveFault) {
        self.config.faults.push(fault);
        self.apply(fault);
    }

    fn apply(&mut self, fault: DriveFault) {
        match fault {
            DriveFault::Identity(identity) => self.od.set_identity(identity),
            DriveFault::NodeSwitches(node) => self.od.switches = Some(node),
            DriveFault::StoreFails => self.od.store_fails = true,
            DriveFault::RefuseWrite { index, sub, abort } => {
                let refusal = (Address::new(index, sub), AbortCode(abort));
                self.od.refused.push(refusal);
            }
            DriveFault::SdoLatency(latency) => self.config.sdo_latency = latency,
            DriveFault::PowerLoss { at } => self.plan_always(at, Job::PowerOff),
            DriveFault::PowerCycle { off, on } => {
                self.plan_always(off, Job::PowerOff);
                self.plan_always(on, Job::PowerOn);
            }
            DriveFault::Load { at, permille } => self.plan_always(at, Job::Load(permille)),
            DriveFault::Blocked { at, until } => {
                self.plan_always(at, Job::Block(true));
                if let Some(until) = until {
                    self.plan_always(until, Job::Block(false));
                }
            }
            DriveFault::Sto { at, until } => {
                let code = errors::STO;
                self.plan_always(
                    at,
                    Job::Error {
                        code,
                        lasting: true,
                    },
                );
                if let Some(until) = until {
                    self.plan_always(until, Job::CauseGone(code));
                }
            }
            DriveFault::Error { at, code, until } => {
                let lasting = until.is_some();
                self.plan_always(at, Job::Error { code, lasting });
                if let Some(until) = until {
                    self.plan_always(until, Job::CauseGone(code));
                }
            }
            DriveFault::ControlwordLate(delay) => self.control_delay = Some(delay),
            DriveFault::ModeStuck { at } => self.plan_always(at, Job::StickMode),
            DriveFault::InState { state, what } => {
                if state == self.axis.state() {
                    self.plan_trouble(state, what);
                }
            }
            // Looked at whenever there is something to do.
            DriveFault::SdoDead { .. }
            | DriveFault::SdoWrong(_)
            | DriveFault::ControlwordIgnored { .. }
            | DriveFault::HeartbeatLost { .. }
            | DriveFault::TpdosLost { .. } => {}
            DriveFault::Warnings { every, turn, delay } => {
                self.warnings = Some(Warnings::new(every, turn, delay));
            }
        }
    }

    fn plan_always(&mut self, at: Time, job: Job) {
        let life = None;
        self.agenda.push(Planned { at, job, life });
    }

    /// What is wrong in the state that the drive is in.
    pub(super) fn troubles(&self) -> impl Iterator<Item = Trouble> + '_ {
        let now = self.axis.state();
        let here = move |fault: &DriveFault| match *fault {
            DriveFault::InState { state, what } if state == now => Some(what),
            _ => None,
        };
        self.config.faults.iter().filter_map(here)
    }

    /// Whether a state can be entered in which something is wrong.
    pub(super) fn has_troubles(&self) -> bool {
        let troubles = |fault: &DriveFault| matches!(fault, DriveFault::InState { .. });
        self.config.faults.iter().any(troubles)
    }

    /// Plans what goes wrong in a state that was entered just now.
    pub(super) fn watch_state(&mut self) {
        let state = self.axis.state();
        if state == self.watched_state {
            return;
        }
        self.watched_state = state;
        let troubles: Vec<Trouble> = self.troubles().collect();
        for trouble in troubles {
            self.plan_trouble(state, trouble);
        }
    }

    fn plan_trouble(&mut self, state: State, trouble: Trouble) {
        let (after_us, job) = match trouble {
            // Looked at with each controlword.
            Trouble::Deaf | Trouble::Slow(_) => return,
            Trouble::DropsOut { after_us } => (after_us, Job::DropOut(state)),
            Trouble::Error { after_us, code } => {
                let lasting = false;
                (after_us, Job::Error { code, lasting })
            }
            Trouble::PowerLoss { after_us } => (after_us, Job::PowerOff),
        };
        self.plan(self.now + self.clock.span(after_us), job);
    }

    /// The drive leaves `state` by itself, if it is still there.
    pub(super) fn drop_out(&mut self, state: State) {
        if self.axis.state() == state {
            self.axis.drop_out();
        }
    }
}

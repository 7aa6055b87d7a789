//! Faults of the configuration, turned into what the drive does.

use super::config::DriveFault;
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
            // Looked at whenever there is something to do.
            DriveFault::SdoDead { .. }
            | DriveFault::SdoWrong(_)
            | DriveFault::ControlwordIgnored { .. }
            | DriveFault::HeartbeatLost { .. }
            | DriveFault::TpdosLost { .. } => {}
        }
    }

    fn plan_always(&mut self, at: Time, job: Job) {
        let life = None;
        self.agenda.push(Planned { at, job, life });
    }
}

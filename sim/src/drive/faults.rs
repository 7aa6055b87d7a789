//! Faults of the configuration, turned into what the drive does.

use super::config::{DriveConfig, DriveFault};
use super::{Drive, Job, Planned};
use canmaster::id::Address;
use canmaster::sdo::AbortCode;

/// Faults that are there from the start.
pub(super) fn configure(config: &mut DriveConfig) {
    for fault in config.faults.clone() {
        match fault {
            DriveFault::Identity(identity) => config.identity = identity,
            DriveFault::SdoLatency(latency) => config.sdo_latency = latency,
            _ => {}
        }
    }
}

/// The entries whose writing is refused.
pub(super) fn refused(config: &DriveConfig) -> Vec<(Address, AbortCode)> {
    let refusal = |fault: &DriveFault| match *fault {
        DriveFault::RefuseWrite { index, sub, abort } => {
            Some((Address::new(index, sub), AbortCode(abort)))
        }
        _ => None,
    };
    config.faults.iter().filter_map(refusal).collect()
}

impl Drive {
    /// Power-on, and what the faults do at their moments.
    pub(super) fn plan_faults(&mut self) {
        let mut plan = |at, job| {
            self.agenda.push(Planned {
                at,
                job,
                life: None,
            });
        };
        plan(self.config.power_on, Job::PowerOn);
        for fault in &self.config.faults {
            match *fault {
                DriveFault::PowerLoss { at } => plan(at, Job::PowerOff),
                DriveFault::PowerCycle { off, on } => {
                    plan(off, Job::PowerOff);
                    plan(on, Job::PowerOn);
                }
                DriveFault::Error { at, code, until } => {
                    let lasting = until.is_some();
                    plan(at, Job::Error { code, lasting });
                    if let Some(until) = until {
                        plan(until, Job::CauseGone(code));
                    }
                }
                _ => {}
            }
        }
    }
}

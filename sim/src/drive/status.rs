//! What is seen from outside: the truth for a judge, the state for a table.

use super::Drive;
use super::cia402;
use super::plant::PlantState;
use crate::time::Time;
use canmaster::NodeId;
use canmaster::nmt::State as NmtState;

/// Speed above which the axis counts as moving, rpm.
const MOVING_RPM: f64 = 5.0;

/// The drive at this moment, as it sees itself.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveStatus {
    /// Its node-ID as configured: its place in the machine.
    pub node: NodeId,
    /// The node-ID in use; `None` before the boot-up message, and without one.
    pub node_id: Option<NodeId>,
    /// NMT state; initialising while it has no supply or no node-ID.
    pub nmt: NmtState,
    /// State of CiA 402.
    pub state: cia402::State,
    /// 6041h.
    pub statusword: u16,
    /// 6061h.
    pub mode: i8,
    /// Speed demand, rpm.
    pub demand_rpm: f64,
    /// 6064h.
    pub position: i32,
    /// Code of the last EMCY, 0 after a reset; `None` if there was none.
    pub last_emcy: Option<u16>,
    /// 1003h, newest first.
    pub errors: Vec<u16>,
    /// Last end of a control cycle at which the true speed exceeded 5 rpm.
    pub moved_at: Option<Time>,
}

/// The truth at the end of a control cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// When.
    pub at: Time,
    /// The motor then.
    pub plant: PlantState,
    /// Speed demand of the drive, rpm.
    pub demand_rpm: f64,
}

impl Drive {
    /// The motor as it truly is, at the end of the last control cycle.
    pub fn truth(&self) -> PlantState {
        self.axis.truth()
    }

    /// The drive as it sees itself.
    pub fn status(&self) -> DriveStatus {
        let errors = &self.od.errors;
        DriveStatus {
            node: self.config.node,
            node_id: self.od.node(),
            nmt: self.nmt.state(),
            state: self.axis.state(),
            statusword: self.axis.statusword(self.od.operational, errors.warning()),
            mode: self.axis.mode().code(),
            demand_rpm: self.axis.demand(),
            position: self.od.number(0x6064, 0) as i32,
            last_emcy: self.last_emcy,
            errors: (1..=errors.count())
                .filter_map(|sub| errors.entry(sub))
                .collect(),
            moved_at: self.moved_at,
        }
    }

    /// From now on a [`Sample`] of every control cycle is kept until it is
    /// taken.
    pub fn keep_samples(&mut self) {
        self.samples.get_or_insert_default();
    }

    /// The samples since the last call, in order.
    pub fn take_samples(&mut self) -> Vec<Sample> {
        match &mut self.samples {
            Some(samples) => std::mem::take(samples),
            None => Vec::new(),
        }
    }

    pub(super) fn observe(&mut self) {
        let plant = self.axis.truth();
        if plant.velocity_rpm.abs() > MOVING_RPM {
            self.moved_at = Some(self.now);
        }
        if let Some(samples) = &mut self.samples {
            samples.push(Sample {
                at: self.now,
                plant,
                demand_rpm: self.axis.demand(),
            });
        }
    }
}

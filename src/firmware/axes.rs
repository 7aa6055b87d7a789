//! From the TPDOs of one SYNC to the RPDOs of the next.

use crate::{
    control::Control,
    derived::{AXES, PDOS},
};
use canmaster::{
    Frame,
    cia402::StatusWord,
    master::{Cycle, Ramps, TPDOS_PER_AXIS, TpdoSlot},
    motion::{AxisCommand, AxisFeedback, Group, GroupEvent, GroupState, Request},
    network::Network,
};

/// The group with what surrounds it.
pub(crate) struct Axes {
    network: &'static Network,
    group: &'static mut Group<AXES>,
    feedback: [AxisFeedback; AXES],
    commands: [AxisCommand; AXES],
    ramps: Ramps<AXES>,
}

impl Axes {
    pub(crate) fn new(network: &'static Network, group: &'static mut Group<AXES>) -> Axes {
        Axes {
            network,
            group,
            feedback: [AxisFeedback::default(); AXES],
            commands: [AxisCommand::default(); AXES],
            ramps: Ramps::new(),
        }
    }

    /// Takes in the TPDOs of a cycle, each through `tpdo`.
    pub(crate) fn read(&mut self, cycle: &Cycle, mut tpdo: impl FnMut(TpdoSlot) -> [u8; 8]) {
        for (axis, (feedback, pdos)) in self.feedback.iter_mut().zip(&PDOS).enumerate() {
            let (Some(first), Some(second)) = (TpdoSlot::new(axis, 0), TpdoSlot::new(axis, 1))
            else {
                continue;
            };
            let fresh = !cycle.missing.contains(first) && !cycle.missing.contains(second);
            *feedback = pdos.feedback(&[tpdo(first), tpdo(second)], fresh);
        }
    }

    /// Steps the group. A press of the button releases the motion, and stops it
    /// when there is one.
    pub(crate) fn step(&mut self, control: &Control) {
        let moving = self.group.state() == GroupState::Moving;
        let request = Request {
            network_ready: control.network_ready
                && control.leads()
                && !control.bus_off
                && !control.cycle_differs,
            release: control.pressed && !moving,
            stop: control.pressed && moving,
            fault: control.fault,
            absent: !control.operational,
        };
        self.group.step(request, &self.feedback, &mut self.commands);
    }

    /// What the axes are told.
    pub(crate) const fn commands(&self) -> &[AxisCommand; AXES] {
        &self.commands
    }

    /// Whether an axis is enabled or led there. What was last heard of a node that
    /// is booted again does not count.
    pub(crate) fn enabled(&self, control: &Control) -> bool {
        let led = !matches!(self.group.state(), GroupState::Idle | GroupState::Faulted);
        let is = |(axis, feedback): (usize, &AxisFeedback)| {
            control.operational & 1 << axis != 0
                && StatusWord(feedback.statusword).state().is_enabled()
        };
        led || self.feedback.iter().enumerate().any(is)
    }

    /// What the group has to report.
    pub(crate) fn take_event(&mut self) -> Option<GroupEvent> {
        self.group.take_event()
    }

    /// Hands the RPDOs of the next cycle to `send`.
    pub(crate) fn write(&mut self, mut send: impl FnMut(Frame)) {
        let due = self.ramps.due(&self.commands);
        let nodes = self.network.nodes.iter().zip(&PDOS);
        for (((node, pdos), command), ramps) in nodes.zip(&self.commands).zip(due) {
            for number in 0..TPDOS_PER_AXIS as u8 {
                if !pdos.has_only_ramps(number) || ramps {
                    pdos.rpdo(number, node.id, command).map(&mut send);
                }
            }
        }
    }
}

//! From the TPDOs of one SYNC to the RPDOs of the next.

use crate::{
    control::Control,
    derived::{AXES, AXIS_BUSES, GROUP, PDOS, RAMPS_ON_CHANGE, RPDOS_AFTER_SYNC},
    lines::Lines,
};
use canmaster::{
    cia402::StatusWord,
    master::{Cycle, MasterOd, Ramps, TpdoSlot},
    motion::{
        AxisCommand, AxisFeedback, Group, GroupEvent, GroupState, Inputs, Order, Speedometer,
    },
    network::Network,
};
use rtic::Mutex;

/// For the axes whose TPDOs carry no velocity.
const SPEEDOMETERS: [Speedometer; AXES] = {
    let mut all = [Speedometer::new(1, GROUP.cycle); AXES];
    let mut n = 0;
    while n < AXES {
        all[n] = Speedometer::new(GROUP.axes[n].increments_per_turn, GROUP.cycle);
        n += 1;
    }
    all
};

/// The group with what surrounds it.
#[expect(unreachable_pub, reason = "RTIC wants shared resources to be public")]
pub struct Axes {
    network: &'static Network,
    pub(crate) group: &'static mut Group<AXES>,
    /// The button was pressed while nothing moved: `sdo_configurator` runs the
    /// program.
    pub(crate) pressed: bool,
    feedback: [AxisFeedback; AXES],
    commands: [AxisCommand; AXES],
    ramps: Ramps<AXES>,
    speed: [Speedometer; AXES],
}

impl Axes {
    pub(crate) fn new(network: &'static Network, group: &'static mut Group<AXES>) -> Axes {
        Axes {
            network,
            group,
            pressed: false,
            feedback: [AxisFeedback::default(); AXES],
            commands: [AxisCommand::default(); AXES],
            ramps: Ramps::new(),
            speed: SPEEDOMETERS,
        }
    }

    /// Takes in the TPDOs of a cycle.
    pub(crate) fn read(&mut self, cycle: &Cycle, od: &mut impl Mutex<T = MasterOd<AXES>>) {
        let axes = self.feedback.iter_mut().zip(&mut self.speed);
        for (axis, ((feedback, speed), pdos)) in axes.zip(&PDOS).enumerate() {
            let (Some(first), Some(second)) = (TpdoSlot::new(axis, 0), TpdoSlot::new(axis, 1))
            else {
                continue;
            };
            let fresh = !cycle.missing.contains(first) && !cycle.missing.contains(second);
            *feedback = od.lock(|od| pdos.feedback(od.image(axis), fresh));
            if fresh && !pdos.has_velocity() {
                feedback.velocity = speed.at(feedback.position);
            }
        }
    }

    /// Steps the group. A press of the button stops the motion, and else asks for
    /// one.
    pub(crate) fn step(&mut self, control: &Control) {
        let moving = self.moves();
        if control.pressed && moving {
            // Refused in no state in which the group moves.
            let _ = self.group.order(Order::Stop);
        }
        self.pressed |= control.pressed && !moving;
        let inputs = Inputs {
            network_ready: control.network_ready
                && control.leads()
                && !control.bus_off
                && !control.cycle_differs,
            fault: control.fault,
            absent: !control.operational,
        };
        self.group.step(&inputs, &self.feedback, &mut self.commands);
    }

    /// Whether what is planned counts.
    pub(crate) fn moves(&self) -> bool {
        matches!(
            self.group.state(),
            GroupState::Moving | GroupState::Homing | GroupState::ModeChange
        )
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

    /// Writes the RPDOs of the next cycle.
    pub(crate) fn write(&mut self, cycle: &Cycle, lines: &mut impl Mutex<T = Lines>) {
        lines.lock(|lines| {
            for line in lines.iter_mut() {
                line.begin(cycle.sync);
            }
        });
        let due = self.ramps.due(&self.commands);
        let nodes = self.network.nodes.iter().zip(&PDOS);
        for (axis, ((node, pdos), command)) in nodes.zip(&self.commands).enumerate() {
            let on_change = RAMPS_ON_CHANGE.get(axis).is_some_and(|on| *on);
            let ramps = match on_change && due != Some(axis) {
                true => None,
                false => pdos.ramps(command, node.id),
            };
            let cyclic = pdos.cyclic(command, node.id);
            lines.lock(|lines| {
                let bus = AXIS_BUSES.get(axis).map(|bus| usize::from(*bus));
                let Some(line) = bus.and_then(|bus| lines.get_mut(bus)) else {
                    return;
                };
                if let Some(frame) = cyclic {
                    line.cyclic(frame, RPDOS_AFTER_SYNC);
                }
                if let Some(frame) = ramps {
                    if on_change {
                        line.on_change(frame);
                    } else {
                        line.cyclic(frame, true);
                    }
                }
            });
        }
    }
}

//! From the TPDOs of one SYNC to the RPDOs of the next.

use crate::{
    control::Control,
    derived::{self, AXES, AXIS_BUSES, GROUP, NETWORK, RAMPS_ON_CHANGE, RPDOS_AFTER_SYNC},
    lines::Lines,
};
use canmaster::{
    cia402::StatusWord,
    design,
    master::{Cycle, MasterOd, Overload, Ramps, TpdoSlot},
    motion::{AxisCommand, AxisFeedback, Cause, Group, GroupState, Inputs, Order, Speedometer},
};
use rtic::Mutex;

/// No axis has this number.
const ALL_AXES: usize = usize::MAX;

/// The group with what surrounds it.
#[expect(unreachable_pub, reason = "RTIC wants shared resources to be public")]
pub struct Axes {
    pub(crate) group: Group<AXES>,
    /// The button was pressed while nothing moved: `sdo_configurator` runs the
    /// program.
    pub(crate) pressed: bool,
    feedback: [AxisFeedback; AXES],
    ramps: Ramps<AXES>,
    overload: Overload<{ design::LATE_CYCLES_MAX }>,
    /// RPDOs of the last cycle did not get out.
    unsent: bool,
    /// For the axes whose TPDOs carry no velocity.
    speed: [Speedometer; AXES],
}

impl Axes {
    /// All of it is 0 until the group is configured.
    pub(crate) const ZERO: Axes = Axes {
        group: Group::ZERO,
        pressed: false,
        feedback: [AxisFeedback::NONE; AXES],
        ramps: Ramps::new(),
        overload: Overload::new(),
        unsent: false,
        speed: [Speedometer::new(); AXES],
    };

    /// Takes in the TPDOs of a cycle.
    pub(crate) fn read(&mut self, cycle: &Cycle, od: &mut impl Mutex<T = MasterOd<AXES>>) {
        let axes = self.feedback.iter_mut().zip(&mut self.speed);
        for (axis, ((feedback, speed), limits)) in axes.zip(&GROUP.axes).enumerate() {
            let (Some(first), Some(second), Some(pdos)) = (
                TpdoSlot::new(axis, 0),
                TpdoSlot::new(axis, 1),
                derived::pdos(axis),
            ) else {
                continue;
            };
            let fresh = !cycle.missing.contains(first) && !cycle.missing.contains(second);
            *feedback = od.lock(|od| pdos.feedback(od.image(axis), fresh));
            if fresh && !pdos.has_velocity() {
                feedback.velocity = speed.at(feedback.position, &limits.scale);
            }
        }
    }

    /// Steps the group. A press of the button stops the motion, and else asks for
    /// one.
    pub(crate) fn step(
        &mut self,
        cycle: &Cycle,
        control: &Control,
        commands: &mut [AxisCommand; AXES],
    ) {
        let state = self.group.state();
        let moving = self.moves();
        if control.pressed && moving {
            // Refused in no state in which the group moves.
            let _ = self.group.order(Order::Stop);
        }
        self.pressed |= control.pressed && !moving;
        let unsent = core::mem::take(&mut self.unsent);
        let late = self.overload.cycle(cycle.passed, unsent);
        let led = !matches!(state, GroupState::Idle | GroupState::Faulted);
        let late = late.filter(|_| led && state != GroupState::FaultStop);
        let late = late.map(|cycles| (ALL_AXES, Cause::CyclesLate.with(cycles.into())));
        let inputs = Inputs {
            network_ready: control.network_ready
                && control.leads()
                && !control.bus_off
                && !control.cycle_differs,
            fault: control.fault.or(late),
            passed: cycle.passed,
            absent: match control.network_ready {
                true => !control.operational,
                false => control.missing,
            },
        };
        self.group.step(&inputs, &self.feedback, commands);
    }

    /// Whether what is planned counts.
    pub(crate) fn moves(&self) -> bool {
        matches!(
            self.group.state(),
            GroupState::Moving | GroupState::Homing | GroupState::ModeChange
        )
    }

    /// Whether there is something for `sdo_configurator`, which looks by itself when
    /// the director is to go on.
    pub(crate) fn has_news(&self) -> bool {
        self.pressed
            || self.group.has_events()
            || matches!(
                self.group.state(),
                GroupState::ModeChange | GroupState::Enabling
            )
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

    /// It is too late for the RPDOs of this cycle.
    pub(crate) const fn skip(&mut self) {
        self.unsent = true;
    }

    /// Writes the RPDOs of the next cycle. Whether any of them may go before the
    /// next SYNC.
    pub(crate) fn write(
        &mut self,
        cycle: &Cycle,
        commands: &[AxisCommand; AXES],
        lines: &mut impl Mutex<T = Lines>,
    ) -> bool {
        let mut any = false;
        lines.lock(|lines| {
            for line in lines.iter_mut() {
                self.unsent |= line.begin(cycle.sync);
            }
        });
        let due = self.ramps.due(commands);
        for (axis, (node, command)) in NETWORK.nodes.iter().zip(commands).enumerate() {
            let Some(pdos) = derived::pdos(axis) else {
                continue;
            };
            let on_change = RAMPS_ON_CHANGE.get(axis).is_some_and(|on| *on);
            let ramps = match on_change && due != Some(axis) {
                true => None,
                false => pdos.ramps(command, node.id),
            };
            let cyclic = pdos.cyclic(command, node.id);
            any |= !RPDOS_AFTER_SYNC || on_change && ramps.is_some();
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
        any
    }
}

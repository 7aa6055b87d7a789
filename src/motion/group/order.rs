//! Orders to the group, judged at once and carried out in the next step.

use super::axis::Axis;
use super::{Group, Inputs};
use crate::motion::contract::{Cell, Event, cell};
use crate::motion::mode::Mode;
use crate::motion::{AxisFeedback, GroupEvent, GroupState, Refusal};

/// What the group is told to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Somebody wants the axes enabled.
    Enable,
    /// Nobody does.
    Disable,
    /// The group may move.
    Release,
    /// The motion is done: standby.
    Finish,
    /// Ramp down together to standby.
    Stop,
    /// Ramp down together and wait for another release.
    Halt,
    /// Every drive brakes on its quick stop ramp; the axes are disabled then.
    QuickStop,
    /// Reset the fault and enable.
    Reset,
    /// Search for home within so many cycles: bit n for axis n.
    Home {
        /// The axes; their mode has to be homing.
        axes: u32,
        /// Cycles.
        limit: u32,
    },
    /// Change the mode of operation: bit n for axis n.
    SetMode {
        /// The axes.
        axes: u32,
        /// The new mode.
        mode: Mode,
    },
}

impl Order {
    const fn event(self) -> Option<Event> {
        Some(match self {
            Order::Enable => return None,
            Order::Disable => Event::Disable,
            Order::Release => Event::Release,
            Order::Finish => Event::Done,
            Order::Stop => Event::Stop,
            Order::Halt => Event::Halt,
            Order::QuickStop => Event::QuickStop,
            Order::Reset => Event::Reset,
            Order::Home { .. } => Event::Home,
            Order::SetMode { .. } => Event::Mode,
        })
    }
}

impl<const N: usize> Group<N> {
    /// Takes an order for the next step. A stop replaces what was ordered before.
    ///
    /// # Errors
    /// [`Refusal`]: nothing is done.
    pub fn order(&mut self, order: Order) -> Result<(), Refusal> {
        match order {
            Order::Enable => {
                self.wanted = true;
                return Ok(());
            }
            Order::Disable => {
                self.wanted = false;
                return Ok(());
            }
            _ => {}
        }
        if let Some(event) = order.event()
            && cell(self.state, event) == Cell::Refuse
        {
            return Err(Refusal::NotIn(self.state));
        }
        match order {
            Order::Finish if self.state != GroupState::Moving || !self.all_arrived() => {
                return Err(Refusal::Busy);
            }
            Order::Stop | Order::QuickStop => {}
            _ if self.ordered.is_some() => return Err(Refusal::Busy),
            _ => self
                .axes
                .iter()
                .try_for_each(|axis| self.permit(order, axis))?,
        }
        if matches!(order, Order::QuickStop) {
            self.wanted = false;
        }
        self.ordered = Some(order);
        Ok(())
    }

    /// Whether an axis can do what is ordered.
    fn permit(&self, order: Order, axis: &Axis) -> Result<(), Refusal> {
        let AxisFeedback {
            velocity, fresh, ..
        } = axis.feedback;
        let (n, mode) = (axis.n, axis.mode);
        match order {
            _ if axis.absent => {}
            Order::Reset if !self.network_ready => return Err(Refusal::NetworkNotReady),
            Order::Release | Order::SetMode { .. } if !fresh => {
                return Err(Refusal::NotFresh { axis: n });
            }
            Order::Release | Order::SetMode { .. }
                if velocity.unsigned_abs() > self.config.standstill_rpm =>
            {
                return Err(Refusal::NotAtRest { axis: n, velocity });
            }
            Order::Home { axes, .. } if axis.is_in(axes) && mode != Mode::Homing => {
                return Err(Refusal::WrongMode { axis: n, mode });
            }
            Order::SetMode { axes, mode } if axis.is_in(axes) && !mode.is_in(axis.config.modes) => {
                return Err(Refusal::ModeNotSupported {
                    axis: n,
                    mode,
                    supported: axis.config.modes,
                });
            }
            _ => {}
        }
        Ok(())
    }

    /// The network, and what was ordered.
    pub(super) fn obey(&mut self, inputs: &Inputs) {
        let ready = inputs.network_ready;
        self.network_ready = ready;
        let left_out = |axis: &Axis| axis.faulted && axis.is_in(inputs.absent);
        self.network_was_down |= !ready || self.axes.iter().any(left_out);
        let waits = self.state == GroupState::Faulted && !self.network_was_down;
        let ordered = self.ordered.take();
        if inputs.absent != self.absent
            && matches!(
                self.state,
                GroupState::Idle | GroupState::Standby | GroupState::Faulted
            )
        {
            self.absent = inputs.absent;
            self.happen(Event::AxesChanged);
        }
        if !self.wanted {
            self.happen(Event::Disable);
        } else if ready && !waits {
            self.happen(Event::Ready);
        }
        let Some((order, event)) = ordered.and_then(|order| Some((order, order.event()?))) else {
            return;
        };
        let before = self.state;
        if !self.happen(event) {
            // Something came in between.
            let why = Refusal::NotIn(before);
            self.events.report(GroupEvent::ReleaseRefused(why));
            return;
        }
        self.carry_out(order);
    }

    /// What a transition needs to know of its order.
    fn carry_out(&mut self, order: Order) {
        match (order, self.state) {
            (Order::Release, GroupState::Moving) => {
                self.hold_actual();
                for axis in &mut self.axes {
                    axis.arrived = true;
                }
            }
            (Order::Home { axes, limit }, GroupState::Homing) => {
                for axis in self.axes.iter_mut().filter(|axis| axis.is_in(axes)) {
                    axis.led.home(limit);
                    axis.arrived = axis.absent;
                }
            }
            (Order::SetMode { axes, mode }, GroupState::ModeChange) => {
                for axis in self.axes.iter_mut().filter(|axis| axis.is_in(axes)) {
                    axis.wanted = (axis.mode != mode && !axis.absent).then_some(mode);
                    axis.hold_actual();
                }
            }
            _ => {}
        }
    }
}

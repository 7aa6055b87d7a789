//! Orders to the group, judged at once and carried out in the next step.

use super::axis::{Axes, FRESH, SLOW};
use super::{Group, Inputs, bit};
use crate::motion::contract::{Cell, Event, cell};
use crate::motion::mode::Mode;
use crate::motion::program::{Judged, Refused};
use crate::motion::{GroupEvent, GroupState, Reason, Refusal, next};

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
    /// Search for home within so many cycles, released and at rest: bit n for axis n.
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
        let mut why = Refusal::NONE;
        self.accept(order, &mut why).map_err(|Refused| why)
    }

    /// The same.
    #[inline(never)]
    pub(in crate::motion) fn accept(&mut self, order: Order, why: &mut Refusal) -> Judged {
        let Some(event) = order.event() else {
            self.unwanted = false;
            return Ok(());
        };
        if matches!(event, Event::Disable | Event::Stop | Event::QuickStop) {
            self.stops = self.stops.wrapping_add(1);
        }
        if event == Event::Disable {
            self.unwanted = true;
            return Ok(());
        }
        if cell(self.state, event) == Cell::Refuse {
            let missing = self.absent & (bit(N) - 1);
            if !self.network_ready && missing != 0 {
                why.axis = missing.trailing_zeros() as u8;
                return why.because(Reason::Network, 0, 1);
            }
            return why.state(self.state);
        }
        match order {
            Order::Finish | Order::Home { .. }
                if self.state != GroupState::Moving || !self.all_arrived() =>
            {
                return why.busy();
            }
            // A torque that is done may leave its axis turning.
            Order::Finish if self.here() & !self.which(SLOW) != 0 => return why.busy(),
            Order::Stop | Order::QuickStop => {}
            _ if self.ordered.event().is_some() => return why.busy(),
            _ => self.permit(order, why)?,
        }
        self.ordered = order;
        Ok(())
    }

    /// Whether all axes can do what is ordered.
    fn permit(&self, order: Order, why: &mut Refusal) -> Judged {
        let Some(config) = self.config else {
            return Ok(());
        };
        let mut look = self.here();
        let (wanted, other) = match order {
            Order::Reset if !self.network_ready => return why.because(Reason::Network, 0, 1),
            Order::Release => (0, Mode::Homing),
            Order::SetMode { axes, mode } => (axes, mode),
            Order::Home { axes, .. } => (axes, Mode::Homing),
            _ => return Ok(()),
        };
        let homes = matches!(order, Order::Home { .. });
        while let Some(n) = next(&mut look) {
            let (Some(of), Some(limits)) = (self.axes.get(n), config.axes.get(n)) else {
                continue;
            };
            let (reason, value, allowed) = if of.seen & FRESH == 0 {
                (Reason::NotFresh, 0, 1)
            } else if of.seen & SLOW == 0 {
                let speed = of.feedback.velocity.unsigned_abs();
                (Reason::NotAtRest, speed, config.standstill_rpm)
            } else if wanted & bit(n) == 0 {
                continue;
            } else if homes && of.mode() != other {
                (Reason::WrongMode, of.mode() as u32, other as u32)
            } else if !other.is_in(limits.modes) {
                (Reason::NoSuchMode, other as u32, limits.modes)
            } else {
                continue;
            };
            why.axis = n as u8;
            return why.because(reason, value, allowed);
        }
        Ok(())
    }

    /// The network, and what was ordered.
    pub(super) fn obey(&mut self, inputs: &Inputs) {
        let ready = inputs.network_ready;
        self.network_ready = ready;
        self.network_was_down |= !ready || self.faulted & inputs.absent != 0;
        let waits = self.state == GroupState::Faulted && !self.network_was_down;
        if inputs.absent != self.absent
            && matches!(
                self.state,
                GroupState::Idle | GroupState::Standby | GroupState::Faulted
            )
        {
            self.absent = inputs.absent;
            self.happen(Event::AxesChanged);
        }
        if self.unwanted {
            self.happen(Event::Disable);
        } else if ready && !waits {
            self.happen(Event::Ready);
        }
        let order = core::mem::replace(&mut self.ordered, Order::Enable);
        let Some(event) = order.event() else { return };
        self.unwanted |= event == Event::QuickStop;
        let before = self.state;
        if !self.happen(event) {
            // Something came in between.
            let why = Refusal::not_in(before);
            self.events.report(GroupEvent::ReleaseRefused(why));
            return;
        }
        self.carry_out(order);
    }

    /// What a transition needs to know of its order.
    fn carry_out(&mut self, order: Order) {
        let mut of = match (order, self.state) {
            (Order::Release, GroupState::Moving) => {
                self.hold_actual();
                self.busy = 0;
                for (n, axis) in self.axes.iter().enumerate() {
                    // Until its drive has taken over where it is.
                    self.busy |= Axes::from(!axis.led.is_done()) << n;
                }
                return;
            }
            (Order::Home { axes, .. }, GroupState::Homing)
            | (Order::SetMode { axes, .. }, GroupState::ModeChange) => axes & self.here(),
            _ => return,
        };
        if self.state == GroupState::Homing {
            self.busy |= of;
        }
        while let Some(n) = next(&mut of) {
            let Some(axis) = self.axes.get_mut(n) else {
                continue;
            };
            match order {
                Order::Home { limit, .. } => axis.led.home(limit),
                Order::SetMode { mode, .. } => {
                    axis.wanted = (axis.mode() != mode).then_some(mode);
                    axis.hold_actual();
                }
                _ => {}
            }
        }
    }
}

//! Somebody else's tool on the bus, frame by frame: what a test says to the
//! board and hears.

use std::collections::VecDeque;

use super::line::Who;
use super::{FIRST, World};
use crate::bridge::Controller;
use crate::bus::{BitTiming, Bus, Event, PortId};
use crate::frame::WireFrame;
use crate::time::Time;

/// A CAN controller of its own, with what it has heard.
pub(super) struct Guest {
    port: PortId,
    timing: Option<BitTiming>,
    controller: Controller,
    heard: VecDeque<WireFrame>,
}

impl Guest {
    pub(super) fn on_event(&mut self, event: &Event) {
        if event.port == self.port {
            self.heard.extend(self.controller.on_event(event.kind));
        }
    }

    pub(super) fn offer(&mut self, bus: &mut Bus, now: Time) {
        let timing = self.controller.timing();
        if timing != self.timing {
            self.timing = timing;
            bus.set_timing(self.port, timing, now);
        }
        bus.offer(self.port, self.controller.offer());
    }
}

impl World<'_> {
    /// The same with a guest on the first bus, at its bit rate.
    pub fn with_guest(mut self) -> Self {
        let port = self.lines[FIRST].attach("guest".to_string(), Who::Tool);
        let mut controller = Controller::default();
        controller.start(self.machine.segments()[FIRST].bit_rate);
        self.guest = Some(Guest {
            port,
            timing: None,
            controller,
            heard: VecDeque::new(),
        });
        self
    }

    /// The guest sends a frame; false if there is none, or too much waits.
    pub fn say(&mut self, frame: WireFrame) -> bool {
        let now = self.now;
        self.guest
            .as_mut()
            .is_some_and(|guest| guest.controller.send(frame, now))
    }

    /// The next frame that the guest has heard.
    pub fn hear(&mut self) -> Option<WireFrame> {
        self.guest.as_mut()?.heard.pop_front()
    }
}

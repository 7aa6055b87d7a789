//! The CAN controller of one adapter: sends in the order of asking, again
//! after a lost arbitration or an error.

use std::collections::VecDeque;

use crate::bus::{BitTiming, ErrorState, EventKind, Offer};
use crate::frame::WireFrame;
use crate::time::Time;

/// Frames that wait for the bus, at most.
pub(super) const QUEUE: usize = 64;

// Status flags of the SJA1000 as the `F` command tells them.
const TX_FULL: u8 = 1 << 1;
const ERROR_WARNING: u8 = 1 << 2;
const OVERRUN: u8 = 1 << 3;
const ERROR_PASSIVE: u8 = 1 << 5;
const ARBITRATION_LOST: u8 = 1 << 6;
const BUS_ERROR: u8 = 1 << 7;

/// See the module.
#[derive(Clone, Debug, Default)]
pub struct Controller {
    timing: Option<BitTiming>,
    /// With the moment from which each may be sent.
    queue: VecDeque<(WireFrame, Time)>,
    /// The head of the queue is on the wire.
    in_flight: bool,
    state: Option<ErrorState>,
    /// What has happened since it was last asked.
    happened: u8,
}

impl Controller {
    /// Joins the bus, with counters at zero.
    pub fn start(&mut self, bit_rate: u32) {
        *self = Controller {
            timing: Some(BitTiming::new(bit_rate, 0.0)),
            ..Controller::default()
        };
    }

    /// Leaves the bus; what was not sent is forgotten.
    pub fn stop(&mut self) {
        *self = Controller::default();
    }

    /// Its bit timing; `None` while it is off the bus.
    pub fn timing(&self) -> Option<BitTiming> {
        self.timing
    }

    /// No frame waits.
    pub fn is_idle(&self) -> bool {
        self.queue.is_empty()
    }

    /// No frame more can wait.
    pub fn is_full(&self) -> bool {
        self.queue.len() >= QUEUE
    }

    /// Takes a frame to send; false if it is off the bus or full.
    pub fn send(&mut self, frame: WireFrame, now: Time) -> bool {
        let takes = self.timing.is_some() && !self.is_full();
        if takes {
            self.queue.push_back((frame, now));
        }
        takes
    }

    /// What it would send next.
    pub fn offer(&self) -> Option<Offer> {
        let (frame, ready_at) = self.queue.front().filter(|_| !self.in_flight)?;
        Some(Offer {
            frame: *frame,
            ready_at: *ready_at,
            tag: 0,
        })
    }

    /// Takes in what the bus says. `Some`: a frame that arrived.
    pub fn on_event(&mut self, event: EventKind) -> Option<WireFrame> {
        match event {
            EventKind::TxStarted { .. } => self.in_flight = true,
            EventKind::TxDone { .. } => {
                self.in_flight = false;
                self.queue.pop_front();
            }
            EventKind::ArbitrationLost { .. } => {
                self.in_flight = false;
                self.happened |= ARBITRATION_LOST;
            }
            EventKind::TxError { .. } => {
                self.in_flight = false;
                self.happened |= BUS_ERROR;
            }
            EventKind::RxError { .. } => self.happened |= BUS_ERROR,
            EventKind::Rx { frame, .. } => return self.timing.map(|_| frame),
            EventKind::Counters { state, .. } => self.state = Some(state),
        }
        None
    }

    /// A frame was lost because nobody fetched it.
    pub fn overrun(&mut self) {
        self.happened |= OVERRUN;
    }

    /// The status flags: what is, and what has happened since the last call.
    pub fn take_flags(&mut self) -> u8 {
        let mut flags = std::mem::take(&mut self.happened);
        if self.is_full() {
            flags |= TX_FULL;
        }
        match self.state {
            None | Some(ErrorState::Active) => {}
            Some(ErrorState::Warning) => flags |= ERROR_WARNING,
            Some(ErrorState::Passive | ErrorState::BusOff) => {
                flags |= ERROR_WARNING | ERROR_PASSIVE;
            }
        }
        flags
    }
}

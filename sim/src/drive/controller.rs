//! The CAN controller of the drive: what waits to be sent, lowest identifier
//! first, and the way through bus-off.

use crate::bus::{ErrorState, EventKind, Offer};
use crate::frame::{WireFrame, WireId};
use crate::time::Time;

/// Frames that can wait.
const CAPACITY: usize = 16;
/// From the request to the moment at which the controller can start.
const REQUEST_DELAY: Time = Time::from_us(2);

#[derive(Clone, Copy, Debug)]
struct Waiting {
    frame: WireFrame,
    ready_at: Time,
    tag: u32,
}

/// The queue is full and the frame is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct QueueFull;

/// The controller.
#[derive(Clone, Debug)]
pub(super) struct Controller {
    queue: Vec<Waiting>,
    in_flight: Option<u32>,
    next_tag: u32,
    state: ErrorState,
}

impl Default for Controller {
    fn default() -> Controller {
        Controller {
            queue: Vec::new(),
            in_flight: None,
            next_tag: 0,
            state: ErrorState::Active,
        }
    }
}

impl Controller {
    /// Puts a frame in the queue, behind those with its identifier.
    pub(super) fn send(&mut self, frame: WireFrame, now: Time) -> Result<(), QueueFull> {
        if self.queue.len() >= CAPACITY {
            return Err(QueueFull);
        }
        self.queue.push(Waiting {
            frame,
            ready_at: now + REQUEST_DELAY,
            tag: self.next_tag,
        });
        self.next_tag = self.next_tag.wrapping_add(1);
        Ok(())
    }

    /// The same for an object with a mailbox of its own: new data replaces data
    /// that still waits.
    pub(super) fn send_latest(&mut self, frame: WireFrame, now: Time) -> Result<(), QueueFull> {
        let in_flight = self.in_flight;
        let old = self
            .queue
            .iter_mut()
            .find(|w| w.frame.id == frame.id && Some(w.tag) != in_flight);
        match old {
            Some(waiting) => {
                waiting.frame = frame;
                Ok(())
            }
            None => self.send(frame, now),
        }
    }

    /// How many frames with this identifier wait or are on the wire.
    pub(super) fn waiting(&self, id: WireId) -> usize {
        self.queue.iter().filter(|w| w.frame.id == id).count()
    }

    /// Everything that waits is forgotten.
    pub(super) fn clear(&mut self) {
        self.queue.clear();
        self.in_flight = None;
    }

    /// A new start of the controller.
    pub(super) fn reset(&mut self) {
        self.clear();
        self.state = ErrorState::Active;
    }

    /// What the bus would get next. Nothing while a frame is on the wire.
    pub(super) fn offer(&self) -> Option<Offer> {
        if self.in_flight.is_some() {
            return None;
        }
        // Equal identifiers keep their order: `min_by_key` takes the first.
        let first = self
            .queue
            .iter()
            .min_by_key(|w| w.frame.arbitration_key())?;
        Some(Offer {
            frame: first.frame,
            ready_at: first.ready_at,
            tag: first.tag,
        })
    }

    /// Takes in what the bus says. A change of the error state is answered.
    pub(super) fn on_event(&mut self, kind: &EventKind) -> Option<ErrorState> {
        match *kind {
            EventKind::TxStarted { tag } => self.in_flight = Some(tag),
            EventKind::TxDone { tag, .. } => {
                self.queue.retain(|w| w.tag != tag);
                self.in_flight = None;
            }
            EventKind::ArbitrationLost { .. } | EventKind::TxError { .. } => {
                self.in_flight = None;
            }
            EventKind::Counters { state, .. } if state != self.state => {
                self.state = state;
                return Some(state);
            }
            _ => {}
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(id: u16, byte: u8) -> WireFrame {
        WireFrame::standard(id, &[byte])
    }

    fn first(c: &Controller) -> (u16, u8) {
        let offer = c.offer().unwrap();
        let WireId::Standard(id) = offer.frame.id else {
            panic!("standard frames only");
        };
        (id, offer.frame.data[0])
    }

    #[test]
    fn the_lowest_identifier_goes_first_and_equal_ones_in_order() {
        let mut c = Controller::default();
        for f in [
            frame(0x701, 5),
            frame(0x581, 1),
            frame(0x581, 2),
            frame(0x181, 3),
        ] {
            c.send(f, Time::ZERO).unwrap();
        }
        let mut seen = Vec::new();
        while let Some(offer) = c.offer() {
            seen.push(first(&c));
            c.on_event(&EventKind::TxStarted { tag: offer.tag });
            assert_eq!(c.offer(), None, "on the wire");
            c.on_event(&EventKind::TxDone {
                tag: offer.tag,
                sof: Time::ZERO,
            });
        }
        assert_eq!(seen, [(0x181, 3), (0x581, 1), (0x581, 2), (0x701, 5)]);
    }

    #[test]
    fn a_lost_arbitration_or_an_error_offers_the_frame_again() {
        let mut c = Controller::default();
        c.send(frame(0x701, 1), Time::ZERO).unwrap();
        let tag = c.offer().unwrap().tag;
        c.on_event(&EventKind::TxStarted { tag });
        c.on_event(&EventKind::ArbitrationLost { tag });
        assert_eq!(c.offer().unwrap().tag, tag);
        c.send(frame(0x181, 2), Time::ZERO).unwrap();
        assert_eq!(first(&c), (0x181, 2), "a better one overtakes");
    }

    #[test]
    fn a_mailbox_holds_the_newest_data() {
        let mut c = Controller::default();
        c.send_latest(frame(0x181, 1), Time::ZERO).unwrap();
        c.send_latest(frame(0x181, 2), Time::ZERO).unwrap();
        assert_eq!(first(&c), (0x181, 2));
        let tag = c.offer().unwrap().tag;
        c.on_event(&EventKind::TxStarted { tag });
        c.send_latest(frame(0x181, 3), Time::ZERO).unwrap();
        c.on_event(&EventKind::TxDone {
            tag,
            sof: Time::ZERO,
        });
        assert_eq!(first(&c), (0x181, 3), "what is on the wire is not touched");
    }

    #[test]
    fn a_full_queue_says_so() {
        let mut c = Controller::default();
        for n in 0..CAPACITY {
            assert_eq!(c.send(frame(0x581, n as u8), Time::ZERO), Ok(()));
        }
        assert_eq!(c.send(frame(0x581, 0), Time::ZERO), Err(QueueFull));
    }

    #[test]
    fn a_change_of_the_error_state_is_told_once() {
        let mut c = Controller::default();
        let passive = EventKind::Counters {
            tec: 130,
            rec: 0,
            state: ErrorState::Passive,
        };
        assert_eq!(c.on_event(&passive), Some(ErrorState::Passive));
        assert_eq!(c.on_event(&passive), None);
    }
}

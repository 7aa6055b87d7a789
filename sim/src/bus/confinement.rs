//! Fault confinement: the two error counters and what follows from them
//! (ISO 11898-1:2015, 12.1.4).

use super::types::{ErrorState, EventKind};

/// From here on a node warns (12.1.4).
const WARNING_LIMIT: u16 = 96;
/// A counter above this makes a node error passive.
const PASSIVE_LIMIT: u16 = 127;
/// A transmit error counter above this takes a node off the bus.
const BUS_OFF_LIMIT: u16 = 255;
/// What an error costs a transmitter, and a receiver that raised it first.
const HEAVY: u16 = 8;
/// An error passive receiver comes back to this value (119..=127 are allowed)
/// with its first good frame.
const BACK_FROM_PASSIVE: u16 = 119;

/// Transmit and receive error counter of one node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counters {
    tec: u16,
    rec: u16,
}

impl Counters {
    /// What the counters mean.
    pub(super) fn state(self) -> ErrorState {
        let worst = self.tec.max(self.rec);
        if self.tec > BUS_OFF_LIMIT {
            ErrorState::BusOff
        } else if worst > PASSIVE_LIMIT {
            ErrorState::Passive
        } else if worst >= WARNING_LIMIT {
            ErrorState::Warning
        } else {
            ErrorState::Active
        }
    }

    pub(super) fn is_passive(self) -> bool {
        self.state() >= ErrorState::Passive
    }

    pub(super) fn is_bus_off(self) -> bool {
        self.state() == ErrorState::BusOff
    }

    /// Rule c: a transmitter sends an error flag. Also rules d and f for a
    /// transmitter.
    pub(super) fn transmit_error(&mut self) {
        self.tec = self.tec.saturating_add(HEAVY);
    }

    /// Rule a: a receiver detects an error.
    pub(super) fn receive_error(&mut self) {
        self.raise_rec(1);
    }

    /// Rules b, e and f: a receiver that sees dominant right after its error
    /// flag, a bit error in its flag, or a bus that stays dominant.
    pub(super) fn receive_error_heavy(&mut self) {
        self.raise_rec(HEAVY);
    }

    /// Above the passive limit the receive counter rises no further.
    fn raise_rec(&mut self, by: u16) {
        if self.rec <= PASSIVE_LIMIT {
            self.rec += by;
        }
    }

    /// Rule g: a frame was sent and acknowledged.
    pub(super) fn transmitted(&mut self) {
        self.tec = self.tec.saturating_sub(1);
    }

    /// Rule h: a frame was received up to the acknowledge slot and
    /// acknowledged.
    pub(super) fn received(&mut self) {
        self.rec = if self.rec > PASSIVE_LIMIT {
            BACK_FROM_PASSIVE
        } else {
            self.rec.saturating_sub(1)
        };
    }

    /// As the controller is told.
    pub(super) fn report(self) -> EventKind {
        EventKind::Counters {
            tec: self.tec,
            rec: self.rec,
            state: self.state(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counters(tec: u16, rec: u16) -> Counters {
        Counters { tec, rec }
    }

    #[test]
    fn limits() {
        use ErrorState::*;
        for (tec, rec, state) in [
            (0, 0, Active),
            (95, 95, Active),
            (96, 0, Warning),
            (0, 96, Warning),
            (127, 127, Warning),
            (128, 0, Passive),
            (0, 128, Passive),
            (255, 0, Passive),
            (256, 0, BusOff),
        ] {
            assert_eq!(counters(tec, rec).state(), state, "{tec} {rec}");
        }
    }

    #[test]
    fn sixteen_errors_make_a_transmitter_passive_thirty_two_take_it_off() {
        let mut c = Counters::default();
        for n in 1..=32 {
            c.transmit_error();
            assert_eq!(c.is_passive(), n >= 16);
            assert_eq!(c.is_bus_off(), n >= 32);
        }
    }

    #[test]
    fn good_frames_count_down() {
        let mut c = counters(1, 1);
        for _ in 0..2 {
            c.transmitted();
            c.received();
        }
        assert_eq!(c, Counters::default());
        let mut passive = counters(0, 135);
        passive.received();
        assert_eq!(passive, counters(0, 119));
    }

    #[test]
    fn a_passive_receiver_stops_counting() {
        let mut c = Counters::default();
        for _ in 0..1000 {
            c.receive_error_heavy();
        }
        assert_eq!(c, counters(0, 128));
        assert_eq!(c.state(), ErrorState::Passive);
    }
}

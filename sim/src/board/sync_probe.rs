//! Watches how long after TIM2's update the SYNC is requested.

use crate::frame::{WireFrame, WireId};

/// From the timer event to the transmit request of the SYNC.
#[derive(Debug, Clone)]
pub(crate) struct SyncProbe {
    cob_id: u16,
    updates: u64,
    /// The update that waits for its SYNC, and whether one has been requested.
    due: Option<u64>,
    answered: bool,
    figures: SyncFigures,
}

/// What the probe has seen, in core cycles.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SyncFigures {
    /// Updates after which a SYNC was requested.
    pub count: u64,
    /// Worst time from the update to the first request.
    pub worst_first_cycles: u64,
    /// Worst time from the update to the last request (several buses).
    pub worst_last_cycles: u64,
    /// The time of the latest update's first request.
    pub latest_cycles: u64,
}

impl SyncProbe {
    /// Watches for data frames with identifier `cob_id`.
    #[must_use]
    pub(crate) fn new(cob_id: u16) -> Self {
        Self {
            cob_id,
            updates: 0,
            due: None,
            answered: false,
            figures: SyncFigures::default(),
        }
    }

    /// After a reset the timer counts its updates from zero; figures stay.
    pub(crate) fn restart(&mut self) {
        self.updates = 0;
        self.due = None;
    }

    /// What has been seen so far.
    #[must_use]
    pub(crate) const fn figures(&self) -> SyncFigures {
        self.figures
    }

    /// Forgets the figures, for a measurement that starts later.
    pub(crate) fn clear(&mut self) {
        self.figures = SyncFigures::default();
    }

    /// The timer has had `updates` updates, the last at cycle `last`.
    pub(crate) fn note_updates(&mut self, updates: u64, last: u64) {
        if updates > self.updates {
            self.due = Some(last);
            self.answered = false;
        }
        self.updates = updates;
    }

    /// A frame was requested at `cycle`.
    pub(crate) fn note_request(&mut self, frame: &WireFrame, cycle: u64) {
        if frame.id != WireId::Standard(self.cob_id) {
            return;
        }
        let Some(due) = self.due else { return };
        let took = cycle.saturating_sub(due);
        let figures = &mut self.figures;
        if !self.answered {
            self.answered = true;
            figures.count += 1;
            figures.latest_cycles = took;
            figures.worst_first_cycles = figures.worst_first_cycles.max(took);
        }
        figures.worst_last_cycles = figures.worst_last_cycles.max(took);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_from_the_update_to_the_first_and_last_request() {
        let mut probe = SyncProbe::new(0x080);
        let sync = WireFrame::standard(0x080, &[]);
        probe.note_request(&sync, 5);
        assert_eq!(probe.figures().count, 0, "no update, no figure");
        probe.note_updates(1, 1000);
        probe.note_request(&WireFrame::standard(0x201, &[0; 6]), 1010);
        probe.note_request(&sync, 1100);
        probe.note_request(&sync, 1150);
        probe.note_updates(2, 2000);
        probe.note_request(&sync, 2080);
        assert_eq!(
            probe.figures(),
            SyncFigures {
                count: 2,
                worst_first_cycles: 100,
                worst_last_cycles: 150,
                latest_cycles: 80,
            }
        );
    }
}

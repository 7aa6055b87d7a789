//! How long the controller stays away after bus-off.

use crate::time::{Duration, Instant};

/// The first pause. Longer than the drives' reaction to an error frame storm,
/// short against a person's patience.
const FIRST: Duration = Duration::from_millis(100);
/// No pause is longer.
const LONGEST: Duration = Duration::from_millis(6_400);
/// The time without bus-off after which the pauses begin anew.
const QUIET: Duration = Duration::from_millis(30_000);

/// Pauses that double while the bus stays bad.
#[derive(Debug)]
pub(super) struct Pauses {
    last: Option<(Instant, Duration)>,
}

impl Pauses {
    pub(super) const fn new() -> Pauses {
        Pauses { last: None }
    }

    /// The controller is bus-off: how long to wait before it is restarted.
    pub(super) fn next(&mut self, now: Instant) -> Duration {
        let pause = match self.last {
            Some((at, pause)) if now - at < QUIET => (pause + pause).min(LONGEST),
            _ => FIRST,
        };
        self.last = Some((now, pause));
        pause
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    #[test]
    fn pauses_double_up_to_the_longest_and_begin_anew_after_a_quiet_time() {
        let mut pauses = Pauses::new();
        let mut now = Instant::ZERO;
        let mut next = |after_ms| {
            now += Duration::from_millis(after_ms);
            pauses.next(now).as_millis()
        };
        let doubled: Vec<u32> = (0..9).map(|_| next(8_000)).collect();
        assert_eq!(doubled, [100, 200, 400, 800, 1600, 3200, 6400, 6400, 6400]);
        assert_eq!(next(29_999), 6400);
        assert_eq!(next(30_000), 100);
        assert_eq!(next(1), 200);
    }
}

//! Virtual time against the clock on the wall.

use std::time::Duration;

use crate::time::Time;

/// How much lost time is made up for by going faster: as much as a sleep may
/// overshoot. What is lost beyond, as on a slow computer or one that was
/// asleep, stays lost: nobody sees a burst of time.
const MAKE_UP: Duration = Duration::from_millis(20);

/// Keeps a simulation from running ahead of the clock.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pace {
    /// How far virtual time has fallen behind for good.
    behind: Duration,
}

impl Pace {
    /// How long to wait at `simulated` when so much has `elapsed` on the wall
    /// since the simulation began.
    pub fn wait(&mut self, simulated: Time, elapsed: Duration) -> Duration {
        let due = Duration::from_nanos(simulated.as_ns()) + self.behind;
        let late = elapsed.saturating_sub(due);
        self.behind += late.saturating_sub(MAKE_UP);
        due.saturating_sub(elapsed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: fn(u64) -> Duration = Duration::from_millis;

    #[test]
    fn whoever_is_early_waits() {
        let mut pace = Pace::default();
        assert_eq!(pace.wait(Time::from_ms(10), MS(4)), MS(6));
        assert_eq!(pace.wait(Time::from_ms(10), MS(10)), MS(0));
    }

    #[test]
    fn a_little_lost_time_is_made_up_for() {
        let mut pace = Pace::default();
        assert_eq!(pace.wait(Time::from_ms(10), MS(25)), MS(0));
        assert_eq!(pace.wait(Time::from_ms(30), MS(25)), MS(5));
    }

    #[test]
    fn much_lost_time_stays_lost() {
        let mut pace = Pace::default();
        assert_eq!(pace.wait(Time::from_ms(10), MS(1010)), MS(0));
        assert_eq!(
            pace.wait(Time::from_ms(50), MS(1010)),
            MS(20),
            "980 ms are lost for good, 20 ms are made up for"
        );
    }
}

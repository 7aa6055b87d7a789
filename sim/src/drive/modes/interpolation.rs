//! Between the set values of the cyclic modes (60C2h): linear, one period
//! behind. A value that stays away is made up for by the last slope for one
//! more period; then the drive gives up (8250h). The EPOS4's documentation does
//! not say how long it waits.

/// For how many periods a set value counts.
const PERIODS: f64 = 2.0;
/// A control cycle of the drive: what ends the gap comes with a SYNC that may be late
/// by its jitter and by the drive's own clock.
const CONTROL_CYCLE_S: f64 = 0.0004;

/// The set value between two of them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Interpolation {
    from: f64,
    slope: f64,
    /// How much the slope has changed with the last set value.
    change: f64,
    start_s: f64,
    period_s: f64,
}

impl Interpolation {
    /// Standing at `value`.
    pub fn begin(value: f64, now_s: f64) -> Interpolation {
        Interpolation {
            from: value,
            start_s: now_s,
            ..Interpolation::default()
        }
    }

    /// A new set value, to be met after `period_s`; 0: at once.
    pub fn set(&mut self, to: f64, now_s: f64, period_s: f64) {
        let from = self.value(now_s);
        let before = self.slope(now_s);
        *self = if period_s > 0.0 {
            let slope = (to - from) / period_s;
            Interpolation {
                from,
                slope,
                change: slope - before,
                start_s: now_s,
                period_s,
            }
        } else {
            Interpolation::begin(to, now_s)
        };
    }

    /// The value now.
    pub fn value(&self, now_s: f64) -> f64 {
        let passed = (now_s - self.start_s).clamp(0.0, PERIODS * self.period_s);
        self.from + self.slope * passed
    }

    /// Its change per second.
    pub fn slope(&self, now_s: f64) -> f64 {
        if now_s - self.start_s <= PERIODS * self.period_s {
            self.slope
        } else {
            0.0
        }
    }

    /// The change of the slope per second, averaged over a period.
    pub fn bend(&self, now_s: f64) -> f64 {
        if self.period_s > 0.0 && now_s - self.start_s <= self.period_s {
            self.change / self.period_s
        } else {
            0.0
        }
    }

    /// With this period in 60C2h, no set value has come for too long.
    pub fn overdue(&self, now_s: f64, period_s: f64) -> bool {
        period_s > 0.0 && now_s - self.start_s > PERIODS * period_s + CONTROL_CYCLE_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_value_is_met_after_the_period() {
        let mut i = Interpolation::begin(100.0, 1.0);
        i.set(110.0, 1.0, 0.002);
        assert!((i.value(1.001) - 105.0).abs() < 1e-9);
        assert!((i.value(1.002) - 110.0).abs() < 1e-9);
        assert!((i.slope(1.001) - 5000.0).abs() < 1e-6);
        assert!(!i.overdue(1.0043, 0.002));
        assert!(i.overdue(1.0045, 0.002));
        assert!((i.value(2.0) - 120.0).abs() < 1e-9, "one period more");
        assert_eq!(i.slope(2.0), 0.0);
    }

    #[test]
    fn without_a_period_it_steps() {
        let mut i = Interpolation::begin(100.0, 1.0);
        i.set(110.0, 1.0, 0.0);
        assert_eq!((i.value(1.0), i.slope(1.0)), (110.0, 0.0));
        assert!(!i.overdue(9.0, 0.0));
    }
}

//! Where the travel of an axis ends, and where its switches and index pulses
//! are. Positions are those of the shaft, in increments.

/// The ends of the travel and the switches on it. By default there are none:
/// the shaft turns for ever.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Travel {
    /// A hard stop that the shaft cannot pass in the negative direction.
    pub negative_stop: Option<f64>,
    /// The same in the positive direction.
    pub positive_stop: Option<f64>,
    /// The negative limit switch is closed here and below.
    pub negative_switch: Option<f64>,
    /// The positive limit switch is closed here and above.
    pub positive_switch: Option<f64>,
    /// The home switch is closed from the first to the second position.
    pub home_switch: Option<(f64, f64)>,
    /// Here is an index pulse, and every turn from here.
    pub index_at: f64,
}

/// The switches as the drive sees them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inputs {
    /// The negative limit switch is closed.
    pub negative: bool,
    /// The positive limit switch is closed.
    pub positive: bool,
    /// The home switch is closed.
    pub home: bool,
}

impl Travel {
    /// Whether a limit switch exists.
    pub fn has_limit_switch(&self) -> bool {
        self.negative_switch.is_some() || self.positive_switch.is_some()
    }

    /// The switches with the shaft at `position`.
    pub fn inputs(&self, position: f64) -> Inputs {
        Inputs {
            negative: self.negative_switch.is_some_and(|at| position <= at),
            positive: self.positive_switch.is_some_and(|at| position >= at),
            home: self
                .home_switch
                .is_some_and(|(from, to)| (from..=to).contains(&position)),
        }
    }

    /// The hard stop that `position` would be behind.
    pub fn stop(&self, position: f64) -> Option<f64> {
        let below = self.negative_stop.filter(|&stop| position < stop);
        let above = self.positive_stop.filter(|&stop| position > stop);
        below.or(above)
    }

    /// The index pulse that the encoder passes on its way, the first if there
    /// are several. One at the start does not count again.
    pub fn index_between(&self, from: i64, to: i64, turn: u32) -> Option<i64> {
        let (offset, turn) = (self.index_at.round() as i64, i64::from(turn));
        let first = if to >= from {
            from - (from - offset).rem_euclid(turn) + turn
        } else {
            from - 1 - (from - 1 - offset).rem_euclid(turn)
        };
        let passed = if to >= from { first <= to } else { first >= to };
        passed.then_some(first)
    }
}

impl Inputs {
    /// 60FDh (CiA 402-2, 12.3.6): bit 0 negative limit, 1 positive limit,
    /// 2 home switch.
    pub fn bits(self) -> u32 {
        u32::from(self.negative) | u32::from(self.positive) << 1 | u32::from(self.home) << 2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn index_pulses_are_a_turn_apart_and_latched_once() {
        let travel = Travel {
            index_at: 300.0,
            ..Travel::default()
        };
        for (from, to, expected) in [
            (0, 299, None),
            (0, 300, Some(300)),
            (300, 2299, None),
            (299, 2301, Some(300)),
            (-1800, 0, Some(-1700)),
            (-1700, 0, None),
            (-1701, 0, Some(-1700)),
            (301, 300, Some(300)),
            (300, 299, None),
            (300, -1700, Some(-1700)),
            (5, 5, None),
        ] {
            assert_eq!(
                travel.index_between(from, to, 2000),
                expected,
                "{from} {to}"
            );
        }
    }

    #[test]
    fn switches_and_stops() {
        let travel = Travel {
            negative_stop: Some(-100.0),
            positive_switch: Some(50.0),
            home_switch: Some((-10.0, 10.0)),
            ..Travel::default()
        };
        assert_eq!(travel.inputs(0.0).bits(), 0b100);
        assert_eq!(travel.inputs(50.0).bits(), 0b010);
        assert_eq!(travel.inputs(-99.0).bits(), 0);
        assert_eq!(travel.stop(-101.0), Some(-100.0));
        assert_eq!(travel.stop(1e9), None);
    }
}

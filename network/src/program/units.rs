//! From the units of a program to increments: rational numbers, so that nothing
//! drifts.

use super::axes::Axis;

/// The unit of positions in a program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Unit {
    /// Those of 6064h.
    #[default]
    Increments,
    /// Of the load, behind the gear.
    Turns,
    /// Of the load.
    Degrees,
    /// As `units_per_turn` of the axis says.
    User,
}

/// By the names that a program calls them.
pub(super) const UNITS: [(&str, Unit); 4] = [
    ("increments", Unit::Increments),
    ("turns", Unit::Turns),
    ("degrees", Unit::Degrees),
    ("units", Unit::User),
];

/// From here on a number has no fraction.
const WHOLE: f64 = 9_007_199_254_740_992.0;
const FULL_CIRCLE: u32 = 360;

impl Unit {
    /// Increments for so many of these units; `None`: the axis has no such unit.
    fn factor(self, axis: &Axis) -> Option<(i128, i128)> {
        let (of_motor, of_load) = axis.motor.gear;
        let per_turn = match self {
            Unit::Increments => return Some((1, 1)),
            Unit::Turns => 1,
            Unit::Degrees => FULL_CIRCLE,
            Unit::User => axis.units_per_turn?,
        };
        let increments = i128::from(axis.motor.increments_per_turn) * i128::from(of_motor);
        Some((increments, i128::from(of_load) * i128::from(per_turn)))
    }

    /// The axis has such a unit.
    pub(super) fn is_known(self, axis: &Axis) -> bool {
        self.factor(axis).is_some()
    }

    /// The nearest increment, and what is lost by that; `None`: the axis has no such
    /// unit, or it is no position.
    pub(super) fn increments(self, axis: &Axis, value: f64) -> Option<(i64, f64)> {
        let (increments, units) = self.factor(axis)?;
        if value.fract() == 0.0 && value.abs() < WHOLE {
            // Exact, however far it is.
            let product = value as i128 * increments;
            let half = units / 2 * product.signum();
            let nearest = (product + half) / units;
            let lost = (product - nearest * units) as f64 / units as f64;
            return Some((i64::try_from(nearest).ok()?, lost));
        }
        let exact = value * increments as f64 / units as f64;
        let nearest = exact.round();
        let fits = nearest.abs() < WHOLE;
        fits.then_some((nearest as i64, exact - nearest))
    }

    /// What so many increments are, for a message.
    pub(super) fn show(self, axis: &Axis, increments: i64) -> String {
        let word = UNITS.iter().find(|(_, unit)| *unit == self);
        let word = word.map_or("", |(word, _)| *word);
        match self.factor(axis) {
            Some((by, per)) if self != Unit::Increments => {
                let value = increments as f64 * per as f64 / by as f64;
                format!("{value:.3} {word} ({increments} increments)")
            }
            _ => format!("{increments} increments"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Motor;

    fn axis() -> Axis {
        Axis {
            name: "x".to_string(),
            motor: Motor {
                increments_per_turn: 2000,
                gear: (7, 3),
                max_speed: 3000,
                max_acceleration: 20_000,
                limits: (-i32::MAX, i32::MAX),
                modes: 0,
            },
            units_per_turn: Some(3600),
            mode: 3,
            modes: 0,
            velocity_max: 3000,
            acceleration_max: 20_000,
            travel: (-1, 1),
        }
    }

    #[test]
    fn a_billion_increments_are_exact() {
        let (axis, unit) = (axis(), Unit::User);
        // 2000 * 7 / (3 * 3600) = 35 / 27.
        for user in [0i64, 1, -1, 13, 27, 771_428_571, -771_428_571] {
            let (there, lost) = unit.increments(&axis, user as f64).unwrap();
            assert!((there * 27 - user * 35).abs() <= 13, "{user}");
            assert!(lost.abs() <= 0.5);
        }
        assert_eq!(
            unit.increments(&axis, 771_428_571.0).unwrap().0,
            999_999_999
        );
        assert_eq!(Unit::Turns.increments(&axis, 1.5).unwrap(), (7000, 0.0));
        assert_eq!(Unit::Degrees.increments(&axis, -540.0).unwrap().0, -7000);
        assert_eq!(Unit::Increments.increments(&axis, 2.5).unwrap().0, 3);
        assert_eq!(Unit::Turns.increments(&axis, f64::NAN), None);
    }
}

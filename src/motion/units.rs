//! User units: rational, so that nothing drifts.

/// Increments of 6064h for user units, a rational number: encoder times gear.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Units {
    /// So many increments ...
    pub increments: u32,
    /// ... are so many user units.
    pub user: u32,
}

impl Units {
    /// An encoder with so many increments for a turn of the motor, a gear of
    /// `motor` turns for `load` turns, and so many user units for a turn of the
    /// load. `None` if a factor is 0 or the products do not fit.
    pub const fn new(per_turn: u32, gear: (u32, u32), per_load_turn: u32) -> Option<Units> {
        let (Some(increments), Some(user)) = (
            per_turn.checked_mul(gear.0),
            per_load_turn.checked_mul(gear.1),
        ) else {
            return None;
        };
        if increments == 0 || user == 0 {
            return None;
        }
        let common = common_divisor(increments, user);
        Some(Units {
            increments: increments / common,
            user: user / common,
        })
    }

    /// The increment nearest to a position in user units; halves away from zero.
    /// Positions are absolute: what is converted is never summed.
    pub const fn to_increments(&self, user: i64) -> Option<i64> {
        scaled(user, self.increments, self.user)
    }

    /// The user unit nearest to a position in increments.
    pub const fn to_user(&self, increments: i64) -> Option<i64> {
        scaled(increments, self.user, self.increments)
    }
}

const fn common_divisor(mut a: u32, mut b: u32) -> u32 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// `x * by / per`, rounded to the nearest.
const fn scaled(x: i64, by: u32, per: u32) -> Option<i64> {
    let Some(product) = x.checked_mul(by as i64) else {
        return None;
    };
    let half = (per / 2) as i64;
    match if product < 0 {
        product.checked_sub(half)
    } else {
        product.checked_add(half)
    } {
        Some(sum) => Some(sum / per as i64),
        None => None,
    }
}

/// A position beyond the 32 bits of 6064h: follows its wrap, as long as the axis
/// goes less than 2^31 increments from one look to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unwrapped(i64);

impl Unwrapped {
    /// Begins at a value of 6064h.
    pub const fn new(position: i32) -> Unwrapped {
        Unwrapped(position as i64)
    }

    /// Takes in the next value of 6064h; the position.
    pub const fn follow(&mut self, position: i32) -> i64 {
        self.0 += position.wrapping_sub(self.0 as i32) as i64;
        self.0
    }
}

/// The unit of velocities, object 60A9h: a power of ten of rpm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VelocityUnit {
    /// One unit is `10^-digits` rpm.
    pub digits: u8,
}

impl VelocityUnit {
    /// rpm, as 60A9h has it without its prefix: revolutions, minutes.
    const RPM: u32 = 0x00B4_4700;
    /// The most digits that drives offer.
    const DIGITS_MAX: u8 = 6;

    /// The unit of a value of 60A9h; `None` if it is not rpm down to 10^-6 rpm.
    pub const fn of(object: u32) -> Option<VelocityUnit> {
        const PREFIX_SHIFT: u32 = 24;
        let digits = ((object >> PREFIX_SHIFT) as u8).wrapping_neg();
        if object << u8::BITS == Self::RPM << u8::BITS && digits <= Self::DIGITS_MAX {
            Some(VelocityUnit { digits })
        } else {
            None
        }
    }

    /// Units for one rpm.
    pub const fn per_rpm(self) -> u32 {
        const TEN: u32 = 10;
        TEN.pow(self.digits as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_position_is_the_same_after_a_billion_increments_there_and_back() {
        // 7 : 3, 3600 units a turn: 2000 * 7 / 10800.
        let units = Units::new(2000, (7, 3), 3600).unwrap();
        assert_eq!((units.increments, units.user), (35, 27));
        for user in [0, 1, -1, 13, 27, 771_428_571, -771_428_571] {
            let there = units.to_increments(user).unwrap();
            assert!((there * 27 - user * 35).abs() <= 13);
            assert_eq!(units.to_user(there).unwrap(), user);
        }
        assert_eq!(units.to_increments(771_428_571), Some(999_999_999));
        assert_eq!(Units::new(2000, (0, 1), 1), None);
        assert_eq!(Units::new(65_536, (65_536, 1), 1), None);
        assert_eq!(units.to_increments(i64::MAX), None);
    }

    #[test]
    fn the_wrap_of_6064h_is_followed_both_ways() {
        let mut position = Unwrapped::new(i32::MAX - 5);
        let mut expected = i64::from(i32::MAX - 5);
        for step in [
            10,
            1_000_000_000,
            1_500_000_000,
            -7,
            -2_000_000_000,
            -1_999_999_999,
        ] {
            expected += step;
            assert_eq!(position.follow(expected as i32), expected);
        }
    }

    #[test]
    fn velocity_units_of_60a9h() {
        let digits = |object| VelocityUnit::of(object).map(|unit| unit.digits);
        assert_eq!(digits(0x00B4_4700), Some(0));
        assert_eq!(digits(0xFFB4_4700), Some(1));
        assert_eq!(digits(0xFAB4_4700), Some(6));
        assert_eq!(digits(0xF9B4_4700), None);
        assert_eq!(digits(0x01B4_4700), None);
        assert_eq!(digits(0x00B4_0300), None);
        assert_eq!(VelocityUnit::of(0xFDB4_4700).unwrap().per_rpm(), 1000);
    }
}

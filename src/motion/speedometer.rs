//! Velocity from positions, for a drive whose TPDOs carry none.

use super::scale::Scale;

/// The mean velocity of the last cycles, the newest counting most.
///
/// An increment in one cycle of 2 ms is 15 rpm with 2000 increments for a turn: too
/// coarse to tell rest from motion. Averaged over 20 ms it is 1.5 rpm.
#[derive(Clone, Copy, Debug, Default)]
pub struct Speedometer {
    last: Option<i32>,
    /// Increments of the last cycles, older ones fading.
    moved: f32,
}

impl Speedometer {
    /// Before the first position.
    pub const fn new() -> Speedometer {
        Speedometer {
            last: None,
            moved: 0.0,
        }
    }

    /// The velocity in rpm at the new position of an axis of this `scale`.
    pub fn at(&mut self, position: i32, scale: &Scale) -> i32 {
        /// Over how long it averages: 20 ms.
        const PER_SECOND: f32 = 50.0;
        let way = position.wrapping_sub(self.last.unwrap_or(position));
        self.last = Some(position);
        self.moved += way as f32;
        // The part that fades in a cycle.
        let mut fading = scale.per_cycle(PER_SECOND);
        if fading > 1.0 {
            fading = 1.0;
        }
        let faded = self.moved * fading;
        self.moved -= faded;
        scale.rpm(faded) as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Duration;

    struct Speed(Speedometer, Scale);

    impl Speed {
        fn at(&mut self, position: i32) -> i32 {
            self.0.at(position, &self.1)
        }
    }

    fn speedometer(cycle_ms: u32) -> Speed {
        let scale = Scale::new(2000, Duration::from_millis(cycle_ms));
        Speed(Speedometer::new(), scale)
    }

    #[test]
    fn a_steady_speed_is_found() {
        for (cycle_ms, step) in [(1, 50), (2, 100), (10, 500), (50, 2500)] {
            let mut speed = speedometer(cycle_ms);
            let mut at = i32::MAX - 20_000;
            for _ in 0..200 {
                at = at.wrapping_add(step);
                speed.at(at);
            }
            assert!((speed.at(at.wrapping_add(step)) - 1500).abs() <= 1);
        }
    }

    #[test]
    fn an_increment_to_and_fro_is_rest() {
        let mut speed = speedometer(2);
        for n in 0..100 {
            assert!(speed.at(n % 2).abs() <= 1);
        }
    }

    #[test]
    fn the_first_position_is_no_motion() {
        assert_eq!(speedometer(2).at(1_000_000), 0);
    }

    #[test]
    fn it_stands_soon_after_the_stop() {
        let mut speed = speedometer(2);
        for n in 0..100 {
            speed.at(n * 10);
        }
        let soon = (0..50).position(|_| speed.at(990) <= 6).unwrap();
        assert!((20..40).contains(&soon), "{soon}");
    }
}

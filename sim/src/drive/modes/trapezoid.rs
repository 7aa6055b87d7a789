//! Linear ramps to a position or a speed: the generator of profile position and
//! homing (6086h = 0). Increments, seconds.

/// Limits of a move, all positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MoveLimits {
    /// Increments per second.
    pub speed: f64,
    /// Increments per second squared.
    pub acceleration: f64,
    /// Increments per second squared.
    pub deceleration: f64,
}

/// Nearer than this the target is met: the encoder cannot tell.
const MET: f64 = 0.5;

/// Where the demand is and how fast it moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Trapezoid {
    /// Increments.
    pub position: f64,
    /// Increments per second.
    pub rate: f64,
}

impl Trapezoid {
    /// From this place and speed on.
    pub fn begin(position: f64, rate: f64) -> Trapezoid {
        Trapezoid { position, rate }
    }

    /// One cycle on the way to `target`. True once it has come to rest there.
    pub fn approach(&mut self, target: f64, limits: MoveLimits, seconds: f64) -> bool {
        let distance = target - self.position;
        if self.rate == 0.0 && distance.abs() < MET {
            self.position = target;
            return true;
        }
        let direction = if distance < 0.0 { -1.0 } else { 1.0 };
        let speed = self.rate * direction;
        let slowest = speed - limits.deceleration * seconds;
        let next = if speed < 0.0 {
            // It moves away: to rest first.
            (speed + limits.deceleration * seconds).min(0.0)
        } else {
            let stop = stoppable(speed, distance.abs(), limits.deceleration, seconds);
            let faster = speed + limits.acceleration * seconds;
            faster.min(limits.speed).min(stop).max(slowest).max(0.0)
        };
        self.advance(next * direction, seconds);
        if self.rate == 0.0 && (target - self.position).abs() < MET {
            self.position = target;
            return true;
        }
        false
    }

    /// One cycle on the way to a speed with a sign.
    pub fn run(&mut self, speed: f64, slope: f64, seconds: f64) {
        let change = slope * seconds;
        let next = self.rate + (speed - self.rate).clamp(-change, change);
        self.advance(next, seconds);
    }

    fn advance(&mut self, rate: f64, seconds: f64) {
        self.position += (self.rate + rate) / 2.0 * seconds;
        self.rate = rate;
    }
}

/// The largest speed at the end of the cycle from which the way that is left
/// then still suffices to stop: (v + w) t / 2 + w^2 / 2d = distance.
fn stoppable(speed: f64, distance: f64, deceleration: f64, seconds: f64) -> f64 {
    let half = deceleration * seconds / 2.0;
    let square = half * half + 2.0 * deceleration * distance - deceleration * speed * seconds;
    if square > 0.0 {
        (square.sqrt() - half).max(0.0)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 0.0004;
    const LIMITS: MoveLimits = MoveLimits {
        speed: 50_000.0,
        acceleration: 400_000.0,
        deceleration: 300_000.0,
    };

    /// Time to the target, largest speed, farthest place.
    fn travel(from: Trapezoid, target: f64) -> (f64, f64, f64) {
        let mut t = from;
        let (mut cycles, mut fastest, mut farthest) = (0, 0.0f64, from.position);
        while !t.approach(target, LIMITS, DT) {
            cycles += 1;
            fastest = fastest.max(t.rate.abs());
            farthest = farthest.max(t.position);
            assert!(cycles < 100_000, "it arrives");
        }
        assert_eq!((t.position, t.rate), (target, 0.0));
        (f64::from(cycles) * DT, fastest, farthest)
    }

    #[test]
    fn a_long_move_takes_the_time_of_its_trapezoid() {
        let (time, fastest, farthest) = travel(Trapezoid::default(), 100_000.0);
        let exact = 50_000.0 / 4e5 / 2.0 + 50_000.0 / 3e5 / 2.0 + 100_000.0 / 50_000.0;
        assert!((time - exact).abs() < 3.0 * DT, "{time} {exact}");
        assert_eq!(fastest, 50_000.0);
        assert!(farthest < 100_000.1, "{farthest}");
    }

    #[test]
    fn moves_of_every_length_arrive_without_overshoot() {
        for n in 0..400 {
            let target = f64::from(n) * 7.3 + f64::from(n * n);
            let (_, _, farthest) = travel(Trapezoid::default(), target);
            assert!(farthest <= target + 0.1, "{target}: {farthest}");
        }
    }

    #[test]
    fn a_target_too_near_is_passed_and_come_back_to() {
        let (_, _, farthest) = travel(Trapezoid::begin(0.0, 50_000.0), 100.0);
        let way = 50_000.0f64.powi(2) / 2.0 / 3e5;
        assert!((farthest - way).abs() < 20.0, "{farthest} {way}");
        travel(Trapezoid::begin(0.0, 50_000.0), -3000.0);
    }
}

//! The ramp of profile velocity: a demand that approaches its target with
//! separate limits for speeding up and slowing down.

/// Limits of a ramp, rpm/s, both positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slopes {
    /// 6083h: while the amount of speed grows.
    pub acceleration: f64,
    /// 6084h (or 6085h): while it shrinks.
    pub deceleration: f64,
}

/// The demand after `seconds`, coming from `demand` and going to `target`
/// (rpm). A change of sign slows down to zero with the deceleration first and
/// speeds up with the acceleration in what is left of the step.
pub(super) fn step(demand: f64, target: f64, slopes: Slopes, seconds: f64) -> f64 {
    let slowing = demand * target < 0.0 || demand.abs() > target.abs();
    if !slowing {
        return toward(demand, target, slopes.acceleration * seconds);
    }
    let corner = if demand * target < 0.0 { 0.0 } else { target };
    let change = slopes.deceleration * seconds;
    let distance = (demand - corner).abs();
    if change < distance || corner == target {
        return toward(demand, corner, change);
    }
    let rest = seconds - distance / slopes.deceleration;
    toward(corner, target, slopes.acceleration * rest)
}

fn toward(from: f64, to: f64, change: f64) -> f64 {
    if (to - from).abs() <= change {
        to
    } else {
        from + change.copysign(to - from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLOPES: Slopes = Slopes {
        acceleration: 1000.0,
        deceleration: 4000.0,
    };

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-9
    }

    #[test]
    fn speeding_up_and_slowing_down_have_their_own_slopes() {
        assert!(close(step(0.0, 500.0, SLOPES, 0.1), 100.0));
        assert!(close(step(0.0, -500.0, SLOPES, 0.1), -100.0));
        assert!(close(step(500.0, 0.0, SLOPES, 0.1), 100.0));
        assert!(close(step(-500.0, -300.0, SLOPES, 0.01), -460.0));
    }

    #[test]
    fn the_target_is_met_exactly() {
        assert_eq!(step(499.0, 500.0, SLOPES, 0.1), 500.0);
        assert_eq!(step(1.0, 0.0, SLOPES, 0.1), 0.0);
    }

    #[test]
    fn a_reversal_uses_both_slopes_in_one_step() {
        // 100 rpm down takes 25 ms, the other 75 ms speed up to -75 rpm.
        assert!(close(step(100.0, -500.0, SLOPES, 0.1), -75.0));
    }
}

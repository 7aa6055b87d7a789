//! Position control closed in the master over the drive's velocity loop.
//!
//! The drive runs in profile velocity mode (CiA 402-2, clause 15) and gets a new
//! target velocity (60FFh) every cycle. Two delays lie between a reference and
//! the motor: what is written in cycle k is taken over at SYNC k+1, and the
//! drive's velocity loop follows with a lag. Both are known well enough to
//! command ahead of time; the position loop only removes what is left.
//!
//! - *Feed-forward*: at SYNC k the reference for SYNC k+2 is commanded, where the
//!   drive's ramp from the target of SYNC k+1 ends, advanced by the lag.
//! - *Lag*: starts at a nominal value and is learned while the reference
//!   accelerates: there, a lag estimated wrongly by d shows as a constant
//!   position error of d times the acceleration over the gain.
//! - *Position loop*: proportional, bounded. Below the resolution of 60FFh (1
//!   rpm) the rounding error is carried to the next cycle, so that the mean
//!   velocity is exact and the last increment is reached. Inside the dead band
//!   an axis whose reference rests is commanded 0: it does not hunt.

use super::path::Sample;
use super::scale::Scale;
use crate::time::Duration;

/// Properties of the position loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// Proportional gain in 1/cycle. Its product with the loop's delay (1.5 cycles
    /// and the lag) should stay below 0.35: then the loop does not overshoot.
    pub gain: f32,
    /// Lag of the drive's velocity loop to start from, in cycles.
    pub lag: f32,
    /// Largest lag that can be learned, in cycles.
    pub lag_max: f32,
    /// Share of a newly seen lag that is taken over per cycle, 0 .. 1.
    pub learning: f32,
    /// Bound of the position loop's output in rpm while the reference moves.
    pub correction_rpm: f32,
    /// The same in rpm while the reference rests: creeping to the last
    /// increments must not count as motion.
    pub creep_rpm: f32,
    /// Position error in increments within which a resting axis gets velocity 0.
    pub dead_band: f32,
}

impl Tuning {
    /// For drives with a velocity loop of 3 .. 10 ms: the gain falls with the delay
    /// of the loop, 1.5 cycles and the lag; the lag is learned in the same time at
    /// every cycle.
    pub const fn for_cycle(cycle: Duration) -> Tuning {
        /// The product of gain and delay.
        const GAIN_BY_DELAY: f32 = 0.3;
        /// The lag that a drive is taken to have at most, in microseconds.
        const LAG_US: f32 = 10_000.0;
        /// That to start from, and that which can be learned.
        const FIRST_LAG_US: f32 = 5_000.0;
        const LAG_MAX_US: f32 = 15_000.0;
        const CYCLES: f32 = 1.5;
        /// What of an error is learned in a cycle of 10 ms, and in every longer one.
        const LEARNING: f32 = 0.03;
        const NOMINAL_US: f32 = 10_000.0;
        const fn least(a: f32, b: f32) -> f32 {
            if a < b { a } else { b }
        }
        let cycle_us = cycle.as_micros() as f32;
        Tuning {
            gain: GAIN_BY_DELAY / (CYCLES + LAG_US / cycle_us),
            lag: FIRST_LAG_US / cycle_us,
            lag_max: LAG_MAX_US / cycle_us,
            learning: LEARNING * least(cycle_us / NOMINAL_US, 1.0),
            correction_rpm: 60.0,
            creep_rpm: 3.0,
            dead_band: 1.0,
        }
    }
}

/// What an axis rolls on after an advanced ramp, over deceleration times lag
/// squared. It is a half for a continuous ramp; with ramps in steps of a cycle,
/// interpolated by the drive (which shortens the lag as learned), simulated
/// drives of 3 .. 10 ms end nearest to their targets with this value.
const STOPPING_SHORT: f32 = 1.0;

/// The reference around one SYNC, as the position loop needs it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window<'a> {
    /// At the SYNC just passed, when the position was sampled.
    pub now: &'a Sample,
    /// At the end of the cycle that the next command governs.
    pub ahead: &'a Sample,
    /// Velocity one cycle later, increments per cycle.
    pub beyond: f32,
    /// Reference minus position at `now`, increments. Without it (the axis' TPDO is
    /// missing) the axis is driven by feed-forward alone.
    pub error: Option<f32>,
}

impl Window<'_> {
    /// Whether the reference rests all through the window.
    fn rests(&self) -> bool {
        self.now.velocity == 0.0 && self.ahead.velocity == 0.0 && self.beyond == 0.0
    }
}

/// The position loop of one axis: what it remembers from cycle to cycle.
#[derive(Clone, Debug, Default)]
pub struct PositionControl {
    /// The lag as learned so far beyond that to start from, in cycles.
    learned: f32,
    /// What rounding the last command to whole rpm left over, in rpm.
    carry: f32,
}

impl PositionControl {
    /// A loop that has learned nothing yet.
    pub const fn new() -> PositionControl {
        PositionControl {
            learned: 0.0,
            carry: 0.0,
        }
    }

    /// The target velocity (60FFh) in rpm that follows the reference, at most
    /// `limit` in magnitude.
    pub fn step(&mut self, window: &Window<'_>, tuning: &Tuning, scale: Scale, limit: u32) -> i32 {
        let lag = tuning.lag + self.learned;
        let mut correction = 0.0;
        if let Some(error) = window.error {
            let Sample {
                velocity,
                acceleration,
                ..
            } = *window.now;
            let rests = window.rests();
            // The way by which an axis has to stay behind while it brakes: the
            // advanced command reaches 0 a lag before the reference does and cannot
            // undershoot, so that the axis would roll on when the ramp is over.
            let mut error = error;
            if acceleration * velocity < 0.0 {
                error += STOPPING_SHORT * acceleration * lag * lag;
            }
            if rests && error.abs() <= tuning.dead_band {
                self.carry = 0.0;
                return 0;
            }
            let wanted = error * tuning.gain;
            // A constant error while the reference accelerates is a wrong lag.
            if acceleration != 0.0 && window.ahead.acceleration == acceleration {
                let learned = self.learned + tuning.learning * wanted / acceleration;
                self.learned = within(learned, -tuning.lag, tuning.lag_max - tuning.lag);
            }
            let bound = if rests {
                tuning.creep_rpm
            } else {
                tuning.correction_rpm
            };
            correction = within(scale.rpm(wanted), -bound, bound);
        }
        let ahead = window.ahead.velocity;
        let advanced = ahead + (tuning.lag + self.learned) * (window.beyond - ahead);
        let wanted = scale.rpm(advanced) + correction + self.carry;
        let limit = limit as f32;
        let wanted = within(wanted, -limit, limit);
        let command = round(wanted);
        self.carry = wanted - command as f32;
        command
    }
}

/// The number of `low ..= high` that is nearest to `x`. Unlike `f32::clamp` it
/// has no panic, whose message would bring the formatting of floating-point
/// numbers into the image.
#[inline(never)]
fn within(x: f32, low: f32, high: f32) -> f32 {
    if x < low {
        low
    } else if x > high {
        high
    } else {
        x
    }
}

/// To the nearest whole number, halves away from zero.
fn round(x: f32) -> i32 {
    (x + 0.5f32.copysign(x)) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Increments per cycle that are 1 rpm with 2000 increments and 10 ms.
    const RPM: f32 = 1.0 / 3.0;
    const CYCLE: Duration = Duration::from_millis(10);
    const TUNING: Tuning = Tuning::for_cycle(CYCLE);

    /// A step with 2000 increments for a turn and at most 3000 rpm.
    fn step(control: &mut PositionControl, window: &Window<'_>) -> i32 {
        control.step(window, &TUNING, Scale::new(2000, CYCLE), 3000)
    }

    const REST: Sample = Sample::at_rest(0);

    fn resting(error: f32) -> Window<'static> {
        Window {
            now: &REST,
            ahead: &REST,
            beyond: 0.0,
            error: Some(error),
        }
    }

    fn moving(rpm: f32, acceleration: f32) -> Sample {
        Sample {
            velocity: rpm * RPM,
            acceleration,
            position: 0,
        }
    }

    fn along(at: &Sample, error: Option<f32>) -> Window<'_> {
        Window {
            now: at,
            ahead: at,
            beyond: at.velocity + at.acceleration,
            error,
        }
    }

    #[test]
    fn the_tuning_follows_the_cycle() {
        let per_second = |ms: u16| {
            let tuning = Tuning::for_cycle(Duration::from_millis(ms.into()));
            tuning.gain * 1000.0 / f32::from(ms)
        };
        assert!((per_second(10) - 12.0).abs() < 1e-5);
        assert!(per_second(2) > 20.0 && per_second(50) < 4.0);
        let learning = |ms: u32| Tuning::for_cycle(Duration::from_millis(ms)).learning;
        assert_eq!([learning(10), learning(50)], [0.03, 0.03]);
        assert!((learning(1) - 0.003).abs() < 1e-9);
    }

    #[test]
    fn a_resting_axis_inside_the_dead_band_gets_nothing() {
        let mut control = PositionControl::new();
        for error in [-1.0, 0.0, 1.0] {
            assert_eq!(step(&mut control, &resting(error)), 0);
        }
    }

    #[test]
    fn creeping_is_slower_than_what_counts_as_motion() {
        for error in [-1000i16, -20, 20, 1000] {
            let mut control = PositionControl::new();
            for _ in 0..10 {
                let rpm = step(&mut control, &resting(error.into()));
                assert!(rpm.abs() <= 3 && rpm * i32::from(error) > 0, "{rpm}");
            }
        }
    }

    /// Two increments of error are 0.72 rpm: 72 of 100 cycles at 1 rpm.
    #[test]
    fn rounding_is_carried_on() {
        let mut control = PositionControl::new();
        let sum: i32 = (0..100).map(|_| step(&mut control, &resting(2.0))).sum();
        assert_eq!(sum, 72);
    }

    #[test]
    fn commands_keep_their_limits() {
        for rpm in [5000, -5000i16] {
            let at = moving(rpm.into(), 0.0);
            let command = step(&mut PositionControl::new(), &along(&at, Some(0.0)));
            assert_eq!(command, 3000 * i32::from(rpm.signum()));
        }
        // The correction is bounded as well.
        let at = moving(1000.0, 0.0);
        let rpm = step(&mut PositionControl::new(), &along(&at, Some(100_000.0)));
        assert_eq!(rpm, 1060);
    }

    #[test]
    fn without_feedback_the_feed_forward_goes_on() {
        let mut control = PositionControl::new();
        let at = moving(750.0, 0.0);
        for _ in 0..10 {
            assert_eq!(step(&mut control, &along(&at, None)), 750);
        }
    }

    /// A drive whose lag is 4 ms longer than assumed is late by 4 ms times the
    /// acceleration, less the share already learned.
    #[test]
    fn the_lag_is_learned_and_bounded() {
        let mut control = PositionControl::new();
        let acceleration = 3.0;
        let at = moving(300.0, acceleration);
        for _ in 0..300 {
            let lag = TUNING.lag + control.learned;
            let late = ((0.9 - lag) * acceleration / TUNING.gain).round();
            step(&mut control, &along(&at, Some(late)));
        }
        let lag = TUNING.lag + control.learned;
        assert!((lag - 0.9).abs() < 0.03, "{lag}");
        for (error, end) in [(100_000.0, TUNING.lag_max), (-100_000.0, 0.0)] {
            for _ in 0..1000 {
                step(&mut control, &along(&at, Some(error)));
            }
            assert!((TUNING.lag + control.learned - end).abs() < 1e-6);
        }
    }
}

//! The position controller of the drive: proportional, with the speed and the
//! acceleration fed forward so that a demand within the motor's means is
//! followed without lag.

use super::modes::Motion;

/// Gain times the time constant of the velocity loop below it: a damping of 1.1.
const GAIN: f64 = 0.2;

/// The speed in rpm that brings the axis along `motion`. `error` is demand minus
/// actual position at the begin of the cycle, increments; `time_constant_s` that
/// of the velocity loop.
pub(super) fn speed(motion: Motion, error: f64, time_constant_s: f64, per_rpm: f64) -> f64 {
    let gain = GAIN / time_constant_s;
    let wanted = motion.rate + time_constant_s * motion.acceleration + gain * error;
    wanted / per_rpm
}

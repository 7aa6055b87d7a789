//! Seeded random numbers: one independent stream per purpose, so that a draw
//! more here never changes what happens there.

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Spreads seeds that differ in a few bits over the whole state.
const MIX: u64 = 0x9E37_79B9_7F4A_7C15;

/// One stream of random numbers.
#[derive(Clone, Debug)]
pub struct Random(Pcg64Mcg);

impl Random {
    /// The stream `purpose` of `seed`.
    pub fn new(seed: u64, purpose: u64) -> Random {
        let mixed = (seed ^ purpose.wrapping_mul(MIX).rotate_left(32)).wrapping_mul(MIX);
        Random(Pcg64Mcg::seed_from_u64(mixed))
    }

    /// Uniform in `min ..= max`.
    pub fn between(&mut self, min: f64, max: f64) -> f64 {
        min + (max - min) * self.0.random::<f64>()
    }

    /// Uniform in `min ..= max`.
    pub fn integer(&mut self, min: u64, max: u64) -> u64 {
        if max <= min {
            return min;
        }
        self.0.random_range(min..=max)
    }

    /// Uniform in -1 .. 1.
    pub fn symmetric(&mut self) -> f64 {
        self.between(-1.0, 1.0)
    }
}

/// Streams of a drive.
pub(super) const SPREAD: u64 = 1;
/// Disturbance torque.
pub(super) const DISTURBANCE: u64 = 2;
/// Noise of measured values.
pub(super) const MEASUREMENT: u64 = 3;
/// Latencies of SDO answers and TPDOs, boot times.
pub(super) const LATENCY: u64 = 4;

//! Warnings that come and go with the SYNCs.

use super::config::Spread;
use super::errors::OVERLOAD;
use super::{Drive, Job};

/// See [`DriveFault::Warnings`](super::DriveFault::Warnings).
#[derive(Clone, Debug)]
pub(super) struct Warnings {
    every: u32,
    delay: Spread,
    /// SYNCs until the next one.
    left: u32,
}

impl Warnings {
    pub(super) fn new(every: u32, turn: u32, delay: Spread) -> Warnings {
        Warnings {
            every: every.max(2),
            delay,
            left: turn,
        }
    }
}

impl Drive {
    /// A SYNC has come.
    pub(super) fn warn(&mut self) {
        let Some(warnings) = &mut self.warnings else {
            return;
        };
        let job = if warnings.left == 0 {
            warnings.left = warnings.every;
            Some(Job::Error {
                code: OVERLOAD,
                lasting: false,
            })
        } else {
            (warnings.left == warnings.every - 1).then_some(Job::CauseGone(OVERLOAD))
        };
        warnings.left -= 1;
        if let Some(job) = job {
            let us = warnings.delay.draw(&mut self.random);
            self.plan(self.now + self.clock.span(us), job);
        }
    }
}

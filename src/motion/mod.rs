//! Motion: several axes as one group, moved in step; the contract is in
//! `docs/motion.md`.
//!
//! [`Group`] is stepped once per SYNC cycle with what the drives reported and
//! says what to command in the next one. It evaluates a [`path`] for each axis and
//! turns it into the target of the axis' [`mode`]: for profile velocity mode
//! through [`PositionControl`], position control closed here, in the master.
//! [`Director`] plans the paths, of single moves and of programs, in a task of low
//! priority.
//!
//! Arithmetic is in integers where a value must be exact (positions, times in
//! cycles) and in single precision elsewhere: the Cortex-M4F computes it in
//! hardware.

mod config;
pub mod contract;
mod director;
mod event;
pub mod experiment;
mod fixed;
mod group;
pub mod mode;
pub mod panel;
pub mod path;
pub mod plan;
mod position_control;
mod program;
mod scale;
mod speedometer;
pub mod units;

/// Takes the first out of a set: bit n for n.
fn next(set: &mut u32) -> Option<usize> {
    let first = set.trailing_zeros();
    *set &= set.wrapping_sub(1);
    (first < u32::BITS).then_some(first as usize)
}

fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

pub use config::{AxisConfig, GroupConfig};
pub use director::{Director, format};
pub use event::{Cause, FaultCause, GroupEvent, GroupState};
pub use group::{
    AxisCommand, AxisFeedback, AxisView, DriveSetting, Group, Inputs, Order, SetPoint, TooLate,
    Wanted,
};
pub use position_control::{PositionControl, Tuning, Window};
pub use program::{AxisMove, Reason, Refusal};
pub use scale::Scale;
pub use speedometer::Speedometer;

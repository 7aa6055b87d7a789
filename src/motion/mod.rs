//! Motion: several axes as one group, moved in step.
//!
//! [`Group`] is stepped once per SYNC cycle with what the drives reported and
//! says what to command in the next one. It runs a [`Program`] once per
//! release. Below it, a [`Profile`] gives each axis' reference and
//! [`PositionControl`] turns it into the target velocity of profile velocity
//! mode (60FFh): position control is closed here, in the master.
//!
//! Arithmetic is in integers where a value must be exact (positions, times in
//! cycles) and in single precision elsewhere: the Cortex-M4F computes it in
//! hardware.

pub mod experiment;
mod group;
mod position_control;
mod profile;
mod program;
mod reference;
mod scale;
mod speedometer;

pub use group::{
    AxisCommand, AxisConfig, AxisFeedback, FaultCause, Group, GroupConfig, GroupEvent, GroupState,
    Refusal, Request,
};
pub use position_control::{PositionControl, Tuning, Window};
pub use profile::{Limits, NotFeasible, Profile, Setpoint, Timing};
pub use program::{AxisMove, Limit, PlanError, Program, Step};
pub use reference::{Ramp, Reference};
pub use scale::Scale;
pub use speedometer::Speedometer;

//! Simulator.

pub mod bus;
pub mod frame;
pub mod time;

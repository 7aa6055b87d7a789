//! Simulator.

pub mod board;
pub mod bridge;
pub mod bus;
pub mod drive;
pub mod frame;
pub mod judge;
pub mod log;
pub mod time;
pub mod world;

//! Motion on the emulated board, with six simulated drives: what `docs/motion.md`
//! says, asked for and watched by a client on the bus as any CANopen tool does it.

#[path = "../common/mod.rs"]
mod common;

mod commands;
mod homing;
mod judged;
mod leader;
mod modes;
mod orders;
mod programs;
mod stops;
mod troubles;

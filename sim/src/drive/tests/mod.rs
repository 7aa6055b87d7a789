//! Drives as seen from the wire.

mod boot;
mod faults;
mod motion;
mod objects;
mod on_bus;
mod process;
mod rig;

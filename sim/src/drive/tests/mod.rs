//! Drives as seen from the wire.

mod boot;
mod faults;
mod guarding;
mod layer;
mod modes;
mod motion;
mod objects;
mod on_bus;
mod process;
mod rig;
mod storing;

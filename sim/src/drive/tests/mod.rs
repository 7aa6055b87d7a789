//! Drives as seen from the wire.

mod boot;
mod faults;
mod guarding;
mod layer;
mod mangled;
mod modes;
mod motion;
mod objects;
mod on_bus;
mod process;
mod rig;
mod storing;
mod trouble;

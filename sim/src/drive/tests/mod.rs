//! Drives as seen from the wire.

mod boot;
mod faults;
mod motion;
mod objects;
mod process;
mod rig;

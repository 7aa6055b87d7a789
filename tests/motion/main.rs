//! The motion group against a plant: drives in profile velocity mode, each with
//! its own lag, inertia, friction and noise. Virtual time, seeded.

mod absent;
mod arrivals;
mod contract;
mod plant;
mod profile;
mod program;
mod property;
mod rig;

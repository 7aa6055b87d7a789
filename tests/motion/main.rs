//! The group, its paths and programs, against simulated drives in every mode.
//! Virtual time, seeded.

mod absent;
mod arrivals;
mod built_in;
mod contract;
mod faults;
mod modes;
mod panel;
mod paths;
mod plant;
mod programs;
mod rig;
mod table;

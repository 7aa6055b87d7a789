//! The group, its paths and programs, against simulated drives in every mode.
//! Virtual time, seeded.

mod absent;
mod arrivals;
mod compiled;
mod contract;
mod faults;
mod modes;
mod modes_in_doubt;
mod panel;
mod paths;
mod plant;
mod programs;
mod random;
mod rig;
mod set_points;
mod stops;
mod table;

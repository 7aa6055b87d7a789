//! The master as a CANopen device: its object dictionary by SDO, its settings,
//! its emergencies, TIME.

mod anything;
mod emergency;
mod golden;
mod matrix;
mod nodes;
mod pdos;
mod rig;
mod settings;
mod time;
mod transfer;

//! What follows from a machine.

mod cycle;
mod dbc;
mod dcf;
mod picture;
mod rust;

pub use dbc::dbc;
pub use dcf::concise_dcf;
pub use picture::picture;
pub use rust::rust;

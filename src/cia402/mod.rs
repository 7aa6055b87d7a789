//! CiA 402: the drive profile's statusword, controlword and state machine.
//!
//! [`StatusWord`] and [`ControlWord`] interpret bits and survive any value;
//! [`Axis`] is the commanding side for one drive: it is told a [`Goal`] and each
//! cycle the statusword, and says which controlword to send.

mod axis;
mod control_word;
mod status_word;

pub use axis::{Axis, Goal, Timeout};
pub use control_word::{Command, ControlWord};
pub use status_word::{State, StatusWord};

#[cfg(test)]
mod tests;

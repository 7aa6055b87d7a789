//! A CANopen network master for microcontrollers, and the node side that goes
//! with it: sans-IO, no heap, no unsafe code.
//!
//! A frame and the time go in; frames and the next deadline come out. There is
//! no hardware, clock, executor or logger in here: the firmware in
//! `src/firmware` wires this library to a chip, the simulator in `sim/` to a
//! simulated bus.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unreachable,
        clippy::todo
    )
)]

#[cfg(test)]
extern crate std;

pub mod boot;
pub mod cia402;
pub mod design;
pub mod device;
pub mod emcy;
pub mod frame;
pub mod id;
pub mod led;
pub mod lss;
pub mod master;
pub mod motion;
pub mod network;
pub mod nmt;
pub mod objects;
pub mod od;
pub mod pdo;
pub mod sdo;
pub mod store;
pub mod sync;
pub mod time;
pub mod time_of_day;

mod words;

pub use frame::Frame;
pub use id::{CobId, Index, NodeId, SubIndex};
pub use time::{Duration, Instant};

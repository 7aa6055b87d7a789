//! The bridge without the firmware: words, one adapter on a bus, sockets.

mod adapter;
mod sockets;
mod words;

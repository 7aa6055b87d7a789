//! Tests of the SDO services.

mod block;
mod client;
mod commands;
mod common;
mod lossy;
mod server;

//! Tests of the SDO services.

mod client;
mod commands;
mod common;
mod server;

//! Tests of the SDO services.

mod async_client;
mod block;
mod broken;
mod client;
mod client_matrix;
mod commands;
mod common;
mod late;
mod lossy;
mod server;
mod server_matrix;
mod wire;

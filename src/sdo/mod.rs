//! Service data objects: reading and writing single entries of an object
//! dictionary, confirmed by the other side (CiA 301, 7.2.4).
//!
//! [`Server`] and [`Client`] are sans-IO: a frame and the time go in, a frame
//! comes out. Neither ever waits.

pub mod abort;
pub mod client;
pub mod command;
mod error;
mod response;
pub mod server;

pub use abort::AbortCode;
pub use client::{Client, Progress, StartError};
pub use error::SdoError;
pub use response::{RESPONSE_MAX, Response};
pub use server::Server;

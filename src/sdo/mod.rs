//! Service data objects: reading and writing single entries of an object
//! dictionary, confirmed by the other side (CiA 301, 7.2.4).
//!
//! [`Server`], [`Channel`] and [`Client`] are sans-IO: a frame and the time go
//! in, a frame comes out. None of them ever waits. A [`Session`]
//! carries one transfer through, an [`AsyncClient`] lets async code await it.

pub mod abort;
mod async_client;
mod block;
mod channel;
mod client;
pub mod command;
mod crc;
mod error;
mod progress;
mod response;
mod server;
mod session;
mod test_data;

pub use abort::AbortCode;
pub use async_client::{AsyncClient, AsyncLink};
pub use channel::{Channel, Payload, Protocol, Transfer};
pub use client::Client;
pub use crc::Crc16;
pub use error::SdoError;
pub use progress::{Progress, StartError};
pub use response::{RESPONSE_MAX, Response};
pub use server::Server;
pub use session::{Course, Link, Session};
pub use test_data::TestData;

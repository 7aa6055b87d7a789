//! Boot-up of the network after CiA 302-2: every node is awaited, identified,
//! configured and watched, all of them in parallel, before any is started.
//!
//! [`NetworkBoot`] runs the network, a `NodeBoot` per node
//! runs the steps of CiA 302-2, "Boot slave". A frame or the time goes in,
//! [`Action`]s come out.

mod event;
mod failure;
mod network;
mod node;

pub use event::{Action, Event};
pub use failure::{Cause, Failure, Status};
pub use network::NetworkBoot;

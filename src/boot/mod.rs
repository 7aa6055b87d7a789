//! Boot-up of the network after CiA 302-2: every node is awaited, identified,
//! configured and watched, all of them in parallel, before any is started.
//!
//! [`NetworkBoot`] runs the network and, for each node, the steps of CiA 302-2,
//! "Boot slave", each step a state. A frame or the time goes in, [`Action`]s
//! come out. [`Settings`] are 1F80h, 1F81h, 1F89h and 1F8Ah; what each node has to
//! be (1F84h .. 1F88h), what is written to it (1F22h) and when it need not be
//! (1F26h, 1F27h) comes from the description of the network.
//!
//! LSS is required (CiA 302-2, "NMT start-up") where a node that the network
//! names by its serial number did not boot within 1F89h: before it is given up,
//! it is looked for among the nodes without node-ID (CiA 305, fastscan), given its
//! node-ID, and booted. That is done once. Where every node boots, no LSS frame is
//! sent; where nobody is without node-ID, one question is.
//!
//! Where the standard leaves room, or motion wants more than it asks for:
//! - Nodes are started only when every mandatory one is booted, one by one too.
//! - NMT start goes by broadcast (1F80h, bit 1) only if all nodes wait for it.
//! - A node that returns a boot-up frame where none was awaited, falls silent or
//!   leaves operational is booted again, and started again; the caller learns
//!   of it by [`Event::NodeLost`], [`Event::NetworkDown`] and, at the end,
//!   [`Event::NodeBack`] and [`Event::NetworkReady`].
//! - Check and update of a node's program (1F81h, bits 5 and 6; G, H, I) and the
//!   flying master (1F80h, bit 5) are not offered.

mod bus_off;
mod event;
mod factory;
mod failure;
mod network;
mod node;
mod phase;
mod request;
mod settings;
mod start;

pub use event::{Action, Event};
pub use failure::{BootResult, Cause, Failure, Status};
pub use network::NetworkBoot;
pub use request::Refusal;
pub use settings::{Assignment, NodeSettings, Settings, Startup};

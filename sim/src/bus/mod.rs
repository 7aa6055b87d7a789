//! A CAN bus in virtual time.

mod types;

pub use types::{
    BitTiming, BusFault, ErrorState, Event, EventKind, Offer, PortId, RecordKind, WireError,
    WireRecord,
};

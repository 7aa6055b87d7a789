//! Boot-up of the network, read as sequence charts: what is sent when, and what
//! the nodes answer. The nodes here are tables of bytes, not the library's own
//! server.

mod anything;
mod bus_off;
mod configuration;
mod factory;
mod guarding;
mod letters;
mod lost;
mod networks;
mod random;
mod request;
mod rig;
mod start;
mod words;

//! Layer setting services: giving nodes their node-ID and bit rate over the
//! network (CiA 305).

mod address;
mod bit_rate;
mod command;
mod fastscan;
mod master;
mod slave;

pub use address::{LssAddress, Part};
pub use bit_rate::BitRate;
pub(crate) use command::Awaited;
pub use command::{Answer, ConfigurationResult, Mode, Request};
pub(crate) use fastscan::{Fastscan, Verdict};
pub use master::{LssError, LssMaster, Outcome, Progress, Service};
pub use slave::{Device, LssSlave, SlaveEvent};

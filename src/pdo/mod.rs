//! Process data objects: mapping, communication parameters, and when a PDO is
//! sent or takes effect (CiA 301, 7.2.2, 7.5.2.35 .. 7.5.2.38).
//!
//! The node side holds one [`Configuration`] per PDO, which keeps to the rules
//! of remapping, and one [`RpdoState`] or [`TpdoState`] beside it. The master
//! knows its layouts when it is compiled and uses [`Writer`] and [`Reader`].

mod cob_id;
mod configuration;
mod fields;
mod mapping;
mod runtime;
mod transmission;

pub use cob_id::PdoCobId;
pub use configuration::{Configuration, Features};
pub use fields::{Reader, Writer};
pub use mapping::{MAPPING_MAX, Mapping, MappingEntry};
pub use runtime::{Received, RpdoState, TpdoState};
pub use transmission::Transmission;

/// First communication parameter of the RPDOs (CiA 301, 7.5.2.35).
pub const RPDO_COMMUNICATION: u16 = 0x1400;
/// First mapping parameter of the RPDOs (CiA 301, 7.5.2.36).
pub const RPDO_MAPPING: u16 = 0x1600;
/// First communication parameter of the TPDOs (CiA 301, 7.5.2.37).
pub const TPDO_COMMUNICATION: u16 = 0x1800;
/// First mapping parameter of the TPDOs (CiA 301, 7.5.2.38).
pub const TPDO_MAPPING: u16 = 0x1A00;
/// The most bytes that a PDO carries.
pub const PDO_MAX: usize = crate::frame::MAX_DATA;

/// Whether a node receives or transmits the PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Direction {
    /// RPDO.
    Receive,
    /// TPDO.
    Transmit,
}

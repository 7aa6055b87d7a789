//! Rules between the parts of a description.

mod bits;
mod budget;
mod capacity;
mod configuration;
mod error_control;
mod firmware;
mod identifiers;
mod liveness;

pub(crate) use bits::{bit_rates, peripherals};
pub(crate) use budget::budget;
pub(crate) use capacity::capacity;
pub(crate) use configuration::configuration;
pub(crate) use error_control::error_control;
pub(crate) use firmware::firmware;
pub(crate) use identifiers::identifiers;
pub(crate) use liveness::liveness;

use crate::description::{Description, Device, Node};

/// The device of a node, which was found before.
fn device<'a>(description: &'a Description, node: &Node) -> Option<&'a Device> {
    description
        .device
        .iter()
        .find(|(name, _)| name.get_ref() == node.device.get_ref())
        .map(|(_, device)| device.get_ref())
}

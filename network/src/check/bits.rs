//! Bit rates and controllers.

use std::collections::BTreeMap;

use crate::description::Description;
use crate::eds::Eds;
use crate::model::{Bus, Node};
use crate::resolve::Context;

const PER_KILO: u32 = 1000;

/// Every bus has a controller of its own.
pub(crate) fn peripherals(description: &Description, buses: &[Bus], context: &mut Context<'_>) {
    for (n, (described, bus)) in description.bus.values().zip(buses).enumerate() {
        if let Some(other) = buses
            .iter()
            .take(n)
            .find(|other| other.peripheral == bus.peripheral)
        {
            let peripheral = &described.get_ref().peripheral;
            let place = context.at(peripheral);
            context.problems.error(
                &place,
                peripheral.get_ref(),
                format!("the bus \"{}\" has this controller already", other.name),
                "put its nodes on that bus, or use another controller",
            );
        }
    }
}

/// Every device has the bit rate of its bus, as far as its EDS tells.
pub(crate) fn bit_rates(
    description: &Description,
    files: &BTreeMap<String, Eds>,
    buses: &[Bus],
    nodes: &[Node],
    context: &mut Context<'_>,
) {
    for (described, node) in description.node.iter().zip(nodes) {
        let described = described.get_ref();
        let (Some(eds), Some(bus)) = (files.get(described.device.get_ref()), buses.get(node.bus))
        else {
            continue;
        };
        if eds.device.bit_rates.get(&(bus.bit_rate / PER_KILO)) != Some(&false) {
            continue;
        }
        let has: Vec<String> = eds
            .device
            .bit_rates
            .iter()
            .filter(|(_, has)| **has)
            .map(|(rate, _)| (rate * PER_KILO).to_string())
            .collect();
        if let Some(at) = description.bus.values().nth(node.bus) {
            let rate = &at.get_ref().bit_rate;
            let place = context.at(rate);
            context.problems.error(
                &place,
                rate.get_ref(),
                format!(
                    "{} does not offer this bit rate (BaudRate_{}=0)",
                    eds.file,
                    bus.bit_rate / PER_KILO
                ),
                format!("it offers {}", has.join(", ")),
            );
        }
    }
}

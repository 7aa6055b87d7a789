//! From a machine that was read at run time to the library's description, which
//! is `'static` because the firmware has it in flash: it stays in memory for as long
//! as the program runs.

use canmaster::NodeId;
use canmaster::id::Address;
use canmaster::network::{ConfigWrite, Identity, Kind, Master, Network, Node, Pdo};
use canmaster::pdo::{MappingEntry, Transmission};
use canmaster::time::Duration;
use canmaster_network::model::{self, Machine};
use canmaster_network::object;

/// Why a machine has no description in the library's terms. What
/// `canmaster_network` has checked has one.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LibraryError {
    /// It has no bus with this place.
    #[error("the machine has no bus number {0}: count from 0")]
    NoBus(usize),
    /// The number is no node-ID.
    #[error("{0} is no node-ID: choose 1 .. 127")]
    NodeId(u8),
    /// No object of this length is written while a node is configured.
    #[error("{at} has {bytes} bytes: only values of 1, 2 and 4 bytes are written")]
    Length {
        /// The object.
        at: object::Address,
        /// Its length.
        bytes: u8,
    },
}

/// All nodes of a machine as one network, at the bit rate and cycle of its first bus.
///
/// # Errors
/// If the machine was not checked.
pub fn network(machine: &Machine) -> Result<&'static Network, LibraryError> {
    with_nodes(machine, 0, |_| true)
}

/// One bus of a machine, with the nodes that are on it.
///
/// # Errors
/// If there is no such bus, or the machine was not checked.
pub fn network_of_bus(machine: &Machine, bus: usize) -> Result<&'static Network, LibraryError> {
    with_nodes(machine, bus, |node| node.bus == bus)
}

fn with_nodes(
    machine: &Machine,
    bus: usize,
    belongs: impl Fn(&model::Node) -> bool,
) -> Result<&'static Network, LibraryError> {
    let described = machine.buses.get(bus).ok_or(LibraryError::NoBus(bus))?;
    let master = &machine.master;
    let nodes = machine.nodes.iter().filter(|node| belongs(node));
    Ok(Box::leak(Box::new(Network {
        bit_rate: described.bit_rate,
        cycle: Duration::from_micros(described.cycle_us),
        master: Master {
            node: node_id(master.node_id)?,
            heartbeat: Duration::from_millis(master.heartbeat_ms.into()),
            silence: Duration::from_millis(master.silence_ms),
            boot_time: Duration::from_millis(master.boot_time_ms),
            sdo_tries: master.sdo_tries,
            syncs_before_start: master.syncs_before_start,
        },
        nodes: kept(nodes.map(node))?,
    })))
}

fn kept<T>(
    items: impl Iterator<Item = Result<T, LibraryError>>,
) -> Result<&'static [T], LibraryError> {
    Ok(items.collect::<Result<Vec<T>, _>>()?.leak())
}

fn node_id(id: u8) -> Result<NodeId, LibraryError> {
    NodeId::new(id).ok_or(LibraryError::NodeId(id))
}

fn node(node: &model::Node) -> Result<Node, LibraryError> {
    let identity = &node.identity;
    Ok(Node {
        id: node_id(node.id)?,
        mandatory: node.mandatory,
        name: node.name.clone().leak(),
        serial: identity.serial,
        kind: Box::leak(Box::new(kind(node)?)),
    })
}

fn kind(node: &model::Node) -> Result<Kind, LibraryError> {
    let identity = &node.identity;
    Ok(Kind {
        identity: Identity {
            device_type: identity.device_type,
            vendor: identity.vendor,
            product: identity.product,
            revision: identity.revision,
        },
        heartbeat_ms: node.heartbeat_ms,
        consumer_ms: node.master_timeout_ms,
        rpdos: kept(node.rpdos.iter().map(pdo))?,
        tpdos: kept(node.tpdos.iter().map(pdo))?,
        start_values: kept(node.start_values.iter().map(write))?,
        sdo_timeout: Duration::from_millis(node.sdo_timeout_ms),
        configured: node.configured,
    })
}

fn pdo(pdo: &model::Pdo) -> Result<Pdo, LibraryError> {
    let entries = pdo.mapping.iter();
    Ok(Pdo {
        number: pdo.number,
        transmission: Transmission::from_code(pdo.transmission),
        mapping: kept(entries.map(|entry| Ok(MappingEntry(entry.word()))))?,
    })
}

fn write(write: &model::Write) -> Result<ConfigWrite, LibraryError> {
    let at = Address::new(write.at.index, write.at.sub);
    match write.bytes {
        1 => Ok(ConfigWrite::u8(at, write.value as u8)),
        2 => Ok(ConfigWrite::u16(at, write.value as u16)),
        4 => Ok(ConfigWrite::u32(at, write.value)),
        bytes => Err(LibraryError::Length {
            at: write.at,
            bytes,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    use canmaster::network::sample::{SIX_EPOS4, SIX_EPOS4_10_MS};

    fn sample() -> Machine {
        described("network.toml")
    }

    fn described(file: &str) -> Machine {
        let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        canmaster_network::load(&workspace.join(file))
            .machine
            .unwrap()
    }

    #[test]
    fn the_samples_are_the_networks_that_the_library_has() {
        for (file, ours) in [
            ("network.toml", &SIX_EPOS4),
            ("networks/one_bus_10ms.toml", &SIX_EPOS4_10_MS),
        ] {
            let read = network_of_bus(&described(file), 0).unwrap();
            assert_eq!(format!("{read:#?}"), format!("{ours:#?}"));
        }
    }

    #[test]
    fn what_was_not_checked_is_refused_by_name() {
        let refused = |change: fn(&mut Machine)| {
            let mut machine = sample();
            change(&mut machine);
            network(&machine).unwrap_err()
        };
        assert_eq!(
            network_of_bus(&sample(), 1).unwrap_err(),
            LibraryError::NoBus(1)
        );
        assert_eq!(
            refused(|machine| machine.nodes[0].id = 128),
            LibraryError::NodeId(128)
        );
        let long = refused(|machine| machine.nodes[0].start_values[0].bytes = 3);
        assert!(matches!(long, LibraryError::Length { bytes: 3, .. }));
    }
}

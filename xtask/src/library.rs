//! From a machine that was read at run time to the library's description, which
//! is `'static` because the firmware has it in flash.

use anyhow::{Context, Result};
use canmaster::NodeId;
use canmaster::id::Address;
use canmaster::network::{ConfigWrite, Identity, Master, Network, Node, Pdo};
use canmaster::pdo::{MappingEntry, Transmission};
use canmaster::time::Duration;
use canmaster_network::model::{self, Machine};

/// One bus of a machine as the library has it. It stays for as long as this
/// program runs, which is one command.
pub(crate) fn network(machine: &Machine, bus: usize) -> Result<&'static Network> {
    let described = machine.buses.get(bus).context("there is no such bus")?;
    let master = &machine.master;
    let nodes: Result<Vec<Node>> = machine
        .nodes
        .iter()
        .filter(|node| node.bus == bus)
        .map(node)
        .collect();
    let network = Network {
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
        nodes: nodes?.leak(),
    };
    Ok(Box::leak(Box::new(network)))
}

fn node_id(id: u8) -> Result<NodeId> {
    NodeId::new(id).with_context(|| format!("{id} is no node-ID"))
}

fn node(node: &model::Node) -> Result<Node> {
    let identity = node.identity;
    let start_values: Result<Vec<ConfigWrite>> = node.start_values.iter().map(write).collect();
    Ok(Node {
        id: node_id(node.id)?,
        name: node.name.clone().leak(),
        mandatory: node.mandatory,
        identity: Identity {
            device_type: identity.device_type,
            vendor: identity.vendor,
            product: identity.product,
            revision: identity.revision,
            serial: identity.serial,
        },
        heartbeat_ms: node.heartbeat_ms,
        consumer_ms: node.master_timeout_ms,
        rpdos: pdos(&node.rpdos),
        tpdos: pdos(&node.tpdos),
        start_values: start_values?.leak(),
        sdo_timeout: Duration::from_millis(node.sdo_timeout_ms),
        configured: node.configured,
    })
}

fn pdos(pdos: &[model::Pdo]) -> &'static [Pdo] {
    let pdos = pdos.iter().map(|pdo| {
        let mapping = pdo.mapping.iter().map(|entry| MappingEntry(entry.word()));
        Pdo {
            number: pdo.number,
            transmission: Transmission::from_code(pdo.transmission),
            mapping: mapping.collect::<Vec<_>>().leak(),
        }
    });
    pdos.collect::<Vec<_>>().leak()
}

fn write(write: &model::Write) -> Result<ConfigWrite> {
    let at = Address::new(write.at.index, write.at.sub);
    match write.bytes {
        1 => Ok(ConfigWrite::u8(at, write.value as u8)),
        2 => Ok(ConfigWrite::u16(at, write.value as u16)),
        4 => Ok(ConfigWrite::u32(at, write.value)),
        bytes => anyhow::bail!("{} has {bytes} bytes", write.at),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cargo;
    use crate::machine::DESCRIPTION;

    #[test]
    fn the_sample_is_the_network_that_the_firmware_has() {
        let outcome = canmaster_network::load(&cargo::workspace().join(DESCRIPTION));
        let machine = outcome.machine.unwrap();
        assert_eq!(
            format!("{:#?}", network(&machine, 0).unwrap()),
            format!("{:#?}", canmaster::network::sample::SIX_EPOS4)
        );
    }
}

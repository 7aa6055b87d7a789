//! Networks and nodes as the tests want them.

use crate::rig::{Fake, NODES, id, ms};
use canmaster::NodeId;
use canmaster::boot::Settings;
use canmaster::lss::{LssAddress, LssSlave};
use canmaster::network::{ConfigWrite, Identity, Kind, Master, Network, Node};

/// A network of `n` small nodes; node 2 is made as the test wants it.
pub(crate) fn network(n: u8, change: impl Fn(&mut Node, &mut Kind)) -> &'static Network {
    let nodes = (1..=n).map(|number| {
        let mut kind = Kind {
            identity: Identity {
                device_type: Some(0x0002_0192),
                vendor: Some(0x0000_00FB),
                product: Some(0x6150_0000),
                revision: Some(0x0170_0000),
            },
            heartbeat_ms: 100,
            consumer_ms: 200,
            rpdos: &[],
            tpdos: &[],
            start_values: &[START_VALUE],
            sdo_timeout: ms(100),
            configured: [0; 2],
        };
        let mut node = Node {
            id: id(number),
            mandatory: true,
            name: "node",
            serial: None,
            kind: Box::leak(Box::new(kind)),
        };
        if number == 2 {
            change(&mut node, &mut kind);
        }
        node.kind = Box::leak(Box::new(kind));
        node
    });
    Box::leak(Box::new(Network {
        bit_rate: 1_000_000,
        cycle: ms(10),
        master: Master {
            node: NodeId::MAX,
            heartbeat: ms(50),
            silence: ms(600),
            boot_time: ms(1500),
            sdo_tries: 3,
            syncs_before_start: 2,
        },
        nodes: Box::leak(nodes.collect()),
    }))
}

const START_VALUE: ConfigWrite = ConfigWrite::u8(canmaster::objects::MODES_OF_OPERATION, 3);

/// Sets bits of 1F81h of the node with this number.
pub(crate) fn assign(node: usize, bits: u32) -> impl FnOnce(&mut Settings<NODES>) {
    move |settings| settings.nodes[node - 1].assignment.0 |= bits
}

/// Makes a node optional.
pub(crate) fn optional(node: &mut Node, _: &mut Kind) {
    node.mandatory = false;
}

/// A node without node-ID.
pub(crate) fn unconfigured(fake: &mut Fake, serial: u32) {
    fake.lss = Some(LssSlave::new(
        LssAddress {
            vendor: 0x0000_00FB,
            product: 0x6150_0000,
            revision: 0x0170_0000,
            serial,
        },
        None,
    ));
    fake.id = 0xFF;
    fake.set((0x1018, 4), serial);
}

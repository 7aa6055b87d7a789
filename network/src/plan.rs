//! What is written to a node before it is started, in the order that the
//! firmware keeps: every PDO switched off and the used ones mapped anew, then the
//! start values, then error control (CiA 301, 7.5.2.36, 7.5.2.38).

use crate::model::{Master, Node, Pdo, Write};
use crate::object::{Address, Direction};

/// PDOs that every node of the predefined connection set has in each direction
/// (CiA 301, 7.3.5).
pub const PDOS_PER_NODE: u8 = 4;
/// First entry of the consumer heartbeat times, 1016h.
pub const CONSUMER_HEARTBEAT: Address = Address::new(0x1016, 1);
/// 1017h
pub const PRODUCER_HEARTBEAT: Address = Address::new(0x1017, 0);

const INVALID: u32 = 1 << 31;
const NO_RTR: u32 = 1 << 30;
/// Sub-indices of a communication parameter.
const COB_ID: u8 = 1;
const TRANSMISSION: u8 = 2;
const INHIBIT_TIME: u8 = 3;
/// Lowest bit of the node-ID in 1016h.
const CONSUMER_NODE: u32 = 16;

/// Everything that is written to `node`, in order.
pub fn plan(master: &Master, node: &Node) -> Vec<Write> {
    let mut writes = Vec::new();
    for (direction, used) in [
        (Direction::Receive, &node.rpdos),
        (Direction::Transmit, &node.tpdos),
    ] {
        for number in 1..=PDOS_PER_NODE {
            let used = used.iter().find(|pdo| pdo.number == number);
            pdo(node.id, direction, number, used, &mut writes);
        }
    }
    writes.extend(&node.start_values);
    let consumer = u32::from(master.node_id) << CONSUMER_NODE | u32::from(node.master_timeout_ms);
    writes.push(Write::new(CONSUMER_HEARTBEAT, consumer.into(), 4));
    writes.push(Write::new(PRODUCER_HEARTBEAT, node.heartbeat_ms.into(), 2));
    writes
}

fn pdo(node: u8, direction: Direction, number: u8, used: Option<&Pdo>, writes: &mut Vec<Write>) {
    let offset = u16::from(number) - 1;
    let parameter = |sub| Address::new(direction.communication() + offset, sub);
    let mapped = |sub| Address::new(direction.mapping() + offset, sub);
    let id = u32::from(direction.function_code(number)) + u32::from(node);
    let id = match direction {
        Direction::Receive => id,
        Direction::Transmit => id | NO_RTR,
    };
    writes.push(Write::new(parameter(COB_ID), (id | INVALID).into(), 4));
    let Some(pdo) = used else {
        return;
    };
    writes.push(Write::new(mapped(0), 0, 1));
    for (sub, entry) in (1..).zip(&pdo.mapping) {
        writes.push(Write::new(mapped(sub), entry.word().into(), 4));
    }
    writes.push(Write::new(mapped(0), pdo.mapping.len() as i128, 1));
    writes.push(Write::new(
        parameter(TRANSMISSION),
        pdo.transmission.into(),
        1,
    ));
    if direction == Direction::Transmit {
        writes.push(Write::new(parameter(INHIBIT_TIME), 0, 2));
    }
    writes.push(Write::new(parameter(COB_ID), id.into(), 4));
}

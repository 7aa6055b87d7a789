//! Node-IDs, names, serial numbers and COB-IDs.

use std::collections::BTreeMap;

use toml::Spanned;

use crate::description::{Description, StartValue};
use crate::model::{Node, Write};
use crate::resolve::Context;

/// Identifiers that PDOs and the like may not have (CiA 301, 7.3.5, table 40).
const RESTRICTED: [(u32, u32); 6] = [
    (0x000, 0x07F),
    (0x101, 0x180),
    (0x581, 0x5FF),
    (0x601, 0x67F),
    (0x6E0, 0x6FF),
    (0x701, 0x7FF),
];
const INVALID: u32 = 1 << 31;
const EXTENDED: u32 = 1 << 29;
const PRODUCES: u32 = 1 << 30;
const ID_MASK: u32 = 0x7FF;
const COB_ID_SYNC: u16 = 0x1005;
const SYNC: u32 = 0x080;
/// Where COB-IDs stand: object by object, and their sub-indices.
const COB_IDS: [(u16, u16, &[u8]); 6] = [
    (0x1012, 0x1012, &[0]),
    (0x1014, 0x1014, &[0]),
    (0x1200, 0x12FF, &[1, 2]),
    (0x1400, 0x15FF, &[1]),
    (0x1800, 0x19FF, &[1]),
    (0x1FA0, 0x1FCF, &[1]),
];
/// Identifier without node-ID, and what it is (CiA 301, 7.3.5).
const PER_NODE: [(u32, &str); 4] = [
    (0x080, "EMCY"),
    (0x580, "SDO response"),
    (0x600, "SDO request"),
    (0x700, "heartbeat"),
];

pub(crate) fn identifiers(description: &Description, nodes: &[Node], context: &mut Context<'_>) {
    let described = || description.node.iter().map(|node| node.get_ref());
    let master = &description.master.get_ref().node_id;
    let mut ids: BTreeMap<i64, String> = BTreeMap::new();
    ids.insert(*master.get_ref(), "the master".to_string());
    for node in described() {
        let name = node.name.get_ref();
        let id = *node.id.get_ref();
        if let Some(other) = ids.get(&id) {
            let place = context.at(&node.id);
            let free = (1..=crate::resolve::NODE_MAX).find(|id| {
                !ids.contains_key(id) && !described().any(|node| node.id.get_ref() == id)
            });
            context.problems.error(
                &place,
                id,
                format!("{other} has this node-ID already"),
                match free {
                    Some(free) => format!("node-ID {free} is free"),
                    None => "there are only 127 node-IDs".to_string(),
                },
            );
        } else {
            ids.insert(id, format!("\"{name}\""));
        }
    }
    unique(described().map(|node| &node.name), "name", context);
    unique(
        described().filter_map(|node| node.serial.as_ref()),
        "serial number",
        context,
    );
    cob_ids(description, nodes, context);
}

fn unique<'a, T: PartialEq + std::fmt::Display + 'a>(
    values: impl Iterator<Item = &'a Spanned<T>>,
    what: &str,
    context: &mut Context<'_>,
) {
    let mut seen: Vec<&T> = Vec::new();
    for value in values {
        if seen.contains(&value.get_ref()) {
            let place = context.at(value);
            context.problems.error(
                &place,
                value.get_ref(),
                format!("another node has this {what} already"),
                format!("every node needs a {what} of its own"),
            );
        }
        seen.push(value.get_ref());
    }
}

/// COB-IDs that start values give, against all others.
fn cob_ids(description: &Description, nodes: &[Node], context: &mut Context<'_>) {
    let mut used: BTreeMap<u32, String> = BTreeMap::new();
    let mut add = |id: u32, who: String| {
        used.entry(id).or_insert(who);
    };
    add(SYNC, "SYNC".to_string());
    add(0x100, "TIME".to_string());
    let master = u32::try_from(*description.master.get_ref().node_id.get_ref());
    for (base, what) in PER_NODE {
        if let Ok(master) = master {
            add(base + master, format!("{what} of the master"));
        }
        for node in nodes {
            add(
                base + u32::from(node.id),
                format!("{what} of \"{}\"", node.name),
            );
        }
    }
    for node in nodes {
        for pdo in node.rpdos.iter().chain(&node.tpdos) {
            let who = format!(
                "{}{} of \"{}\"",
                pdo.direction.word(),
                pdo.number,
                node.name
            );
            add(u32::from(pdo.cob_id(node.id)), who);
        }
    }
    for (described, node) in description.node.iter().filter_map(|d| {
        Some((
            d.get_ref(),
            nodes
                .iter()
                .find(|n| n.name == *d.get_ref().name.get_ref())?,
        ))
    }) {
        let device = super::device(description, described).map(|device| &device.start_values);
        for write in &node.start_values {
            let listed = device
                .into_iter()
                .chain([&described.start_values])
                .flatten();
            cob_id(node, write, listed, &mut used, context);
        }
    }
}

fn cob_id<'a>(
    node: &Node,
    write: &Write,
    listed: impl Iterator<Item = &'a StartValue>,
    used: &mut BTreeMap<u32, String>,
    context: &mut Context<'_>,
) {
    let value = write.value;
    let shown = format!("0x{value:X}");
    // The start value that gave it; of a node's and its device's the last.
    let start = listed
        .filter(|start| *start.value.get_ref() == i64::from(value))
        .last();
    let Some(place) = start.map(|start| context.at(&start.value)) else {
        return;
    };
    let id = value & ID_MASK;
    if write.at.index == COB_ID_SYNC {
        if value & PRODUCES != 0 || id != SYNC {
            context.problems.error(
                &place,
                shown,
                format!(
                    "{}: the master is the SYNC producer, with COB-ID 080h",
                    write.at
                ),
                "leave it out",
            );
        }
        return;
    }
    let holds = COB_IDS.iter().any(|(first, last, subs)| {
        (*first..=*last).contains(&write.at.index) && subs.contains(&write.at.sub)
    });
    if !holds || value & INVALID != 0 {
        return;
    }
    if value & EXTENDED != 0 {
        context.problems.error(
            &place,
            shown,
            format!("{} has a 29-bit identifier (bit 29)", write.at),
            "use an 11-bit identifier: the master receives no other",
        );
        return;
    }
    let restricted = RESTRICTED
        .iter()
        .find(|(first, last)| (*first..=*last).contains(&id));
    if let Some((first, last)) = restricted {
        context.problems.error(
            &place,
            shown,
            format!("{first:03X}h ..= {last:03X}h are restricted (CiA 301, 7.3.5, table 40)"),
            "choose another identifier",
        );
        return;
    }
    let who = format!("{} of \"{}\"", write.at, node.name);
    match used.get(&id) {
        Some(other) if *other != who => context.problems.error(
            &place,
            shown,
            format!("{other} has the COB-ID {id:03X}h already"),
            "choose another identifier; two senders of one make error frames",
        ),
        _ => {
            used.insert(id, who);
        }
    }
}

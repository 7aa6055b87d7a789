//! From what is written to what it means.

mod axis;
mod bus;
mod context;
mod device;
mod find;
mod pdo;
mod value;

pub(crate) use bus::{CYCLE_MAX_US, CYCLE_MIN_US, SDO_EVERY_MAX, least_compute_us};
pub(crate) use context::Context;

use std::collections::BTreeMap;
use std::io;

use crate::check;
use crate::description::{self, Description};
use crate::eds::Eds;
use crate::model::{Liveness, Machine, Master, Node};
use crate::object::Direction;
use crate::problem::{Place, Problems, nearest};
use crate::program::{self, Group, Program};
use crate::source::Source;

/// Opens a file that the description names.
pub(crate) type Open<'a> = dyn FnMut(&str) -> io::Result<Source> + 'a;

/// The EDS files by the name of the device that they belong to.
type Files = BTreeMap<String, Eds>;

/// Longest time that a 16-bit object holds, ms.
pub(crate) const MS_16: i64 = u16::MAX as i64;
/// Longest time of the boot-up, ms: a day.
const DAY_MS: i64 = 24 * 3600 * 1000;
/// Highest node-ID.
pub(crate) const NODE_MAX: i64 = 127;

pub(crate) fn machine(
    description: &Description,
    source: &Source,
    open: &mut Open<'_>,
    for_firmware: bool,
    problems: &mut Problems,
) -> Option<Machine> {
    let mut context = Context { source, problems };
    let files = device::files(description, open, &mut context);
    let master = master(&description.master, &mut context);
    let mut buses = Vec::new();
    for (name, bus) in &description.bus {
        buses.push(bus::bus(
            name,
            bus.get_ref(),
            description.node.len(),
            &mut context,
        ));
    }
    let missing_tpdos = match &description.liveness.missing_tpdos {
        Some(count) => context.number(count, "missing_tpdos", 1..=u8::MAX.into())?,
        None => DEFAULT_MISSING_TPDOS,
    };
    let by = description.liveness.by.as_ref();
    let liveness = context.word(by, "by", &LIVENESS)?;
    if description.node.is_empty() {
        context.problems.error(
            &Place::file(source),
            "node",
            "there is no node",
            "add a [[node]] for each device on the bus",
        );
    }
    let mut nodes = Vec::new();
    for node in &description.node {
        let cycle_us = |bus: usize| buses.get(bus).and_then(Option::as_ref).map(|b| b.cycle_us);
        let resolved = resolve_node(
            description,
            node.get_ref(),
            &files,
            open,
            &cycle_us,
            &mut context,
        );
        nodes.extend(resolved);
    }
    check::identifiers(description, &nodes, &mut context);
    let master = master?;
    let buses: Option<Vec<_>> = buses.into_iter().collect();
    let buses = buses?;
    if nodes.len() != description.node.len() || context.problems.has_errors() {
        return None;
    }
    check::peripherals(description, &buses, &mut context);
    check::liveness(description, liveness, &nodes, &mut context);
    check::bit_rates(description, &files, &buses, &nodes, &mut context);
    check::configuration(description, &files, &master, &nodes, &mut context);
    let buses = check::capacity(description, buses, &master, &nodes, &mut context);
    check::error_control(description, &master, &buses, &nodes, &mut context);
    check::budget(description, &buses, &nodes, &mut context);
    if for_firmware && !context.problems.has_errors() {
        check::firmware(description, &nodes, &mut context);
    }
    let mut machine = Machine {
        master,
        buses,
        liveness,
        missing_tpdos,
        nodes,
        program: None,
    };
    machine.program = program(description, &machine, open, &mut context);
    Some(machine)
}

/// What one release runs: what the description names, or S1's experiment.
fn program(
    description: &Description,
    machine: &Machine,
    open: &mut Open<'_>,
    context: &mut Context<'_>,
) -> Option<Program> {
    let group = Group::of(machine)?;
    let Some(named) = &description.group.program else {
        return Some(program::pairs(&group));
    };
    match open(named.get_ref()) {
        Ok(source) => program::resolve(&source, &group, context.problems),
        Err(error) => {
            let place = context.at(named);
            context.problems.error(
                &place,
                named.get_ref(),
                format!("the motion program cannot be read: {error}"),
                "give its path from the folder of this file; without the key it is S1's experiment",
            );
            None
        }
    }
}

/// One may fall to a bus error and one to its retransmission.
const DEFAULT_MISSING_TPDOS: u8 = 3;

const LIVENESS: [(&str, Liveness); 2] =
    [("TPDO", Liveness::Tpdo), ("heartbeat", Liveness::Heartbeat)];

fn master(
    master: &toml::Spanned<description::Master>,
    context: &mut Context<'_>,
) -> Option<Master> {
    let m = master.get_ref();
    // All of them are read before one of them ends it.
    let node_id = context.number(&m.node_id, "node_id", 1..=NODE_MAX);
    let heartbeat_ms = context.number(&m.heartbeat_ms, "heartbeat_ms", 1..=MS_16);
    let silence_ms = context.number(&m.silence_ms, "silence_ms", 0..=DAY_MS);
    let boot_time_ms = context.number(&m.boot_time_ms, "boot_time_ms", 0..=DAY_MS);
    let sdo_tries = context.number(&m.sdo_tries, "sdo_tries", 1..=u8::MAX.into());
    let syncs = context.number(
        &m.syncs_before_start,
        "syncs_before_start",
        0..=u8::MAX.into(),
    );
    Some(Master {
        node_id: node_id?,
        heartbeat_ms: heartbeat_ms?,
        silence_ms: silence_ms?,
        boot_time_ms: boot_time_ms?,
        sdo_tries: sdo_tries?,
        syncs_before_start: syncs?,
    })
}

fn resolve_node(
    description: &Description,
    node: &description::Node,
    files: &Files,
    open: &mut Open<'_>,
    cycle_us: &dyn Fn(usize) -> Option<u32>,
    context: &mut Context<'_>,
) -> Option<Node> {
    let id: Option<u8> = context.number(&node.id, "id", 1..=NODE_MAX);
    if node.name.get_ref().trim().is_empty() {
        let place = context.at(&node.name);
        context.problems.error(
            &place,
            "\"\"",
            "a node without a name cannot be told from others in a message",
            "name the node, for example \"axis 1\"",
        );
    }
    let serial = node
        .serial
        .as_ref()
        .and_then(|serial| context.number::<u32>(serial, "serial", 1..=u32::MAX.into()));
    let bus = bus::of_node(description, node, context);
    let Some((name, device)) = description
        .device
        .iter()
        .find(|(name, _)| name.get_ref() == node.device.get_ref())
    else {
        let known = || {
            description
                .device
                .keys()
                .map(|name| name.get_ref().as_str())
        };
        let help = match nearest(node.device.get_ref(), known()) {
            Some(name) => format!("did you mean \"{name}\"?"),
            None => format!(
                "add [device.{}], or use one of those there are",
                node.device.get_ref()
            ),
        };
        let place = context.at(&node.device);
        context.problems.error(
            &place,
            node.device.get_ref(),
            "there is no device of this name",
            help,
        );
        return None;
    };
    let device = device.get_ref();
    let (id, bus, eds) = (id?, bus?, files.get(name.get_ref())?);
    let mut pdos = |direction, described| pdo::pdos(eds, direction, described, context);
    let rpdos = pdos(Direction::Receive, &device.rpdo);
    let tpdos = pdos(Direction::Transmit, &device.tpdo);
    let limits = device::times(device, context);
    let configured = device::configured(device, eds, context);
    let mut identity = device::identity(device, eds, context);
    identity.serial = serial;
    let dcf = device::dcf(node, eds, open, context);
    let axis = axis::merged(&device.axis, &node.axis);
    let axis = axis::resolve(
        &axis,
        &[&device.start_values, &node.start_values],
        &dcf,
        eds,
        id,
        cycle_us(bus)?,
        context,
    );
    let (limits, axis) = (limits?, axis?);
    Some(Node {
        id,
        name: node.name.get_ref().clone(),
        bus,
        mandatory: node.mandatory.unwrap_or(true),
        identity,
        heartbeat_ms: limits.heartbeat_ms,
        heartbeat_in_operational: device
            .heartbeat_in_operational
            .as_ref()
            .is_none_or(|on| *on.get_ref()),
        master_timeout_ms: limits.master_timeout_ms,
        sdo_timeout_ms: limits.sdo_timeout_ms,
        configured: configured?,
        tpdo_earliest_us: limits.tpdo_earliest_us,
        tpdo_latency_us: limits.tpdo_latency_us,
        sdo_latency_us: limits.sdo_latency_us,
        rpdos,
        tpdos,
        increments_per_turn: axis.increments_per_turn,
        gear: axis.gear,
        supported_modes: axis.supported_modes,
        units_per_turn: axis.units_per_turn,
        start_values: axis.writes,
    })
}

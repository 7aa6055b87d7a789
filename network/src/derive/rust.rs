//! The constants of the firmware, as Rust.

use std::fmt::Write;

use crate::model::{Identity, Machine, Node, Pdo};
use crate::object::Address;

/// The description of the first bus as constants of the library that `library`
/// names: `crate` within it, `canmaster` outside.
///
/// Everything is `const` or `static` without interior mutability, so that it
/// lies in flash.
pub fn rust(machine: &Machine, library: &str) -> String {
    let mut out = String::new();
    // Writing into a string cannot fail.
    let _ = write(machine, library, &mut out);
    out
}

fn write(machine: &Machine, library: &str, out: &mut String) -> std::fmt::Result {
    let Some(bus) = machine.buses.first() else {
        return Ok(());
    };
    let master = &machine.master;
    writeln!(out, "// Made from network.toml; changes here are lost.\n")?;
    writeln!(out, "use {library}::id::NodeId;")?;
    writeln!(out, "use {library}::motion::experiment::Motor;")?;
    writeln!(
        out,
        "use {library}::network::{{Identity, Kind, Master, Network, Node}};"
    )?;
    writeln!(out, "use {library}::time::Duration;\n")?;
    writeln!(out, "/// Axes of the group.")?;
    writeln!(out, "pub const AXES: usize = {};", machine.nodes.len())?;
    writeln!(
        out,
        "/// When the PDO producer goes ahead without the TPDOs that are missing, us."
    )?;
    writeln!(
        out,
        "pub const TPDO_DEADLINE_US: u16 = {};",
        bus.tpdo_deadline_us
    )?;
    writeln!(
        out,
        "/// Cycles in a row without a TPDO after which its node counts as lost."
    )?;
    writeln!(
        out,
        "pub const TPDO_MISSING_LIMIT: u8 = {};",
        machine.missing_limit()
    )?;
    writeln!(
        out,
        "/// The SYNC periods (1006h) that pass the check of the description, us."
    )?;
    let (shortest, longest) = machine.cycles().into_inner();
    writeln!(out, "pub const SHORTEST_CYCLE_US: u32 = {shortest};")?;
    writeln!(out, "pub const LONGEST_CYCLE_US: u32 = {longest};")?;
    writeln!(
        out,
        "/// From the last TPDO of a cycle to its first RPDO, us."
    )?;
    let layouts = || machine.buses.iter().map(|bus| &bus.layout);
    let compute = layouts().map(|layout| layout.demand.compute_us);
    let compute = compute.max().unwrap_or(0);
    writeln!(out, "pub const COMPUTE_US: u16 = {compute};")?;
    writeln!(
        out,
        "/// From the first RPDO of a cycle to the end of the last and the guard, us."
    )?;
    let rpdos = layouts().map(|layout| layout.after_tpdos_us() - layout.demand.compute_us);
    let rpdos = rpdos.max().unwrap_or(0);
    writeln!(out, "pub const RPDOS_US: u16 = {rpdos};")?;
    writeln!(
        out,
        "/// Whether all nodes have the same PDOs, mapped alike."
    )?;
    let pdos = || machine.nodes.iter().map(|node| (&node.rpdos, &node.tpdos));
    let alike = pdos().zip(pdos().skip(1)).all(|(one, next)| one == next);
    writeln!(out, "pub const PDOS_ALIKE: bool = {alike};")?;
    super::cycle::cycle(machine, out)?;
    out.push('\n');
    motors(machine, out)?;
    program(machine, out)?;
    let kinds = kinds(machine, library)?;
    let count = kinds.len();
    writeln!(out, "/// What nodes have in common.")?;
    writeln!(
        out,
        "static KINDS: [Kind; {count}] = [\n{}];\n",
        kinds.concat()
    )?;
    writeln!(out, "/// The bus \"{}\".", bus.name.escape_default())?;
    writeln!(out, "pub static NETWORK: Network = Network {{")?;
    writeln!(out, "    bit_rate: {},", bus.bit_rate)?;
    writeln!(out, "    cycle: Duration::from_micros({}),", bus.cycle_us)?;
    writeln!(out, "    master: Master {{")?;
    writeln!(
        out,
        "        node: NodeId::constant::<{}>(),",
        master.node_id
    )?;
    for (name, ms) in [
        ("heartbeat", u32::from(master.heartbeat_ms)),
        ("silence", master.silence_ms),
        ("boot_time", master.boot_time_ms),
    ] {
        writeln!(out, "        {name}: Duration::from_millis({ms}),")?;
    }
    writeln!(out, "        sdo_tries: {},", master.sdo_tries)?;
    writeln!(
        out,
        "        syncs_before_start: {},",
        master.syncs_before_start
    )?;
    writeln!(out, "    }},\n    nodes: &[")?;
    for described in &machine.nodes {
        node(described, &kinds, library, out)?;
    }
    writeln!(out, "    ],\n}};")
}

fn motors(machine: &Machine, out: &mut String) -> std::fmt::Result {
    writeln!(out, "/// The motors, in the order of the axes.")?;
    writeln!(out, "pub const MOTORS: [Motor; AXES] = [")?;
    for motor in machine.nodes.iter().filter_map(Node::motor) {
        let (motor_turns, load_turns) = motor.gear;
        writeln!(out, "    Motor {{")?;
        writeln!(
            out,
            "        increments_per_turn: {},",
            motor.increments_per_turn
        )?;
        writeln!(out, "        gear: ({motor_turns}, {load_turns}),")?;
        writeln!(out, "        max_speed: {},", motor.max_speed)?;
        writeln!(out, "        max_acceleration: {},", motor.max_acceleration)?;
        writeln!(out, "        limits: {:?},", motor.limits)?;
        writeln!(out, "        modes: 0x{:X},\n    }},", motor.modes)?;
    }
    writeln!(out, "];\n")
}

fn program(machine: &Machine, out: &mut String) -> std::fmt::Result {
    const LINE: usize = 12;
    let Some(program) = &machine.program else {
        return Ok(());
    };
    let bytes = program.bytes();
    writeln!(
        out,
        "/// What one release runs: \"{}\".",
        program.name.escape_default()
    )?;
    writeln!(out, "pub static PROGRAM: [u8; {}] = [", bytes.len())?;
    for line in bytes.chunks(LINE) {
        let line: Vec<String> = line.iter().map(|byte| format!("0x{byte:02X},")).collect();
        writeln!(out, "    {}", line.join(" "))?;
    }
    writeln!(out, "];\n")
}

/// What nodes of one kind have in common is there once, so that it lies in flash once:
/// the text of each kind, in the order of the first node that has it.
fn kinds(machine: &Machine, library: &str) -> Result<Vec<String>, std::fmt::Error> {
    let mut kinds = Vec::new();
    for node in &machine.nodes {
        let text = kind(node, library)?;
        if !kinds.contains(&text) {
            kinds.push(text);
        }
    }
    Ok(kinds)
}

fn node(node: &Node, kinds: &[String], library: &str, out: &mut String) -> std::fmt::Result {
    let text = kind(node, library)?;
    let kind = kinds.iter().position(|kind| *kind == text).unwrap_or(0);
    writeln!(out, "        Node {{")?;
    writeln!(out, "            id: NodeId::constant::<{}>(),", node.id)?;
    writeln!(out, "            mandatory: {},", node.mandatory)?;
    writeln!(out, "            name: \"{}\",", node.name.escape_default())?;
    match node.identity.serial {
        Some(serial) => writeln!(out, "            serial: Some(0x{serial:08X}),")?,
        None => writeln!(out, "            serial: None,")?,
    }
    writeln!(out, "            kind: &KINDS[{kind}],\n        }},")
}

fn kind(node: &Node, library: &str) -> Result<String, std::fmt::Error> {
    let mut text = String::new();
    let out = &mut text;
    writeln!(out, "    Kind {{")?;
    let Identity {
        device_type,
        vendor,
        product,
        revision,
        ..
    } = node.identity;
    writeln!(out, "        identity: Identity {{")?;
    for (name, value) in [
        ("device_type", device_type),
        ("vendor", vendor),
        ("product", product),
        ("revision", revision),
    ] {
        match value {
            Some(value) => writeln!(out, "            {name}: Some(0x{value:08X}),")?,
            None => writeln!(out, "            {name}: None,")?,
        }
    }
    writeln!(out, "        }},")?;
    writeln!(out, "        heartbeat_ms: {},", node.heartbeat_ms)?;
    writeln!(out, "        consumer_ms: {},", node.master_timeout_ms)?;
    pdos("rpdos", &node.rpdos, library, out)?;
    pdos("tpdos", &node.tpdos, library, out)?;
    writeln!(out, "        start_values: &[")?;
    for write in &node.start_values {
        writeln!(
            out,
            "            {library}::network::ConfigWrite::u{}({}, 0x{:X}),",
            u32::from(write.bytes) * u8::BITS,
            address(write.at, library),
            write.value
        )?;
    }
    writeln!(out, "        ],")?;
    let timeout = node.sdo_timeout_ms;
    writeln!(
        out,
        "        sdo_timeout: Duration::from_millis({timeout}),"
    )?;
    let [date, time] = node.configured;
    writeln!(out, "        configured: [{date}, {time}],\n    }},")?;
    Ok(text)
}

fn pdos(name: &str, pdos: &[Pdo], library: &str, out: &mut String) -> std::fmt::Result {
    writeln!(out, "        {name}: &[")?;
    for pdo in pdos {
        writeln!(out, "            {library}::network::Pdo {{")?;
        writeln!(out, "                number: {},", pdo.number)?;
        writeln!(
            out,
            "                transmission: {library}::pdo::Transmission::from_code({}),",
            pdo.transmission
        )?;
        writeln!(out, "                mapping: &[")?;
        for entry in &pdo.mapping {
            writeln!(
                out,
                "                    {library}::pdo::MappingEntry::new(0x{:04X}, {}, {}),",
                entry.at.index, entry.at.sub, entry.bits
            )?;
        }
        writeln!(out, "                ],\n                }},")?;
    }
    writeln!(out, "        ],")
}

fn address(at: Address, library: &str) -> String {
    format!(
        "{library}::id::Address::new(0x{:04X}, {})",
        at.index, at.sub
    )
}

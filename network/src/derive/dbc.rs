//! A DBC with every PDO, so that tools which decode CAN logs show the values.

use std::fmt::Write;

use crate::model::{Machine, Mapped, Node, Pdo};
use crate::object::{DataType, Direction};

const MASTER: &str = "master";
/// A receiver that is not named.
const ANYBODY: &str = "Vector__XXX";
/// SIG_VALTYPE_ of IEEE numbers.
const FLOAT: u8 = 1;
const DOUBLE: u8 = 2;

/// The DBC of one bus, by its place in the machine.
pub fn dbc(machine: &Machine, bus: usize) -> String {
    let nodes: Vec<&Node> = machine
        .nodes
        .iter()
        .filter(|node| node.bus == bus)
        .collect();
    let mut out = String::new();
    // Writing into a string cannot fail.
    let _ = write(machine, &nodes, &mut out);
    out
}

/// The board's own TPDOs: 1A00h to 1A03h.
const OWN_TPDOS: u8 = 4;
/// Axes whose actual positions are in one of them.
const AXES_OF_TPDO: usize = 2;
const POSITION_BITS: usize = 32;

/// State of the group and step of the program; actual positions of two axes each.
fn own(machine: &Machine, out: &mut String) -> std::fmt::Result {
    let positions: Vec<String> = machine
        .nodes
        .iter()
        .map(|node| format!("Actual_position_{}", node_name(node)))
        .collect();
    let state = vec![
        "Group_state : 0|8@1+".to_string(),
        "Program_step : 8|16@1+".to_string(),
    ];
    let of_axes = positions.chunks(AXES_OF_TPDO).map(|names| {
        let signal = |(n, name): (usize, &String)| {
            format!("{name} : {}|{POSITION_BITS}@1-", n * POSITION_BITS)
        };
        names.iter().enumerate().map(signal).collect()
    });
    let all = std::iter::once(state).chain(of_axes);
    for (number, signals) in (1..=OWN_TPDOS).zip(all) {
        let id = Direction::Transmit.function_code(number) + u16::from(machine.master.node_id);
        let bytes = match number {
            1 => 3,
            _ => signals.len() * POSITION_BITS / u8::BITS as usize,
        };
        writeln!(out, "BO_ {id} TPDO{number}_{MASTER}: {bytes} {MASTER}")?;
        for signal in signals {
            writeln!(out, " SG_ {signal} (1,0) [0|0] \"\" {ANYBODY}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

fn write(machine: &Machine, nodes: &[&Node], out: &mut String) -> std::fmt::Result {
    writeln!(out, "VERSION \"\"\n\nNS_ :\n\nBS_:\n")?;
    let names: Vec<String> = nodes.iter().map(|node| node_name(node)).collect();
    writeln!(out, "BU_: {MASTER} {}\n", names.join(" "))?;
    own(machine, out)?;
    let mut comments = String::new();
    let mut types = String::new();
    for (node, name) in nodes.iter().zip(&names) {
        for pdo in node.rpdos.iter().chain(&node.tpdos) {
            let id = pdo.cob_id(node.id);
            let word = pdo.direction.word();
            let (from, to) = match pdo.direction {
                Direction::Receive => (MASTER, name.as_str()),
                Direction::Transmit => (name.as_str(), MASTER),
            };
            writeln!(
                out,
                "BO_ {id} {word}{}_{name}: {} {from}",
                pdo.number,
                pdo.bytes()
            )?;
            for (signal, first, entry) in signals(pdo) {
                let sign = if entry.data_type.is_signed() {
                    '-'
                } else {
                    '+'
                };
                writeln!(
                    out,
                    " SG_ {signal} : {first}|{}@1{sign} (1,0) [0|0] \"\" {to}",
                    entry.bits
                )?;
                writeln!(
                    comments,
                    "CM_ SG_ {id} {signal} \"{} {}\";",
                    entry.at,
                    quoted(&entry.name)
                )?;
                match entry.data_type {
                    DataType::Real(32) => writeln!(types, "SIG_VALTYPE_ {id} {signal} : {FLOAT};")?,
                    DataType::Real(_) => writeln!(types, "SIG_VALTYPE_ {id} {signal} : {DOUBLE};")?,
                    _ => {}
                }
            }
            writeln!(out)?;
        }
    }
    for (node, name) in nodes.iter().zip(&names) {
        writeln!(
            out,
            "CM_ BU_ {name} \"node {}, {}\";",
            node.id,
            quoted(&node.name)
        )?;
    }
    write!(out, "{comments}{types}")
}

/// Name, first bit and object of each signal; names are unique in the PDO, and
/// bits that nobody uses have none.
fn signals(pdo: &Pdo) -> Vec<(String, u32, &Mapped)> {
    const FIRST_OBJECT: u16 = 0x1000;
    let mut first = 0;
    let mut found: Vec<(String, u32, &Mapped)> = Vec::new();
    for entry in &pdo.mapping {
        if entry.at.index >= FIRST_OBJECT {
            let mut name = identifier(&entry.name);
            if found.iter().any(|(other, ..)| *other == name) {
                name = format!("{name}_{:04X}_{:02X}_{first}", entry.at.index, entry.at.sub);
            }
            found.push((name, first, entry));
        }
        first += u32::from(entry.bits);
    }
    found
}

fn node_name(node: &Node) -> String {
    // With the node-ID it is unique whatever becomes of the name.
    let name = identifier(&node.name);
    let id = node.id.to_string();
    if name.ends_with(&id) {
        name
    } else {
        format!("{name}_{id}")
    }
}

/// What the format takes for a name.
fn identifier(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let name: String = name.chars().map(plain).collect();
    if name.starts_with(|c: char| c.is_ascii_alphabetic()) {
        name
    } else {
        format!("_{name}")
    }
}

fn quoted(text: &str) -> String {
    text.replace(['"', '\\', '\n'], "'")
}

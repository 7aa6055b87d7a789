//! The PDOs of a device.

use std::collections::BTreeMap;

use toml::Spanned;

use super::context::Context;
use super::find;
use crate::description;
use crate::eds::Eds;
use crate::model::{Mapped, Pdo, Send};
use crate::object::{Address, DataType, Direction};
use crate::plan::PDOS_PER_NODE;

/// Bits of a CAN frame.
const BITS_MAX: u32 = 64;
/// Every SYNC.
const EVERY_SYNC: u8 = 1;
/// Transmission types (CiA 301, tables 68 and 72).
const RESERVED: std::ops::RangeInclusive<u8> = 241..=251;
const RTR: std::ops::RangeInclusive<u8> = 252..=253;

type Described = BTreeMap<Spanned<String>, Spanned<description::Pdo>>;

/// All PDOs of a direction; what is wrong with one does not hide the next.
pub(super) fn pdos(
    eds: &Eds,
    direction: Direction,
    described: &Described,
    context: &mut Context<'_>,
) -> Vec<Pdo> {
    described
        .iter()
        .filter_map(|(number, described)| pdo(eds, direction, number, described.get_ref(), context))
        .collect()
}

fn pdo(
    eds: &Eds,
    direction: Direction,
    number: &Spanned<String>,
    described: &description::Pdo,
    context: &mut Context<'_>,
) -> Option<Pdo> {
    let word = direction.word();
    let place = context.at(number);
    let parsed = number.get_ref().parse::<u8>().ok();
    let Some(parsed) = parsed.filter(|n| (1..=PDOS_PER_NODE).contains(n)) else {
        context.problems.error(
            &place,
            number.get_ref(),
            format!("a node has {word} 1 ..= {PDOS_PER_NODE}"),
            format!("number it 1 ..= {PDOS_PER_NODE}"),
        );
        return None;
    };
    let index = direction.mapping() + u16::from(parsed) - 1;
    let communication = direction.communication() + u16::from(parsed) - 1;
    for needed in [communication, index] {
        if !eds.objects.contains_key(&needed) {
            context.problems.error(
                &place,
                number.get_ref(),
                format!(
                    "{} has no {word}{parsed}: {needed:04X}h is missing",
                    eds.file
                ),
                "use a PDO that the device has",
            );
            return None;
        }
    }
    if described.map.is_empty() {
        context.problems.error(
            &place,
            "map = []",
            format!("{word}{parsed} carries nothing"),
            "name the objects that it carries, or remove it: it is switched off then",
        );
    }
    let mapping = mapping(eds, direction, &described.map, context);
    let room = eds
        .objects
        .get(&index)
        .and_then(|object| object.entries.keys().max().copied());
    if let Some(room) = room
        && described.map.len() > usize::from(room)
    {
        context.problems.error(
            &place,
            described.map.len(),
            format!("{word}{parsed} of {} has room for {room}", eds.file),
            "move objects to another PDO",
        );
        return None;
    }
    let transmission = transmission(direction, described.transmission.as_ref(), context);
    let send = send(direction, described.send.as_ref(), context);
    Some(Pdo {
        direction,
        number: parsed,
        transmission: transmission?,
        send: send?,
        mapping: mapping?,
    })
}

fn transmission(
    direction: Direction,
    code: Option<&Spanned<i64>>,
    context: &mut Context<'_>,
) -> Option<u8> {
    let Some(spanned) = code else {
        return Some(EVERY_SYNC);
    };
    let code: u8 = context.number(spanned, "transmission", 0..=u8::MAX.into())?;
    let wrong = if RESERVED.contains(&code) {
        "transmission types 241 ..= 251 are reserved (CiA 301, 7.5.2.35)"
    } else if RTR.contains(&code) && direction == Direction::Receive {
        "an RPDO is never asked for by a remote frame (CiA 301, 7.5.2.35)"
    } else if RTR.contains(&code) {
        "the master asks for no TPDO by remote frames"
    } else {
        return Some(code);
    };
    let place = context.at(spanned);
    context
        .problems
        .error(&place, code, wrong, "1 for every SYNC, 255 for on change");
    None
}

fn send(
    direction: Direction,
    word: Option<&Spanned<String>>,
    context: &mut Context<'_>,
) -> Option<Send> {
    if let (Some(spanned), Direction::Transmit) = (word, direction) {
        let place = context.at(spanned);
        context.problems.error(
            &place,
            spanned.get_ref(),
            "the node decides when it sends a TPDO",
            "leave send out; transmission says when a TPDO comes",
        );
        return None;
    }
    let words = [
        ("every cycle", Send::EveryCycle),
        ("on change", Send::OnChange),
    ];
    context.word(word, "send", &words)
}

fn mapping(
    eds: &Eds,
    direction: Direction,
    names: &[Spanned<String>],
    context: &mut Context<'_>,
) -> Option<Vec<Mapped>> {
    let mut mapping = Vec::new();
    let mut complete = true;
    let mut total = 0;
    for name in names {
        let Some(mapped) = mapped(eds, direction, name, context) else {
            complete = false;
            continue;
        };
        total += u32::from(mapped.bits);
        if total > BITS_MAX {
            let place = context.at(name);
            context.problems.error(
                &place,
                name.get_ref(),
                format!("with this object the PDO has {total} bits, and a frame {BITS_MAX}"),
                "move it to another PDO",
            );
            return None;
        }
        mapping.push(mapped);
    }
    complete.then_some(mapping)
}

fn mapped(
    eds: &Eds,
    direction: Direction,
    name: &Spanned<String>,
    context: &mut Context<'_>,
) -> Option<Mapped> {
    let place = context.at(name);
    if let Some(dummy) = dummy(eds, direction, name.get_ref()) {
        return Some(dummy);
    }
    let asked = match find::find(eds, name.get_ref()) {
        Ok(asked) => asked,
        Err((rule, help)) => {
            context.problems.error(&place, name.get_ref(), rule, help);
            return None;
        }
    };
    let entry = eds.entry(asked.at)?;
    let mut wrong = |rule: String, help: &str| {
        context.problems.error(&place, name.get_ref(), rule, help);
        None
    };
    if !entry.mappable {
        return wrong(
            format!(
                "{} cannot be mapped (PDOMapping=0 in {}:{})",
                asked.at, eds.file, entry.line
            ),
            "access it by SDO, or map another object",
        );
    }
    if !entry.access.allows(direction) {
        let (this, other) = match direction {
            Direction::Receive => ("an RPDO", "a TPDO: it is what the node sends"),
            Direction::Transmit => ("a TPDO", "an RPDO: it is what the node receives"),
        };
        return wrong(
            format!(
                "{} is {} in {}:{} and cannot be in {this}",
                asked.at,
                entry.access.word(),
                eds.file,
                entry.line
            ),
            &format!("map it under {other}"),
        );
    }
    let Some(bits) = entry
        .data_type
        .bits()
        .filter(|bits| u32::from(*bits) <= BITS_MAX)
    else {
        return wrong(
            format!(
                "{} is a {} and has no fixed length",
                asked.at, entry.data_type
            ),
            "access it by SDO",
        );
    };
    if asked.bits.is_some_and(|asked| asked != bits) {
        return wrong(
            format!(
                "{} is {} in {}:{}: {bits} bits",
                asked.at, entry.data_type, eds.file, entry.line
            ),
            &format!("write /{bits}, or no length at all"),
        );
    }
    Some(Mapped {
        at: asked.at,
        name: eds.objects.get(&asked.at.index)?.full_name(asked.at.sub),
        data_type: entry.data_type,
        bits,
    })
}

/// `0005:00` and the like: bits of an RPDO that the node does not use
/// (CiA 301, 7.4.8.2).
fn dummy(eds: &Eds, direction: Direction, name: &str) -> Option<Mapped> {
    const HEX: u32 = 16;
    let index = name.trim().trim_start_matches("0x");
    let index = index.split(':').next().unwrap_or_default();
    let index = u16::from_str_radix(index, HEX).ok()?;
    if direction == Direction::Transmit || !eds.dummies.contains(&index) {
        return None;
    }
    let data_type = DataType::from_code(index);
    Some(Mapped {
        at: Address::new(index, 0),
        name: format!("unused {data_type}"),
        data_type,
        bits: data_type.bits()?,
    })
}

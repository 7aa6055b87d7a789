//! Objects by index or by name.

use crate::eds::{Eds, ObjectKind};
use crate::object::Address;
use crate::problem::nearest;

/// An object as it was asked for.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Asked {
    pub(super) at: Address,
    /// The length that was given with it: `6040:00/16`.
    pub(super) bits: Option<u8>,
}

/// Why it was not found, and what to do.
type NotFound = (String, String);

const HEX: u32 = 16;
const INDEX_DIGITS: usize = 4;

/// Finds what `text` means: `6040`, `0x6040`, `6040h:00`, a name, `Object.Entry`,
/// or the name of an entry if only one has it; each with `/` and a length in bits
/// if that is to be checked.
pub(super) fn find(eds: &Eds, text: &str) -> Result<Asked, NotFound> {
    let (name, bits) = match text.rsplit_once('/') {
        Some((name, bits)) if bits.trim().parse::<u8>().is_ok() => {
            (name.trim(), bits.trim().parse().ok())
        }
        _ => (text.trim(), None),
    };
    let at = match by_name(eds, name) {
        Found::One(at) => at,
        Found::Many(all) => {
            let all: Vec<String> = all.iter().map(Address::to_string).collect();
            return Err((
                format!("{} has this name at {}", eds.file, all.join(", ")),
                "write index and sub-index instead of the name".to_string(),
            ));
        }
        Found::None => match by_index(name) {
            Some((index, sub)) => at_index(eds, index, sub)?,
            None => return Err(no_such_name(eds, name)),
        },
    };
    Ok(Asked { at, bits })
}

enum Found {
    One(Address),
    Many(Vec<Address>),
    None,
}

fn by_name(eds: &Eds, name: &str) -> Found {
    let same = |other: &str| other.eq_ignore_ascii_case(name);
    let full: Vec<Address> = eds
        .entries()
        .filter(|(at, object, _)| same(&object.full_name(at.sub)))
        .map(|(at, ..)| at)
        .collect();
    let found = if full.is_empty() {
        eds.entries()
            .filter(|(_, object, entry)| object.kind != ObjectKind::Variable && same(&entry.name))
            .map(|(at, ..)| at)
            .collect()
    } else {
        full
    };
    match found[..] {
        [] => Found::None,
        [at] => Found::One(at),
        _ => Found::Many(found),
    }
}

/// Index and sub-index, if that is what the text is.
fn by_index(text: &str) -> Option<(u16, Option<u8>)> {
    let plain = |digits: &str| digits.bytes().all(|b| b.is_ascii_hexdigit());
    let bare = |digits: &'_ str| digits.trim().to_ascii_lowercase();
    let (index, sub) = match text.split_once(':') {
        Some((index, sub)) => (bare(index), Some(bare(sub))),
        None => (bare(text), None),
    };
    let index = index.trim_start_matches("0x").trim_end_matches('h');
    if index.len() != INDEX_DIGITS || !plain(index) {
        return None;
    }
    let index = u16::from_str_radix(index, HEX).ok()?;
    let sub = match sub {
        Some(sub) => {
            let sub = sub.trim_start_matches("0x").trim_end_matches('h');
            Some(u8::from_str_radix(sub, HEX).ok().filter(|_| plain(sub))?)
        }
        None => None,
    };
    Some((index, sub))
}

fn at_index(eds: &Eds, index: u16, sub: Option<u8>) -> Result<Address, NotFound> {
    let Some(object) = eds.objects.get(&index) else {
        let near = eds
            .objects
            .range(index..)
            .next()
            .or_else(|| eds.objects.range(..index).next_back());
        let help = match near {
            Some((near, object)) => format!("the nearest is {near:04X}h, {}", object.name),
            None => "give another EDS".to_string(),
        };
        return Err((format!("{} has no object {index:04X}h", eds.file), help));
    };
    let subs = || {
        let subs: Vec<String> = object
            .entries
            .keys()
            .map(|sub| format!("{sub:02X}"))
            .collect();
        subs.join(", ")
    };
    match sub {
        None if object.kind != ObjectKind::Variable => Err((
            format!("{index:04X}h, {}, has sub-indices", object.name),
            format!("write {index:04X}:xx with one of {}", subs()),
        )),
        _ => {
            let sub = sub.unwrap_or(0);
            if object.entries.contains_key(&sub) {
                return Ok(Address::new(index, sub));
            }
            Err((
                format!("{index:04X}h, {}, has no sub-index {sub:02X}", object.name),
                match subs() {
                    subs if subs.is_empty() => "its entries cannot be read".to_string(),
                    subs => format!("its sub-indices are {subs}"),
                },
            ))
        }
    }
}

fn no_such_name(eds: &Eds, name: &str) -> NotFound {
    if let Some((index, _)) = eds
        .objects
        .iter()
        .find(|(_, object)| object.name.eq_ignore_ascii_case(name))
        && let Err(found) = at_index(eds, *index, None)
    {
        return found;
    }
    let names: Vec<(String, Address)> = eds
        .entries()
        .map(|(at, object, _)| (object.full_name(at.sub), at))
        .collect();
    let near = nearest(name, names.iter().map(|(name, _)| name.as_str()));
    let help = match near.and_then(|near| names.iter().find(|(name, _)| name == near)) {
        Some((name, at)) => format!("did you mean \"{name}\", {at}?"),
        None => "write index and sub-index, for example \"6040:00\"".to_string(),
    };
    (format!("{} has no object of this name", eds.file), help)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::Source;

    const EDS: &str = "[6040]\nParameterName=Controlword\nDataType=6\nAccessType=rww\n\
        [60C2]\nParameterName=Interpolation\nObjectType=9\n\
        [60C2sub1]\nParameterName=Value\nDataType=5\nAccessType=rw\n\
        [607D]\nParameterName=Limit\nObjectType=8\n\
        [607Dsub1]\nParameterName=Min\nDataType=4\nAccessType=rw\n\
        [607Dsub2]\nParameterName=Value\nDataType=4\nAccessType=rw\n";

    fn at(text: &str) -> Option<Address> {
        let (eds, _) = Eds::read(&Source::new("x.eds", EDS.as_bytes()));
        find(&eds, text).ok().map(|asked| asked.at)
    }

    #[test]
    fn the_ways_to_name_an_object() {
        let controlword = Some(Address::new(0x6040, 0));
        for text in [
            "6040",
            "0x6040",
            "6040h",
            "6040:00",
            "6040:0",
            "0x6040:0x00",
            "controlWORD",
        ] {
            assert_eq!(at(text), controlword, "{text}");
        }
        let value = Some(Address::new(0x60C2, 1));
        for text in ["60c2:1", "60C2h:01", "Interpolation.Value", " 60C2 : 01 "] {
            assert_eq!(at(text), value, "{text}");
        }
        assert_eq!(at("Min"), Some(Address::new(0x607D, 1)));
        for text in [
            "",
            "604",
            "60400",
            "6040:",
            "6040:1",
            "60C2",
            "Interpolation",
            "Value",
            "+040",
            "6040:+0",
        ] {
            assert_eq!(at(text), None, "{text}");
        }
    }

    #[test]
    fn a_length_may_stand_behind() {
        let (eds, _) = Eds::read(&Source::new("x.eds", EDS.as_bytes()));
        assert_eq!(find(&eds, "6040:00/16").unwrap().bits, Some(16));
        assert_eq!(find(&eds, "Controlword / 16").unwrap().bits, Some(16));
        assert_eq!(find(&eds, "6040").unwrap().bits, None);
    }
}

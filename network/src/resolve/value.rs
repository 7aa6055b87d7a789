//! A value that is to be written to an object.

use super::context::Context;
use crate::eds::Eds;
use crate::model::Write;
use crate::object::Address;
use crate::problem::Place;

/// Lengths that the firmware writes, in bits.
const LENGTHS: [u8; 3] = [8, 16, 32];

/// The write of `value` at `at`, if the object takes it.
pub(super) fn write(
    eds: &Eds,
    node: u8,
    at: Address,
    value: i128,
    place: &Place,
    context: &mut Context<'_>,
) -> Option<Write> {
    let name = eds
        .objects
        .get(&at.index)
        .map_or_else(String::new, |object| object.full_name(at.sub));
    let Some(entry) = eds.entry(at) else {
        context.problems.error(
            place,
            value,
            format!("{} has no object {at} for this", eds.file),
            "remove it, or use a device that has the object",
        );
        return None;
    };
    let what = format!("{at}, {name}, in {}:{}", eds.file, entry.line);
    let mut wrong = |rule: String, help: String| {
        context.problems.error(place, value, rule, help);
        None
    };
    if !entry.access.is_writable() {
        return wrong(
            format!("{what} is {}", entry.access.word()),
            "it cannot be written: remove it".to_string(),
        );
    }
    let (Some((least, most)), Some(bits)) = (entry.data_type.range(), entry.data_type.bits())
    else {
        return wrong(
            format!("{what} is a {} and not a whole number", entry.data_type),
            "the configuration takes whole numbers of 8, 16 and 32 bits".to_string(),
        );
    };
    if !LENGTHS.contains(&bits.next_multiple_of(8)) {
        return wrong(
            format!("{what} is {}", entry.data_type),
            "the configuration takes whole numbers of 8, 16 and 32 bits".to_string(),
        );
    }
    if !(least..=most).contains(&value) {
        return wrong(
            format!("{what} is {}: {least} ..= {most}", entry.data_type),
            format!("the nearest that fits is {}", value.clamp(least, most)),
        );
    }
    let limit = |number: Option<crate::eds::Number>, default| {
        number.map_or(default, |number| number.of_type(entry.data_type, node))
    };
    let (low, high) = (limit(entry.low, least), limit(entry.high, most));
    // Limits the wrong way round are the file's mistake and limit nothing.
    if low <= high && !(low..=high).contains(&value) {
        return wrong(
            format!("{what} is limited to {low} ..= {high}"),
            format!("the nearest that is allowed is {}", value.clamp(low, high)),
        );
    }
    Some(Write::new(at, value, bits.div_ceil(u8::BITS as u8)))
}

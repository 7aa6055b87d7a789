//! Axis parameters and start values: what they write.

use toml::Spanned;

use super::context::Context;
use super::{find, value};
use crate::description::{Axis, StartValue};
use crate::eds::Eds;
use crate::model::Write;
use crate::object::{Address, Direction};
use crate::plan::{CONSUMER_HEARTBEAT, PDOS_PER_NODE, PRODUCER_HEARTBEAT};
use crate::problem::{Place, nearest};

/// Objects of CiA 402.
const MODES_OF_OPERATION: Address = Address::new(0x6060, 0);
const SUPPORTED_MODES: Address = Address::new(0x6502, 0);
const INTERPOLATION_TIME: Address = Address::new(0x60C2, 1);
const INTERPOLATION_EXPONENT: Address = Address::new(0x60C2, 2);
const MAX_PROFILE_VELOCITY: Address = Address::new(0x607F, 0);
const MAX_MOTOR_SPEED: Address = Address::new(0x6080, 0);
const MAX_ACCELERATION: Address = Address::new(0x60C5, 0);
const QUICK_STOP: Address = Address::new(0x6085, 0);
const MIN_POSITION: Address = Address::new(0x607D, 1);
const MAX_POSITION: Address = Address::new(0x607D, 2);
const HOMING_METHOD: Address = Address::new(0x6098, 0);
const HOMING_SPEED: Address = Address::new(0x6099, 1);
const HOMING_ZERO_SPEED: Address = Address::new(0x6099, 2);
const HOMING_ACCELERATION: Address = Address::new(0x609A, 0);

/// A mode of operation: its name, its code in 6060h, its bit in 6502h, and
/// whether the drive interpolates between SYNCs.
struct Mode {
    name: &'static str,
    code: i128,
    bit: u32,
    cyclic: bool,
}

const fn mode(name: &'static str, code: i128, bit: u32, cyclic: bool) -> Mode {
    Mode {
        name,
        code,
        bit,
        cyclic,
    }
}

const MODES: [Mode; 9] = [
    mode("profile position", 1, 0, false),
    mode("velocity", 2, 1, false),
    mode("profile velocity", 3, 2, false),
    mode("profile torque", 4, 3, false),
    mode("homing", 6, 5, false),
    mode("interpolated position", 7, 6, true),
    mode("cyclic synchronous position", 8, 7, true),
    mode("cyclic synchronous velocity", 9, 8, true),
    mode("cyclic synchronous torque", 10, 9, true),
];

/// Microseconds of a second as a power of ten.
const MICRO: i128 = 6;
/// 60C2h:02 unless told otherwise: milliseconds.
const MILLI: i128 = -3;
/// Increments that a turn may have: an encoder of 24 bits.
const INCREMENTS_MAX: i64 = 1 << 24;
/// Turns of either side of a gear.
const TURNS: std::ops::RangeInclusive<i64> = 1..=1_000_000;

/// What an axis is and what is written for it.
pub(super) struct Resolved {
    pub(super) increments_per_turn: Option<u32>,
    pub(super) gear: (u32, u32),
    pub(super) supported_modes: Option<u32>,
    pub(super) units_per_turn: Option<u32>,
    pub(super) writes: Vec<Write>,
}

/// The axis of a node: its own keys go before those of its device.
pub(super) fn merged(device: &Axis, node: &Axis) -> Axis {
    let or = |own: &Option<Spanned<i64>>, common: &Option<Spanned<i64>>| {
        own.clone().or_else(|| common.clone())
    };
    Axis {
        mode: node.mode.clone().or_else(|| device.mode.clone()),
        increments_per_turn: or(&node.increments_per_turn, &device.increments_per_turn),
        gear: node.gear.clone().or_else(|| device.gear.clone()),
        units_per_turn: or(&node.units_per_turn, &device.units_per_turn),
        max_speed: or(&node.max_speed, &device.max_speed),
        max_acceleration: or(&node.max_acceleration, &device.max_acceleration),
        quick_stop: or(&node.quick_stop, &device.quick_stop),
        min_position: or(&node.min_position, &device.min_position),
        max_position: or(&node.max_position, &device.max_position),
        homing_method: or(&node.homing_method, &device.homing_method),
        homing_speed: or(&node.homing_speed, &device.homing_speed),
        homing_zero_speed: or(&node.homing_zero_speed, &device.homing_zero_speed),
        homing_acceleration: or(&node.homing_acceleration, &device.homing_acceleration),
    }
}

/// `lists`: the start values of the device, then those of the node.
pub(super) fn resolve(
    axis: &Axis,
    lists: &[&Vec<StartValue>],
    dcf: &[(Address, i128, Place)],
    eds: &Eds,
    node: u8,
    cycle_us: u32,
    context: &mut Context<'_>,
) -> Option<Resolved> {
    let mut writer = Writer {
        eds,
        node,
        writes: Vec::new(),
        complete: true,
    };
    for (at, value, place) in dcf {
        writer.put(*at, *value, place, context);
    }
    let explicit = writer.explicit(lists, context);
    let mode = axis
        .mode
        .as_ref()
        .and_then(|name| writer.mode(name, context));
    writer.interpolation(axis.mode.as_ref(), mode, &explicit, cycle_us, context);
    for (key, at) in [
        (&axis.max_speed, MAX_PROFILE_VELOCITY),
        (&axis.max_speed, MAX_MOTOR_SPEED),
        (&axis.max_acceleration, MAX_ACCELERATION),
        (&axis.quick_stop, QUICK_STOP),
        (&axis.min_position, MIN_POSITION),
        (&axis.max_position, MAX_POSITION),
        (&axis.homing_method, HOMING_METHOD),
        (&axis.homing_speed, HOMING_SPEED),
        (&axis.homing_zero_speed, HOMING_ZERO_SPEED),
        (&axis.homing_acceleration, HOMING_ACCELERATION),
    ] {
        if let Some(value) = key {
            let place = context.at(value);
            writer.put(at, i128::from(*value.get_ref()), &place, context);
        }
    }
    for (at, value, place) in &explicit {
        if writer
            .writes
            .iter()
            .any(|write| write.at == *at && !dcf.iter().any(|(d, ..)| d == at))
        {
            context.problems.error(
                place,
                value,
                format!("{at} is written twice"),
                "remove one of the two; the keys of axis and heartbeat write objects, too",
            );
        }
        writer.put(*at, *value, place, context);
    }
    positions(axis, context);
    let increments = axis.increments_per_turn.as_ref();
    let increments_per_turn =
        context.optional(increments, "increments_per_turn", 1..=INCREMENTS_MAX);
    let units = axis.units_per_turn.as_ref();
    let units_per_turn = context.optional(units, "units_per_turn", TURNS);
    let gear = gear(axis.gear.as_ref(), context);
    writer.complete.then_some(Resolved {
        increments_per_turn,
        gear: gear?,
        supported_modes: supported_modes(eds, node).map(|bits| bits as u32),
        units_per_turn,
        writes: writer.writes,
    })
}

struct Writer<'a> {
    eds: &'a Eds,
    node: u8,
    writes: Vec<Write>,
    complete: bool,
}

impl Writer<'_> {
    fn put(&mut self, at: Address, value: i128, place: &Place, context: &mut Context<'_>) {
        match value::write(self.eds, self.node, at, value, place, context) {
            Some(write) => {
                // A later one goes before an earlier one of a DCF.
                self.writes.retain(|before| before.at != at);
                self.writes.push(write);
            }
            None => self.complete = false,
        }
    }

    /// The start values as they are written, those that nobody may write left
    /// out.
    fn explicit(
        &mut self,
        lists: &[&Vec<StartValue>],
        context: &mut Context<'_>,
    ) -> Vec<(Address, i128, Place)> {
        let mut found: Vec<(Address, i128, Place)> = Vec::new();
        for (own, start) in lists
            .iter()
            .enumerate()
            .flat_map(|(n, list)| list.iter().map(move |s| (n, s)))
        {
            let place = context.at(&start.object);
            let at = match find::find(self.eds, start.object.get_ref()) {
                Ok(asked) => asked.at,
                Err((rule, help)) => {
                    context
                        .problems
                        .error(&place, start.object.get_ref(), rule, help);
                    self.complete = false;
                    continue;
                }
            };
            if let Some((rule, help)) = reserved(at) {
                context
                    .problems
                    .error(&place, start.object.get_ref(), rule, help);
                self.complete = false;
                continue;
            }
            let value_place = context.at(&start.value);
            let value = i128::from(*start.value.get_ref());
            match found.iter().position(|(before, ..)| *before == at) {
                // A node's own value goes before its device's.
                Some(before) if own > 0 => found[before] = (at, value, value_place),
                Some(_) => context.problems.error(
                    &place,
                    start.object.get_ref(),
                    format!("{at} has a start value already"),
                    "remove one of the two",
                ),
                None => found.push((at, value, value_place)),
            }
        }
        found
    }

    fn mode(&mut self, name: &Spanned<String>, context: &mut Context<'_>) -> Option<&'static Mode> {
        let place = context.at(name);
        let wanted = name.get_ref();
        let Some(mode) = MODES
            .iter()
            .find(|mode| mode.name.eq_ignore_ascii_case(wanted))
        else {
            let names = || MODES.iter().map(|mode| mode.name);
            let help = match nearest(wanted, names()) {
                Some(name) => format!("did you mean \"{name}\"?"),
                None => format!("the modes are {}", names().collect::<Vec<_>>().join(", ")),
            };
            context.problems.error(
                &place,
                wanted,
                "CiA 402 has no such mode of operation",
                help,
            );
            self.complete = false;
            return None;
        };
        let supported = supported_modes(self.eds, self.node);
        if let Some(supported) = supported.filter(|bits| bits >> mode.bit & 1 == 0) {
            let has: Vec<&str> = MODES
                .iter()
                .filter(|mode| supported >> mode.bit & 1 == 1)
                .map(|mode| mode.name)
                .collect();
            context.problems.error(
                &place,
                wanted,
                format!(
                    "the drive lacks this mode: {SUPPORTED_MODES} is {supported:X}h in {}",
                    self.eds.file
                ),
                format!("it has {}", has.join(", ")),
            );
            self.complete = false;
            return None;
        }
        self.put(MODES_OF_OPERATION, mode.code, &place, context);
        Some(mode)
    }

    /// 60C2h: in cyclic modes it must be the SYNC period; in others it is set
    /// where it can be.
    fn interpolation(
        &mut self,
        name: Option<&Spanned<String>>,
        mode: Option<&Mode>,
        explicit: &[(Address, i128, Place)],
        cycle_us: u32,
        context: &mut Context<'_>,
    ) {
        let (Some(name), Some(mode)) = (name, mode) else {
            return;
        };
        let given = |at: Address| explicit.iter().find(|(other, ..)| *other == at);
        let in_eds = self
            .eds
            .entry(INTERPOLATION_EXPONENT)
            .and_then(|entry| entry.default);
        let exponent = match given(INTERPOLATION_EXPONENT) {
            Some((_, value, _)) => *value,
            None => in_eds.map_or(MILLI, |number| number.with_node_id(self.node)),
        };
        let exact = periods(cycle_us, exponent);
        let place = context.at(name);
        if let Some((_, value, place)) = given(INTERPOLATION_TIME) {
            if mode.cyclic && exact != Some(*value) {
                context.problems.error(
                    place,
                    value,
                    format!(
                        "in {} {INTERPOLATION_TIME} must be the cycle of {cycle_us} us, in units \
                         of 10^{exponent} s",
                        mode.name
                    ),
                    match exact {
                        Some(exact) => format!("write {exact}, or leave it out"),
                        None => "change the cycle to a multiple of this unit".to_string(),
                    },
                );
                self.complete = false;
            }
            return;
        }
        let Some(entry) = self.eds.entry(INTERPOLATION_TIME) else {
            return;
        };
        let most = entry
            .high
            .map(|high| high.of_type(entry.data_type, self.node));
        match exact.filter(|exact| most.is_none_or(|most| *exact <= most)) {
            Some(exact) => self.put(INTERPOLATION_TIME, exact, &place, context),
            None if mode.cyclic => {
                context.problems.error(
                    &place,
                    name.get_ref(),
                    format!(
                        "the drive interpolates in units of 10^{exponent} s ({INTERPOLATION_TIME}), \
                         and the cycle of {cycle_us} us cannot be written in these"
                    ),
                    "change cycle_us to a multiple of this unit that the drive takes",
                );
                self.complete = false;
            }
            None => {}
        }
    }
}

/// 6502h as the EDS has it.
fn supported_modes(eds: &Eds, node: u8) -> Option<i128> {
    let default = eds.entry(SUPPORTED_MODES)?.default;
    default.map(|number| number.with_node_id(node))
}

/// A cycle in units of 10^exponent seconds, if that is a whole number.
fn periods(cycle_us: u32, exponent: i128) -> Option<i128> {
    let power = u32::try_from(MICRO + exponent).ok()?;
    let unit_us = 10i128.checked_pow(power)?;
    let cycle = i128::from(cycle_us);
    (cycle % unit_us == 0).then(|| cycle / unit_us)
}

/// Entries that a key of the description writes, and which.
fn reserved(at: Address) -> Option<(String, &'static str)> {
    let described = 0..u16::from(PDOS_PER_NODE);
    for direction in [Direction::Receive, Direction::Transmit] {
        for base in [direction.communication(), direction.mapping()] {
            if at.index >= base && described.contains(&(at.index - base)) {
                return Some((
                    format!("{at} belongs to a PDO"),
                    "describe the PDO under rpdo or tpdo; those not described are switched off",
                ));
            }
        }
    }
    if at == CONSUMER_HEARTBEAT {
        return Some((
            format!("{at} follows from master_timeout_ms"),
            "set master_timeout_ms",
        ));
    }
    if at == PRODUCER_HEARTBEAT {
        return Some((
            format!("{at} follows from heartbeat_ms"),
            "set heartbeat_ms",
        ));
    }
    None
}

fn positions(axis: &Axis, context: &mut Context<'_>) {
    if let (Some(min), Some(max)) = (&axis.min_position, &axis.max_position)
        && min.get_ref() >= max.get_ref()
    {
        let place = context.at(max);
        context.problems.error(
            &place,
            max.get_ref(),
            format!("max_position must be above min_position, {}", min.get_ref()),
            "exchange the two, or leave both out for an axis without limits",
        );
    }
    let (only, key, other) = match (&axis.min_position, &axis.max_position) {
        (Some(only), None) => (only, "min_position", "max_position"),
        (None, Some(only)) => (only, "max_position", "min_position"),
        _ => return,
    };
    let place = context.at(only);
    context.problems.error(
        &place,
        only.get_ref(),
        format!("with {key} alone nobody knows how far the axis may go the other way"),
        format!("add {other}, or leave both out for an axis without limits"),
    );
}

fn gear(gear: Option<&Spanned<Vec<i64>>>, context: &mut Context<'_>) -> Option<(u32, u32)> {
    let Some(spanned) = gear else {
        return Some((1, 1));
    };
    if let [motor, load] = spanned.get_ref()[..]
        && TURNS.contains(&motor)
        && TURNS.contains(&load)
    {
        return Some((motor as u32, load as u32));
    }
    let place = context.at(spanned);
    context.problems.error(
        &place,
        format!("{:?}", spanned.get_ref()),
        format!(
            "a gear is two whole numbers of 1 ..= {}: turns of the motor for turns of the load",
            TURNS.end()
        ),
        "write [1, 1] for no gear, or for example [81, 7]",
    );
    None
}

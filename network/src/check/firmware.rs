//! What the firmware of this project can do: start in profile velocity mode, with the
//! target of each mode and the controlword in one RPDO, the ramps in another, and what
//! is reported in TPDO1 and TPDO2, all at every SYNC.

use toml::Spanned;

use super::device;
use crate::description::{Axis, Description, Node as Described};
use crate::model::{Node, Pdo, Send};
use crate::object::{Address, Direction};
use crate::resolve::Context;

/// A set of TPDOs is kept in 32 bits, two of each node.
const NODES_MAX: usize = 16;
/// TPDOs that it takes in of an axis.
const TPDOS_MAX: u8 = 2;
/// At every SYNC.
const EVERY_SYNC: u8 = 1;
const PROFILE_VELOCITY: u32 = 3;
/// It holds positions to within a few increments.
const INCREMENTS_MIN: u32 = 100;
/// 606Ch carries 1 rpm of noise, and below 6 rpm an axis counts as standing.
const SPEED_MIN: u32 = 60;
/// The final approach of an axis at 3 rpm needs that much.
const ACCELERATION_MIN: u32 = 100;
const MODES_OF_OPERATION: Address = Address::new(0x6060, 0);

/// The units of what it sends and is told, and what stands for them in the drive.
const UNITS: [(Address, u32, &str); 2] = [
    (Address::new(0x60A9, 0), 0x00B4_4700, "speeds in rpm"),
    (Address::new(0x60AA, 0), 0x00C0_0300, "ramps in rpm/s"),
];

/// An object, its bits, its name.
type Wanted = (Address, u8, &'static str);

const CONTROLWORD: Wanted = (Address::new(0x6040, 0), 16, "Controlword");
/// The RPDOs that it sends: each has these two objects, and no other. `true`: without
/// it no axis can be led.
const RPDOS: [(Wanted, Wanted, bool); 4] = [
    (
        CONTROLWORD,
        (Address::new(0x60FF, 0), 32, "Target velocity"),
        true,
    ),
    (
        (Address::new(0x6083, 0), 32, "Profile acceleration"),
        (Address::new(0x6084, 0), 32, "Profile deceleration"),
        true,
    ),
    (
        CONTROLWORD,
        (Address::new(0x607A, 0), 32, "Target position"),
        false,
    ),
    (
        CONTROLWORD,
        (Address::new(0x6071, 0), 16, "Target torque"),
        false,
    ),
];
/// What it has to be told.
const FEEDBACK: [Wanted; 2] = [
    (Address::new(0x6041, 0), 16, "Statusword"),
    (Address::new(0x6064, 0), 32, "Position actual value"),
];

pub(crate) fn firmware(description: &Description, nodes: &[Node], context: &mut Context<'_>) {
    if let Some(node) = description.node.get(NODES_MAX) {
        let place = context.at(node);
        context.problems.error(
            &place,
            description.node.len(),
            format!("the firmware leads at most {NODES_MAX} axes"),
            "remove nodes, or divide them between two boards",
        );
    }
    for (place, (node, described)) in nodes.iter().zip(&description.node).enumerate() {
        let described = described.get_ref();
        motor(description, node, described, context);
        let device = described.device.get_ref();
        let mut before = description.node.iter().take(place);
        if before.any(|other| other.get_ref().device.get_ref() == device) {
            // Told once for all of its kind.
            continue;
        }
        pdos(Direction::Receive, node, described, context);
        pdos(Direction::Transmit, node, described, context);
    }
}

fn motor(description: &Description, node: &Node, described: &Described, context: &mut Context<'_>) {
    if node.increments_per_turn.is_none() {
        let place = context.at(&described.device);
        context.problems.error(
            &place,
            described.device.get_ref(),
            format!(
                "nobody says how many increments a turn of \"{}\" has",
                node.name
            ),
            "add increments_per_turn to the axis of the device or of the node",
        );
    }
    numbers(description, node, described, context);
    units(description, node, described, context);
    let mut modes = node
        .start_values
        .iter()
        .filter(|w| w.at == MODES_OF_OPERATION);
    if modes
        .next_back()
        .is_none_or(|mode| mode.value != PROFILE_VELOCITY)
    {
        let of_device = device(description, described).and_then(|d| d.axis.mode.as_ref());
        let mode: Option<&Spanned<String>> = described.axis.mode.as_ref().or(of_device);
        let place = context.at(mode.unwrap_or(&described.device));
        context.problems.error(
            &place,
            mode.unwrap_or(&described.device).get_ref(),
            "the firmware leads its axes in profile velocity mode",
            "write mode = \"profile velocity\" in the axis",
        );
    }
}

/// A drive with another unit would turn at another speed than it is told.
fn units(description: &Description, node: &Node, described: &Described, context: &mut Context<'_>) {
    for (at, wanted, what) in UNITS {
        let mut writes = node.start_values.iter();
        let Some(write) = writes.rfind(|write| write.at == at && write.value != wanted) else {
            continue;
        };
        let of_device = device(description, described);
        let of_device = of_device.map_or(&[][..], |device| &device.start_values);
        let mut given = described.start_values.iter().chain(of_device);
        let place = given
            .find(|start| u32::try_from(*start.value.get_ref()) == Ok(write.value))
            .map_or_else(
                || context.at(&described.device),
                |start| context.at(&start.value),
            );
        context.problems.error(
            &place,
            format!("{:08X}h", write.value),
            format!(
                "the firmware has {what}: {at} of \"{}\" has to be {wanted:08X}h",
                node.name
            ),
            format!(
                "{}write 0x{wanted:08X}, or leave it out",
                of_ten(write.value, wanted)
            ),
        );
    }
}

/// Says it where a value differs from the unit that is wanted only in the prefix, bits 31..24
/// (CiA 402-2: a power of ten).
fn of_ten(value: u32, wanted: u32) -> String {
    const PREFIX_SHIFT: u32 = 24;
    if (value ^ wanted) << u8::BITS != 0 {
        return String::new();
    }
    let prefix = (value >> PREFIX_SHIFT) as u8 as i8;
    format!("its prefix stands for 10^{prefix}: ")
}

/// What is too little to be led by.
fn numbers(
    description: &Description,
    node: &Node,
    described: &Described,
    context: &mut Context<'_>,
) {
    let Some(motor) = node.motor() else {
        return;
    };
    let of_device = device(description, described).map(|device| &device.axis);
    let mut least =
        |key: fn(&Axis) -> &Option<Spanned<i64>>, value: u32, least: u32, rule: &str| {
            let own = key(&described.axis).as_ref();
            let common = of_device.and_then(|axis| key(axis).as_ref());
            if value < least {
                let place = match own.or(common) {
                    Some(number) => context.at(number),
                    None => context.at(&described.device),
                };
                let help = format!("write at least {least}");
                context.problems.error(&place, value, rule, help);
            }
        };
    least(
        |axis| &axis.increments_per_turn,
        motor.increments_per_turn,
        INCREMENTS_MIN,
        "the firmware holds a position to within a few increments, and a turn has no more",
    );
    least(
        |axis| &axis.max_speed,
        motor.max_speed,
        SPEED_MIN,
        "the firmware takes an axis below 6 rpm as standing, and needs more speed to move it",
    );
    least(
        |axis| &axis.max_acceleration,
        motor.max_acceleration,
        ACCELERATION_MIN,
        "the firmware needs a steeper ramp to hold a position",
    );
    let (lower, upper) = motor.limits;
    let room = upper.max(lower.saturating_neg());
    // A quarter turn is kept free on either side.
    let turns = motor.increments_per_turn + motor.increments_per_turn / 2;
    least(
        |axis| &axis.max_position,
        u32::try_from(room).unwrap_or(0),
        turns,
        "the axis has no room for a turn from home and a quarter turn to spare",
    );
}

fn pdos(direction: Direction, node: &Node, described: &Described, context: &mut Context<'_>) {
    let pdos: &[Pdo] = match direction {
        Direction::Receive => &node.rpdos,
        Direction::Transmit => &node.tpdos,
    };
    let word = direction.word();
    let mut problem = |value: String, rule: String, help: String| {
        let place = context.at(&described.device);
        context.problems.error(&place, value, rule, help);
    };
    for pdo in pdos {
        let name = format!("{word}{}", pdo.number);
        if direction == Direction::Transmit && pdo.number > TPDOS_MAX {
            problem(
                name,
                "the firmware takes in TPDO1 and TPDO2 of an axis".to_string(),
                "map its objects in TPDO1 or TPDO2".to_string(),
            );
            continue;
        }
        if pdo.transmission != EVERY_SYNC {
            problem(
                name.clone(),
                "the firmware exchanges its PDOs at every SYNC".to_string(),
                "leave transmission out, or write 1".to_string(),
            );
        }
        if pdo.send == Send::OnChange && pdo.answers_to_tpdos() {
            problem(
                name.clone(),
                "the firmware sends controlword and target in every cycle".to_string(),
                "leave send out, or move them to another RPDO".to_string(),
            );
        }
        for entry in &pdo.mapping {
            let is = |wanted: &Wanted| wanted.0 == entry.at;
            let known = RPDOS
                .iter()
                .any(|(first, second, _)| is(first) || is(second));
            if direction == Direction::Receive && !known {
                problem(
                    format!("{} \"{}\"", entry.at, entry.name),
                    format!("the firmware has nothing to write there, and it is in {name}"),
                    "remove it from the map; a start value may write it once".to_string(),
                );
            }
            if entry.bits % u8::BITS as u8 != 0 {
                problem(
                    format!("{} \"{}\"", entry.at, entry.name),
                    "the firmware reads and writes whole bytes".to_string(),
                    format!("remove it from {name}"),
                );
            }
        }
    }
    match direction {
        Direction::Receive => rpdos(pdos, node, &mut problem),
        Direction::Transmit => {
            for (at, bits, name) in FEEDBACK {
                let entries = pdos.iter().flat_map(|pdo| &pdo.mapping);
                let times = entries.filter(|e| e.at == at && e.bits == bits).count();
                if times != 1 {
                    problem(
                        format!("{at} \"{name}\""),
                        format!(
                            "the firmware needs it once in TPDO1 or TPDO2 of \"{}\"",
                            node.name
                        ),
                        "map it once in TPDO1 or TPDO2".to_string(),
                    );
                }
            }
        }
    }
}

/// Each RPDO is one of those that the firmware sends, and each of these is there once.
fn rpdos(pdos: &[Pdo], node: &Node, problem: &mut impl FnMut(String, String, String)) {
    let has = |pdo: &Pdo, (at, bits, _): &Wanted| {
        let mut entries = pdo.mapping.iter();
        entries.any(|entry| entry.at == *at && entry.bits == *bits)
    };
    let pairs = || {
        let pair = |(first, second, _): &(Wanted, Wanted, bool)| {
            format!("\"{}\" and \"{}\"", first.2, second.2)
        };
        let all: Vec<String> = RPDOS.iter().map(pair).collect();
        all.join("; ")
    };
    for pdo in pdos {
        let (objects, written) = (pdo.mapping.len(), pdo.answers_to_tpdos() || pdo.has_ramps());
        let whole = RPDOS
            .iter()
            .any(|(first, second, _)| objects == 2 && has(pdo, first) && has(pdo, second));
        if written && !whole {
            problem(
                format!("RPDO{}", pdo.number),
                "the firmware writes two objects in an RPDO, one of its pairs".to_string(),
                format!("map one of these pairs: {}", pairs()),
            );
        }
    }
    for (first, second, needed) in &RPDOS {
        let both = pdos
            .iter()
            .filter(|pdo| has(pdo, first) && has(pdo, second));
        let times = both.count();
        if times > 1 || (times == 0 && *needed) {
            problem(
                format!("{} \"{}\"", second.0, second.2),
                format!(
                    "the firmware needs it once in the RPDOs of \"{}\", beside \"{}\"",
                    node.name, first.2
                ),
                format!("map it once, in the RPDO with \"{}\"", first.2),
            );
        }
    }
}

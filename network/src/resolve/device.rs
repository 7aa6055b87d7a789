//! Devices: their files, identity and times.

use std::collections::BTreeMap;

use toml::Spanned;

use super::context::Context;
use super::{Files, MS_16, Open};
use crate::description::{self, Description, Device};
use crate::eds::Eds;
use crate::model::Identity;
use crate::object::Address;
use crate::problem::Place;
use crate::source::Source;

/// Times of a device.
pub(super) struct Times {
    pub(super) heartbeat_ms: u16,
    pub(super) master_timeout_ms: u16,
    pub(super) sdo_timeout_ms: u32,
    pub(super) tpdo_earliest_us: u32,
    pub(super) tpdo_latency_us: u32,
    pub(super) sdo_latency_us: Option<(u32, u32)>,
}

/// 1020h
const VERIFY_CONFIGURATION: [Address; 2] = [Address::new(0x1020, 1), Address::new(0x1020, 2)];
/// Objects of the application begin here: what lies below is the communication
/// profile, which this program writes by itself.
const APPLICATION: u16 = 0x2000;
/// Drives start to send within a millisecond.
const TPDO_LATENCY_US: u32 = 1000;
/// Seven times the slowest answer that was ever reported.
const SDO_TIMEOUT_MS: u32 = 100;
/// The longest latency that makes sense: a second.
const LATENCY_MAX_US: i64 = 1_000_000;

/// Reads the EDS of every device; what nobody can read is told.
pub(super) fn files(
    description: &Description,
    open: &mut Open<'_>,
    context: &mut Context<'_>,
) -> Files {
    let mut files = BTreeMap::new();
    for (name, device) in &description.device {
        let Some(source) = source(&device.get_ref().eds, open, context) else {
            continue;
        };
        let (eds, problems) = Eds::read(&source);
        context.problems.extend(problems);
        if !eds.objects.is_empty() {
            files.insert(name.get_ref().clone(), eds);
        }
    }
    files
}

fn source(
    name: &Spanned<String>,
    open: &mut Open<'_>,
    context: &mut Context<'_>,
) -> Option<Source> {
    match open(name.get_ref()) {
        Ok(source) => Some(source),
        Err(error) => {
            let place = context.at(name);
            context.problems.error(
                &place,
                name.get_ref(),
                format!("the file cannot be read ({})", error.kind()),
                "put the file there, or correct the name; it is relative to network.toml",
            );
            None
        }
    }
}

pub(super) fn times(device: &Device, context: &mut Context<'_>) -> Option<Times> {
    let heartbeat_ms = context.number(&device.heartbeat_ms, "heartbeat_ms", 0..=MS_16);
    let timeout = &device.master_timeout_ms;
    let master_timeout_ms = context.number(timeout, "master_timeout_ms", 0..=MS_16);
    let tpdo_latency_us = match &device.tpdo_latency_us {
        Some(us) => context.number(us, "tpdo_latency_us", 0..=LATENCY_MAX_US),
        None => Some(TPDO_LATENCY_US),
    };
    let earliest = device.tpdo_earliest_us.as_ref();
    let most = i64::from(tpdo_latency_us.unwrap_or(0));
    let tpdo_earliest_us = match earliest {
        Some(us) => context.number(us, "tpdo_earliest_us", 0..=most),
        None => Some(0),
    };
    let sdo_latency_us = sdo_latency(device, context);
    let sdo_timeout_ms = match &device.sdo_timeout_ms {
        Some(ms) => context.number(ms, "sdo_timeout_ms", 1..=MS_16),
        None => Some(SDO_TIMEOUT_MS),
    };
    Some(Times {
        heartbeat_ms: heartbeat_ms?,
        master_timeout_ms: master_timeout_ms?,
        sdo_timeout_ms: sdo_timeout_ms?,
        tpdo_earliest_us: tpdo_earliest_us?,
        tpdo_latency_us: tpdo_latency_us?,
        sdo_latency_us: sdo_latency_us?,
    })
}

/// The soonest and the slowest answer to an SDO request. Outside: what is wrong was
/// told; inside: nobody knows.
fn sdo_latency(device: &Device, context: &mut Context<'_>) -> Option<Option<(u32, u32)>> {
    let Some(spanned) = &device.sdo_latency_us else {
        return Some(None);
    };
    if let [least, most] = spanned.get_ref()[..]
        && (0..=LATENCY_MAX_US).contains(&most)
        && (0..=most).contains(&least)
    {
        return Some(Some((least as u32, most as u32)));
    }
    let place = context.at(spanned);
    context.problems.error(
        &place,
        format!("{:?}", spanned.get_ref()),
        format!("these are the soonest and the slowest answer, up to {LATENCY_MAX_US} us"),
        "write [soonest, slowest], for example [200, 1_000]; without it SDO is not planned",
    );
    None
}

/// 1F26h and 1F27h: date and time that a configured node shows in 1020h.
pub(super) fn configured(
    device: &Device,
    eds: &Eds,
    context: &mut Context<'_>,
) -> Option<[u32; 2]> {
    let Some(spanned) = &device.configured else {
        return Some([0; 2]);
    };
    let place = context.at(spanned);
    let shown = format!("{:?}", spanned.get_ref());
    let numbers: Result<Vec<u32>, _> = spanned
        .get_ref()
        .iter()
        .map(|n| u32::try_from(*n))
        .collect();
    let Some(configured) = numbers.ok().and_then(|n| <[u32; 2]>::try_from(n).ok()) else {
        context.problems.error(
            &place,
            shown,
            "this is date and time of a configuration: two whole numbers, as in 1020h",
            "write days since 1984-01-01 and milliseconds since midnight",
        );
        return None;
    };
    for at in VERIFY_CONFIGURATION {
        if eds.entry(at).is_none() {
            context.problems.error(
                &place,
                shown,
                format!(
                    "{} has no {at}, which would tell that it is configured",
                    eds.file
                ),
                "leave it out: the device is configured at every boot-up then",
            );
            return None;
        }
    }
    Some(configured)
}

pub(super) fn identity(device: &Device, eds: &Eds, context: &mut Context<'_>) -> Identity {
    let mut number = |value: &Option<Spanned<i64>>, key, in_eds: Option<u32>| {
        let value = value.as_ref()?;
        let number: u32 = context.number(value, key, 0..=u32::MAX.into())?;
        if let Some(other) = in_eds.filter(|other| *other != number && *other != 0) {
            let place = context.at(value);
            context.problems.warning(
                &place,
                format!("0x{number:08X}"),
                format!("the EDS {} is of {key} 0x{other:08X}", eds.file),
                "take the EDS of the device that is there, or correct the number",
            );
        }
        Some(number)
    };
    let default = |at| {
        let number = eds.entry(at)?.default?;
        u32::try_from(number.with_node_id(0)).ok()
    };
    let device_type = default(Address::new(0x1000, 0));
    Identity {
        device_type: number(&device.device_type, "device_type", device_type),
        vendor: number(&device.vendor, "vendor", eds.device.vendor),
        product: number(&device.product, "product", eds.device.product),
        revision: number(&device.revision, "revision", eds.device.revision),
        serial: None,
    }
}

/// The ParameterValues of a node's DCF, for the objects of the application that
/// can be written.
pub(super) fn dcf(
    node: &description::Node,
    eds: &Eds,
    open: &mut Open<'_>,
    context: &mut Context<'_>,
) -> Vec<(Address, i128, Place)> {
    let Some(name) = &node.dcf else {
        return Vec::new();
    };
    let Some(source) = source(name, open, context) else {
        return Vec::new();
    };
    let (dcf, problems) = Eds::read(&source);
    context.problems.extend(problems);
    let id = *node.id.get_ref();
    if let Some(other) = dcf.node_id.filter(|other| i64::from(*other) != id) {
        let place = context.at(name);
        context.problems.error(
            &place,
            name.get_ref(),
            format!("this DCF is made for node-ID {other}, and the node is {id}"),
            "export the DCF for this node, or correct the node-ID",
        );
    }
    dcf.entries()
        .filter(|(at, ..)| at.index >= APPLICATION)
        .filter(|(at, ..)| {
            eds.entry(*at)
                .is_some_and(|entry| entry.access.is_writable())
        })
        .filter_map(|(at, _, entry)| {
            let value = entry.parameter?.of_type(entry.data_type, id as u8);
            Some((at, value, Place::line(&source, entry.line)))
        })
        .collect()
}

//! `network.toml` as it is written. `docs/network.md` explains each key.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::Deserialize;
use toml::Spanned;

use crate::problem::{Place, Problems, nearest};
use crate::source::Source;

/// The whole file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Description {
    pub(crate) master: Spanned<Master>,
    pub(crate) bus: BTreeMap<Spanned<String>, Spanned<Bus>>,
    #[serde(default)]
    pub(crate) liveness: Liveness,
    #[serde(default)]
    pub(crate) group: Group,
    pub(crate) device: BTreeMap<Spanned<String>, Spanned<Device>>,
    #[serde(default)]
    pub(crate) node: Vec<Spanned<Node>>,
}

/// `[master]`
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Master {
    pub(crate) node_id: Spanned<i64>,
    pub(crate) heartbeat_ms: Spanned<i64>,
    pub(crate) silence_ms: Spanned<i64>,
    pub(crate) boot_time_ms: Spanned<i64>,
    pub(crate) sdo_tries: Spanned<i64>,
    pub(crate) syncs_before_start: Spanned<i64>,
}

/// `[bus.NAME]`
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Bus {
    pub(crate) peripheral: Spanned<String>,
    pub(crate) bit_rate: Spanned<i64>,
    pub(crate) sample_point: Option<Spanned<f64>>,
    pub(crate) cycle_us: Spanned<i64>,
    pub(crate) tpdo_deadline_us: Option<Spanned<i64>>,
    pub(crate) compute_us: Option<Spanned<i64>>,
    pub(crate) guard_us: Option<Spanned<i64>>,
    pub(crate) sdo_frames: Option<Spanned<i64>>,
    pub(crate) sdo_every: Option<Spanned<i64>>,
    pub(crate) emcy_frames: Option<Spanned<i64>>,
    pub(crate) heartbeats_wait: Option<bool>,
    pub(crate) rpdos: Option<Spanned<String>>,
    pub(crate) load_limit: Option<Spanned<f64>>,
}

/// `[liveness]`
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Liveness {
    pub(crate) by: Option<Spanned<String>>,
    pub(crate) missing_tpdos: Option<Spanned<i64>>,
}

/// `[group]`
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Group {
    pub(crate) program: Option<Spanned<String>>,
}

/// `[device.NAME]`
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Device {
    pub(crate) eds: Spanned<String>,
    pub(crate) device_type: Option<Spanned<i64>>,
    pub(crate) vendor: Option<Spanned<i64>>,
    pub(crate) product: Option<Spanned<i64>>,
    pub(crate) revision: Option<Spanned<i64>>,
    pub(crate) heartbeat_ms: Spanned<i64>,
    pub(crate) master_timeout_ms: Spanned<i64>,
    pub(crate) sdo_timeout_ms: Option<Spanned<i64>>,
    pub(crate) configured: Option<Spanned<Vec<i64>>>,
    pub(crate) tpdo_earliest_us: Option<Spanned<i64>>,
    pub(crate) tpdo_latency_us: Option<Spanned<i64>>,
    pub(crate) sdo_latency_us: Option<Spanned<Vec<i64>>>,
    pub(crate) heartbeat_in_operational: Option<Spanned<bool>>,
    #[serde(default)]
    pub(crate) rpdo: BTreeMap<Spanned<String>, Spanned<Pdo>>,
    #[serde(default)]
    pub(crate) tpdo: BTreeMap<Spanned<String>, Spanned<Pdo>>,
    #[serde(default)]
    pub(crate) axis: Axis,
    #[serde(default)]
    pub(crate) start_values: Vec<StartValue>,
}

/// `[device.NAME.rpdo.N]`, `[device.NAME.tpdo.N]`
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Pdo {
    pub(crate) map: Vec<Spanned<String>>,
    pub(crate) transmission: Option<Spanned<i64>>,
    pub(crate) send: Option<Spanned<String>>,
}

/// `[device.NAME.axis]`, `[node.axis]`
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Axis {
    pub(crate) mode: Option<Spanned<String>>,
    pub(crate) increments_per_turn: Option<Spanned<i64>>,
    pub(crate) gear: Option<Spanned<Vec<i64>>>,
    pub(crate) units_per_turn: Option<Spanned<i64>>,
    pub(crate) max_speed: Option<Spanned<i64>>,
    pub(crate) max_acceleration: Option<Spanned<i64>>,
    pub(crate) quick_stop: Option<Spanned<i64>>,
    pub(crate) min_position: Option<Spanned<i64>>,
    pub(crate) max_position: Option<Spanned<i64>>,
    pub(crate) homing_method: Option<Spanned<i64>>,
    pub(crate) homing_speed: Option<Spanned<i64>>,
    pub(crate) homing_zero_speed: Option<Spanned<i64>>,
    pub(crate) homing_acceleration: Option<Spanned<i64>>,
}

/// An element of `start_values`
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StartValue {
    pub(crate) object: Spanned<String>,
    pub(crate) value: Spanned<i64>,
}

/// `[[node]]`
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Node {
    pub(crate) id: Spanned<i64>,
    pub(crate) name: Spanned<String>,
    pub(crate) device: Spanned<String>,
    pub(crate) bus: Option<Spanned<String>>,
    pub(crate) mandatory: Option<bool>,
    pub(crate) serial: Option<Spanned<i64>>,
    pub(crate) dcf: Option<Spanned<String>>,
    #[serde(default)]
    pub(crate) axis: Axis,
    #[serde(default)]
    pub(crate) start_values: Vec<StartValue>,
}

impl Description {
    /// Reads the file; what is wrong with its form is told, one thing at a time.
    pub(crate) fn read(source: &Source, problems: &mut Problems) -> Option<Description> {
        match toml::from_str(source.text()) {
            Ok(description) => Some(description),
            Err(error) => {
                malformed(source, &error, "docs/network.md", problems);
                None
            }
        }
    }
}

/// Tells what is wrong with the form of a file that `reference` explains.
pub(crate) fn malformed(
    source: &Source,
    error: &toml::de::Error,
    reference: &str,
    problems: &mut Problems,
) {
    let span = error.span().unwrap_or(0..0);
    let place = match error.span() {
        Some(_) => Place::at(source, &span),
        None => Place::file(source),
    };
    let value = offending(source, &span);
    let (rule, suggestion) = words(error.message(), &value, reference);
    problems.error(&place, value, rule, suggestion);
}

/// What the span of an error shows: its first line.
fn offending(source: &Source, span: &Range<usize>) -> String {
    let text = source.slice(span.clone()).lines().next().unwrap_or("");
    if !text.trim().is_empty() {
        return text.trim().to_string();
    }
    let line = source.line(source.line_of(span.start));
    match line.is_empty() {
        true => source.name().to_string(),
        false => line.to_string(),
    }
}

/// The reader's message as a rule and a suggestion.
fn words(message: &str, value: &str, reference: &str) -> (String, String) {
    let message = message.lines().collect::<Vec<_>>().join("; ");
    let known = || message.split('`').skip(3).step_by(2);
    let suggestion = if message.starts_with("unknown field") {
        match nearest(value.trim_matches('"'), known()) {
            Some(name) => format!("did you mean `{name}`?"),
            None => format!(
                "the keys here are {}",
                known().collect::<Vec<_>>().join(", ")
            ),
        }
    } else if let Some(field) = message.strip_prefix("missing field ") {
        format!("add {field}; {reference} says what it means")
    } else if message.starts_with("invalid type") {
        format!("write the value as {reference} has it")
    } else {
        "see https://toml.io for how this is written".to_string()
    };
    (message, suggestion)
}

//! A motion program as it is written. `docs/motion.md` explains each key.

use std::fmt;

use serde::Deserialize;
use serde::de::value::SeqAccessDeserializer;
use serde::de::{Deserializer, SeqAccess, Visitor};
use toml::Spanned;

type Number = Option<Spanned<f64>>;
type Count = Option<Spanned<i64>>;
type Names = Option<Spanned<Vec<Spanned<String>>>>;

/// The whole file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) name: Option<String>,
    pub(super) unit: Option<Spanned<String>>,
    pub(super) velocity: Option<Spanned<Values>>,
    pub(super) acceleration: Option<Spanned<Values>>,
    pub(super) deceleration: Option<Spanned<Values>>,
    #[serde(default)]
    pub(super) step: Vec<Spanned<Step>>,
}

/// `[[step]]`
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Step {
    #[serde(rename = "move")]
    pub(super) moves: Option<Vec<Spanned<Move>>>,
    pub(super) jerk: Count,
    pub(super) settle: Option<Spanned<bool>>,
    pub(super) wait_ms: Number,
    pub(super) repeat: Count,
    pub(super) forever: Option<Spanned<bool>>,
    #[serde(default)]
    pub(super) step: Vec<Spanned<Step>>,
    pub(super) sine: Option<Spanned<Sine>>,
    pub(super) trapezoid: Option<Spanned<Trapezoid>>,
    pub(super) table: Option<Spanned<Table>>,
    pub(super) path: Option<Spanned<WayPoints>>,
    pub(super) home: Option<Spanned<Home>>,
    pub(super) mode: Option<Spanned<Mode>>,
}

/// `[[step.move]]`
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Move {
    pub(super) axes: Names,
    pub(super) to: Option<Spanned<Values>>,
    pub(super) by: Option<Spanned<Values>>,
    pub(super) velocity: Option<Spanned<Values>>,
    pub(super) acceleration: Option<Spanned<Values>>,
    pub(super) deceleration: Option<Spanned<Values>>,
}

/// `[step.sine]`
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Sine {
    pub(super) axes: Names,
    pub(super) amplitude: Spanned<Values>,
    pub(super) points: Spanned<i64>,
    pub(super) cycles: Count,
    pub(super) periods: Count,
}

/// `[step.trapezoid]`
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Trapezoid {
    pub(super) axes: Names,
    pub(super) amplitude: Spanned<Values>,
    pub(super) ramp_ms: Spanned<f64>,
    pub(super) speed_ms: Number,
    pub(super) rest_ms: Number,
    pub(super) periods: Count,
}

/// `[step.table]`
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Table {
    pub(super) axes: Names,
    pub(super) every_ms: Spanned<f64>,
    pub(super) points: Spanned<Vec<Spanned<Values>>>,
    pub(super) periods: Count,
}

/// `[step.path]`
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WayPoints {
    pub(super) axes: Names,
    pub(super) points: Spanned<Vec<Spanned<Values>>>,
    pub(super) velocity: Option<Spanned<Values>>,
    pub(super) acceleration: Option<Spanned<Values>>,
}

/// `[step.home]`
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Home {
    pub(super) axes: Names,
    pub(super) limit_ms: Number,
}

/// `[step.mode]`
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Mode {
    pub(super) axes: Names,
    pub(super) is: Spanned<String>,
}

/// One number for all axes, or one for each.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    One(f64),
    Each(Vec<f64>),
}

impl Values {
    /// That of a member.
    pub(super) fn of(&self, member: usize) -> f64 {
        match self {
            Values::One(value) => *value,
            Values::Each(values) => values.get(member).copied().unwrap_or_default(),
        }
    }
}

impl fmt::Display for Values {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Values::One(value) => write!(f, "{value}"),
            Values::Each(values) => write!(f, "{values:?}"),
        }
    }
}

impl<'de> Deserialize<'de> for Values {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Values, D::Error> {
        deserializer.deserialize_any(AnyOf)
    }
}

struct AnyOf;

impl<'de> Visitor<'de> for AnyOf {
    type Value = Values;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, or a list of numbers, one for each axis")
    }

    fn visit_i64<E>(self, value: i64) -> Result<Values, E> {
        Ok(Values::One(value as f64))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Values, E> {
        Ok(Values::One(value))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, values: A) -> Result<Values, A::Error> {
        let values = Vec::<f64>::deserialize(SeqAccessDeserializer::new(values))?;
        Ok(Values::Each(values))
    }
}

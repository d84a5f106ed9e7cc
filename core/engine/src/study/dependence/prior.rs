//! A prior as a study writes it: a distribution, the posterior of an earlier run, or an interval without any distribution.

use std::borrow::Cow;
use std::fmt;
use std::path::PathBuf;

use lacuna::math::distribution::Distribution;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Serialize;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};

/// Prior of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Prior {
    /// A distribution.
    Own(Distribution),
    /// The posterior of an earlier run.
    Earlier {
        /// Run directory of the earlier run, relative to the study file. Parameters that name the same run have its joint
        /// posterior. Their names must be those of the run; units are converted.
        posterior: PathBuf,
    },
    /// No distribution: a fixed value of which bounds are known and nothing else.
    Interval {
        /// Lower and upper bound, in the parameter's unit.
        interval: [f64; 2],
    },
}

impl<'de> Deserialize<'de> for Prior {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Written)
    }
}

/// The forms of a distribution and two more, so that an editor names the fault of one form.
impl JsonSchema for Prior {
    fn schema_name() -> Cow<'static, str> {
        "Prior".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut schema = Distribution::json_schema(generator);
        let earlier = json_schema!({
            "description": "The posterior of an earlier run: its run directory, relative to the study file. Parameters that \
                            name the same run have its joint posterior; units are converted.",
            "type": "object",
            "properties": { "posterior": { "type": "string" } },
            "required": ["posterior"],
            "additionalProperties": false
        });
        let interval = json_schema!({
            "description": "No distribution: a fixed value between `[lower bound, upper bound]`, of which nothing else is known. \
                            Quantities are then bounded over the interval; in a study without data only.",
            "type": "object",
            "properties": {
                "interval": { "type": "array", "items": { "type": "number" }, "minItems": 2, "maxItems": 2 }
            },
            "required": ["interval"],
            "additionalProperties": false
        });
        let object = schema.ensure_object();
        if let Some(forms) = object.get_mut("oneOf").and_then(serde_json::Value::as_array_mut) {
            forms.extend([earlier.to_value(), interval.to_value()]);
        }
        schema
    }
}

struct Written;

impl<'de> Visitor<'de> for Written {
    type Value = Prior;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a distribution such as { uniform = [0, 1] }")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Prior, A::Error> {
        let Some(name) = map.next_key::<String>()? else {
            return Err(Error::custom(
                "expected a distribution such as { uniform = [0, 1] }, found an empty table",
            ));
        };
        let prior = match name.as_str() {
            "posterior" => Prior::Earlier { posterior: map.next_value()? },
            "interval" => Prior::Interval { interval: bounds(&map.next_value::<Vec<f64>>()?)? },
            _ => return Distribution::named(&name, map).map(Prior::Own),
        };
        match map.next_key::<String>()? {
            Some(second) => {
                Err(Error::custom(format!("expected one prior, found `{name}` and `{second}`")))
            }
            None => Ok(prior),
        }
    }
}

/// Bounds of an interval, checked.
fn bounds<E: Error>(numbers: &[f64]) -> Result<[f64; 2], E> {
    let expected = match *numbers {
        [low, high] if !(low.is_finite() && high.is_finite()) => "finite numbers",
        [low, high] if low >= high => "the lower bound below the upper",
        [low, high] if !(high - low).is_finite() => "a narrower interval",
        [low, high] => return Ok([low, high]),
        _ => "`interval` to be [lower bound, upper bound]",
    };
    let found: Vec<String> = numbers.iter().map(f64::to_string).collect();
    Err(Error::custom(format!("expected {expected}, found [{}]", found.join(", "))))
}

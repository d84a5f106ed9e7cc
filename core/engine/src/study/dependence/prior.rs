//! A prior as a study writes it: a distribution, or the posterior of an earlier run.

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
}

impl<'de> Deserialize<'de> for Prior {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Written)
    }
}

/// The forms of a distribution and one more, so that an editor names the fault of one form.
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
        let object = schema.ensure_object();
        if let Some(forms) = object.get_mut("oneOf").and_then(serde_json::Value::as_array_mut) {
            forms.push(earlier.to_value());
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
        if name != "posterior" {
            return Distribution::named(&name, map).map(Prior::Own);
        }
        let posterior = map.next_value()?;
        match map.next_key::<String>()? {
            Some(second) => {
                Err(Error::custom(format!("expected one prior, found `posterior` and `{second}`")))
            }
            None => Ok(Prior::Earlier { posterior }),
        }
    }
}

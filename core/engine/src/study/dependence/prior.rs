//! A prior as a study writes it: a distribution, or the posterior of an earlier run.

use std::fmt;
use std::path::PathBuf;

use lacuna::math::distribution::Distribution;
use schemars::JsonSchema;
use serde::Serialize;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};

/// Prior of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
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

//! Values of the summary that JSON has no type for: numbers that claim no uncertainty, and maps in the order of the
//! study.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Serialize, Serializer};

/// Number that claims no uncertainty: an estimate, a setting, a measured value, a time.
///
/// A plain `f64` in a struct of the summary states an uncertainty or is used to judge one. Such a key needs an entry in
/// `tests/gate/printed.toml`, which names the test that checks how often the statement holds. A number that is not
/// finite is written as `null`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Quantity(pub f64);

impl Quantity {
    /// Name of the definition in the schema.
    pub const NAME: &str = "Quantity";
}

impl From<f64> for Quantity {
    fn from(value: f64) -> Self {
        Self(value)
    }
}

impl JsonSchema for Quantity {
    fn schema_name() -> Cow<'static, str> {
        Self::NAME.into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A number that claims no uncertainty: an estimate, a setting, a measured figure, a time; `null` where it is \
                            not finite.",
            "type": ["number", "null"],
        })
    }
}

/// A JSON object whose keys are names from the study, in the order in which they were added.
#[derive(Debug, Clone, PartialEq)]
pub struct ByName<T>(Vec<(String, T)>);

impl<T> ByName<T> {
    /// Returns true if the map has no entries.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl<T> FromIterator<(String, T)> for ByName<T> {
    /// Builds the map; of several entries with the same name, the last value is kept at the place of the first.
    fn from_iter<I: IntoIterator<Item = (String, T)>>(entries: I) -> Self {
        let mut all: Vec<(String, T)> = Vec::new();
        for (name, value) in entries {
            match all.iter_mut().find(|(known, _)| *known == name) {
                Some(entry) => entry.1 = value,
                None => all.push((name, value)),
            }
        }
        Self(all)
    }
}

impl<T: Serialize> Serialize for ByName<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, value)| (name, value)))
    }
}

impl<T: JsonSchema> JsonSchema for ByName<T> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("{}_by_name", T::schema_name()).into()
    }

    fn schema_id() -> Cow<'static, str> {
        format!("ByName<{}>", T::schema_id()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "object", "additionalProperties": generator.subschema_for::<T>() })
    }
}

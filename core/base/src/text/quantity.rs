//! Numbers with or without a unit.

use std::fmt;

use schemars::JsonSchema;
use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize, Serializer};

use crate::data::Unit;

/// A number in the unit of the option that it sets, or a number with its unit: `{ value = 1.2, unit = "MW" }`.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantity {
    /// Number.
    pub value: f64,
    /// Unit; `None` for a plain number.
    pub unit: Option<Unit>,
}

/// A quantity as a table.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Table {
    /// Number.
    value: f64,
    /// Unit of the number.
    unit: Unit,
}

impl Quantity {
    /// The value in another unit; a plain number is taken to be in that unit. `None` if the dimensions differ.
    pub fn in_unit(&self, unit: &Unit) -> Option<f64> {
        self.unit.as_ref().map_or(Some(self.value), |own| own.convert(self.value, unit))
    }
}

impl Serialize for Quantity {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.unit {
            None => self.value.serialize(serializer),
            Some(unit) => Table { value: self.value, unit: unit.clone() }.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Quantity {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = Quantity;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(
                    "a number, or a number with a unit such as `{ value = 1.2, unit = \"MW\" }`",
                )
            }
            fn visit_f64<E: de::Error>(self, value: f64) -> Result<Quantity, E> {
                Ok(Quantity { value, unit: None })
            }
            fn visit_i64<E: de::Error>(self, value: i64) -> Result<Quantity, E> {
                Ok(Quantity { value: value as f64, unit: None })
            }
            fn visit_u64<E: de::Error>(self, value: u64) -> Result<Quantity, E> {
                Ok(Quantity { value: value as f64, unit: None })
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Quantity, A::Error> {
                let table = Table::deserialize(de::value::MapAccessDeserializer::new(map))?;
                Ok(Quantity { value: table.value, unit: Some(table.unit) })
            }
        }
        deserializer.deserialize_any(Either)
    }
}

impl JsonSchema for Quantity {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Quantity".into()
    }
    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let table = generator.subschema_for::<Table>();
        schemars::json_schema!({ "anyOf": [{ "type": "number" }, table] })
    }
}

//! Positive numbers that are known or have a prior.

use std::borrow::Cow;
use std::fmt;

use lacuna::data::Layout;
use lacuna::math::distribution::Distribution;
use lacuna::text::problem::Complaints;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::StrDeserializer;
use serde::de::{self, DeserializeSeed, MapAccess};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

use super::{By, Groups};

/// A positive number: a prior such as `{ half_normal = 1e-6 }` if it is unknown, or `{ known = 2.5e-11 }`, with a
/// list for one number per group, `{ known = [1e-11, 4e-11] }`.
#[derive(Debug, Clone, PartialEq)]
pub enum Quantity {
    /// The known number, or one for each group.
    Known(Vec<f64>),
    /// Prior of the unknown number.
    Unknown(Distribution),
}

/// A variance: known, unknown, or a multiple of the variance measured between replicates.
#[derive(Debug, Clone, PartialEq)]
pub enum Variance {
    /// Variance in the squared unit of the response.
    Of(Quantity),
    /// Factor on the variance between the replicates of each output.
    Measured(Quantity),
}

impl Quantity {
    /// Returns the number of each output of a layout grouped by `by`, if it is known.
    pub fn known(&self, layout: &Layout, by: &By) -> Option<Vec<f64>> {
        let Self::Known(values) = self else { return None };
        let groups = Groups::of(layout, by).ok()?;
        let of_group = |g: &usize| match values.as_slice() {
            [one] => Some(*one),
            many => many.get(*g).copied(),
        };
        let each: Option<Vec<f64>> = groups.position.iter().map(of_group).collect();
        Some(groups.spread(&each?))
    }

    /// Reports a known number that is not above zero, a wrong count of numbers, and a prior that reaches below zero.
    pub fn check_positive(&self, at: &str, groups: usize, complaints: &mut Complaints<'_>) {
        match self {
            Self::Known(values) => {
                if values.len() != 1 && values.len() != groups {
                    complaints
                        .at(at)
                        .say("there must be one number, or one for each group")
                        .expected(format!("1 or {groups} numbers"))
                        .found(values.len());
                }
                if let Some(value) = values.iter().find(|v| !(v.is_finite() && **v > 0.0)) {
                    complaints.at(at).say("this must be above zero").found(value);
                }
            }
            Self::Unknown(prior) => {
                let (low, high) = prior.support();
                if low < 0.0 || high <= 0.0 {
                    complaints
                        .at(at)
                        .say("this quantity must be positive")
                        .expected("a prior on positive values, such as `{ half_normal = 1e-6 }`")
                        .found(prior);
                }
            }
        }
    }
}

impl Variance {
    /// Returns the standard deviation of each output of a layout, if the variance is known and not measured.
    pub fn known_sd(&self, layout: &Layout, by: &By) -> Option<Vec<f64>> {
        let Self::Of(quantity) = self else { return None };
        let variance = quantity.known(layout, by)?;
        Some(variance.into_iter().map(f64::sqrt).collect())
    }

    /// Returns the prior of the unknown variances or multipliers.
    pub fn prior(&self) -> Option<&Distribution> {
        let (Self::Of(quantity) | Self::Measured(quantity)) = self;
        match quantity {
            Quantity::Unknown(prior) => Some(prior),
            Quantity::Known(_) => None,
        }
    }

    /// Reports values and priors that are not positive.
    pub fn check(&self, groups: Option<&Groups>, complaints: &mut Complaints<'_>) {
        let count = groups.map_or(1, Groups::count);
        match self {
            Self::Of(quantity) => quantity.check_positive("variance", count, complaints),
            Self::Measured(quantity) => {
                quantity.check_positive("variance.measured", count, complaints);
            }
        }
    }
}

impl From<Distribution> for Variance {
    fn from(prior: Distribution) -> Self {
        Self::Of(Quantity::Unknown(prior))
    }
}

impl Serialize for Quantity {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let values = match self {
            Self::Unknown(prior) => return prior.serialize(serializer),
            Self::Known(values) => values,
        };
        let mut map = serializer.serialize_map(Some(1))?;
        match values.as_slice() {
            [value] => map.serialize_entry("known", value)?,
            values => map.serialize_entry("known", values)?,
        }
        map.end()
    }
}

impl Serialize for Variance {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Of(quantity) => quantity.serialize(serializer),
            Self::Measured(quantity) => {
                let mut map = serializer.serialize_map(Some(1))?;
                map.serialize_entry("measured", quantity)?;
                map.end()
            }
        }
    }
}

impl<'de> Deserialize<'de> for Quantity {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match deserializer.deserialize_map(Table { measured: false })? {
            Variance::Of(quantity) | Variance::Measured(quantity) => Ok(quantity),
        }
    }
}

impl<'de> Deserialize<'de> for Variance {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Table { measured: true })
    }
}

/// Deserialises a table of one key: `known`, `measured` if allowed, or the name of a distribution.
struct Table {
    measured: bool,
}

impl<'de> de::Visitor<'de> for Table {
    type Value = Variance;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a prior such as { half_normal = 1e-6 }, or { known = 1e-10 }")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Variance, A::Error> {
        let first = map.next_key::<String>()?;
        let value = match first.as_deref() {
            Some("known") => Variance::Of(Quantity::Known(map.next_value::<Numbers>()?.0)),
            Some("measured") if self.measured => Variance::Measured(map.next_value()?),
            _ => {
                let rest = de::value::MapAccessDeserializer::new(Replayed { first, map });
                return Ok(Distribution::deserialize(rest)?.into());
            }
        };
        match map.next_key::<String>()? {
            None => Ok(value),
            Some(second) => Err(de::Error::custom(format!(
                "expected one key, found `{}` and `{second}`",
                first.unwrap_or_default()
            ))),
        }
    }
}

/// A table whose first key has been read already.
struct Replayed<A> {
    first: Option<String>,
    map: A,
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for Replayed<A> {
    type Error = A::Error;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, A::Error> {
        match self.first.take() {
            Some(key) => seed.deserialize(StrDeserializer::new(&key)).map(Some),
            None => self.map.next_key_seed(seed),
        }
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, A::Error> {
        self.map.next_value_seed(seed)
    }
}

/// One number or a list of numbers.
struct Numbers(Vec<f64>);

impl<'de> Deserialize<'de> for Numbers {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumbersVisitor)
    }
}

struct NumbersVisitor;

impl<'de> de::Visitor<'de> for NumbersVisitor {
    type Value = Numbers;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number or a list of numbers")
    }
    fn visit_f64<E>(self, x: f64) -> Result<Numbers, E> {
        Ok(Numbers(vec![x]))
    }
    fn visit_i64<E>(self, x: i64) -> Result<Numbers, E> {
        Ok(Numbers(vec![x as f64]))
    }
    fn visit_u64<E>(self, x: u64) -> Result<Numbers, E> {
        Ok(Numbers(vec![x as f64]))
    }
    fn visit_seq<A: de::SeqAccess<'de>>(self, mut items: A) -> Result<Numbers, A::Error> {
        let mut numbers = Vec::new();
        while let Some(x) = items.next_element()? {
            numbers.push(x);
        }
        Ok(Numbers(numbers))
    }
}

/// Returns the schema of a distribution with further tables as alternatives.
fn extended(generator: &mut SchemaGenerator, tables: Vec<Value>) -> Schema {
    let mut schema = Distribution::json_schema(generator);
    if let Some(Value::Array(cases)) = schema.get_mut("oneOf") {
        cases.splice(0..0, tables);
    }
    schema.remove("description");
    schema
}

fn table(key: &str, content: Value, description: &str) -> Value {
    json_schema!({
        "description": description,
        "type": "object",
        "properties": { key: content },
        "required": [key],
        "additionalProperties": false
    })
    .to_value()
}

fn known() -> Value {
    let content = json_schema!({
        "anyOf": [{ "type": "number" }, { "type": "array", "items": { "type": "number" } }]
    });
    table(
        "known",
        content.to_value(),
        "Known value: one number, or a list with one number per group of outputs.",
    )
}

impl JsonSchema for Quantity {
    fn schema_name() -> Cow<'static, str> {
        // `Quantity` is a number with a unit.
        "PriorOrKnown".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        extended(generator, vec![known()])
    }
}

impl JsonSchema for Variance {
    fn schema_name() -> Cow<'static, str> {
        "Variance".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let content = generator.subschema_for::<Quantity>().to_value();
        let text = "Multiple of the variance between the replicates of each output: the prior of the \
                    multiplier, or `{ known = 1 }`.";
        extended(generator, vec![known(), table("measured", content, text)])
    }
}

//! Section `[response]` as written: name, unit and axes.

use std::fmt;

use schemars::JsonSchema;
use serde::de::{self, Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize, Serializer};

use super::labels::{self, LabelSection};
use super::memory;
use super::values::{Count, Name};
use crate::data::{Axis, Unit};

/// Quantity that the model returns and the experiment measures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ResponseSection {
    /// Name of the response, such as `strain`.
    pub name: Name,
    /// Unit of its values.
    #[serde(default = "Unit::dimensionless")]
    pub unit: Unit,
    /// Axes, slowest-varying first; omit for a single number.
    #[serde(default)]
    pub axes: Axes,
}

/// Named axes in the order in which they are written.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Axes(pub Vec<(Name, AxisSection)>);

/// One axis: labels, with their positions if they are known, or a grid of numbers with a unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum AxisSection {
    /// Labels, such as the names of sensors.
    Labels(Vec<String>),
    /// Labels with their positions on a line.
    Placed(LabelSection),
    /// Numbers with a unit, such as times.
    Grid(GridSection),
}

/// An axis of increasing numbers: `first`, `last` and `count`, or `values`, or those of the measurements.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GridSection {
    /// First number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first: Option<f64>,
    /// Last number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last: Option<f64>,
    /// Number of equally spaced numbers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<Count>,
    /// The numbers themselves, increasing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub values: Option<Vec<f64>>,
    /// Set to true to take the numbers at which the scenario was measured, from its file.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub measured: bool,
    /// Unit of the numbers.
    #[serde(default = "Unit::dimensionless")]
    pub unit: Unit,
}

impl GridSection {
    /// The numbers of the axis; `measured` gives those of the measurements.
    ///
    /// # Errors
    /// A description of what is wrong with them.
    pub fn numbers(
        &self,
        measured: impl FnOnce(&Unit) -> Result<Vec<f64>, String>,
    ) -> Result<Vec<f64>, String> {
        let numbers = match (self.first, self.last, self.count, &self.values, self.measured) {
            (None, None, None, None, true) => measured(&self.unit)?,
            (None, None, None, Some(values), false) => values.clone(),
            (Some(first), Some(last), Some(count), None, false) => {
                memory::axis(count.get())?;
                evenly(first, last, count.get())
            }
            _ => {
                let ways =
                    "expected `first`, `last` and `count`, or `values`, or `measured = true`";
                return Err(ways.to_owned());
            }
        };
        match numbers
            .windows(2)
            .find(|pair| pair[0].partial_cmp(&pair[1]) != Some(std::cmp::Ordering::Less))
        {
            Some(pair) => {
                Err(format!("expected increasing numbers, found {} before {}", pair[0], pair[1]))
            }
            None if numbers.is_empty() => {
                Err("expected at least one number, found none".to_owned())
            }
            None => Ok(numbers),
        }
    }
}

/// Equally spaced numbers, each computed from the ends, so that rounding errors do not accumulate.
fn evenly(first: f64, last: f64, count: usize) -> Vec<f64> {
    let place = |i: usize| {
        let share = if count > 1 { i as f64 / (count as f64 - 1.0) } else { 0.0 };
        // Rounding to 12 decimals makes grids such as 1e-5, 2e-5, … come out as written.
        let plain = first + (last - first) * share;
        format!("{plain:.12e}").parse().unwrap_or(plain)
    };
    (0..count).map(place).collect()
}

impl AxisSection {
    /// The axis; `measured` gives the numbers of the measurements in a unit.
    ///
    /// # Errors
    /// A description of what is wrong with it.
    pub fn axis(
        &self,
        name: &str,
        measured: impl FnOnce(&Unit) -> Result<Vec<f64>, String>,
    ) -> Result<Axis, String> {
        match self {
            Self::Labels(labels) => labels::axis(name, labels),
            Self::Placed(section) => labels::axis(name, &section.labels),
            Self::Grid(grid) => Ok(Axis::grid(name, grid.numbers(measured)?, grid.unit.clone())),
        }
    }
}

impl Serialize for Axes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, axis)| (name.as_str(), axis)))
    }
}

impl<'de> Deserialize<'de> for Axes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entries;
        impl<'de> Visitor<'de> for Entries {
            type Value = Axes;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table of axes")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Axes, A::Error> {
                let mut axes = Vec::new();
                while let Some(entry) = map.next_entry::<Name, AxisSection>()? {
                    axes.push(entry);
                }
                Ok(Axes(axes))
            }
        }
        deserializer.deserialize_map(Entries)
    }
}

impl<'de> Deserialize<'de> for AxisSection {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = AxisSection;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(
                    "a list of labels, a table with `labels` and `positions`, or a table with `first`, `last`, `count` \
                     and `unit`",
                )
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<AxisSection, A::Error> {
                let labels = Vec::deserialize(de::value::SeqAccessDeserializer::new(seq))?;
                Ok(AxisSection::Labels(labels))
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<AxisSection, A::Error> {
                let table = AxisTable::deserialize(de::value::MapAccessDeserializer::new(map))?;
                table.section().map_err(de::Error::custom)
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// The keys of both kinds of axes that are tables.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AxisTable {
    labels: Option<Vec<String>>,
    positions: Option<Vec<f64>>,
    first: Option<f64>,
    last: Option<f64>,
    count: Option<Count>,
    values: Option<Vec<f64>>,
    #[serde(default)]
    measured: bool,
    unit: Option<Unit>,
}

impl AxisTable {
    fn section(self) -> Result<AxisSection, &'static str> {
        let Self { labels, positions, first, last, count, values, measured, unit } = self;
        let has_numbers = first.or(last).is_some() || count.is_some() || values.is_some();
        match (labels, positions, has_numbers || measured) {
            (None, None, _) => {
                let unit = unit.unwrap_or_else(Unit::dimensionless);
                Ok(AxisSection::Grid(GridSection { first, last, count, values, measured, unit }))
            }
            (Some(labels), positions, false) => {
                let unit = unit.unwrap_or_else(labels::metre);
                Ok(AxisSection::Placed(LabelSection { labels, positions, unit }))
            }
            (None, Some(_), _) => Err("expected `labels` beside `positions`, found none"),
            (Some(_), _, true) => Err("expected labels or numbers, found both"),
        }
    }
}

impl JsonSchema for Axes {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Axes".into()
    }
    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let labels = generator.subschema_for::<LabelSection>();
        let grid = generator.subschema_for::<GridSection>();
        // Told apart by the key `labels`: of an `anyOf`, a validator could not say which key is wrong.
        let placed = serde_json::json!({ "type": "object", "required": ["labels"] });
        let numbers = serde_json::json!({ "type": "object", "not": { "required": ["labels"] } });
        schemars::json_schema!({
            "type": "object",
            "additionalProperties": {
                "type": ["array", "object"],
                "items": { "type": "string" },
                "allOf": [{ "if": placed, "then": labels }, { "if": numbers, "then": grid }]
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decimal_grid_comes_out_as_written() {
        let grid = evenly(1e-5, 1e-3, 100);
        assert_eq!((grid[0], grid[2], grid[6], grid[99]), (1e-5, 3e-5, 7e-5, 1e-3));
    }
}

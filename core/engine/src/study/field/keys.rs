//! The keys of `[[field]]`.

use std::fmt;

use lacuna::data::Unit;
use lacuna::text::response::Axes;
use lacuna::text::values::{Count, Name, OpenFraction, Positive};
use schemars::JsonSchema;
use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize};

use crate::study::scenario::FunctionSection;

/// A random field as an input of the model, such as a conductivity that varies along a rod: its Karhunen-Loève expansion. The
/// unknowns are the coefficients of its terms, `name.term[1]` and so on, which are independent and standard normal under the
/// prior. Expressions call the field as `name(x)`; a model that has inputs only takes its values at the places as `name[1]`,
/// `name[2]` and so on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FieldSection {
    /// Name of the field, with which expressions call it.
    pub name: Name,
    /// Unit of its values.
    #[serde(default = "Unit::dimensionless")]
    pub unit: Unit,
    /// The coordinate and the places at which the field is computed: one axis of numbers, such as
    /// `{ x = { first = 0, last = 1, count = 51, unit = "m" } }`. Between two places the field is interpolated.
    pub axes: Axes,
    /// Distribution of the field at one place.
    pub distribution: FieldDistribution,
    /// Correlation between two places, as a function of their distance.
    pub kernel: FieldKernel,
    /// Correlation length, in the unit of the axis.
    pub length: Positive,
    /// Share of the variance, integrated over the places, that the terms keep; as many terms as this needs. Default: 0.95.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variance: Option<OpenFraction>,
    /// Number of terms, in place of `variance`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub terms: Option<Count>,
}

/// Distribution of a field at one place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum FieldDistribution {
    /// Normal: `{ normal = { mean = 20, sd = 2 } }`.
    Normal {
        /// Mean, in the unit of the field: a number, or a table over the coordinate such as
        /// `{ path = "mean.csv", at = "x", value = "k" }`.
        mean: Level,
        /// Standard deviation, in the unit of the field.
        sd: Positive,
    },
    /// The logarithm is normal, for values above zero: `{ log_normal = { median = 20, sd = 0.3 } }`.
    LogNormal {
        /// Median, in the unit of the field: a number above zero, or a table over the coordinate.
        median: Level,
        /// Standard deviation of the natural logarithm.
        sd: Positive,
    },
}

/// A number, or a function of the coordinate from two columns of a table.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Level {
    /// The same number at all places.
    Number(f64),
    /// A table.
    Table(FunctionSection),
}

impl<'de> Deserialize<'de> for Level {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = Level;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(
                    "a number, or a table such as `{ path = \"mean.csv\", at = \"x\", value = \"k\" }`",
                )
            }
            fn visit_f64<E: de::Error>(self, value: f64) -> Result<Level, E> {
                Ok(Level::Number(value))
            }
            fn visit_i64<E: de::Error>(self, value: i64) -> Result<Level, E> {
                Ok(Level::Number(value as f64))
            }
            fn visit_u64<E: de::Error>(self, value: u64) -> Result<Level, E> {
                Ok(Level::Number(value as f64))
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Level, A::Error> {
                let table =
                    FunctionSection::deserialize(de::value::MapAccessDeserializer::new(map))?;
                Ok(Level::Table(table))
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// Correlation of a field between two places at a distance `h`, with the correlation length `l` (Rasmussen and Williams,
/// Gaussian Processes for Machine Learning (2006), 4.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FieldKernel {
    /// `exp(-h/l)`: continuous, rough. It needs the most terms.
    Exponential,
    /// Matérn with index 3/2: once differentiable.
    #[serde(rename = "matern_3_2")]
    ThreeHalves,
    /// Matérn with index 5/2: twice differentiable.
    #[serde(rename = "matern_5_2")]
    FiveHalves,
    /// `exp(-h²/(2 l²))`: infinitely differentiable.
    SquaredExponential,
}

impl FieldKernel {
    /// Correlation at a distance in units of the correlation length.
    pub fn at(self, distance: f64) -> f64 {
        match self {
            Self::Exponential => (-distance).exp(),
            Self::ThreeHalves => {
                let x = 3.0_f64.sqrt() * distance;
                (1.0 + x) * (-x).exp()
            }
            Self::FiveHalves => {
                let x = 5.0_f64.sqrt() * distance;
                (1.0 + x + x * x / 3.0) * (-x).exp()
            }
            Self::SquaredExponential => (-0.5 * distance * distance).exp(),
        }
    }

    /// Name in a study.
    pub fn name(self) -> &'static str {
        match self {
            Self::Exponential => "exponential",
            Self::ThreeHalves => "matern_3_2",
            Self::FiveHalves => "matern_5_2",
            Self::SquaredExponential => "squared_exponential",
        }
    }
}

//! The options of a study's section.

use std::fmt;

use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::{Deserialize, Deserializer, Serialize, de};

/// How the coefficients are found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Solver {
    /// A few terms among many: least-angle regression proposes them one after the other, and the set
    /// with the least corrected leave-one-out error is fitted by least squares. There may be more
    /// terms to choose from than runs.
    #[default]
    LeastAngleRegression,
    /// All terms of a degree by least squares. There must be more runs than terms; twice as many is a
    /// usual rule.
    LeastSquares,
}

impl Solver {
    /// The name in a study.
    pub fn name(self) -> &'static str {
        match self {
            Self::LeastAngleRegression => "least_angle_regression",
            Self::LeastSquares => "least_squares",
        }
    }
}

/// The degrees to be tried: a whole number, or `{ min = 1, max = 20 }`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Degree {
    /// This one.
    Fixed(usize),
    /// Each output takes the one with the least error.
    Range(DegreeRange),
}

/// A range of degrees.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DegreeRange {
    /// The first degree to be tried.
    pub min: usize,
    /// The last one.
    pub max: usize,
}

impl Default for DegreeRange {
    fn default() -> Self {
        Self { min: 1, max: 20 }
    }
}

impl Default for Degree {
    fn default() -> Self {
        Self::Range(DegreeRange::default())
    }
}

impl Degree {
    /// The first and the last degree.
    pub fn range(self) -> DegreeRange {
        match self {
            Self::Fixed(degree) => DegreeRange { min: degree, max: degree },
            Self::Range(range) => range,
        }
    }
}

impl<'de> Deserialize<'de> for Degree {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(DegreeVisitor)
    }
}

/// Reads a [`Degree`] by the kind of value that stands there, so that errors inside the range keep
/// their own place and words.
struct DegreeVisitor;

impl<'de> de::Visitor<'de> for DegreeVisitor {
    type Value = Degree;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a whole number or a range such as `{ min = 1, max = 20 }`")
    }

    fn visit_u64<E: de::Error>(self, degree: u64) -> Result<Degree, E> {
        usize::try_from(degree)
            .map(Degree::Fixed)
            .map_err(|_| E::invalid_value(de::Unexpected::Unsigned(degree), &self))
    }

    fn visit_i64<E: de::Error>(self, degree: i64) -> Result<Degree, E> {
        usize::try_from(degree)
            .map(Degree::Fixed)
            .map_err(|_| E::invalid_value(de::Unexpected::Signed(degree), &self))
    }

    fn visit_map<A: de::MapAccess<'de>>(self, map: A) -> Result<Degree, A::Error> {
        DegreeRange::deserialize(MapAccessDeserializer::new(map)).map(Degree::Range)
    }
}

/// When to stop looking for something better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EarlyStop {
    /// An output is done when so many degrees in a row were worse than its best one; 0 tries all. A
    /// search that has not yet explained half of the output's variance goes on regardless.
    pub degrees: usize,
    /// The path of least-angle regression ends when so many terms (or a tenth of the runs, where
    /// that is more) brought no improvement; 0 follows it to its end.
    pub terms: usize,
}

impl Default for EarlyStop {
    fn default() -> Self {
        Self { degrees: 2, terms: 50 }
    }
}

impl EarlyStop {
    /// After how many steps without improvement a path ends.
    pub fn window(&self, runs: usize) -> usize {
        if self.terms == 0 { usize::MAX } else { self.terms.max(runs / 10) }
    }
}

//! Options of the study's section.

use std::fmt;

use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::{Deserialize, Deserializer, Serialize, de};

/// Method that chooses the terms; the chosen terms are then fitted by least squares.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Solver {
    /// Sparse expansion by least-angle regression: terms are proposed one after the other, and the set with the
    /// smallest error is taken. There may be more terms to choose from than runs. The usual choice.
    #[default]
    LeastAngleRegression,
    /// Greedy sparse expansion: the term most correlated with the residual enters next, up to half as many terms as
    /// runs. Good if few terms carry nearly all of the variance; otherwise its leave-one-out error is too small.
    OrthogonalMatchingPursuit,
    /// Sparse expansion by exchange: sets of a given size are improved term by term, and the size with the smallest
    /// error is taken. Often the best if there are few runs and many parameters, but slower.
    SubspacePursuit,
    /// Sparse Bayesian learning: only terms that the data require keep a weight; the noise is found by five-fold
    /// cross-validation. It gives few terms and is slower.
    BayesianCompressiveSensing,
    /// All terms of a degree. There must be more runs than terms; twice as many is a common rule.
    LeastSquares,
    /// Projection with the weights of a quadrature rule. The runs must be its nodes, made by
    /// `[design] use = "quadrature"` with the same `basis`; a rule of level `l` determines expansions up to degree `l`.
    Quadrature,
}

impl Solver {
    /// Returns the name of the solver in a study.
    pub fn name(self) -> &'static str {
        match self {
            Self::LeastAngleRegression => "least_angle_regression",
            Self::OrthogonalMatchingPursuit => "orthogonal_matching_pursuit",
            Self::SubspacePursuit => "subspace_pursuit",
            Self::BayesianCompressiveSensing => "bayesian_compressive_sensing",
            Self::LeastSquares => "least_squares",
            Self::Quadrature => "quadrature",
        }
    }
}

/// Error by which terms, degrees and norms are chosen.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Selection {
    /// Leave-one-out error, corrected for the number of terms.
    #[default]
    LeaveOneOut,
    /// Cross-validation error of that many random groups of runs, at least 2: `{ k_fold = 10 }`. Less optimistic if
    /// there are few runs, but slower.
    KFold(usize),
}

/// Degrees to be tried: a whole number, or `{ min = 1, max = 20 }`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Degree {
    /// A single degree.
    Fixed(usize),
    /// A range, from which each output takes the degree with the smallest error.
    Range(DegreeRange),
}

/// A range of degrees, within 1 to 1000.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DegreeRange {
    /// Lowest degree to be tried.
    pub min: usize,
    /// Highest degree to be tried.
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
    /// Returns the lowest and the highest degree.
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

/// Deserialises a [`Degree`] by the type of the value, so that errors inside the range keep their own position and
/// message.
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

/// Conditions that end the search for a better expansion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EarlyStop {
    /// Number of consecutive degrees that are worse than the best before the search for an output ends; 0 tries all
    /// degrees. A search that has not yet explained half of the output's variance continues regardless.
    pub degrees: usize,
    /// Number of consecutive terms (or a tenth of the runs, at most 100, if larger) without improvement after which the
    /// path of least-angle regression or matching pursuit ends; 0 follows it to its end.
    pub terms: usize,
}

impl Default for EarlyStop {
    fn default() -> Self {
        Self { degrees: 2, terms: 50 }
    }
}

/// Largest number of terms without improvement that follows from the number of runs: with thousands of runs the steps
/// after the best one would take most of the time.
const LONGEST: usize = 100;

impl EarlyStop {
    /// Returns the number of steps without improvement after which a path ends.
    pub fn window(&self, runs: usize) -> usize {
        if self.terms == 0 { usize::MAX } else { self.terms.max((runs / 10).min(LONGEST)) }
    }
}

/// Norms to be tried: a number, a list of numbers, or `{ min = 0.5, max = 1.0, step = 0.1 }`; above 0, at most 1.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum QNorm {
    /// A single norm.
    Fixed(f64),
    /// A list, from which each output takes the norm with the smallest error.
    List(Vec<f64>),
    /// Equally spaced norms, from which each output takes the one with the smallest error.
    Range(QNormRange),
}

/// Equally spaced norms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct QNormRange {
    /// Smallest norm, above 0.
    pub min: f64,
    /// Largest norm, at most 1.
    pub max: f64,
    /// Step between norms, above 0.
    pub step: f64,
}

impl Default for QNormRange {
    fn default() -> Self {
        Self { min: 0.5, max: 1.0, step: 0.1 }
    }
}

impl QNorm {
    /// Returns all norms in increasing order, or a description of what is wrong with them.
    pub fn values(&self) -> Result<Vec<f64>, String> {
        let mut values = match self {
            Self::Fixed(q) => vec![*q],
            Self::List(list) => list.clone(),
            Self::Range(QNormRange { min, max, step }) => {
                if !(min <= max && *step > 0.0 && (max - min) / step < 100.0) {
                    return Err(format!(
                        "`q_norm` from {min} to {max} in steps of {step} is not an increasing range of up to 100 values"
                    ));
                }
                let count = ((max - min) / step + 1e-9).floor() as usize;
                (0..=count).map(|k| (min + k as f64 * step).min(*max)).collect()
            }
        };
        values.sort_by(f64::total_cmp);
        values.dedup();
        if values.is_empty() {
            return Err("`q_norm` is an empty list".to_owned());
        }
        match values.iter().find(|&&q| !(q > 0.0 && q <= 1.0)) {
            Some(q) => Err(format!("`q_norm` is {q}, but must be above 0 and at most 1")),
            None => Ok(values),
        }
    }
}

impl<'de> Deserialize<'de> for QNorm {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(QNormVisitor)
    }
}

/// Deserialises a [`QNorm`] by the type of the value.
struct QNormVisitor;

impl<'de> de::Visitor<'de> for QNormVisitor {
    type Value = QNorm;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, a list or a range such as `{ min = 0.5, max = 1.0, step = 0.1 }`")
    }

    fn visit_f64<E: de::Error>(self, q: f64) -> Result<QNorm, E> {
        Ok(QNorm::Fixed(q))
    }

    fn visit_u64<E: de::Error>(self, q: u64) -> Result<QNorm, E> {
        Ok(QNorm::Fixed(q as f64))
    }

    fn visit_i64<E: de::Error>(self, q: i64) -> Result<QNorm, E> {
        Ok(QNorm::Fixed(q as f64))
    }

    fn visit_seq<A: de::SeqAccess<'de>>(self, seq: A) -> Result<QNorm, A::Error> {
        Vec::deserialize(de::value::SeqAccessDeserializer::new(seq)).map(QNorm::List)
    }

    fn visit_map<A: de::MapAccess<'de>>(self, map: A) -> Result<QNorm, A::Error> {
        QNormRange::deserialize(MapAccessDeserializer::new(map)).map(QNorm::Range)
    }
}

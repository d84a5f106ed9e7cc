//! The options of a study's section.

use std::fmt;

use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::{Deserialize, Deserializer, Serialize, de};

/// How the terms are chosen; those chosen are then fitted by least squares.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Solver {
    /// A few terms among many: least-angle regression proposes them one after the other, and the set
    /// with the least error is taken. There may be more terms to choose from than runs. The usual choice.
    #[default]
    LeastAngleRegression,
    /// The term most correlated with what is not yet explained comes next, up to half as many as runs: greedier,
    /// good where few terms carry nearly everything. Its leave-one-out error is too small where they do not.
    OrthogonalMatchingPursuit,
    /// Sets of so many terms at once, improved by exchange; the number of terms with the least error is
    /// taken. Often the best where runs are few and dimensions many, and slower.
    SubspacePursuit,
    /// Sparse Bayesian learning: terms stay whose weights the data need; the noise is found by five-fold
    /// cross-validation. Few terms, and slower.
    BayesianCompressiveSensing,
    /// All terms of a degree. There must be more runs than terms; twice as many is a usual rule.
    LeastSquares,
    /// Projection by the weights of a quadrature rule. The runs must be the nodes, made by `[design] use =
    /// "quadrature"` with the same `basis`; a rule of level `l` finds expansions up to degree `l`.
    Quadrature,
}

impl Solver {
    /// The name in a study.
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

/// The error by which terms, degrees and norms are chosen.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Selection {
    /// Each run is left out once, corrected for the number of terms.
    #[default]
    LeaveOneOut,
    /// The runs are cut into so many groups at random, and each group is left out once:
    /// `{ k_fold = 10 }`. Less optimistic where runs are few, and slower.
    KFold(usize),
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

/// The norms to be tried: a number, a list of numbers, or `{ min = 0.5, max = 1.0, step = 0.1 }`.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum QNorm {
    /// This one.
    Fixed(f64),
    /// Each output takes the one with the least error.
    List(Vec<f64>),
    /// The same from equal steps.
    Range(QNormRange),
}

/// Norms in equal steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct QNormRange {
    /// The smallest.
    pub min: f64,
    /// The largest.
    pub max: f64,
    /// From one to the next.
    pub step: f64,
}

impl Default for QNormRange {
    fn default() -> Self {
        Self { min: 0.5, max: 1.0, step: 0.1 }
    }
}

impl QNorm {
    /// All norms from the smallest, or what is wrong with them in words.
    pub fn values(&self) -> Result<Vec<f64>, String> {
        let mut values = match self {
            Self::Fixed(q) => vec![*q],
            Self::List(list) => list.clone(),
            Self::Range(QNormRange { min, max, step }) => {
                if !(min <= max && *step > 0.0 && (max - min) / step < 100.0) {
                    return Err(format!(
                        "`q_norm` from {min} to {max} in steps of {step} is no range"
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

/// Reads a [`QNorm`] by the kind of value that stands there.
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

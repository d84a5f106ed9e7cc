//! Options common to all Gaussian processes.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, de};

/// Choice between separate and common hyperparameters of the components.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LengthScales {
    /// Each component has its own.
    #[default]
    Each,
    /// All components share one set, which costs little more than fitting one of them and is slightly less accurate.
    Shared,
}

/// Covariance of the runs: that of all of them, or that of each with its nearest ones.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Approximation {
    /// Exact with at most 2000 runs, 100 neighbours with more.
    #[default]
    Automatic,
    /// All covariances. The time grows with the cube of the number of runs and the memory with its square: 10,000 runs
    /// need 800 MB for each matrix.
    Exact,
    /// Number of nearest runs on which each run's density is conditioned, at least 1 and below the number of runs, such
    /// as `{ neighbours = 50 }`. More are more accurate, which matters most for smooth responses without noise; the time
    /// grows with their cube.
    Neighbours(usize),
}

impl Approximation {
    /// Number of runs up to which the automatic choice is exact.
    const EXACT: usize = 2000;
    /// Number of neighbours above it.
    const USUAL: usize = 100;

    /// Returns the number of neighbours with this number of runs; `None` for the exact covariance.
    pub fn neighbours(self, runs: usize) -> Option<usize> {
        match self {
            Self::Automatic => (runs > Self::EXACT).then_some(Self::USUAL),
            Self::Exact => None,
            Self::Neighbours(count) => Some(count),
        }
    }

    /// Returns what is wrong with the choice for this number of runs, if that is known.
    pub fn fault(self, runs: Option<usize>) -> Option<String> {
        let Self::Neighbours(count) = self else { return None };
        if count == 0 {
            return Some("the number of neighbours must be at least 1".to_owned());
        }
        let runs = runs.filter(|runs| count >= *runs)?;
        Some(format!("each run has {count} neighbours, but there are {runs} runs in all"))
    }
}

/// Variance of the noise of the runs, as a fraction of the variance of the process: `"estimated"`, or a number.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Nugget {
    /// Estimate with the length scales.
    Estimated(Estimated),
    /// A fixed value; 0 for a response that must be interpolated exactly.
    Fixed(f64),
}

/// Keyword for an estimated value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Estimated {
    /// Estimate with the length scales.
    Estimated,
}

impl Default for Nugget {
    fn default() -> Self {
        Self::Estimated(Estimated::Estimated)
    }
}

impl<'de> Deserialize<'de> for Nugget {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NuggetVisitor)
    }
}

/// Deserialises a [`Nugget`] by the type of the value.
struct NuggetVisitor;

impl de::Visitor<'_> for NuggetVisitor {
    type Value = Nugget;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("`\"estimated\"` or a number, such as `1e-8`")
    }

    fn visit_str<E: de::Error>(self, word: &str) -> Result<Nugget, E> {
        if word == "estimated" {
            return Ok(Nugget::default());
        }
        Err(E::invalid_value(de::Unexpected::Str(word), &self))
    }

    fn visit_f64<E: de::Error>(self, nugget: f64) -> Result<Nugget, E> {
        Ok(Nugget::Fixed(nugget))
    }

    fn visit_i64<E: de::Error>(self, nugget: i64) -> Result<Nugget, E> {
        Ok(Nugget::Fixed(nugget as f64))
    }

    fn visit_u64<E: de::Error>(self, nugget: u64) -> Result<Nugget, E> {
        Ok(Nugget::Fixed(nugget as f64))
    }
}

/// Bounds of the hyperparameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Bounds {
    /// Smallest and largest length scale, in units of the range of a parameter with a uniform design (for any other
    /// design, the distance between its 10 % and 90 % quantiles divided by 0.8).
    pub length_scale: [f64; 2],
    /// Smallest and largest nugget if it is estimated. A smaller lower bound makes the mean of a noise-free response
    /// more accurate and its derivatives less so, because they carry more rounding errors.
    pub nugget: [f64; 2],
}

impl Default for Bounds {
    fn default() -> Self {
        Self { length_scale: [0.01, 100.0], nugget: [1e-12, 1.0] }
    }
}

impl Bounds {
    /// Returns what is wrong with the bounds: the option, and a description.
    pub fn faults(&self) -> Vec<(&'static str, String)> {
        let check = |key, [low, high]: [f64; 2]| {
            let sound = low > 0.0 && low < high && high.is_finite();
            let words =
                || format!("the bounds {low} and {high} are not two numbers above 0 in order");
            (!sound).then(|| (key, words()))
        };
        let both =
            [check("bounds.length_scale", self.length_scale), check("bounds.nugget", self.nugget)];
        both.into_iter().flatten().collect()
    }
}

impl Nugget {
    /// Returns a description of what is wrong with the nugget, if anything.
    pub fn fault(&self) -> Option<String> {
        match *self {
            Self::Fixed(nugget) if !(nugget >= 0.0 && nugget.is_finite()) => {
                Some(format!("the nugget is {nugget}, but must be 0 or above"))
            }
            _ => None,
        }
    }
}

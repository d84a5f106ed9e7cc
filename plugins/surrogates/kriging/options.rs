//! The options that all Gaussian processes share.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, de};

/// Which components have hyperparameters of their own.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LengthScales {
    /// Each component.
    #[default]
    Each,
    /// All components share them, which costs little more than one of them and is a little less accurate.
    Shared,
}

/// What runs differ by besides the smooth response: `"estimated"`, or a number.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Nugget {
    /// Estimated with the length scales.
    Estimated(Estimated),
    /// This share of the variance of the process; 0 for a response that must be interpolated.
    Fixed(f64),
}

/// The word that asks for an estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Estimated {
    /// Estimated with the length scales.
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

/// Reads a [`Nugget`] by the kind of value that stands there.
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

/// Where hyperparameters are looked for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Bounds {
    /// The least and the largest length scale; 1 is the range of a parameter with a uniform design (of any other, the
    /// distance of its 10 % and 90 % quantiles divided by 0.8).
    pub length_scale: [f64; 2],
    /// The least and the largest nugget where it is estimated. A smaller least value makes the mean of a response without
    /// noise more accurate, and its derivatives less so: they carry more round-off.
    pub nugget: [f64; 2],
}

impl Default for Bounds {
    fn default() -> Self {
        Self { length_scale: [0.01, 100.0], nugget: [1e-12, 1.0] }
    }
}

impl Bounds {
    /// What is wrong with them: the option, and in words.
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
    /// What is wrong with it, in words.
    pub fn fault(&self) -> Option<String> {
        match *self {
            Self::Fixed(nugget) if !(nugget >= 0.0 && nugget.is_finite()) => {
                Some(format!("the nugget is {nugget}, but must be 0 or above"))
            }
            _ => None,
        }
    }
}

//! `[[reliability]]`: probabilities of rare events.

use lacuna::plugin::Reliability;
use lacuna::plugin::quantity::{Misfit, in_unit};
use lacuna::plugin::registry::Section;
use lacuna::text::quantity::Quantity;
use lacuna::text::values::Name;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::plain::Study;
use super::quantity::Asked;

/// The engine's keys of `[[reliability]]`: the probability that a quantity of interest exceeds a limit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReliabilityKeys {
    /// Name of the probability.
    pub name: Name,
    /// Name of the value of a `[[quantity]]`, with the labels of its curve and scenario, such as `damage_R`.
    pub quantity: String,
    /// Limit above which the quantity fails: a number in the unit of the quantity, or with a unit as in
    /// `{ value = 2, unit = "mm" }`. Exactly one of `above` and `below` is stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub above: Option<Quantity>,
    /// Limit below which the quantity fails.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub below: Option<Quantity>,
    /// Distribution of the parameters. Default: the posterior if the study has one, otherwise the prior.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distribution: Option<Source>,
}

/// Distribution of the parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// The independent priors of the parameters.
    Prior,
    /// The posterior of all unknowns.
    Posterior,
}

impl Source {
    /// Word for the distribution.
    pub fn word(self) -> &'static str {
        match self {
            Self::Prior => "prior",
            Self::Posterior => "posterior",
        }
    }
}

/// A section `[[reliability]]`.
pub type ReliabilitySection = Section<dyn Reliability, ReliabilityKeys>;

/// An event whose probability is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// Index of the value among those that the study asks for.
    pub value: usize,
    /// Limit, in the unit of the value.
    pub limit: f64,
    /// True for values above the limit, false for those below.
    pub above: bool,
    /// Distribution of the parameters.
    pub source: Source,
}

impl Event {
    /// The event of a section.
    ///
    /// # Errors
    /// If the quantity or the limit does not fit.
    pub fn of(
        study: &Study,
        section: &ReliabilitySection,
        asked: &[Asked],
    ) -> Result<Self, Vec<Misfit>> {
        let keys = &section.common;
        let default = if study.sampler.is_some() { Source::Posterior } else { Source::Prior };
        let source = keys.distribution.unwrap_or(default);
        if source == Source::Posterior && study.sampler.is_none() {
            let misfit = Misfit::new("distribution", "the study has no posterior");
            return Err(vec![misfit.expected("`prior`, or a study with a `[sampler]`")]);
        }
        if source == Source::Prior && study.has_effects() {
            let misfit =
                Misfit::new("distribution", "the parameters of effects have no prior without data");
            return Err(vec![misfit.expected("`posterior`, or a study without `[[effect]]`")]);
        }
        if source == Source::Prior && !study.prior().is_independent() {
            let misfit = Misfit::new("distribution", "the priors depend on each other");
            return Err(vec![misfit.expected("`posterior`, or a study with independent priors")]);
        }
        if source == Source::Posterior && section.built.plugin.needs_standard_normal() {
            let message = "the method needs independent priors, not a posterior";
            let misfit = Misfit::new("use", message);
            let methods = "a method for any distribution: see `lacuna plugins reliability`";
            return Err(vec![misfit.expected(methods).help("or state `distribution = \"prior\"`")]);
        }
        let Some(value) = asked.iter().position(|asked| asked.name == keys.quantity) else {
            let names: Vec<String> = asked.iter().map(|a| format!("`{}`", a.name)).collect();
            let misfit = Misfit::new("quantity", "there is no quantity of this name");
            let expected =
                if names.is_empty() { "a `[[quantity]]`".to_owned() } else { names.join(", ") };
            return Err(vec![misfit.expected(expected).found(format!("`{}`", keys.quantity))]);
        };
        let (key, limit, above) = match (&keys.above, &keys.below) {
            (Some(limit), None) => ("above", limit, true),
            (None, Some(limit)) => ("below", limit, false),
            _ => {
                let misfit = Misfit::new("above", "exactly one limit is stated");
                return Err(vec![misfit.expected("either `above` or `below`")]);
            }
        };
        let limit = in_unit(key, limit, &asked[value].unit)?;
        Ok(Self { value, limit, above, source })
    }
}

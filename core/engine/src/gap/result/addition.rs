//! Effects as a study adds them.

use lacuna::data::Unit;
use lacuna::plugin::effect::On;
use serde::{Deserialize, Serialize};
use toml::Table;

use crate::gap::candidates::Candidate;
use crate::gap::search::{CrossValidation, SearchResult, Verdict};

/// An effect as a study adds it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AddedEffect {
    /// The name.
    pub name: String,
    /// The type: the name that the study gives the candidate, otherwise that of the plugin.
    pub kind: String,
    /// The name of its plugin.
    pub plugin: String,
    /// A title for reports.
    pub title: String,
    /// The formula.
    pub formula: String,
    /// The labels on which it acts, by axis; empty for all.
    pub on: On,
    /// The options.
    pub options: Table,
    /// The inputs of the extended forward map that it sets free, if it acts inside the model.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub switches: Vec<usize>,
    /// True if it is another model in place of the study's; its options are then those of `[model]`.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub model: bool,
    /// The unknowns; for another model, the parameters that it shares with the study's.
    pub unknowns: Vec<Estimate>,
    /// The types that these data cannot distinguish from it, itself first.
    pub class: Vec<String>,
    /// The probability that its type is right, as counted in cases of which half hide what no candidate is.
    pub probability: f64,
    /// The posterior probability of its type among the candidates, as if one of them were exactly true.
    #[serde(default)]
    pub posterior_probability: f64,
    /// The share of the gap that it closes beside the other effects.
    #[serde(default)]
    pub share: f64,
    /// True when it keeps its name also where another part of the gap has none.
    #[serde(default)]
    pub certain: bool,
    /// The comparisons with its rival on left-out data: with a free form in its place, or for another model with the
    /// study's model and its effects.
    #[serde(default)]
    pub rivals: Vec<CrossValidation>,
}

/// The name of the plugin of effects inside a companion, which are no plugins.
pub const IN_COMPANION: &str = "companion";

/// The name of the plugin of effects that a further table of runs shows, which are no plugins.
pub const IN_RUNS: &str = "runs";

impl AddedEffect {
    /// Returns true if it acts inside the companion.
    pub fn is_in_companion(&self) -> bool {
        self.plugin == IN_COMPANION
    }

    /// Returns true if a further table of runs shows it.
    pub fn is_in_runs(&self) -> bool {
        self.plugin == IN_RUNS
    }

    /// The label in reports: the type, or the name of the other model.
    pub fn label(&self) -> &str {
        if self.model { &self.name } else { &self.kind }
    }
}

/// An unknown with its value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The name.
    pub name: String,
    /// The unit.
    pub unit: Unit,
    /// The value of largest posterior density, in its unit.
    pub value: f64,
    /// The standard deviation by the normal approximation.
    pub sd: f64,
}

/// The effects of a search.
pub(super) fn additions(
    found: &SearchResult<'_>,
    candidates: &[Candidate],
    verdict: &Verdict,
) -> Vec<AddedEffect> {
    let placed = found.system.effects.iter().zip(&found.chosen).zip(&verdict.effects);
    placed
        .zip(&found.support)
        .map(|(((effect, placement), named), support)| {
            let candidate = &candidates[placement.candidate];
            let described = candidate.effect.describe();
            let unknowns = effect.hyperparameters().into_iter().enumerate();
            AddedEffect {
                name: named.name.clone(),
                kind: named.kind.clone(),
                plugin: candidate.plugin.clone(),
                title: described.title,
                formula: described.formula,
                on: named.on.clone(),
                options: candidate.options.clone(),
                switches: candidate.effect.switches().to_vec(),
                model: false,
                unknowns: unknowns
                    .map(|(k, unknown)| Estimate {
                        name: unknown.name,
                        unit: unknown.unit,
                        value: named.values[k],
                        sd: named.sd[k],
                    })
                    .collect(),
                class: named.class.clone(),
                probability: named.probability,
                posterior_probability: named.posterior_probability,
                share: named.share,
                certain: named.certain,
                rivals: support.against_free_form.clone(),
            }
        })
        .collect()
}

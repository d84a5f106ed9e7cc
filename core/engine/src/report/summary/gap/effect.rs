//! The keys of an effect that was found.

use lacuna::plugin::effect::On;
use schemars::JsonSchema;
use serde::Serialize;

use crate::gap::result::added::Augmented;
use crate::gap::result::{AddedEffect, Estimate};
use crate::report::summary::value::{ByName, Quantity};

/// Effect that explains a part of the gap.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Effect {
    /// Type of the effect; `model_swap` for another model in place of the study's own.
    #[serde(rename = "type")]
    pub kind: String,
    /// Name of the effect in the study that the search writes.
    pub name: String,
    /// Labels of the places where the effect acts; empty if it acts everywhere.
    pub sensors: Vec<String>,
    /// Labels of the places where the effect acts, by axis.
    #[schemars(extend("propertyNames" = { "title": "axis" }))]
    pub on: On,
    /// Unknowns of the effect: the posterior if the study with the effects was run, otherwise the maximum of the
    /// posterior density with the normal approximation.
    #[schemars(extend("propertyNames" = { "title": "unknown" }))]
    pub parameters: ByName<Unknown>,
    /// Probability that the type is right, as counted in simulated cases of which half hide physics that no candidate has:
    /// of the study itself if `lacuna power STUDY` was run on it, otherwise of other systems. Never above 0.99.
    pub probability: f64,
    /// Posterior probability of the type among the candidates, as if one of them were exactly true.
    pub posterior_probability: Quantity,
    /// Share of the gap that the effect closes beside the others.
    pub explained: Quantity,
    /// True if no remainder is significant beside the effects.
    pub exact: bool,
    /// True if the effect keeps its name although another part of the gap may have none.
    pub certain: bool,
    /// Types that the data cannot distinguish from this one, which comes first.
    pub class: Vec<String>,
}

/// Posterior of an unknown of an effect.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Unknown {
    /// Posterior mean, or the maximum of the posterior density if the study with the effects was not run.
    pub mean: Quantity,
    /// Posterior standard deviation, or that of the normal approximation.
    pub sd: f64,
    /// 2.5 % quantile; only if the study with the effects was run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub q025: Option<f64>,
    /// 97.5 % quantile; only if the study with the effects was run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub q975: Option<f64>,
    /// Unit of the unknown.
    pub unit: String,
}

impl Effect {
    pub fn of(addition: &AddedEffect, exact: bool, added: Option<&Augmented>) -> Self {
        let unknowns = addition.unknowns.iter().map(|unknown| {
            let short = unknown.name.rsplit('.').next().unwrap_or_default();
            (short.to_owned(), Unknown::of(unknown, addition, added))
        });
        Self {
            kind: addition.kind.clone(),
            name: addition.name.clone(),
            sensors: addition.on.values().flatten().cloned().collect(),
            on: addition.on.clone(),
            parameters: unknowns.collect(),
            probability: addition.probability,
            posterior_probability: addition.posterior_probability.into(),
            explained: addition.share.into(),
            exact,
            certain: addition.certain,
            class: addition.class.clone(),
        }
    }
}

impl Unknown {
    fn of(unknown: &Estimate, addition: &AddedEffect, added: Option<&Augmented>) -> Self {
        let is_it = |name: &String| *name == unknown.name;
        if let Some(p) = added.and_then(|added| added.unknowns.iter().find(|p| is_it(&p.name))) {
            return Self {
                mean: p.mean.into(),
                sd: p.sd,
                q025: Some(p.interval[0]),
                q975: Some(p.interval[1]),
                unit: p.unit.to_string(),
            };
        }
        // Another model shares parameters with the study's own; the run of the study with the effects calibrated them.
        let moved =
            added.filter(|_| addition.model).into_iter().flat_map(|added| &added.parameters);
        let shared = moved.into_iter().find(|p| is_it(&p.name));
        let (mean, sd) = shared.map_or((unknown.value, unknown.sd), |p| (p.mean[1], p.sd[1]));
        Self { mean: mean.into(), sd, q025: None, q975: None, unit: unknown.unit.to_string() }
    }
}

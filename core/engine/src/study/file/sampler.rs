//! The engine's keys of `[sampler]`.

use lacuna::plugin::sampler::Start;
use lacuna::text::values::{Count, Fraction};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The engine's keys of `[sampler]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SamplerKeys {
    /// Burn-in: fraction of the steps, from the start of each chain, that is discarded from every summary.
    pub burn_in: Fraction,
    /// Starting points of the chains. Default: those recommended by the sampler, which are around the posterior maximum
    /// unless its page says otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<Start>,
    /// Stopping rule: sampling continues beyond the sampler's own number of steps until this is satisfied. Default: the
    /// sampler's own number of steps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stop: Option<StopRule>,
    /// Number of values of the parameters with `cut`, at least 10; the other parameters are sampled for each of them.
    /// Default: 40.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub imputations: Option<Count>,
}

/// Stopping rule of a sampler.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StopRule {
    /// Effective sample size (ESS) to reach: the smallest over all unknowns, of bulk and tail ESS, after the burn-in.
    pub effective_sample_size: Count,
    /// Maximum number of steps of each chain, reached even if the ESS is not. Default: fifty times the sampler's own
    /// number of steps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_steps: Option<Count>,
}

impl Default for SamplerKeys {
    fn default() -> Self {
        let burn_in = Fraction::new(0.5).unwrap_or_else(|_| unreachable!("0.5 is a fraction"));
        Self { burn_in, start: None, stop: None, imputations: None }
    }
}

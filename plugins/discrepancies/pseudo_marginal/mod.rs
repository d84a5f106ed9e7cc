//! `pseudo_marginal`: the likelihood of a stochastic simulator, estimated from several of its runs.

mod likelihood;
#[cfg(test)]
mod tests;

use lacuna::data::Layout;
use lacuna::plugin::component::{Component, Context};
use lacuna::plugin::discrepancy::{Discrepancy, Known, Likelihood, StatedNoise, StochasticModel};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::{By, Groups, Noise, Normal, Replicates, Variance};
use likelihood::{Datum, Estimated};

/// Likelihood of a simulator whose response is random, with independent normal noise of the measurement.
///
/// The same parameters give another response in each run: a queue, a Gillespie simulation, a particle code. The
/// likelihood of a replicate is the mean of the density of its noise over all responses, which has no closed form. It is
/// estimated, without bias, by the mean over `simulations` runs,
///
/// ```text
/// Π_replicates Π_groups mean over runs of Π_outputs N(y; response, variance)
/// ```
///
/// Each replicate has runs of its own, because each experiment is another realisation. A Markov chain that keeps the
/// estimate of its current point samples the posterior exactly, for any number of runs (Beaumont, Genetics 164 (2003)
/// 1139; Andrieu and Roberts, Annals of Statistics 37 (2009) 697); too few runs make it stick to points whose estimate
/// is large by chance. The report states the variance of the log-likelihood's estimate at the centre of the posterior:
/// 1 to 3 is best (Doucet, Pitt, Deligiannidis and Kohn, Biometrika 102 (2015) 295; Sherlock, Thiery, Roberts and
/// Rosenthal, Annals of Statistics 43 (2015) 238), and it falls in inverse proportion to `simulations`.
///
/// The model needs `seed` in `[model]`, and the study must not have a surrogate. All samplers without derivatives can be
/// used; `sequential_monte_carlo`, `nested` and `parallel_tempering` give the evidence as well. Without an analytical
/// density of the noise use `approximate_bayesian_computation`. A response with many outputs and little noise needs a
/// number of runs that grows exponentially with the number of outputs, unless parts of it are independent
/// (`independent_by`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PseudoMarginal {
    /// Number of runs of the model for each replicate, from which the likelihood at one point is estimated.
    #[serde(default = "simulations")]
    pub simulations: usize,
    /// Groups of outputs whose responses are independent of each other at given parameters, such as those of different
    /// specimens: `"all"` for one group, one per value of an axis such as `"sensor"`, windows of an axis, or a list of
    /// these. The estimates of the groups are multiplied, which has a far smaller variance than one estimate for all;
    /// it is wrong if the groups depend on each other.
    #[serde(default)]
    pub independent_by: By,
    /// Variance of the noise, in the squared unit of the response: a prior such as `{ half_normal = 1e-6 }` or
    /// `{ known = 2.5e-11 }`. The scatter between replicates is larger, because it contains that of the model.
    pub variance: Variance,
    /// Groups of outputs with a common variance of the noise: `"all"`, one per value of an axis such as `"sensor"`,
    /// windows of an axis, or a list of these.
    #[serde(default)]
    pub by: By,
}

fn simulations() -> usize {
    50
}

/// Largest number of runs for each replicate.
const MOST: usize = 100_000;

impl Component for PseudoMarginal {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let layout = context.layout;
        self.by.check("by", layout, complaints);
        self.independent_by.check("independent_by", layout, complaints);
        self.variance.check(Groups::of(layout, &self.by).ok().as_ref(), complaints);
        if matches!(self.variance, Variance::Measured(_)) {
            complaints
                .at("variance.measured")
                .say("the variance between replicates of a stochastic model is not that of the noise")
                .expected("a known variance or a prior, such as `{ half_normal = 1e-6 }`");
        }
        if !(1..=MOST).contains(&self.simulations) {
            let spot = complaints.at("simulations");
            spot.say("this number of runs is out of range")
                .expected(format!("1 to {MOST}"))
                .found(self.simulations);
        }
    }
}

impl Discrepancy for PseudoMarginal {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        let replicates = Replicates::of(known.data, known.common)?;
        let layout = &known.data.layout;
        let mut hyper = Vec::new();
        let by = (&self.variance, &self.by);
        let noise = Noise::new(known, known.data, &replicates, by, &mut hyper)?;
        let groups = Groups::of(layout, &self.independent_by).map_err(Stop::new)?;
        let groups = groups.with_data(&replicates.measured);
        let of_replicate = |values: &Vec<Option<f64>>| {
            let mut parts = vec![Vec::new(); groups.count()];
            for (output, value) in values.iter().enumerate() {
                let Some((value, group)) = value.zip(groups.of[output]) else { continue };
                parts[group].push(Datum { output, value });
            }
            parts.retain(|part| !part.is_empty());
            parts
        };
        let data = known.data.replicates.iter().map(|replicate| of_replicate(&replicate.values));
        let data = data.filter(|parts| !parts.is_empty()).collect();
        let normal = Normal::new(&replicates, known.common)?;
        let simulations = self.simulations;
        Ok(Box::new(Estimated { noise, normal, replicates, hyper, data, simulations }))
    }

    fn stochastic_model(&self) -> StochasticModel {
        StochasticModel::Needed
    }

    fn stated_noise(&self, layout: &Layout, _: &[f64]) -> Option<StatedNoise> {
        let sd = self.variance.known_sd(layout, &self.by)?;
        Some(StatedNoise { sd, correlation_time: None })
    }
}

lacuna::register!(Discrepancy, "pseudo_marginal", PseudoMarginal);

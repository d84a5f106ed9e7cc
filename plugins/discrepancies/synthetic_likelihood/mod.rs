//! `synthetic_likelihood`: a normal distribution fitted to several runs of a stochastic simulator.

mod likelihood;
mod normal;
#[cfg(test)]
mod tests;

use lacuna::plugin::component::{Component, Context};
use lacuna::plugin::discrepancy::{Discrepancy, Known, Likelihood, StochasticModel};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::{By, Groups, Noise, Normal, Replicates, Variance};
use likelihood::{Noisy, Synthetic};

/// Synthetic likelihood: at each point the simulator runs several times, and a normal distribution with the mean and the
/// covariance of the responses takes the place of their unknown distribution (Wood, Nature 466 (2010) 1102).
///
/// Choose it for a stochastic simulator whose response is a handful of summary statistics: means, autocovariances, counts.
/// They are nearly normal if they are averages, whatever the process behind them, and need far fewer runs than an exact
/// likelihood (`pseudo_marginal`) or a small tolerance (`approximate_bayesian_computation`). If the statistics are not
/// normal, the posterior is wrong, and nothing in it says so: compare it with that of data that the simulator generated.
///
/// The estimator `"unbiased"` (Ghurye and Olkin, Annals of Mathematical Statistics 40 (1969) 1261; Price, Drovandi, Lee and
/// Nott, J. Computational and Graphical Statistics 27 (2018) 1) estimates the normal density without bias, so that the posterior
/// is that of normal statistics for any number of runs; `"plug_in"` inserts mean and covariance into the density, and its
/// posterior depends weakly on their number. The report states the variance of the log-likelihood's estimate; 1 to 3 is
/// best. Each replicate has runs of its own.
///
/// The model needs `seed` in `[model]`, and the study must not have a surrogate. All samplers without derivatives can be
/// used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SyntheticLikelihood {
    /// Number of runs of the model for each replicate; at least four more than the number of statistics.
    pub simulations: usize,
    /// Estimator of the normal density.
    pub estimator: Estimator,
    /// Variance of a noise of the measurement that the model does not contain, in the squared unit of the response: a prior
    /// such as `{ half_normal = 1e-6 }` or `{ known = 2.5e-11 }`. It is added to each run. Default: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub variance: Option<Variance>,
    /// Groups of outputs with a common variance of that noise: `"all"`, one per value of an axis such as `"sensor"`,
    /// windows of an axis, or a list of these.
    pub by: By,
}

/// Estimator of a normal density from a sample.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Estimator {
    /// Without bias for normal statistics; zero for data far from all runs.
    #[default]
    Unbiased,
    /// The normal density with the mean and the covariance of the runs.
    PlugIn,
}

impl Default for SyntheticLikelihood {
    fn default() -> Self {
        let (estimator, by) = (Estimator::default(), By::default());
        Self { simulations: 100, estimator, variance: None, by }
    }
}

/// Number of runs beyond that of the statistics which the unbiased estimator needs.
const MORE: usize = 4;
/// Largest number of runs for each replicate.
const MOST: usize = 100_000;

impl Component for SyntheticLikelihood {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let layout = context.layout;
        self.by.check("by", layout, complaints);
        if let Some(variance) = &self.variance {
            variance.check(Groups::of(layout, &self.by).ok().as_ref(), complaints);
            if matches!(variance, Variance::Measured(_)) {
                complaints
                    .at("variance.measured")
                    .say("the variance between replicates of a stochastic model is not that of the noise")
                    .expected("a known variance or a prior, such as `{ half_normal = 1e-6 }`");
            }
        }
        let least = layout.len() + MORE;
        if !(least..=MOST.max(least)).contains(&self.simulations) {
            let spot = complaints.at("simulations");
            spot.say(format!("the covariance of {} outputs needs more runs", layout.len()))
                .expected(format!("{least} to {}", MOST.max(least)))
                .found(self.simulations);
        }
    }
}

impl Discrepancy for SyntheticLikelihood {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        let replicates = Replicates::of(known.data, known.common)?;
        let mut hyper = Vec::new();
        let data = known.data.replicates.iter().map(|replicate| {
            let all = replicate.values.iter().enumerate();
            all.filter_map(|(output, value)| Some((output, (*value)?))).collect::<Vec<_>>()
        });
        let data = data.filter(|values| !values.is_empty()).collect();
        let normal = Normal::new(&replicates, known.common)?;
        let noisy = match &self.variance {
            None => None,
            Some(variance) => {
                let by = (variance, &self.by);
                let noise = Noise::new(known, known.data, &replicates, by, &mut hyper)?;
                Some(Noisy { noise, normal, replicates })
            }
        };
        let (simulations, estimator) = (self.simulations, self.estimator);
        let measured = known.data.clone();
        Ok(Box::new(Synthetic { noisy, hyper, data, measured, simulations, estimator }))
    }

    fn stochastic_model(&self) -> StochasticModel {
        StochasticModel::Needed
    }
}

lacuna::register!(Discrepancy, "synthetic_likelihood", SyntheticLikelihood, aliases: ["bsl"]);

//! `subset_simulation`: the failure region is reached through a sequence of larger ones.

mod chains;
mod levels;

use lacuna::math::random::Stream;
use lacuna::plugin::reliability::{Estimate, LimitState};
use lacuna::plugin::{Component, Context, Reliability, Size};
use lacuna::run::{Progress, Stop};
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::levels::{Outcome, Settings, Simulated, simulate};
use super::common::{Counted, at_least, between, log_normal};

/// Subset simulation: the small probability is a product of larger ones, of a sequence of thresholds, each estimated from
/// Markov chains that start at the samples beyond the threshold before.
///
/// It needs no gradient, finds failure regions of several parts, and its cost hardly depends on the number of parameters:
/// about `samples` calls per factor of ten in the probability. The chains move by adaptive conditional sampling.
/// The coefficient of variation contains the correlation within the chains, and not that between the levels, so it is
/// somewhat too small. It works from a posterior: the first level has draws of the sampler, and the chains accept with
/// the density of the posterior.
///
/// References: Au and Beck, Probabilistic Engineering Mechanics 16 (2001) 263; Papaioannou, Betz, Zwirglmaier and
/// Straub, Probabilistic Engineering Mechanics 41 (2015) 89.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SubsetSimulation {
    /// Number of samples of each level.
    pub samples: usize,
    /// Probability of each level, given the one before.
    pub level_probability: f64,
    /// Largest number of levels: with a level probability of 0.1 the smallest probability is about 10 to the power of minus
    /// this number.
    pub levels: usize,
}

impl Default for SubsetSimulation {
    fn default() -> Self {
        Self { samples: 2000, level_probability: 0.1, levels: 15 }
    }
}

impl Component for SubsetSimulation {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        at_least("samples", self.samples, 100, complaints);
        between("level_probability", self.level_probability, (0.0, 0.51), complaints);
        at_least("levels", self.levels, 1, complaints);
    }

    fn room(&self, unknowns: usize) -> Vec<Size> {
        vec![of_level("samples", self.samples, unknowns)]
    }
}

/// Memory of a simulation by the samples of a level: their points, values and chains, the values in order, and the points
/// and values of the model.
pub fn of_level(key: &'static str, samples: usize, unknowns: usize) -> Size {
    Size { key, what: "the samples", value: samples, numbers: 2 * unknowns + 4 }
}

impl Reliability for SubsetSimulation {
    fn estimate(
        &self,
        state: &dyn LimitState,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Estimate, Stop> {
        let counted = Counted::new(state, progress);
        let values = |points: &Matrix| counted.answers(points);
        let log_weights = |points: &Matrix| state.log_weights(points);
        let problem = Simulated {
            dimension: state.dimension(),
            values: &values,
            log_weights: (!state.is_standard_normal()).then_some(&log_weights),
            draws: state.draws(),
        };
        let settings =
            Settings { samples: self.samples, share: self.level_probability, levels: self.levels };
        let outcome = simulate(&problem, settings, stream)?;
        let mut warnings: Vec<String> = counted.warning().into_iter().collect();
        if !outcome.reached {
            let count = outcome.levels.len();
            warnings.push(format!("the failure region was not reached after {count} levels"));
        }
        let (p, variation) = (outcome.probability, outcome.variation);
        let usable = p > 0.0 && variation.is_finite();
        Ok(Estimate {
            probability: p,
            variation: usable.then_some(variation),
            interval: usable.then(|| log_normal(p, variation)),
            calls: counted.calls(),
            undefined: counted.undefined(),
            failures: Some(counted.failures()),
            design_points: Vec::new(),
            converged: outcome.reached,
            warnings,
        })
    }
}

lacuna::register!(Reliability, "subset_simulation", SubsetSimulation);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_samples_of_a_level_need_memory() {
        let found = SubsetSimulation { samples: 1000, ..SubsetSimulation::default() }.room(3);
        let what = "the samples";
        assert_eq!(found, [Size { key: "samples", what, value: 1000, numbers: 10 }]);
    }
}

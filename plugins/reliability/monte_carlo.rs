//! `monte_carlo`: crude Monte Carlo simulation.

use lacuna::math::random::Stream;
use lacuna::plugin::reliability::{Estimate, LimitState};
use lacuna::plugin::{Component, Context, Reliability};
use lacuna::run::{Progress, Stop};
use lacuna::text::Complaints;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::{Counted, at_least, clopper_pearson, normals};

/// Crude Monte Carlo: the share of independent draws at which the limit is exceeded.
///
/// Exact for any limit state and any number of variables; the interval is that of a binomial probability. The coefficient of
/// variation is `sqrt((1 - p) / (n p))`: a probability of 1e-3 needs 100 000 calls for 10 %, one of 1e-6 needs 100 million.
/// From a posterior the draws are those of the sampler, so that there are at most as many calls as independent draws.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MonteCarlo {
    /// Number of calls.
    pub samples: usize,
}

impl Default for MonteCarlo {
    fn default() -> Self {
        Self { samples: 100_000 }
    }
}

/// Number of failures below which an estimate is doubtful: its coefficient of variation is above 30 %.
const FEW: usize = 10;
/// Number of points evaluated together.
const TOGETHER: usize = 10_000;

impl Component for MonteCarlo {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        at_least("samples", self.samples, 100, complaints);
    }
}

impl Reliability for MonteCarlo {
    fn estimate(
        &self,
        state: &dyn LimitState,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Estimate, Stop> {
        let counted = Counted::new(state, progress);
        let mut rng = stream.generator();
        let count = state.draws().map_or(self.samples, |draws| draws.rows().min(self.samples));
        for first in (0..count).step_by(TOGETHER) {
            let size = TOGETHER.min(count - first);
            let points = match state.draws() {
                None => normals(size, state.dimension(), &mut rng),
                Some(draws) => spread(draws, count, first, size),
            };
            counted.values(&points)?;
        }
        let failures = counted.failures();
        let probability = failures as f64 / count.max(1) as f64;
        let mut warnings: Vec<String> = counted.warning().into_iter().collect();
        if failures < FEW {
            warnings.push(format!("the limit was exceeded at only {failures} of {count} draws"));
        }
        let variation = ((1.0 - probability) / (probability * count as f64)).sqrt();
        Ok(Estimate {
            probability,
            variation: Some(variation).filter(|v| v.is_finite()),
            interval: Some(clopper_pearson(failures, count)),
            calls: counted.calls(),
            undefined: counted.undefined(),
            failures: Some(failures),
            design_points: Vec::new(),
            converged: failures >= FEW,
            warnings,
        })
    }
}

/// Rows from `first` on of `count` evenly spread draws.
fn spread(draws: &Matrix, count: usize, first: usize, size: usize) -> Matrix {
    let rows: Vec<usize> = (first..first + size).map(|i| i * draws.rows() / count).collect();
    draws.select_rows(&rows)
}

lacuna::register!(Reliability, "monte_carlo", MonteCarlo);
